"""No run of a random scene completes with an error that its order does not explain."""

from __future__ import annotations

import pytest

from inverse_service.service.scenes import scene_lagrangian
from tests.simulation.random_scenes import Verdict, verdicts

SAMPLE = (0, 4, 37)


def complaints(seed: int, patch: pytest.MonkeyPatch) -> tuple[list[Verdict], int]:
    patch.setattr(scene_lagrangian, "SOLVE_SECONDS", 2.0)
    found = list(verdicts(seed))
    return [one for one in found if one.complaint], sum(
        one.pair == ("completed", "completed") for one in found
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", SAMPLE)
def test_a_random_scene_is_right_or_typed(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert complaints(seed, monkeypatch)[0] == []


@pytest.mark.nightly
def test_three_hundred_random_scenes_are_right_or_typed(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong, completed = [], 0
    for seed in range(300):
        found, count = complaints(seed, monkeypatch)
        wrong += found
        completed += count
    assert wrong == []
    assert completed > 300

"""The decision is right on systems with a known Lagrangian, plain and in other coordinates."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.mechanics.reading import read_system
from tests.generator import GeneratedSystem, disguised, random_right_sides, random_systems


def verdicts(system: GeneratedSystem) -> tuple[str | None, str]:
    """For L(q, v), None where the known Lagrangian contains t and so proves nothing, and for L(t, q, v)."""
    read = read_system(system.coordinates, system.equations, name=system.id)
    autonomous = None if system.time_dependent else decide(read, False).verdict
    return autonomous, decide(read, True).verdict


def assert_variational(system: GeneratedSystem) -> None:
    autonomous, with_time = verdicts(system)
    assert autonomous in (None, "variational"), f"{system.id}: {system.equations}"
    assert with_time == "variational", f"{system.id}: {system.equations}"


@pytest.mark.slow
def test_systems_with_a_lagrangian_are_variational() -> None:
    for system in random_systems(32, seed=17):
        assert_variational(system)


@pytest.mark.slow
def test_they_stay_so_in_other_coordinates() -> None:
    for system in random_systems(16, seed=18):
        assert_variational(disguised(system, 1))


@pytest.mark.slow
def test_random_right_sides_are_decided_and_most_have_no_lagrangian() -> None:
    found = [decide(read_system(s.coordinates, s.equations), True).verdict for s in random_right_sides(45, seed=19)]
    assert "undetermined" not in found
    assert found.count("not_variational") > 36


@pytest.mark.nightly
def test_a_thousand_systems_with_a_lagrangian_are_variational() -> None:
    for system in random_systems(1000, seed=20):
        assert_variational(system)


@pytest.mark.nightly
def test_a_thousand_disguised_systems_are_variational() -> None:
    for system in random_systems(1000, seed=21):
        assert_variational(disguised(system, 1))

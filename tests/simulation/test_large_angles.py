"""An angle of 10^7 has an accuracy of only 1e-9, and Newton's method must not require more."""

from __future__ import annotations

import pytest

from benchmarks.problems import DISK
from inverse_service.simulation.execution import run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Start


@pytest.mark.slow
@pytest.mark.parametrize("angle", [1.3e5, 1e7])
@pytest.mark.parametrize("alpha", [0.0, 0.5, 1.0])
def test_newton_is_content_with_round_off(angle: float, alpha: float) -> None:
    start = Start((angle, 0.0, 0.0, 0.0), (1.0, 0.5, 0.0, 0.0), convention="discrete_constraint")
    assert run(
        DISK, MethodChoice("variational", alpha), start, Grid(0.1, 2000), {"c": 1.0}
    ).outcome.completed

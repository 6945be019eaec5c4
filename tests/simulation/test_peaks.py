"""Peaks of forces between the points of a run are found where the motion passes them: at half of
their height before the peak.

The motions are free or thrown up, x = v t - g t^2/2, which no peak of 1e-9 changes. A Gaussian
exp(-((x - c)/w)^2) is half of its height at |x - c| = w sqrt(log 2).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from inverse_service.integrators.trajectory import Array
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation import accuracy, observing, peaks

HALF = math.sqrt(math.log(2))


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> list[Array]:
    """The moments that are found for each run."""
    seen: list[Array] = []

    def noted(run: observing.Observed) -> Array:
        seen.append(peaks.moments_between(run))
        return np.empty(0)  # so the run is not repeated with them

    monkeypatch.setattr(accuracy, "moments_between", noted)
    return seen


def thrown(peak: str, speed: float, weight: float, step: float = 0.1) -> dict[str, Any]:
    return {
        "system": {"coordinates": ["x"], "lagrangian": f"x'^2/2 - {weight}*x + 1e-9*{peak}"},
        "initial": {"positions": {"x": 0}, "velocities": {"x": speed}},
        "step": step,
        "time": 2,
        "methods": ["runge-kutta"],
        "observe": ["trajectory"],
    }


@pytest.mark.parametrize(
    ("center", "width", "speed", "weight"),
    [
        (0.73, 1e-3, 1.0, 0.0),
        (0.7371, 1e-5, 1.0, 0.0),
        (-0.73, 1e-3, -1.0, 0.0),
        (0.4321, 1e-4, 1.03, 1.0),
    ],
    ids=["narrow", "narrower", "backward", "on a parabola"],
)
def test_a_peak_that_is_passed_is_found_at_half_of_its_height(
    found: list[Array], center: float, width: float, speed: float, weight: float
) -> None:
    simulate(thrown(f"exp(-((x - ({center}))/{width})^2)", speed, weight))
    reached = center - math.copysign(width * HALF, speed)
    root = math.copysign(math.sqrt(speed**2 - 2 * weight * reached), speed)
    times = [2 * reached / (speed + root)]
    if weight:  # passed again on the way down, where the peak is reached from above
        reached = center + width * HALF
        times.append((speed + math.sqrt(speed**2 - 2 * weight * reached)) / weight)
    assert [*map(len, found)] == [len(times)]
    assert np.abs(found[0] - times).max() < 1e-9


def test_a_peak_where_the_motion_turns_is_found(found: list[Array]) -> None:
    """At the highest point, at t = 1.03, the distance is w sqrt(log 2) at 1.03 -
    sqrt(2 w sqrt(log 2)).
    """
    speed, width = 1.03, 1e-5
    simulate(thrown(f"exp(-((x - {speed**2 / 2})/{width})^2)", speed, 1.0))
    (moments,) = found
    assert moments.tolist() == pytest.approx([speed - math.sqrt(2 * width * HALF)], abs=1e-7)


@pytest.mark.parametrize(
    "peak", ["exp(-((x - 0.73)/0.3)^2)", "tanh((x - 0.73)/0.001)", "exp(-((x - 40)/0.001)^2)"]
)
def test_there_is_no_peak_that_the_points_show_or_the_motion_does_not_pass(
    found: list[Array], peak: str
) -> None:
    """tanh is a step, higher after than before."""
    simulate(thrown(peak, 1.0, 0.0))
    assert [*map(len, found)] == [0]


def test_a_dip_of_a_steep_function_is_found_where_it_passes_zero(found: list[Array]) -> None:
    """tanh(u)^2 is 1/2 where |u| = artanh(sqrt(1/2)). Upward and downward on a parabola."""
    speed, center, width = 1.03, 0.4321, 1e-4
    simulate(thrown(f"tanh((x - {center})/{width})^2", speed, 1.0))
    low, high = (center + side * width * math.atanh(math.sqrt(0.5)) for side in (-1, 1))
    times = [speed - math.sqrt(speed**2 - 2 * low), speed + math.sqrt(speed**2 - 2 * high)]
    (moments,) = found
    assert moments.tolist() == pytest.approx(times, abs=1e-9)


def test_a_peak_in_the_velocity_is_found(found: list[Array]) -> None:
    """The velocity is v - t, and the peak is reached from above."""
    speed, center, width = 1.03, 0.4321, 1e-3
    scene = thrown(f"1e-6*exp(-((x' - {center})/{width})^2)", speed, 1.0)
    simulate(scene)
    (moments,) = found
    assert moments.tolist() == pytest.approx([speed - center - width * HALF], abs=1e-6)


def test_a_run_that_stops_at_peaks_goes_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thrown up with v = 1, x = t - t^2/2, of which a peak of 1e-9 changes nothing."""
    runs = []

    def noted(*given: Any) -> Any:
        runs.append(stopping(*given))
        return runs[-1]

    stopping = accuracy._stopping
    monkeypatch.setattr(accuracy, "_stopping", noted)
    simulate(thrown("exp(-((x - 0.21)/0.001)^2)", 1.0, 1.0))
    (ran,) = runs
    assert ran.times[-1] == 2
    assert ran.positions[:, 0] == pytest.approx(ran.times - ran.times**2 / 2, abs=1e-6)

"""Events are found however close they are within a step; touching 0 is not an event, and the result says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.service.scenes.simulating import simulate

OSCILLATOR = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}
METHODS = ["adaptive", "reference", {"method": "stormer-verlet", "order": 8}]


def events(when: str, method: Any = "adaptive", **more: Any) -> dict[str, Any]:
    document = {
        "system": OSCILLATOR, "initial": {"positions": {"x": 0}, "velocities": {"x": 1}}, "step": 0.3, "time": 12,
        "methods": [method], "events": [{"when": when}],
    }  # fmt: skip
    found: dict[str, Any] = simulate(document | more)["methods"][0]
    return found | found["events"][0]


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("below", [1e-2, 1e-4, 1e-6])
def test_two_zeros_within_a_step_are_both_found(method: Any, below: float) -> None:
    """x = sin t is above 1 - d for a time 2 arccos(1 - d) about each top."""
    found = events(f"x - {1 - below!r}", method)
    times = np.array(found["columns"]["t"]).reshape(-1, 2)
    assert len(times) == 2
    assert np.diff(times) == pytest.approx(2 * np.arccos(1 - below), rel=0.02)
    assert (np.array(found["columns"]["v_x"]).reshape(-1, 2) * [1, -1] > 0).all()


def test_many_zeros_within_a_step_are_all_found() -> None:
    found = events("cos(20*t)")
    assert np.array(found["columns"]["t"]) == pytest.approx(np.pi / 20 * (np.arange(76) + 0.5))


@pytest.mark.parametrize(("direction", "first"), [(1, 1.5566), (-1, 1.5849)])
def test_each_of_two_zeros_has_its_direction(direction: int, first: float) -> None:
    found = events("", events=[{"when": "x - 0.9999", "direction": direction}])
    assert found["columns"]["t"] == pytest.approx([first, first + 2 * np.pi], abs=1e-3)


@pytest.mark.parametrize(("when", "time"), [("x - 1", np.pi / 2), ("(x - 1/2)^2", np.pi / 6)])
def test_touching_zero_is_not_an_event_and_is_reported(when: str, time: float) -> None:
    found = events(when)
    assert found["count"] == 0
    assert float(found["note"].split(" = ")[1].split(" the")[0]) == pytest.approx(time, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.0, 1e-17, -1e-17])
@pytest.mark.parametrize("method", ["adaptive", "stormer-verlet"])
def test_a_hop_that_is_shorter_than_the_step_ends_on_the_ground(method: str, height: float) -> None:
    """Thrown up from the ground with 0.01 at g = 10 it is back after 0.002, long before the first step is over."""
    found = events(
        "", method, system={"coordinates": ["y"], "lagrangian": "y'^2/2 - 10*y"},
        initial={"positions": {"y": height}, "velocities": {"y": 0.01}},
        events=[{"when": "y", "direction": -1, "do": "stop"}],
    )  # fmt: skip
    assert found["final"]["t"] == pytest.approx(0.002)
    assert found["final"]["velocities"]["y"] == pytest.approx(-0.01)


def test_a_formula_that_is_round_off_has_no_events() -> None:
    found = events("sin(x)^2 + cos(x)^2 - 1")
    assert found["count"] == 0
    assert "0 within round-off during" in found["note"]


def test_a_zero_at_the_start_is_not_an_event() -> None:
    assert events("x")["columns"]["t"] == pytest.approx([np.pi, 2 * np.pi, 3 * np.pi])
    assert "note" not in events("x")["events"][0]


def test_a_formula_that_jumps_has_an_event_at_every_jump() -> None:
    """sign(x) = x/sqrt(x^2) is undefined at x = 0, which the search may hit exactly."""
    assert events("sign(x)")["columns"]["t"] == pytest.approx([np.pi, 2 * np.pi, 3 * np.pi])
    assert events("1/x")["count"] == events("tan(x)")["count"] - 3 == 0


@pytest.mark.slow
@pytest.mark.parametrize("rate", [1000, 2 * np.pi * 16 / 0.3, 350])
def test_a_formula_that_is_too_fast_for_the_places_says_so(rate: float) -> None:
    assert "events may be missing" in events(f"sin({rate!r}*t + 1/2)")["note"]
    assert "note" not in events("sin(100*t + 1/2)")["events"][0]

"""Events are found however close they are within a step; touching 0 is not an event, and the result
says so.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.service.scenes.simulating import simulate
from tests.values import slow

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
    """Thrown up from the ground with 0.01 at g = 10 it is back after 0.002, long before the first
    step is over.
    """
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


@pytest.mark.parametrize("rate", [100, 350, slow(1000), slow(2 * np.pi * 16 / 0.3)])
def test_a_formula_that_is_faster_than_the_examined_points_has_all_its_events(rate: float) -> None:
    found = events(f"sin({rate!r}*t + 1/2)")
    numbers = np.arange(1, np.floor((12 * rate + 0.5) / np.pi) + 1)
    assert np.array(found["columns"]["t"]) == pytest.approx(
        (numbers * np.pi - 0.5) / rate, rel=1e-12
    )
    assert "note" not in found["events"][0]


@pytest.mark.parametrize("when", ["sin(10^8*t + 1/2)", "exp(-((t - 7.3)/10^-14)^2) - 1/2"])
def test_a_formula_that_is_too_fast_says_so(when: str) -> None:
    assert "events may be missing" in events(when)["note"]


PASSES = {
    "exp(-((x - 7.3)/0.001)^2) - 1/2": 0.001 * np.sqrt(np.log(2)),
    "exp(-((x - 7.3)/10^-7)^2) - 1/2": 1e-7 * np.sqrt(np.log(2)),
    "1/(1 + (10^4*(x - 7.3))^2) - 1/2": 1e-4,
    "abs(x - 7.3) - 10^-6": 1e-6,
    "1/sqrt((x - 7.3)^2 + 10^-8) - 1000": np.sqrt(1e-6 - 1e-8),
    "sech(10^5*(x - 7.3)) - 1/2": np.arccosh(2) / 1e5,
    "log((x - 7.3)^2 + 10^-12) + 20": np.sqrt(np.exp(-20) - 1e-12),
    "(x - 7.3)^2 - 10^-10": 1e-5,
}


@pytest.mark.parametrize("step", [1, 0.5])
@pytest.mark.parametrize("when", PASSES)
def test_an_event_that_is_narrower_than_a_step_is_found(when: str, step: float) -> None:
    """x = t passes two zeros at 7.3 with and without half the width."""
    free = {"system": {"coordinates": ["x"], "lagrangian": "x'^2/2"}, "step": step, "time": 10}
    found = events(when, **free)
    half = PASSES[when]
    assert found["columns"]["t"] == pytest.approx([7.3 - half, 7.3 + half], abs=1e-9 + 1e-6 * half)
    direction = -1 if when.endswith(("- 10^-6", "+ 20", "- 10^-10")) else 1
    turned = {"when": when, "direction": direction, "do": {"set": {"x'": "-x'"}}}
    back = events("", **free, events=[turned])
    assert back["count"] == 1
    assert back["final"]["positions"]["x"] == pytest.approx(14.6 - 2 * half - 10, abs=1e-8)


@pytest.mark.parametrize(
    "when", ["1/(x - 7.3)^2", "(x - 7.3)^2 + 10^-12", "1/(x - 7.3)", "exp(-(10^4*(x - 7.3))^2)"]
)
def test_what_comes_near_zero_or_has_a_pole_is_no_event(when: str) -> None:
    found = events(when, system={"coordinates": ["x"], "lagrangian": "x'^2/2"}, step=1, time=10)
    assert found["count"] == 0


@pytest.mark.parametrize(
    ("when", "direction", "times"),
    [
        ("(t - 1)^2", 0, []), ("-(t - 1)^4", 0, []), ("t - 1", 1, [1]), ("t - 1", -1, []), ("(1 - t)^3", -1, [1]),
        ("t - 2", 1, [2]), ("t - 2", -1, []), ("2 - t", 1, []), ("2 - t", -1, [2]),
    ],
)  # fmt: skip
def test_zeros_at_points_of_the_grid_and_at_the_end_have_their_direction(
    when: str, direction: int, times: list[float]
) -> None:
    found = events(when, step=0.25, time=2, events=[{"when": when, "direction": direction}])
    assert found["columns"]["t"] == pytest.approx(times)


def test_the_first_of_two_events_ends_the_run_and_is_listed() -> None:
    """x = sin t reaches 1/2 at pi/6, before 9/10; both would end it."""
    ends = [{"when": "x - 0.9", "do": "stop"}, {"when": "x - 0.5", "do": "stop"}]
    found = events("", step=2, time=4, events=ends)
    later, first = (one["columns"]["t"] for one in found["events"])
    assert (later, first) == ([], pytest.approx([np.pi / 6]))
    assert found["final"]["positions"]["x"] == pytest.approx(0.5)

"""Events of bodies that touch: each is asked again after every jump, so that none passes through
another.

Exact ends by hand: equal balls exchange their velocities, a wall reverses one, masses m and M of an
elastic impact have the velocities ((m - M) v + 2 M w)/(m + M) and ((M - m) w + 2 m v)/(m + M) after
it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.service.scenes.simulating import simulate
from tests.values import slow

METHODS = [
    "adaptive",
    slow("variational"),
    slow({"method": "runge-kutta", "order": 8}),
    slow("reference"),
]
BALLS = "(a'^2 + b'^2 + c'^2)/2"
KICK = {"when": "t - 1", "do": {"set": {"x'": "-1"}}}
Row = tuple[dict[str, Any], float, dict[str, float]]


def swap(a: str, b: str, direction: int = -1) -> dict[str, Any]:
    return {
        "when": f"{b} - {a}",
        "direction": direction,
        "do": {"set": {f"{a}'": f"{b}'", f"{b}'": f"{a}'"}},
    }


def wall(x: str, direction: int = -1) -> dict[str, Any]:
    return {"when": x, "direction": direction, "do": {"set": {f"{x}'": f"-{x}'"}}}


def elastic(a: str, b: str, m: int, w: int) -> dict[str, Any]:
    """Of masses m and w."""
    values = {
        f"{a}'": f"(({m} - {w})*{a}' + 2*{w}*{b}')/({m} + {w})",
        f"{b}'": f"(({w} - {m})*{b}' + 2*{m}*{a}')/({m} + {w})",
    }
    return {"when": f"{b} - {a}", "direction": -1, "do": {"set": values}}


def scene(
    lagrangian: str,
    start: dict[str, tuple[float, float]],
    events: list[Any],
    time: float = 3,
    **more: Any,
) -> dict[str, Any]:
    positions, velocities = ({name: pair[k] for name, pair in start.items()} for k in (0, 1))
    initial = {"positions": positions, "velocities": velocities}
    system = {"coordinates": list(start), "lagrangian": lagrangian} | more.pop("system", {})
    return {
        "system": system,
        "initial": initial,
        "events": events,
        "step": 0.1,
        "time": time,
    } | more


CRADLE = {"a": (-1, 1), "b": (0, 0), "c": (0, 0)}
MEETING = {"a": (-1, 1), "b": (0, 0), "c": (1, -1)}
REST, AT_WALL = {"x": (0, 0)}, {"x": (0, 0), "a": (1, -1)}
EDGE = {"x": (0, 0), "y": (0, 0), "p": (0, 0)}
# Masses 2 and 1 fall in contact from 1: the lower one has u/3 after it has been turned back twice,
# the upper one 5 u/3.
FALL = float(np.sqrt(2 / 9.81))
LATER, SPEED = 0.5 - FALL, 9.81 * FALL
FIVE = {"a": (-1, 1), "b": (0, 0), "c": (0, 0), "d": (0, 0), "e": (0, 0)}
SCENES: dict[str, Row] = {
    "cradle": (scene(BALLS, CRADLE, [swap("a", "b"), swap("b", "c")]), 1e-12, {"a": 0, "b": 0, "c": 2}),
    "cradle, the other order": (scene(BALLS, CRADLE, [swap("b", "c"), swap("a", "b")]), 1e-12, {"b": 0, "c": 2}),
    "cradle, both directions": (
        scene(BALLS, CRADLE, [swap("b", "c", 0), swap("a", "b", 0)]), 1e-12, {"a": 0, "b": 0, "c": 2},
    ),
    "cradle with five balls": (
        scene("(a'^2 + b'^2 + c'^2 + d'^2 + e'^2)/2", FIVE, [swap(*pair) for pair in ("bc", "de", "ab", "cd")]),
        1e-12, {"a": 0, "b": 0, "c": 0, "d": 0, "e": 2},
    ),
    "two balls hit three": (
        scene("(a'^2 + b'^2 + c'^2 + d'^2 + e'^2)/2", FIVE | {"a": (-1, 1), "b": (-1, 1)},
              [swap(*pair) for pair in ("ab", "bc", "cd", "de")]),
        1e-12, {"a": 0, "b": 0, "c": 0, "d": 2, "e": 2},
    ),
    "three meet in one point": (
        scene(BALLS, MEETING, [swap("a", "b"), swap("b", "c")], 2), 1e-12, {"a": -1, "b": 0, "c": 1},
    ),
    "three meet, the other order": (
        scene(BALLS, MEETING, [swap("b", "c"), swap("a", "b")], 2), 1e-12, {"a": -1, "b": 0, "c": 1},
    ),
    "kicked against a wall": (scene("x'^2/2", REST, [KICK, wall("x")]), 1e-12, {"x": 2}),
    "kicked against a wall that is named first": (scene("x'^2/2", REST, [wall("x"), KICK]), 1e-12, {"x": 2}),
    "kicked before the wall": (scene("x'^2/2", {"x": (0.5, 0)}, [KICK, wall("x")]), 1e-12, {"x": 1.5}),
    "kicked away": (
        scene("x'^2/2", REST, [wall("x"), {"when": "t - 1", "do": {"set": {"x'": "1"}}}]), 1e-12, {"x": 2},
    ),
    "kicked between two walls": (
        scene("x'^2/2", REST, [KICK, wall("x"), {"when": "x - 1/2", "direction": 1, "do": {"set": {"x'": "-x'"}}}]),
        1e-12, {"x": 0},
    ),
    "a ball hits one at the wall": (
        scene("(x'^2 + a'^2)/2", AT_WALL, [swap("x", "a"), wall("x")]), 1e-12, {"x": 0, "a": 2},
    ),
    "a ball hits one at the wall, the other order": (
        scene("(x'^2 + a'^2)/2", AT_WALL, [wall("x"), swap("x", "a")]), 1e-12, {"x": 0, "a": 2},
    ),
    "stack": (
        scene("a'^2 + b'^2/2 - 9.81*(2*a + b)", {"a": (1, 0), "b": (1, 0)}, [wall("a"), elastic("a", "b", 2, 1)], 0.5),
        1e-9, {"a": SPEED / 3 * LATER - 4.905 * LATER**2, "b": 5 * SPEED / 3 * LATER - 4.905 * LATER**2},
    ),
    "kicked with dry friction": (
        scene("x'^2/2", REST, [KICK, wall("x")], forces={"x": "-sign(x')/10"}), 1e-12, {"x": 1.8},
    ),
    "a knife edge kicked against a wall": (
        scene("(x'^2 + y'^2 + p'^2)/2", EDGE, [KICK, wall("x")], system={"constraints": ["sin(p)*x' - cos(p)*y'"]}),
        1e-12, {"x": 2, "y": 0},
    ),
    "set onto a wall": (
        scene("x'^2/2", {"x": (1, -1)}, [{"when": "t - 1/2", "do": {"set": {"x": "0"}}}, wall("x")]), 1e-12,
        {"x": 2.5},
    ),
    "a corner": (
        scene("(x'^2 + y'^2)/2", {"x": (1, -1), "y": (1, -1)}, [wall("x"), wall("y")]), 1e-12, {"x": 2, "y": 2},
    ),
    "one wall by two formulas": (
        scene("x'^2/2", {"x": (1, -1)}, [wall("x"), wall("x") | {"when": "sin(x)"}]), 1e-12, {"x": 2},
    ),
    "a wall and a counter": (
        scene("(x'^2 + n'^2)/2", {"x": (1, -1), "n": (0, 0)},
              [wall("x"), {"when": "x", "direction": -1, "do": {"set": {"n": "n + 1"}}}]), 1e-12, {"x": 2, "n": 1},
    ),
    "kicked upwards where it lands": (
        scene("y'^2/2", {"y": (1, -1)}, [{"when": "t - 1", "do": {"set": {"y'": "2"}}}, wall("y")], 2), 1e-12, {"y": 2},
    ),
    "slower beyond a line": (
        scene("x'^2/2", {"x": (0, 1)}, [{"when": "x - 1", "direction": 1, "do": {"set": {"x'": "x'/2"}}}]), 1e-12,
        {"x": 2},
    ),
    "away from a wall that it touches": (scene("x'^2/2", {"x": (0, 1)}, [wall("x")]), 1e-12, {"x": 3}),
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("name", SCENES)
def test_no_body_passes_through_another(name: str, method: Any) -> None:
    document, apart, ends = SCENES[name]
    (found,) = simulate(document | {"methods": [method]})["methods"]
    if (
        method == "variational" and "constraints" in document["system"]
    ):  # no free Lagrangian has this motion
        assert found["outcome"] == "unavailable"
        return
    assert found["outcome"] == "completed"
    assert {x: found["final"]["positions"][x] for x in ends} == pytest.approx(ends, abs=apart)


@pytest.mark.parametrize("lagrangian", ["x'^2/2 - 10*x", "x'^2/2 - t^3*x"])
def test_what_is_pressed_against_a_wall_by_events_ends_by_name(lagrangian: str) -> None:
    (found,) = simulate(scene(lagrangian, REST, [wall("x")]) | {"methods": ["adaptive"]})["methods"]
    assert found["outcome"] == "zeno"
    assert found["stopped"]["time"] == 0


def test_a_ball_that_an_impact_brings_to_rest_on_the_floor_ends_by_name() -> None:
    """Masses 3 and 1 that fall in contact: the lower one has no velocity after the impact, and lies
    on the floor.
    """
    events = [wall("a"), elastic("a", "b", 3, 1)]
    (found,) = simulate(
        scene("3*a'^2/2 + b'^2/2 - 9.81*(3*a + b)", {"a": (1, 0), "b": (1, 0)}, events)
    )["methods"]
    assert found["outcome"] == "zeno"
    assert found["stopped"]["time"] == pytest.approx(FALL, abs=1e-6)


def test_a_formula_is_only_said_to_be_zero_while_it_is() -> None:
    (found,) = simulate(SCENES["cradle"][0])["methods"]
    assert found["events"][1]["count"] == 1
    assert found["events"][1]["note"].startswith("From t = 0 to 1 the formula is 0")
    assert "note" not in found["events"][0]


def test_a_jump_over_zero_is_reported() -> None:
    over = {"when": "t - 1", "do": {"set": {"x": "-1"}}}
    (found,) = simulate(scene("x'^2/2", {"x": (1, 0)}, [over, wall("x")]))["methods"]
    assert found["events"][1]["count"] == 0
    assert "At t = 1 another event moved the formula over 0" in found["events"][1]["note"]

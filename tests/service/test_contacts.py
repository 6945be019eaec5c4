"""Contacts against exact solutions, and against a small solver of complementarity problems that is written here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.service.scenes.simulating import simulate

G = 9.81
FALL, SPEED = np.sqrt(2 / G), np.sqrt(2 * G)  # of a body from height 1
Start = dict[str, tuple[float, float]]
Scene = dict[str, Any]


def scene(lagrangian: str, start: Start, contacts: list[Scene], time: float, **more: Any) -> Scene:
    positions, velocities = ({name: float(pair[k]) for name, pair in start.items()} for k in (0, 1))
    system = {"coordinates": list(start), "lagrangian": lagrangian} | more.pop("system", {})
    document = {"system": system, "initial": {"positions": positions, "velocities": velocities}, "contacts": contacts}
    return document | {"step": 0.02, "time": time, "methods": ["adaptive"]} | more


def run(document: Scene) -> Scene:
    (found,) = simulate(document)["methods"]
    assert isinstance(found, dict)
    return found


def balls(count: int) -> str:
    return "(" + " + ".join(f"{x}'^2" for x in "abcde"[:count]) + ")/2"


def line(count: int, restitution: float = 1) -> list[Scene]:
    """Balls that touch their neighbors."""
    pairs = zip("abcde", "abcde"[1:count], strict=False)
    return [{"gap": f"{b} - {a}", "restitution": restitution} for a, b in pairs]


def at_rest(*places: float) -> Start:
    return {x: (place, 0) for x, place in zip("abcde", places, strict=False)}


def bounced(t: float, e: float) -> float:
    """A ball from height 1; 0 from its rest on."""
    begin, speed = FALL, e * SPEED
    if t < begin:
        return float(1 - G * t * t / 2)
    for _ in range(60):
        if t < begin + 2 * speed / G:
            return float(speed * (t - begin) - G * (t - begin) ** 2 / 2)
        begin, speed = begin + 2 * speed / G, e * speed
    return 0.0


def rubbed(t: float) -> float:
    """x'' = -4 x with friction 1/2 from rest at 1: half turns about +-1/8 until it sticks."""
    place, begin = 1.0, 0.0
    while 4 * abs(place) > 0.5:
        middle = np.sign(place) / 8
        if t < begin + np.pi / 2:
            return float(middle + (place - middle) * np.cos(2 * (t - begin)))
        place, begin = 2 * middle - place, begin + np.pi / 2
    return float(place)


def folded(x: float, length: float) -> float:
    """A point that is reflected at 0 and at the length."""
    rest = x % (2 * length)
    return min(rest, 2 * length - rest)


def driven(t: float) -> float:
    """x'' = 4 sin(t) with dry friction 1 between stops at 0 and 1 without restitution, from rest at 1/2."""
    begin = np.arcsin(0.25)
    s = t - np.pi - begin
    return float(1 - 4 * np.cos(begin) * s - 4 * (np.sin(t) + np.sin(begin)) + s * s / 2) if s > 0 else 1.0


FLOOR = {"name": "floor", "gap": "y"}
ROUGH = FLOOR | {"friction": 0.3, "slides": "x'"}
POINT, INCLINE = "(x'^2 + y'^2)/2 - g*y", "(x'^2 + y'^2)/2 - g*(y*cos(1/2) + x*sin(1/2))"
GRAVITY = {"parameters": {"g": G}, "system": {"parameters": ["g"]}}
TWO_BLOCKS = "a'^2 + b'^2 + (x'^2 + y'^2)/2 - g*(2*b + y)"  # masses 2 and 1
STACKED = [{"gap": "b"}, {"gap": "y - b - 1", "friction": 0.5, "slides": "x' - a'"}]
WEDGE = [{"gap": "b"}, {"gap": "(y - b)*cos(1/2) - (x - a)*sin(1/2)"}]
SLOPE = G * np.sin(0.5) * np.cos(0.5) / (2 + np.sin(0.5) ** 2)  # of the wedge, backwards
AT_REST_2 = {"a": (0, 0), "b": (0, 0), "x": (0, 0), "y": (1, 0)}
Row = tuple[Scene, dict[str, float]]
ONE: dict[str, Row] = {
    "a ball in the air after five impacts": (
        scene("y'^2/2 - 9.81*y", {"y": (1, 0)}, [FLOOR | {"restitution": 0.8}], 2.5), {"y": bounced(2.5, 0.8)},
    ),
    "a ball that comes to rest": (scene("y'^2/2 - 9.81*y", {"y": (1, 0)}, [FLOOR | {"restitution": 0.5}], 2), {"y": 0}),
    "a ball without restitution": (scene("y'^2/2 - 9.81*y", {"y": (1, 0)}, [FLOOR], 1), {"y": 0}),
    "a ball at rest": (scene("y'^2/2 - 9.81*y", {"y": (0, 0)}, [FLOOR | {"restitution": 0.9}], 1), {"y": 0}),
    "lifted by a growing force": (scene("y'^2/2 - 9.81*y + 20*t*y", {"y": (0, 0)}, [FLOOR], 1),
                                  {"y": 20 / 6 * (1 - G / 20) ** 3}),
    "slides and stops": (scene(POINT, {"x": (0, 2), "y": (0, 0)}, [ROUGH], 1, **GRAVITY), {"x": 4 / (0.6 * G), "y": 0}),
    "slides on": (
        scene(POINT, {"x": (0, 2), "y": (0, 0)}, [ROUGH], 0.5, **GRAVITY), {"x": 1 - 0.15 * G * 0.25, "y": 0},
    ),
    "an incline that holds": (scene(INCLINE, {"x": (0, 0), "y": (0, 0)}, [ROUGH | {"friction": 0.6}], 1, **GRAVITY),
                              {"x": 0, "y": 0}),
    "an incline that does not hold": (scene(INCLINE, {"x": (0, 0), "y": (0, 0)}, [ROUGH], 1, **GRAVITY),
                                      {"x": -G * (np.sin(0.5) - 0.3 * np.cos(0.5)) / 2, "y": 0}),
    "up an incline and held": (
        scene(INCLINE, {"x": (0, 2), "y": (0, 0)}, [ROUGH | {"friction": 0.6}], 1, **GRAVITY),
        {"x": 4 / (2 * G * (np.sin(0.5) + 0.6 * np.cos(0.5)))},
    ),
    "up an incline and back": (
        scene(INCLINE, {"x": (0, 2), "y": (0, 0)}, [ROUGH], 1, **GRAVITY),
        {"x": 4 / (2 * (up := G * (np.sin(0.5) + 0.3 * np.cos(0.5))))
         - G * (np.sin(0.5) - 0.3 * np.cos(0.5)) / 2 * (1 - 2 / up) ** 2},
    ),
    "pulled until it slips": (
        scene(POINT + " + 4*t*x", {"x": (0, 0), "y": (0, 0)}, [ROUGH], 1.5, **GRAVITY),
        {"x": 4 / 6 * (1.5 - 0.3 * G / 4) ** 3},
    ),
    "carried by a belt": (
        scene(POINT, {"x": (0, 0), "y": (0, 0)}, [ROUGH | {"slides": "x' - 1"}], 1, **GRAVITY),
        {"x": 1 - 1 / (2 * 0.3 * G)},
    ),
    "a spring on a rough floor": (
        scene("(x'^2 + y'^2)/2 - 2*x^2 - y", {"x": (1, 0), "y": (0, 0)}, [ROUGH | {"friction": 0.5}], 6),
        {"x": rubbed(6)},
    ),
    "thrown obliquely, it slips": (
        scene(POINT, {"x": (0, 5), "y": (1, 0)}, [ROUGH | {"restitution": 0.5}], 0.6, **GRAVITY),
        {"x": 5 * FALL + (5 - 0.3 * 1.5 * SPEED) * (0.6 - FALL), "y": bounced(0.6, 0.5)},
    ),
    "thrown obliquely, it stops": (
        scene(POINT, {"x": (0, 1), "y": (1, 0)}, [ROUGH | {"restitution": 0.5}], 0.6, **GRAVITY),
        {"x": FALL, "y": bounced(0.6, 0.5)},
    ),
    "a table that sinks faster than a body falls": (
        scene("y'^2/2 - 9.81*y", {"y": (0, 0)}, [{"gap": "y + 2*t^3"}], 1), {"y": -(
            (z := G / 12), 2 * z**3 + 6 * z**2 * (1 - z) + G / 2 * (1 - z) ** 2)[1]},
    ),
    "given by its equation": (
        {**scene("", {"y": (1, 0)}, [FLOOR | {"restitution": 0.5}], 1),
         "system": {"coordinates": ["y"], "equations": {"y": "-9.81"}}}, {"y": bounced(1, 0.5)},
    ),
}  # fmt: skip
SEVERAL: dict[str, Row] = {
    "cradle of three": (scene(balls(3), at_rest(-1, 0, 0) | {"a": (-1, 1)}, line(3), 3), {"a": 0, "b": 0, "c": 2}),
    "cradle of five": (
        scene(balls(5), at_rest(-1, 0, 0, 0, 0) | {"a": (-1, 1)}, line(5), 3), {"a": 0, "b": 0, "c": 0, "d": 0, "e": 2},
    ),
    "two hit three": (
        scene(balls(5), at_rest(-1, -1, 0, 0, 0) | {"a": (-1, 1), "b": (-1, 1)}, line(5), 3),
        {"a": 0, "b": 0, "c": 0, "d": 2, "e": 2},
    ),
    "three meet in one point": (
        scene(balls(3), {"a": (-1, 1), "b": (0, 0), "c": (1, -1)}, line(3), 3), {"a": -2, "b": 0, "c": 2},
    ),
    "a line without restitution": (
        scene(balls(3), at_rest(-1, 0, 0) | {"a": (-1, 1)}, line(3, 0), 2), {"a": 1 / 3, "b": 1 / 3, "c": 1 / 3},
    ),
    "one at a wall is hit": (
        scene("(x'^2 + a'^2)/2", {"x": (0, 0), "a": (1, -1)},
              [{"gap": "a - x", "restitution": 1}, {"gap": "x", "restitution": 1}], 3), {"x": 0, "a": 2},
    ),
    "stack of masses 3 and 1": (
        scene("3*a'^2/2 + b'^2/2 - 9.81*(3*a + b)", at_rest(1, 1),
              [{"gap": "a", "restitution": 1}, {"gap": "b - a", "restitution": 1}], 0.8),
        {"a": 0, "b": 2 * SPEED * (0.8 - FALL) - G / 2 * (0.8 - FALL) ** 2},
    ),
    "stack of masses 2 and 1": (
        scene("a'^2 + b'^2/2 - 9.81*(2*a + b)", at_rest(1, 1),
              [{"gap": "a", "restitution": 1}, {"gap": "b - a", "restitution": 1}], 0.5),
        {"a": SPEED / 3 * (0.5 - FALL) - G / 2 * (0.5 - FALL) ** 2,
         "b": 5 * SPEED / 3 * (0.5 - FALL) - G / 2 * (0.5 - FALL) ** 2},
    ),
    "stack without restitution": (
        scene(balls(3) + " - 9.81*(a + b + c)", at_rest(0, 1, 3), [
            {"gap": "a"}, {"gap": "b - a - 1"}, {"gap": "c - b - 1"}], 1), {"a": 0, "b": 1, "c": 2},
    ),
    "a bouncing box": (
        scene("(x'^2 + y'^2)/2", {"x": (0.3, 1), "y": (0.2, 0.7)}, [
            {"gap": gap, "restitution": 1} for gap in ("x", "1 - x", "y", "1 - y")], 6),
        {"x": folded(6.3, 1), "y": folded(4.4, 1)},
    ),
    "pushed into a corner": (
        scene("(x'^2 + y'^2)/2 - x - 2*y", {"x": (1, 0), "y": (1, 0)}, [{"gap": "x"}, {"gap": "y"}], 3),
        {"x": 0, "y": 0},
    ),
    "into a corner that it meets at once": (
        scene("(x'^2 + y'^2)/2", {"x": (1, -1), "y": (1, -1)}, [
            {"gap": "x", "restitution": 1}, {"gap": "y", "restitution": 0.5}], 3), {"x": 2, "y": 1},
    ),
    "a block carries another": (
        scene(TWO_BLOCKS + " + 6*a", AT_REST_2, STACKED, 1, **GRAVITY), {"a": 1, "x": 1, "b": 0, "y": 1},
    ),
    "a block slips under another": (
        scene(TWO_BLOCKS + " + 20*a", AT_REST_2, STACKED, 1, **GRAVITY),
        {"a": (20 - G / 2) / 4, "x": G / 4, "b": 0, "y": 1},
    ),
    "a wedge on a smooth floor": (
        scene(TWO_BLOCKS.replace("a'^2 + b'^2", "(2*a'^2 + 2*b'^2)/2"), AT_REST_2 | {"y": (0, 0)}, WEDGE, 1, **GRAVITY),
        {"a": SLOPE / 2, "b": 0, "x": -SLOPE, "y": -SLOPE * 1.5 * np.tan(0.5)},
    ),
    "a slider between two stops": (
        scene("x'^2/2", {"x": (0.5, 0)}, [{"gap": "x"}, {"gap": "1 - x"}], 4.2, forces={"x": "4*sin(t) - sign(x')"}),
        {"x": driven(4.2)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", [*ONE, *SEVERAL])
def test_exact_solutions_are_met(name: str) -> None:
    document, ends = {**ONE, **SEVERAL}[name]
    found = run(document)
    assert found["outcome"] == "completed"
    assert "doubt" not in found
    assert {x: found["final"]["positions"][x] for x in ends} == pytest.approx(ends, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["variational", {"method": "runge-kutta", "order": 8}, "reference", "stiff"])
@pytest.mark.parametrize(
    "name", ["a ball that comes to rest", "cradle of three", "pushed into a corner", "slides and stops"]
)
def test_other_methods_meet_them_too(name: str, method: Any) -> None:
    document, ends = {**ONE, **SEVERAL}[name]
    found = run(document | {"methods": [method]})
    assert found["outcome"] == "completed"
    assert {x: found["final"]["positions"][x] for x in ends} == pytest.approx(ends, abs=1e-7)

"""Contacts against exact solutions, and against a small solver of complementarity problems that is
written here.
"""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from api_schemas import scene as schemas
from inverse_service.cli.simulate_command import page
from inverse_service.errors import InputError
from inverse_service.service.scenes import scene_reading
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation import contacts as touching
from tests.values import slow

G = 9.81
FALL, SPEED = np.sqrt(2 / G), np.sqrt(2 * G)  # of a body from height 1
Start = dict[str, tuple[float, float]]
Scene = dict[str, Any]


def scene(lagrangian: str, start: Start, contacts: list[Scene], time: float, **more: Any) -> Scene:
    positions, velocities = ({name: float(pair[k]) for name, pair in start.items()} for k in (0, 1))
    system = {"coordinates": list(start), "lagrangian": lagrangian} | more.pop("system", {})
    document = {
        "system": system,
        "initial": {"positions": positions, "velocities": velocities},
        "contacts": contacts,
    }
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
    """x'' = 4 sin(t) with dry friction 1 between stops at 0 and 1 without restitution, from rest at
    1/2.
    """
    begin = np.arcsin(0.25)
    s = t - np.pi - begin
    return (
        float(1 - 4 * np.cos(begin) * s - 4 * (np.sin(t) + np.sin(begin)) + s * s / 2)
        if s > 0
        else 1.0
    )


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


def kick(x: str, speed: float) -> Scene:
    """At t = 1/2."""
    return {"when": "t - 1/2", "do": {"set": {f"{x}'": str(speed)}}}


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
    "kicked upwards by an event": (
        scene("y'^2/2 - 9.81*y", {"y": (0, 0)}, [FLOOR], 0.8, events=[kick("y", 2)]), {"y": 0.6 - 0.045 * G},
    ),
    "kicked downwards by an event": (
        scene("y'^2/2 - 9.81*y", {"y": (0, 0)}, [FLOOR | {"restitution": 0.5}], 0.6, events=[kick("y", -2)]),
        {"y": 0.1 - 0.005 * G},
    ),
    "kicked along by an event": (
        scene(POINT, {"x": (0, 0), "y": (0, 0)}, [ROUGH], 1, events=[kick("x", 1)], **GRAVITY), {"x": 1 / (0.6 * G)},
    ),
    "dry friction as a force too": (
        scene(POINT, {"x": (0, 2), "y": (0, 0)}, [ROUGH], 1, forces={"x": "-sign(x')"}, **GRAVITY),
        {"x": 2 / (0.3 * G + 1)},
    ),
    "thrown off by a table that slows down": (
        scene("y'^2/2 - 9.81*y", {"y": (0, 5)}, [{"gap": "y - sin(5*t)"}], 0.4),
        {"y": G / 25 + 5 * np.cos(off := np.arcsin(G / 25)) * (0.4 - off / 5) - G / 2 * (0.4 - off / 5) ** 2},
    ),
    "a knife edge at a wall": (
        scene("(x'^2 + y'^2 + p'^2)/2", {"x": (1, -1), "y": (0, -1), "p": (np.pi / 4, 0)},
              [{"gap": "x", "restitution": 0.5}], 3, system={"constraints": ["sin(p)*x' - cos(p)*y'"]}),
        {"x": 1, "y": 0},
    ),
    "a belt that turns back": (
        scene(POINT, {"x": (0, 0), "y": (0, 0)}, [ROUGH | {"slides": "x' - sin(t)"}], 3, **GRAVITY),
        {"x": 1 - np.cos(3)},
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
    "cradle of masses 1, 2 and 3": (
        scene("a'^2/2 + b'^2 + 3*c'^2/2", {"a": (-1, 2), "b": (0, 0), "c": (0, 0)}, line(3), 1.5),
        {"a": -2 / 3, "b": -4 / 15, "c": 16 / 15},
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
    "a spring between two walls": (
        scene("(x'^2 + y'^2)/2 - (y - x - 2)^2/2", {"x": (0.1, 0), "y": (0.9, 0)}, [{"gap": "x"}, {"gap": "1 - y"}], 3),
        {"x": 0, "y": 1},
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
    "a disk rolls down a rough incline": (
        scene("(x'^2 + y'^2)/2 + p'^2/4 - g*(y*cos(1/2) - x*sin(1/2))", {"x": (0, 0), "y": (0, 0), "p": (0, 0)},
              [ROUGH | {"slides": "x' - p'"}], 1, **GRAVITY),
        {"x": G * np.sin(0.5) / 3, "p": G * np.sin(0.5) / 3},
    ),
    "a disk slips down a smoother incline": (
        scene("(x'^2 + y'^2)/2 + p'^2/4 - g*(y*cos(1/2) - x*sin(1/2))", {"x": (0, 0), "y": (0, 0), "p": (0, 0)},
              [ROUGH | {"friction": 0.1, "slides": "x' - p'"}], 1, **GRAVITY),
        {"x": G * (np.sin(0.5) - 0.1 * np.cos(0.5)) / 2, "p": 0.1 * G * np.cos(0.5)},
    ),
    "backspin turns a ball back": (
        scene("(x'^2 + y'^2)/2 + p'^2/4 - g*y", {"x": (0, 1), "y": (0, 0), "p": (0, -5)},
              [ROUGH | {"slides": "x' - p'"}], 1, **GRAVITY),
        {"x": (back := 6 / (3 * 0.3 * G)) - 0.15 * G * back**2 - (1 - back)},
    ),
    "a slider between two stops": (
        scene("x'^2/2", {"x": (0.5, 0)}, [{"gap": "x"}, {"gap": "1 - x"}], 4.2, forces={"x": "4*sin(t) - sign(x')"}),
        {"x": driven(4.2)},
    ),
}  # fmt: skip


# By default, the cousin of each of these runs all of its branches and asks for the same mechanism.
COUSINS = {
    "a bouncing box": "a slider between two stops",
    "a spring on a rough floor": "dry friction as a force too",
    "carried by a belt": "a belt that turns back",
    "a table that sinks faster than a body falls": "thrown off by a table that slows down",
    "up an incline and held": "up an incline and back",
    "pushed into a corner": "stack without restitution",
    "a block carries another": "a block slips under another",
    "stack of masses 3 and 1": "stack of masses 2 and 1",
    "a disk rolls down a rough incline": "backspin turns a ball back",
    "a disk slips down a smoother incline": "backspin turns a ball back",
    "two hit three": "cradle of five",
}


@pytest.mark.parametrize(
    "name", [slow(name) if name in COUSINS else name for name in (*ONE, *SEVERAL)]
)
def test_exact_solutions_are_met(name: str) -> None:
    document, ends = {**ONE, **SEVERAL}[name]
    found = run(document)
    assert found["outcome"] == "completed"
    assert "doubt" not in found
    assert {x: found["final"]["positions"][x] for x in ends} == pytest.approx(ends, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", ["variational", {"method": "runge-kutta", "order": 8}, "reference", "stiff"]
)
@pytest.mark.parametrize(
    "name",
    ["a ball that comes to rest", "cradle of three", "pushed into a corner", "slides and stops"],
)
def test_other_methods_meet_them_too(name: str, method: Any) -> None:
    document, ends = {**ONE, **SEVERAL}[name]
    found = run(document | {"methods": [method]})
    assert found["outcome"] == "completed"
    assert {x: found["final"]["positions"][x] for x in ends} == pytest.approx(ends, abs=1e-7)


# Independent: bodies on a line with constant accelerations, one impact after another, rest by
# complementarity.


def presses(masses: np.ndarray, rows: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """a with M a = F + G^T x, x >= 0, G a >= 0, x G a = 0, by trying all sets."""
    for count in range(len(rows), -1, -1):
        for chosen in combinations(range(len(rows)), count):
            part = rows[list(chosen)]
            x = np.linalg.lstsq(
                part @ np.diag(1 / masses) @ part.T, -part @ (forces / masses), rcond=None
            )[0]
            a = (forces + part.T @ x) / masses
            if (x >= -1e-12).all() and (rows @ a >= -1e-9).all():
                return a
    raise AssertionError("no set of contacts presses")


def by_quadratics(
    masses: list[float], forces: list[float], places: list[float], speeds: list[float], rows: list[list[float]],
    offsets: list[float], restitutions: list[float], until: float,
) -> np.ndarray:  # fmt: skip
    """The places at the end: gaps G q + c are quadratic between impacts."""
    m, f, q, v = (np.array(one, dtype=float) for one in (masses, forces, places, speeds))
    g, c, t = np.array(rows, dtype=float), np.array(offsets, dtype=float), 0.0
    while True:
        for _ in range(10_000):
            closing = np.where(g @ q + c < 1e-11, g @ v, 0.0)
            k = int(closing.argmin())
            if closing[k] > -1e-14:
                break
            e = restitutions[k] if closing[k] < -3e-6 else 0.0
            v = v - (1 + e) * closing[k] / (g[k] @ (g[k] / m)) * g[k] / m
        resting = (g @ q + c < 1e-11) & (np.abs(g @ v) < 3e-6)
        touching, lift = g[resting], np.linalg.pinv(g[resting] / np.sqrt(m)) / np.sqrt(m)[:, None]
        q, v = q - lift @ (touching @ q + c[resting]), v - lift @ (touching @ v)
        a = presses(m, touching, f)
        ends = [until - t]
        for row, offset in zip(g, c, strict=True):
            roots = np.roots([row @ a / 2, row @ v, row @ q + offset])
            real = roots[np.isreal(roots)].real
            ends += [s for s in real if s > 1e-9 and row @ (v + a * s) < 0]
        s = min(ends)
        q, v, t = q + v * s + a * s * s / 2, v + a * s, t + s
        if t >= until - 1e-12:
            return q


PILES = {  # masses, forces, heights, speeds, restitutions, length of time
    "two fall on the floor": ([1, 1], [0.4, 1.5], [0, 0], [0.6, 0.4], 0.9),
    "two of other masses": ([1, 3], [0.4, 1.5], [0, 0], [0.3, 0.2], 1.2),
    "a heavy one below": ([5, 1], [1, 1.1], [0, 0], [0.8, 0.8], 1.0),
    "three thrown at each other": ([1, 2, 1], [1, 2, 3], [2, 0, -2.1], [0.5, 0.5, 0.5], 0.6),
    "three come to rest": ([1, 1, 1], [0.3, 0.7, 1.1], [0, 0, 0], [0.2, 0.2, 0.2], 3.0),
    "three elastic ones": ([1, 2, 3], [0.5, 1.1, 1.7], [0, 0, 0], [1, 1, 1], 1.5),
}


@pytest.mark.parametrize(
    "name", [name if k in (2, 3) else slow(name) for k, name in enumerate(PILES)]
)
def test_piles_are_those_of_the_solver_by_quadratics(name: str) -> None:
    masses, heights, speeds, restitutions, time = PILES[name]
    names = "abc"[: len(masses)]
    kinetic = " + ".join(f"{m}*{x}'^2/2 - {m}*9.81*{x}" for m, x in zip(masses, names, strict=True))
    gaps = [names[0], *(f"{b} - {a} - 1/10" for a, b in pairwise(names))]
    contacts = [{"gap": gap, "restitution": e} for gap, e in zip(gaps, restitutions, strict=True)]
    start = {x: (q, v) for x, q, v in zip(names, heights, speeds, strict=True)}
    found = run(scene(kinetic, start, contacts, time))
    rows = np.eye(len(names)) - np.eye(len(names), k=-1)
    expected = by_quadratics(
        masses, [-m * G for m in masses], heights, speeds, rows.tolist(), [0.0, *[-0.1] * (len(names) - 1)],
        restitutions, time,
    )  # fmt: skip
    assert found["outcome"] == "completed"
    assert list(found["final"]["positions"].values()) == pytest.approx(expected, abs=1e-8)


# Contacts of curved or moving bodies.


def test_a_mass_leaves_a_sphere_where_its_height_has_fallen_by_a_third() -> None:
    """From rest at the angle s: cos = 2/3 cos(s); the time to there is an integral, and then it
    falls freely.
    """
    s, length = 0.1, 2.0
    ball = {"gap": "sqrt(x^2 + y^2) - 1"}
    found = run(
        scene("(x'^2 + y'^2)/2 - y", {"x": (np.sin(s), 0), "y": (np.cos(s), 0)}, [ball], length + 1)
    )
    leaves = np.arccos(2 / 3 * np.cos(s))
    time, _ = quad(
        lambda u: 2 * u / np.sqrt(2 * (np.cos(s) - np.cos(s + u * u))),
        0,
        np.sqrt(leaves - s),
        epsabs=1e-13,
    )
    (contact,) = found["contacts"]
    assert contact["rests"] == [{"begin": 0, "end": pytest.approx(time, abs=1e-8)}]
    assert contact["greatest_force"] == pytest.approx(np.cos(s), abs=1e-8)
    speed, rest = np.sqrt(2 * (np.cos(s) - np.cos(leaves))), found["final"]["t"] - time
    x, y = (
        np.sin(leaves) + speed * np.cos(leaves) * rest,
        np.cos(leaves) - speed * np.sin(leaves) * rest - rest**2 / 2,
    )
    assert found["final"]["positions"] == pytest.approx({"x": x, "y": y}, abs=1e-8)


@pytest.mark.slow
def test_a_mass_falls_out_of_a_loop() -> None:
    """Inside of a circle of radius 1, from its lowest point with 6: it leaves where v^2 = -g
    cos.
    """
    found = run(
        scene(
            "(x'^2 + y'^2)/2 - 9.81*y",
            {"x": (0, 6), "y": (-1, 0)},
            [{"gap": "1 - x^2 - y^2"}],
            0.56,
        )
    )
    last = np.arccos((2 * G - 36) / (3 * G))
    time, _ = quad(lambda p: 1 / np.sqrt(36 - 2 * G * (1 - np.cos(p))), 0, last, epsabs=1e-13)
    speed, rest = np.sqrt(-G * np.cos(last)), 0.56 - time
    ends = {"x": np.sin(last) + speed * np.cos(last) * rest,
            "y": -np.cos(last) + speed * np.sin(last) * rest - G / 2 * rest**2}  # fmt: skip
    assert found["contacts"][0]["rests"] == [{"begin": 0, "end": pytest.approx(time, abs=1e-9)}]
    assert found["final"]["positions"] == pytest.approx(ends, abs=1e-8)


def test_a_mass_follows_a_hill_while_it_is_slow() -> None:
    """On y = -x^2, one equation for x."""
    hill = [{"gap": "y + x^2"}]
    slow_, fast = (
        run(scene("(x'^2 + y'^2)/2 - 9.81*y", {"x": (0, v), "y": (0, 0)}, hill, 0.5))
        for v in (1, 3)
    )
    done = solve_ivp(
        lambda t, s: [s[1], (2 * G * s[0] - 4 * s[0] * s[1] ** 2) / (1 + 4 * s[0] ** 2)], (0, 0.5), [0, 1], "DOP853",
        rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    assert slow_["final"]["positions"]["x"] == pytest.approx(done.y[0, -1], abs=1e-9)
    assert slow_["contacts"][0]["rests"] == [{"begin": 0, "end": 0.5}]
    assert fast["final"]["positions"] == pytest.approx({"x": 1.5, "y": -G / 8}, abs=1e-9)


def test_friction_of_a_contact_is_that_of_a_force() -> None:
    """A belt that shakes faster than friction can follow: a contact and a force with sign are two
    ways to write it.
    """
    belt = [ROUGH | {"friction": 0.1, "slides": "x' - sin(20*t)"}]
    first = run(scene(POINT, {"x": (0, 0), "y": (0, 0)}, belt, 0.4, **GRAVITY))
    second = run(
        scene("x'^2/2", {"x": (0, 0)}, [], 0.4, forces={"x": "-0.1*9.81*sign(x' - sin(20*t))"})
    )
    assert first["outcome"] == second["outcome"] == "completed"
    assert first["final"]["positions"]["x"] == pytest.approx(
        second["final"]["positions"]["x"], abs=1e-9
    )


def test_a_rod_leaves_the_wall_at_two_thirds_of_its_height() -> None:
    """Half of its length is 1: it slides down a wall and a floor until sin(p) = 2/3 sin(p0), where
    p is its slope.
    """
    first = 1.2
    lagrangian = "(x'^2 + y'^2)/2 + p'^2/6 - 9.81*y"
    contacts = [{"name": "wall", "gap": "x - cos(p)"}, {"name": "floor", "gap": "y - sin(p)"}]
    start = {"x": (np.cos(first), 0), "y": (np.sin(first), 0), "p": (first, 0)}
    found = run(scene(lagrangian, start, contacts, 1, observe=["trajectory", "contact_forces"]))
    wall, floor = found["contacts"]
    assert found["outcome"] == "completed"
    assert wall["impacts"] == floor["impacts"] == 0
    (end,) = (span["end"] for span in wall["rests"])
    last = np.arcsin(2 / 3 * np.sin(first))
    rate = 1.5 * G  # p'^2 = rate (sin(p0) - sin(p))
    time, _ = quad(lambda u: 2 * u / np.sqrt(rate * (np.sin(first) - np.sin(first - u * u))), 0, np.sqrt(first - last),
                   epsabs=1e-13)  # fmt: skip
    assert end == pytest.approx(time, abs=1e-8)
    columns = found["points"]["columns"]
    normal, t = np.array(columns["normal_wall"]), np.array(columns["t"])
    assert (normal[t < end - 1e-9] > 0).all()
    assert (normal[t > end + 1e-9] == 0).all()
    assert columns["normal_floor"][0] == pytest.approx(
        G * (1 - 0.75 * np.cos(first) ** 2), abs=1e-9
    )


def test_a_rolling_disk_leaves_a_cylinder_at_four_sevenths() -> None:
    """Disk of radius 1/2 on a cylinder of radius 1/2, without slipping: cos = 4/7 cos(s) from rest
    at s.
    """
    s = 0.1
    system = {"constraints": ["r*a' - p'/2"]}
    lagrangian = "(r'^2 + r^2*a'^2)/2 + p'^2/16 - r*cos(a)"
    start = {"r": (1, 0), "a": (s, 0), "p": (0, 0)}
    found = run(
        scene(
            lagrangian,
            start,
            [{"gap": "r - 1"}],
            4,
            system=system,
            observe=["trajectory", "velocities"],
        )
    )
    ((end,),) = ([span["end"] for span in one["rests"]] for one in found["contacts"])
    t, a = (np.array(found["points"]["columns"][name]) for name in ("t", "a"))
    assert np.interp(end, t, a) == pytest.approx(np.arccos(4 / 7 * np.cos(s)), abs=2e-4)
    time, _ = quad(lambda u: 2 * u / np.sqrt(4 / 3 * (np.cos(s) - np.cos(s + u * u))), 0,
                   np.sqrt(np.arccos(4 / 7 * np.cos(s)) - s), epsabs=1e-13)  # fmt: skip
    assert end == pytest.approx(time, abs=1e-8)


def test_a_ball_on_a_table_that_moves() -> None:
    contacts = [{"gap": "y - sin(5*t)/10", "restitution": 0.9}]
    found = run(scene("y'^2/2 - 9.81*y", {"y": (1, 0)}, contacts, 3))

    def hits(t: float, s: np.ndarray) -> float:
        return float(s[0] - np.sin(5 * t) / 10)

    hits.terminal, hits.direction = True, -1  # type: ignore[attr-defined]
    begin, y, impacts = 0.0, np.array([1.0, 0.0]), 0
    while True:
        done = solve_ivp(
            lambda t, s: [s[1], -G], (begin, 3), y, "DOP853", events=hits, rtol=3e-14, atol=1e-14
        )
        if not len(done.t_events[0]):
            break
        begin, impacts = float(done.t_events[0][0]), impacts + 1
        table = np.cos(5 * begin) / 2
        y = np.array(
            [np.sin(5 * begin) / 10 + 1e-15, table - 0.9 * (done.y_events[0][0][1] - table)]
        )
    assert found["contacts"][0]["impacts"] == impacts > 3
    assert found["final"]["positions"]["y"] == pytest.approx(done.y[0, -1], abs=1e-8)


def test_rests_begin_and_end_where_they_do() -> None:
    """It comes to rest after (1 + e)/(1 - e) times the first fall, and is lifted when 6 t =
    9.81.
    """
    lifted = scene("y'^2/2 - 9.81*y + 6*t*y", {"y": (0, 0)}, [{"name": "floor", "gap": "y"}], 2)
    (floor,) = run(lifted)["contacts"]
    rest = {"begin": 0, "end": pytest.approx(G / 6)}
    assert floor == {"name": "floor", "impacts": 0, "greatest_force": G, "rests": [rest]}
    (floor,) = run(ONE["a ball that comes to rest"][0])["contacts"]
    assert floor["rests"] == [{"begin": pytest.approx(3 * FALL, abs=1e-5), "end": 2}]
    assert floor["greatest_force"] == pytest.approx(G)
    # The last impact is faster than 4 times the fall by 1e-13 of the size, 1 m and the way of a
    # step.
    size = 1 + 0.02 * SPEED
    assert floor["impacts"] == 1 + np.floor(np.log2(SPEED / (4 * np.sqrt(2 * G * 1e-13 * size))))


def test_what_sticks_has_no_velocity_left() -> None:
    final = run(ONE["slides and stops"][0])["final"]
    assert final["velocities"] == pytest.approx({"x": 0, "y": 0}, abs=1e-16)


def test_forces_of_a_pile_are_the_weights_above() -> None:
    found = run(SEVERAL["stack without restitution"][0] | {"observe": ["contact_forces"]})
    assert [one["greatest_force"] for one in found["contacts"]] == pytest.approx([3 * G, 2 * G, G])
    assert found["points"]["columns"]["normal_contact_1"][-1] == pytest.approx(3 * G)
    assert found["contact_forces"]["greatest"]["friction_contact_1"] == 0


def test_friction_is_what_holds() -> None:
    document = ONE["an incline that holds"][0] | {"observe": ["contact_forces"]}
    columns = run(document)["points"]["columns"]
    assert columns["friction_floor"] == pytest.approx(np.full(51, G * np.sin(0.5)))
    assert columns["normal_floor"] == pytest.approx(np.full(51, G * np.cos(0.5)))


def test_where_the_laws_allow_no_motion_the_run_ends_by_name() -> None:
    """A rod that is dragged along a rough floor, mu = 3 (P. Painleve, 1895): its tip would dig
    in.
    """
    slope = 1.1  # of the rod, whose half is 1, against the floor
    lagrangian = "(x'^2 + y'^2)/2 + p'^2/6 - 9.81*y"
    tip = {"name": "tip", "gap": "y - sin(p)", "friction": 3, "slides": "x' + sin(p)*p'"}
    start = {"x": (0, 5), "y": (np.sin(slope), 0), "p": (slope, 0)}
    found = {
        way: run(scene(lagrangian, {**start, "x": (0, way * 5)}, [tip], 0.05)) for way in (1, -1)
    }
    # Forward it is pushed onto its tip where 1 + 3 cos(p) (cos(p) - 3 sin(p)) < 0, backward it is
    # pulled along.
    assert 1 + 3 * np.cos(slope) * (np.cos(slope) - 3 * np.sin(slope)) < 0
    kinds = {found[1]["outcome"], found[-1]["outcome"]}
    assert kinds == {"no_one_motion", "completed"}
    stopped = next(one for one in found.values() if one["outcome"] == "no_one_motion")
    assert "tip" in stopped["stopped"]["quantity"]
    assert (stopped["stopped"]["step"], stopped["stopped"]["time"]) == (0, 0)


def test_where_a_tip_may_press_or_leave_the_run_ends_by_name() -> None:
    """The same rod while it rotates so fast that its tip would leave: A < 0 in g'' = A L + sin(p)
    p'^2 - g, and sin(p) p'^2 > g, so L = 0 and L > 0 both go on.
    """
    slope, turn = 1.1, 5.0
    assert np.sin(slope) * turn**2 > G
    lagrangian = "(x'^2 + y'^2)/2 + p'^2/6 - 9.81*y"
    tip = {"name": "tip", "gap": "y - sin(p)", "friction": 3, "slides": "x' + sin(p)*p'"}
    start = {"y": (np.sin(slope), np.cos(slope) * turn), "p": (slope, turn)}
    ways = [run(scene(lagrangian, {"x": (0, x), **start}, [tip], 0.02)) for x in (20, -20)]
    assert {one["outcome"] for one in ways} == {"no_one_motion", "completed"}


@pytest.mark.parametrize(("speed", "way"), [(5, 1), (-5, -1), (0, -1)])
def test_the_tip_of_a_rod_that_slips_in_an_impact(speed: float, way: int) -> None:
    """Without gravity, e = 1/2, mu = 3/10: S = -mu sign(u) L, u after it where it was 0 before; g'
    from -1 to 1/2.
    """
    slope, mu = 0.7, 0.3
    sine, cosine = np.sin(slope), np.cos(slope)
    tip = {
        "name": "tip",
        "gap": "y - sin(p)",
        "friction": mu,
        "restitution": 0.5,
        "slides": "x' + sin(p)*p'",
    }
    start = {"x": (0, speed), "y": (sine + 0.1, -1), "p": (slope, 0)}
    found = run(scene("(x'^2 + y'^2)/2 + p'^2/6", start, [tip], 0.16))["final"]["velocities"]
    normal = 1.5 / (1 + 3 * cosine**2 + way * mu * 3 * sine * cosine)
    turn = -3 * (cosine + way * mu * sine) * normal
    after = {"x": speed - way * mu * normal, "y": normal - 1, "p": turn}
    assert after["y"] - cosine * turn == pytest.approx(0.5)
    assert way * (after["x"] + sine * turn) > 0  # it slips on
    assert found == pytest.approx(after, abs=1e-9)


@pytest.mark.parametrize(
    ("contact", "pointer", "words"),
    [
        ({"gap": "y - 2"}, "/contacts/0/gap", "negative at the start"),
        ({"gap": "y'"}, "/contacts/0/gap", "coordinate"),
        ({"gap": "t"}, "/contacts/0/gap", "no coordinate"),
        ({"gap": "y + y'^2"}, "/contacts/0/gap", "velocities"),
        ({"gap": "y", "restitution": 1.5}, "/contacts/0/restitution", "from 0 to 1"),
        ({"gap": "y", "friction": -1}, "/contacts/0/friction", "not negative"),
        ({"gap": "y", "friction": 1}, "/contacts/0/slides", "slides"),
        ({"gap": "y", "friction": 1, "slides": "y'^2"}, "/contacts/0/slides", "linear"),
        ({"gap": "z"}, "/contacts/0/gap", "z"),
    ],
)
def test_what_is_no_contact_is_refused_at_its_place(
    contact: Scene, pointer: str, words: str
) -> None:
    with pytest.raises(InputError) as refused:
        simulate(scene("y'^2/2", {"y": (1, 0)}, [contact], 1))
    assert refused.value.pointer.startswith(pointer)
    assert words in refused.value.detail


def test_several_equations_without_masses_and_names_of_columns_are_refused() -> None:
    document = scene("", {"x": (1, 0), "y": (1, 0)}, [{"gap": "y"}], 1)
    document["system"] = {"coordinates": ["x", "y"], "equations": {"x": "0", "y": "-1"}}
    with pytest.raises(InputError, match="masses"):
        simulate(document)
    document = scene(
        "y'^2/2", {"y": (1, 0)}, [{"gap": "y"}], 1, observe=[{"normal_contact_1": "y"}]
    )
    with pytest.raises(InputError):
        simulate(document)
    twice = [{"name": "floor", "gap": "y"}, {"name": "floor", "gap": "y"}]
    with pytest.raises(InputError, match="two contacts"):
        simulate(scene("y'^2/2", {"y": (1, 0)}, twice, 1))


def test_contacts_that_depend_on_one_another_have_one_motion() -> None:
    """The same floor three times."""
    found = run(
        scene(
            "y'^2/2 - 9.81*y", {"y": (1, 0)}, [{"gap": "y"}, {"gap": "2*y"}, {"gap": "sin(y)"}], 1
        )
    )
    assert found["outcome"] == "completed"
    assert found["final"]["positions"]["y"] == pytest.approx(0, abs=1e-12)


@pytest.mark.slow
def test_what_rests_by_another_method_has_its_energy() -> None:
    document = scene("y'^2/2 - g*y", {"y": (0.1, 0)}, [{"gap": "y"}], 0.3, **GRAVITY)
    found = run(document | {"methods": ["variational"], "observe": ["trajectory", "energy"]})
    assert found["outcome"] == "completed"
    energy = found["points"]["columns"]["energy"]
    assert [energy[0], energy[-1]] == pytest.approx([0.1 * G, 0])


def test_events_see_impacts() -> None:
    """An event counts the passages of a line, and one that stops the ball at its third apex ends
    the run.
    """
    events = [{"when": "y - 1/10"}, {"when": "y'", "direction": -1, "do": "stop", "count": 2}]
    found = run(
        scene(
            "y'^2/2 - 9.81*y", {"y": (1, 0)}, [{"gap": "y", "restitution": 0.8}], 5, events=events
        )
    )
    assert found["events"][0]["count"] == 4
    assert found["final"]["t"] == pytest.approx(FALL * (1 + 1.6 + 0.64), abs=1e-9)


def test_a_terminal_shows_what_contacts_did() -> None:
    shown = page(simulate(ONE["lifted by a growing force"][0]))
    assert f"floor: 0 impacts, pressed from t = 0 to {G / 20:.6g}; greatest force 9.81." in shown


def test_contacts_of_an_ensemble_are_refused() -> None:
    document = ONE["a ball at rest"][0] | {
        "ensemble": {"initial": {"positions": {"y": ["0", "1"]}}}
    }
    with pytest.raises(InputError, match="contacts are") as refused:
        simulate(document)
    assert refused.value.pointer == "/contacts"


def test_impacts_are_where_the_gap_is_zero() -> None:
    """Not where it is overlapped enough to be seen: the error is within the uncertainty that is
    shown.
    """
    document = ONE["a ball in the air after five impacts"][0] | {"observe": ["trajectory", "error"]}
    found = run(document)
    columns = found["points"]["columns"]
    error = max(abs(y - bounced(t, 0.8)) for t, y in zip(columns["t"], columns["y"], strict=True))
    assert error <= found["max_error"] + found["error_uncertainty"]
    cradle = run(SEVERAL["cradle of three"][0])["final"]["positions"]
    assert cradle == pytest.approx({"a": 0, "b": 0, "c": 2}, abs=4e-16)


@pytest.mark.parametrize("gap", ["sqrt(y)", "2*y^2", "abs(y)"])
def test_a_gap_that_is_never_negative_is_refused(gap: str) -> None:
    with pytest.raises(InputError, match="never negative"):
        run(scene("(x'^2 + y'^2)/2 - 10*y", {"x": (0, 0), "y": (1, 0)}, [{"gap": gap}], 1))


def test_a_body_does_not_pass_where_its_gap_ends() -> None:
    """sqrt(y) + y has no value below 0, so that no sign of it shows the impact."""
    found = run(
        scene("(x'^2 + y'^2)/2 - 10*y", {"x": (0, 0), "y": (1, 0)}, [{"gap": "sqrt(y) + y"}], 1)
    )
    assert found["outcome"] == "off_domain"
    assert found["final"]["positions"]["y"] > 0


def test_a_contact_that_slides_along_its_own_gap_has_no_motion() -> None:
    contact = FLOOR | {"friction": 0.2, "slides": "2*y'"}
    found = run(scene("(x'^2 + y'^2)/2 - 10*y", {"x": (0, 0), "y": (1, 0)}, [contact], 1))
    assert found["outcome"] == "unavailable"
    assert "slides along its own gap" in found["reason"]


def contacts_of(document: Scene) -> touching.Contacts:
    read, _ = scene_reading.read_scene(schemas.SceneDocument.model_validate(document))
    return touching.Contacts(read, dict(read.values), touching.forces_of(read))


@pytest.mark.parametrize("overlap", [1e-12, 1e-11])
def test_an_impact_leaves_no_overlap(overlap: float) -> None:
    """Round-off has put the ball below the floor and into the wall: it is back on both, and moves
    away, at the speed at which it came, from each."""
    both = [{"gap": "x", "restitution": 1}, {"gap": "y", "restitution": 1}]
    given = scene("(x'^2 + 3*y'^2)/2", {"x": (0, -1), "y": (0, -2)}, both, 1)
    contacts = contacts_of(given)
    state = 0.0, np.array([-overlap, -2 * overlap]), np.array([-1.0, -2.0])
    after = contacts.impact(state, touching.Scale(1.0, 2.0, 0.02))
    assert np.abs(after.state[1]).max() <= overlap / 1000
    assert after.state[2] == pytest.approx([1, 2])
    assert after.counts.tolist() == [1, 1]


@pytest.mark.parametrize("restitution", [0, 0.5, 1])
def test_after_all_impacts_of_a_moment_nothing_closes(restitution: float) -> None:
    """A ball held between two walls: with restitution 1 it would be struck for ever."""
    walls = [{"gap": gap, "restitution": restitution} for gap in ("x", "-x")]
    contacts = contacts_of(scene("x'^2/2", {"x": (0, -1)}, walls, 1))
    after = contacts.impact((0.0, np.zeros(1), np.array([-1.0])), touching.Scale(1.0, 1.0, 0.02))
    assert np.abs(after.state[2]).max() <= 1e-9
    assert sorted(after.resting) == [0, 1]


@pytest.mark.parametrize(("coupling", "friction"), [(0.9, 0.5), (0.9, 0.0), (0.0, 0.5)])
def test_a_run_whose_impacts_win_energy_is_doubted(coupling: float, friction: float) -> None:
    """Kane, Levinson, Dynamics (1985) 5.8: an impulse across the gap that turns the sliding back
    makes the work S (u+ + u-)/2 of friction positive.
    """
    floor = {"gap": "y", "restitution": 1, "friction": friction, "slides": "x'"}
    kinetic = f"(x'^2 + y'^2 + {2 * coupling}*x'*y')/2"
    start = {"x": (0.0, 0.1), "y": (0.1, -1.0)}
    found = run(scene(kinetic, start, [floor], 0.5, observe=["trajectory"]))
    u, v = (found["final"]["velocities"][name] for name in "xy")
    won = (u * u + v * v + 2 * coupling * u * v) - (1.01 - 0.2 * coupling)
    assert v == pytest.approx(1)
    assert (won > 0.1) == (coupling * friction > 0) == ("won energy" in found.get("doubt", ""))

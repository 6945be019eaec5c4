"""Contacts where they are hardest, against exact solutions: impacts at points of the grid, grazing,
forces that begin at zero, masses of a million to one, strings, pistons, and what rests without a
unique force.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.service.test_contacts import (
    FALL,
    FLOOR,
    GRAVITY,
    POINT,
    ROUGH,
    SPEED,
    G,
    Row,
    at_rest,
    balls,
    bounced,
    folded,
    line,
    run,
    scene,
)
from tests.values import slow

Scene = dict[str, Any]
JOINED = {"parameters": {"g": G}, "system": {"parameters": ["g"], "constraints": ["b' - a'"]}}
SLED = "(a'^2 + x'^2)/2 + b'^2 + y'^2 - g*(x + 2*y)"  # masses 1 and 2
RUNNERS = [
    {"gap": "x", "friction": 0.3, "slides": "a'"},
    {"gap": "y", "friction": 0.1, "slides": "b'"},
]
GROOVE = [{"gap": f"(y {sign} x)/sqrt(2)", "friction": 0.2, "slides": "z'"} for sign in "+-"]
DROP = "y'^2/2 - 8*y"  # falls from 1 in 1/2, with 4
GRID = {"step": 1 / 64}
M = 1e6


def hopped(t: float, e: float) -> float:
    """A ball from height 1 with g = 8."""
    return bounced(t * np.sqrt(8 / G), e)


def thrown(speed: float, friction: float, e: float, until: float) -> float:
    """x of a ball with g = 8 that slips at each impact, and then along the floor until it stops."""
    t, x, fall = 0.5, speed / 2, 4.0
    while fall > 1e-16:
        speed, fall = speed - friction * (1 + e) * fall, e * fall
        if t + fall / 4 > until:
            return x + speed * (until - t)
        x, t = x + speed * fall / 4, t + fall / 4
    rest = min(until - t, speed / (8 * friction))
    return x + speed * rest - 4 * friction * rest**2


def lifted(until: float) -> float:
    """y'' = sin(t) - 1/2 above a floor without restitution."""
    t = np.pi / 6

    def flown(s: float) -> float:
        return float(np.sin(t) - np.sin(s) + np.cos(t) * (s - t) - (s - t) ** 2 / 4)

    while True:
        lands = t + 0.5
        while flown(lands) > 0:
            lands += 1e-3
        lands = brentq(flown, lands - 1e-3, lands, xtol=1e-15)
        if until < lands:
            return flown(until)
        t += 2 * np.pi
        if until < t:
            return 0.0


def driven_ball(until: float, wall: float, x: float = 0.5, speed: float = 1.0) -> float:
    """Between 0 and 1 + wall t."""
    t = 0.0
    while True:
        ahead = (1 + wall * t - x) / (speed - wall) if speed > wall else np.inf
        back = -x / speed if speed < 0 else np.inf
        if t + min(ahead, back) > until:
            return x + speed * (until - t)
        x, t = x + speed * min(ahead, back), t + min(ahead, back)
        speed = 2 * wall - speed if ahead < back else -speed


def caught(until: float) -> tuple[float, float]:
    """A mass at (0.6, 0) falls until its string of length 1 is taut, then swings."""
    taut = np.sqrt(1.6 / G)
    angle = np.arctan2(0.6, 0.8)
    begin = [angle, -G * taut * np.sin(angle)]
    swung = solve_ivp(
        lambda _, y: [y[1], -G * np.sin(y[0])],
        (0, until - taut),
        begin,
        "DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    return float(np.sin(swung.y[0, -1])), float(-np.cos(swung.y[0, -1]))


def carried(until: float, below: float) -> tuple[float, float]:
    """A plank of mass 2 and the block of mass 1 on it, which begins with 3: friction 0.3 between
    them, `below` under the plank.
    """
    gains, loses = (0.3 - 3 * below) * G / 2, 0.3 * G
    together = 3 / (gains + loses)
    speed, rest = gains * together, until - together
    rest = min(rest, speed / (below * G)) if below else rest
    way = speed * rest - below * G * rest**2 / 2
    return gains * together**2 / 2 + way, 3 * together - loses * together**2 / 2 + way


SHARP = 4 * (1 + 1e-6)
MEETS = (SHARP - np.sqrt(SHARP**2 - 16)) / 8  # the ceiling, with a millionth of its speed
HARD: dict[str, Row] = {
    "impact at a point of the grid": (
        scene(DROP, {"y": (1, 0)}, [FLOOR | {"restitution": 0.5}], 1, **GRID),
        {"y": hopped(1, 0.5)},
    ),
    "elastic, at points of the grid": (
        scene(DROP, {"y": (1, 0)}, [FLOOR | {"restitution": 1}], 7.25, **GRID),
        {"y": hopped(7.25, 1)},
    ),
    "a hundred bounces": (
        scene(DROP, {"y": (1, 0)}, [FLOOR | {"restitution": 1}], 100.3),
        {"y": 4 * (x := 100.3 - 99.5) - 4 * x * x},
    ),
    "two balls at one moment": (
        scene(
            DROP + " + z'^2/2 - 8*z",
            {"y": (1, 0), "z": (1, 0)},
            [FLOOR | {"restitution": 0.5}, {"gap": "z", "restitution": 1}],
            1.3125,
            **GRID,
        ),
        {"y": hopped(1.3125, 0.5), "z": hopped(1.3125, 1)},
    ),
    "grazes a ceiling": (
        scene(DROP, {"y": (0, 4)}, [{"gap": "1 - y", "restitution": 0.5}], 0.875, **GRID),
        {"y": 3.5 - 4 * 0.875**2},
    ),
    "hardly meets a ceiling": (
        scene(DROP, {"y": (0, SHARP)}, [{"gap": "1 - y", "restitution": 0.5}], 0.875, **GRID),
        {"y": 1 - np.sqrt(SHARP**2 - 16) / 2 * (0.875 - MEETS) - 4 * (0.875 - MEETS) ** 2},
    ),
    "grazes a cylinder": (
        scene(
            "(x'^2 + y'^2)/2",
            {"x": (-2, 1), "y": (1, 0)},
            [{"gap": "sqrt(x^2 + y^2) - 1", "restitution": 1}],
            4,
            **GRID,
        ),
        {"x": 2, "y": 1},
    ),
    "scrapes along a cylinder": (
        scene(
            "(x'^2 + y'^2)/2",
            {"x": (-2, 1), "y": (0.999, 0)},
            [{"gap": "x^2 + y^2 - 1", "restitution": 1}],
            4,
            **GRID,
        ),
        {
            "x": -(c := np.sqrt(1 - 0.999**2)) + (1 - 2 * c * c) * (2 + c),
            "y": 0.999 + 2 * c * 0.999 * (2 + c),
        },
    ),
    "a heavy body hits a light one": (
        scene(
            f"{M}*a'^2/2 + b'^2/2",
            {"a": (0, 1), "b": (1, 0)},
            [{"gap": "b - a", "restitution": 1}],
            3,
        ),
        {"a": 1 + 2 * (M - 1) / (M + 1), "b": 1 + 4 * M / (M + 1)},
    ),
    "a light body on a heavy one": (
        scene(
            f"{M}*a'^2/2 + b'^2/2 - 9.81*({M}*a + b)",
            at_rest(1, 1),
            [{"gap": "a", "restitution": 1}, {"gap": "b - a", "restitution": 1}],
            0.6,
        ),
        {
            "a": SPEED * (M - 3) / (M + 1) * (0.6 - FALL) - G / 2 * (0.6 - FALL) ** 2,
            "b": SPEED * (3 * M - 1) / (M + 1) * (0.6 - FALL) - G / 2 * (0.6 - FALL) ** 2,
        },
    ),
    "five equal balls in a box": (
        scene(
            balls(5),
            dict(
                zip(
                    "abcde",
                    zip((0.1, 0.25, 0.4, 0.7, 0.85), (1, -0.7, 0.3, -1.3, 0.45), strict=True),
                    strict=True,
                )
            ),
            [*line(5), {"gap": "a", "restitution": 1}, {"gap": "1 - e", "restitution": 1}],
            3,
        ),
        dict(
            zip(
                "abcde",
                sorted(
                    folded(q + 3 * v, 1)
                    for q, v in ((0.1, 1), (0.25, -0.7), (0.4, 0.3), (0.7, -1.3), (0.85, 0.45))
                ),
                strict=True,
            )
        ),
    ),
    "thrown obliquely, to rest": (
        scene(
            "(x'^2 + y'^2)/2 - 8*y",
            {"x": (0, 6), "y": (1, 0)},
            [ROUGH | {"restitution": 0.5, "friction": 0.2}],
            2,
        ),
        {"x": thrown(6, 0.2, 0.5, 2), "y": 0},
    ),
    "thrown obliquely, until it stops": (
        scene(
            "(x'^2 + y'^2)/2 - 8*y",
            {"x": (0, 6), "y": (1, 0)},
            [ROUGH | {"restitution": 0.5, "friction": 0.2}],
            6,
        ),
        {"x": thrown(6, 0.2, 0.5, 6), "y": 0},
    ),
    "friction greater than any": (
        scene(
            "(x'^2 + y'^2)/2 - 8*y",
            {"x": (0, 6), "y": (1, 0)},
            [ROUGH | {"restitution": 1, "friction": 10}],
            1.3,
        ),
        {"x": 3, "y": hopped(1.3, 1)},
    ),
    "pulled by a spring, it stops for a moment": (
        scene(POINT + " - 2*(x - t)^2", {"x": (0, 0), "y": (0, 0)}, [ROUGH], 6, **GRAVITY),
        {"x": (pull := 6 - 0.075 * G) - np.sin(2 * pull) / 2},
    ),
    "slides along a groove": (
        scene(
            "(x'^2 + y'^2 + z'^2)/2 - g*y",
            {"x": (0, 0), "y": (0, 0), "z": (0, 3)},
            GROOVE,
            0.7,
            **GRAVITY,
        ),
        {"x": 0, "y": 0, "z": 2.1 - np.sqrt(2) * 0.049 * G},
    ),
    "stops in a groove": (
        scene(
            "(x'^2 + y'^2 + z'^2)/2 - g*y",
            {"x": (0, 0), "y": (0, 0), "z": (0, 3)},
            GROOVE,
            3,
            **GRAVITY,
        ),
        {"x": 0, "y": 0, "z": 9 / (0.4 * np.sqrt(2) * G)},
    ),
    "a string that is taut": (
        scene(POINT, {"x": (0.6, 0), "y": (0, 0)}, [{"gap": "1 - x^2 - y^2"}], 1.5, **GRAVITY),
        dict(zip("xy", caught(1.5), strict=True)),
    ),
    "a string between two": (
        scene(
            "(a'^2 + b'^2)/2",
            {"a": (0, 0), "b": (0.5, 1)},
            [{"gap": "1 - b + a", "restitution": 1}],
            2,
        ),
        {"a": 1.5, "b": 1},
    ),
    "a piston that goes": (
        scene(
            "x'^2/2",
            {"x": (0.5, 1)},
            [{"gap": "x", "restitution": 1}, {"gap": "1 + t/5 - x", "restitution": 1}],
            9,
        ),
        {"x": driven_ball(9, 0.2)},
    ),
    "a piston that comes": (
        scene(
            "x'^2/2",
            {"x": (0.5, 1)},
            [{"gap": "x", "restitution": 1}, {"gap": "1 - t/10 - x", "restitution": 1}],
            8,
        ),
        {"x": driven_ball(8, -0.1)},
    ),
    "impact at the start": (
        scene(DROP, {"y": (0, -4)}, [FLOOR | {"restitution": 0.5}], 0.4),
        {"y": 0.16},
    ),
    "a force that touches zero": (
        scene("y'^2/2 - (t - 1)^2*y", {"y": (0, 0)}, [FLOOR], 2.5),
        {"y": 0},
    ),
    "pressed by a force that begins at zero": (
        scene("y'^2/2 - t*(1 - t)*y", {"y": (0, 0)}, [FLOOR], 2),
        {"y": 1 / 4},
    ),
    "lifted by a force that begins at zero": (
        scene("y'^2/2 + t*y", {"y": (0, 0)}, [FLOOR], 2),
        {"y": 8 / 6},
    ),
    "pulled by a force that begins at zero": (
        scene(
            "(x'^2 + y'^2)/2 - y + t*x", {"x": (0, 0), "y": (0, 0)}, [ROUGH | {"friction": 0.5}], 2
        ),
        {"x": 1.5**3 / 6},
    ),
    "no room to move": (
        scene("x'^2/2 - x*(t - 1/2)", {"x": (0, 0)}, [{"gap": "x"}, {"gap": "-x"}], 1),
        {"x": 0},
    ),
    "no room to move in a field that turns again and again": (
        scene("x'^2/2 + 3*x*sin(5*t)", {"x": (0, 0)}, [{"gap": "x"}, {"gap": "-x"}], 5),
        {"x": 0},
    ),
    "lifted again and again": (
        scene("y'^2/2 + (sin(t) - 1/2)*y", {"y": (0, 0)}, [FLOOR], 15),
        {"y": lifted(15)},
    ),
    "a plank on a smooth floor": (
        scene(
            "a'^2 + b'^2 + (x'^2 + y'^2)/2 - g*(2*b + y)",
            {"a": (0, 0), "b": (0, 0), "x": (0, 3), "y": (1, 0)},
            [{"gap": "b"}, {"gap": "y - b - 1", "friction": 0.3, "slides": "x' - a'"}],
            2,
            **GRAVITY,
        ),
        dict(zip("ax", carried(2, 0), strict=True)),
    ),
    "a plank on a rough floor": (
        scene(
            "a'^2 + b'^2 + (x'^2 + y'^2)/2 - g*(2*b + y)",
            {"a": (0, 0), "b": (0, 0), "x": (0, 3), "y": (1, 0)},
            [
                {"gap": "b", "friction": 0.05, "slides": "a'"},
                {"gap": "y - b - 1", "friction": 0.3, "slides": "x' - a'"},
            ],
            4,
            **GRAVITY,
        ),
        dict(zip("ax", carried(4, 0.05), strict=True)),
    ),
    "two that a rod joins slow down": (
        scene(SLED, {"a": (0, 2), "b": (1, 2), "x": (0, 0), "y": (0, 0)}, RUNNERS, 0.5, **JOINED),
        {"a": 1 - G / 48, "b": 2 - G / 48},
    ),
    "two that a rod joins stop": (
        scene(SLED, {"a": (0, 2), "b": (1, 2), "x": (0, 0), "y": (0, 0)}, RUNNERS, 1.5, **JOINED),
        {"a": 12 / G, "b": 1 + 12 / G},
    ),
    "a gear brakes": (
        scene(
            "(x'^2 + y'^2)/2 + p'^2 - g*y",
            {"x": (0, 2), "y": (0, 0), "p": (0, 2)},
            [ROUGH],
            0.5,
            parameters={"g": G},
            system={"parameters": ["g"], "constraints": ["x' - p'"]},
        ),
        {"x": 1 - 0.0125 * G},
    ),
}
QUICK = (
    "pressed by a force that begins at zero",
    "no room to move",
    "lifted again and again",
    "two that a rod joins stop",
)


@pytest.mark.parametrize("name", [name if name in QUICK else slow(name) for name in HARD])
def test_hard_contacts_are_exact(name: str) -> None:
    document, ends = HARD[name]
    found = run(document | {"observe": ["trajectory", "contact_forces"]})
    assert found["outcome"] == "completed"
    if name == "two that a rod joins stop":  # what others hold needs no friction
        columns = found["points"]["columns"]
        assert columns["friction_contact_1"][-1] + columns["friction_contact_2"][-1] == 0
    assert {x: found["final"]["positions"][x] for x in ends} == pytest.approx(ends, abs=1e-8)


def collided(mass: float, until: float) -> tuple[float, float, int]:
    """Places of a unit mass at a wall and of a heavy one that comes, and the number of impacts."""
    x, v, t, count = np.array([1.0, 2.0]), np.array([0.0, -1.0]), 0.0, 0
    while True:
        wall = -x[0] / v[0] if v[0] < 0 else np.inf
        other = (x[1] - x[0]) / (v[0] - v[1]) if v[0] > v[1] else np.inf
        if t + min(wall, other) > until:
            return *(float(one) for one in x + v * (until - t)), count
        x, t, count = x + v * min(wall, other), t + min(wall, other), count + 1
        v = np.array(
            [-v[0], v[1]]
            if wall < other
            else [
                ((1 - mass) * v[0] + 2 * mass * v[1]) / (1 + mass),
                ((mass - 1) * v[1] + 2 * v[0]) / (1 + mass),
            ]
        )


@pytest.mark.parametrize(("mass", "digits"), [slow(100, 31), slow(10_000, 314)])
def test_impacts_at_a_wall_count_the_digits_of_pi(mass: int, digits: int) -> None:
    """G. Galperin, Playing pool with pi, Regular and Chaotic Dynamics 8 (2003) 375."""
    contacts = [{"gap": "a", "restitution": 1}, {"gap": "b - a", "restitution": 1}]
    until = 4 if mass == 100 else 400
    found = run(
        scene(
            f"a'^2/2 + {mass}*b'^2/2",
            {"a": (1, 0), "b": (2, -1)},
            contacts,
            until,
            step=until / 200,
        )
    )
    *ends, count = collided(mass, until)
    assert found["outcome"] == "completed"
    assert sum(one["impacts"] for one in found["contacts"]) == count == digits
    assert [*found["final"]["positions"].values()] == pytest.approx(ends, abs=1e-8)

"""Contacts of rods, links, wires, and moving walls against a program that is written here: SymPy
derives the equations, DOP853 steps them between events, and the contacts that press are those of a
complementarity problem, of which each subset is tried.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tests.service.test_contacts import GRAVITY, POINT, G, Row, Scene, Start, run, scene
from tests.values import slow

Array = Any
TOUCHES, STILL = 1e-9, 1e-10
SLOW = 1e-6  # bounces below this velocity are some 1e-13 high: there is none any more


def parsed(text: str) -> sp.Expr:
    """x' is the symbol x_1."""
    return sp.sympify(re.sub(r"(\w)'", r"\1_1", text).replace("^", "**"))


class Motion:
    """M a = f with gaps g, g' = G v + h, g'' = G a + k, as numbers."""

    def __init__(self, names: list[str], lagrangian: str, gaps: list[str]) -> None:
        t, tree = sp.Symbol("t"), parsed(lagrangian)
        q, v = (sp.Matrix(sp.symbols([f"{x}{end}" for x in names])) for end in ("", "_1"))

        def rate(formula: sp.Expr) -> sp.Expr:
            return sp.diff(formula, t) + (sp.Matrix([formula]).jacobian(q) * v)[0]

        momenta = sp.Matrix([tree]).jacobian(v)
        force = sp.Matrix([tree]).jacobian(q) - sp.Matrix([[rate(p) for p in momenta]])
        g = [parsed(one) for one in gaps]
        rates = [rate(one) for one in g]
        found = (
            momenta.jacobian(v), force.T, sp.Matrix(g), sp.Matrix(g).jacobian(q),
            sp.Matrix(rates), sp.Matrix([rate(one) for one in rates]),
        )  # fmt: skip
        self.count, self.size = len(g), len(names)
        self._numbers = sp.lambdify([t, [*q], [*v]], found, "numpy", cse=True)

    def at(self, t: float, y: Array) -> tuple[Array, ...]:
        mass, force, g, slopes, rates, bends = map(
            np.asarray, self._numbers(t, y[: self.size], y[self.size :])
        )
        return mass, force.ravel(), g.ravel(), slopes, rates.ravel(), bends.ravel()

    def pressed(self, t: float, y: Array, active: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Accelerations, the forces of the active contacts, and all g''."""
        mass, force, _, slopes, _, bends = self.at(t, y)
        rows, n, k = slopes[[*active]], self.size, len(active)
        whole = np.block([[mass, -rows.T], [rows, np.zeros((k, k))]])
        found = np.linalg.solve(whole, np.concatenate([force, -bends[[*active]]]))
        return found[:n], found[n:], slopes @ found[:n] + bends

    def after_impacts(self, t: float, y: Array, restitutions: list[float]) -> Array:
        """The fastest closing contact first, until none closes."""
        y = y.copy()
        for _ in range(1000):
            mass, _, g, slopes, rates, _ = self.at(t, y)
            closing = [k for k in range(self.count) if g[k] < TOUCHES and rates[k] < -STILL]
            if not closing:
                return y
            k = min(closing, key=lambda one: rates[one])
            push = np.linalg.solve(mass, slopes[k])
            e = restitutions[k] if rates[k] < -SLOW else 0.0
            y[self.size :] -= (1 + e) * rates[k] / (slopes[k] @ push) * push
        raise AssertionError("impacts without an end")

    def set_that_presses(self, t: float, y: Array) -> tuple[int, ...]:
        """0 <= lambda, g'' >= 0, and one of them is 0, for the contacts that touch at rest."""
        _, _, g, _, rates, _ = self.at(t, y)
        rest = [k for k in range(self.count) if g[k] < TOUCHES and abs(rates[k]) <= STILL]
        fits = []
        for active in (one for size in range(len(rest) + 1) for one in combinations(rest, size)):
            _, forces, bends = self.pressed(t, y, active)
            others = [k for k in rest if k not in active]
            if (forces > 1e-9).all() and (bends[others] >= -1e-9).all():
                fits.append(active)
        (found,) = fits
        return found


def by_complementarity(document: Scene) -> dict[str, float]:
    """The places at the end of a scene without friction."""
    names = document["system"]["coordinates"]
    contacts = document["contacts"]
    motion = Motion(names, document["system"]["lagrangian"], [one["gap"] for one in contacts])
    restitutions = [one.get("restitution", 0) for one in contacts]
    begin = document["initial"]
    y = np.array([float(begin[part][x]) for part in ("positions", "velocities") for x in names])
    t, end = 0.0, document["time"]
    while t < end:
        y = motion.after_impacts(t, y, restitutions)
        active = motion.set_that_presses(t, y)

        def rates(s: float, z: Array, active: tuple[int, ...] = active) -> Array:
            return np.concatenate([z[motion.size :], motion.pressed(s, z, active)[0]])

        def event(place: int, is_gap: bool, active: tuple[int, ...] = active) -> Callable[..., Any]:
            def value(s: float, z: Array) -> float:
                found = motion.at(s, z)[2] if is_gap else motion.pressed(s, z, active)[1]
                return float(found[place])

            value.terminal, value.direction = True, -1  # type: ignore[attr-defined]
            return value

        events = [event(k, True) for k in range(motion.count) if k not in active]
        events += [event(k, False) for k in range(len(active))]
        found = solve_ivp(
            rates, (t, end), y, "DOP853", rtol=1e-13, atol=1e-14, max_step=0.02, events=events
        )
        t, y = float(found.t[-1]), found.y[:, -1]
    return dict(zip(names, y, strict=False))


def links(count: int) -> tuple[str, list[str], list[str]]:
    """The Lagrangian, x and y of the ends of links of length and mass 1, from the downward line."""
    names, kinetic = "abc"[:count], list[str]()
    xs, ys = (
        [" + ".join(f"{f}({one})" for one in names[: k + 1]) for k in range(count)]
        for f in ("sin", "cos")
    )
    for k in range(count):
        for f in ("cos", "sin"):
            moved = " + ".join(f"{f}({one})*{one}'" for one in names[: k + 1])
            kinetic.append(f"({moved})^2/2")
    height = " + ".join(f"9.81*({y})" for y in ys)
    return " + ".join([*kinetic, height]), xs, [f"-({y})" for y in ys]


ROD = "(x'^2 + y'^2)/2 + u'^2/6 - 9.81*y"  # of length 2 and mass 1; its ends are at y -+ sin(u)
TWO, X2, Y2 = links(2)
THREE, X3, Y3 = links(3)
RING = "(a'^2 + b'^2 + c'^2)/2 + cos(a) + cos(b) + cos(c)"
TURNED = [f"1 {s} (x*cos(t/3) + y*sin(t/3))" for s in "-+"] + [
    f"1 {s} (y*cos(t/3) - x*sin(t/3))" for s in "-+"
]


def still(**places: float) -> Start:
    return {name: (place, 0.0) for name, place in places.items()}


SCENES: dict[str, Scene] = {
    "a rod falls flat on its floor": scene(
        ROD, still(x=0, y=1, u=0.4), [{"gap": f"y {s} sin(u)"} for s in "-+"], 1.5
    ),
    "a rod bounces on both ends": scene(
        ROD, still(x=0, y=1.5, u=0.3),
        [{"gap": "y - sin(u)", "restitution": 0.9}, {"gap": "y + sin(u)", "restitution": 0.7}], 1.4,
    ),
    "a rod that turns meets the floor, a wall and a ceiling": scene(
        ROD, {"x": (0.0, 1.0), "y": (1.6, 0.0), "u": (0.2, 4.0)},
        [
            {"gap": "y - sin(u)", "restitution": 0.5}, {"gap": "y + sin(u)", "restitution": 0.5},
            {"gap": "2 - x - cos(u)", "restitution": 1}, {"gap": "2 - x + cos(u)", "restitution": 1},
            {"gap": "2.7 - y - sin(u)", "restitution": 0.8}, {"gap": "2.7 - y + sin(u)", "restitution": 0.8},
        ], 1.2,
    ),
    "two links fall on a floor": scene(
        TWO, still(a=1.2, b=1.5), [{"gap": f"{y} + 1.3"} for y in Y2], 1.5
    ),
    "two links between walls": scene(
        TWO, still(a=1.0, b=1.4),
        [{"gap": f"1.9 - ({X2[1]})", "restitution": 0.6}, {"gap": f"0.5 + ({X2[0]})", "restitution": 1}], 2.5,
    ),
    "three links hit a wall": scene(
        THREE, still(a=0.9, b=0.9, c=0.9),
        [{"gap": f"{x} + 0.2", "restitution": 0.3} for x in X3], 1.5,
    ),
    "three links on a floor that gives way": scene(
        THREE, still(a=1.0, b=1.3, c=1.5), [{"gap": f"{Y3[2]} + 1.5 + t^2/4"}], 1.5
    ),
    "two beads on a parabola": scene(
        "(1 + 4*a^2)*a'^2/2 + (1 + 4*b^2)*b'^2 - 9.81*(a^2 + 2*b^2)", still(a=-1, b=0.5),
        [{"gap": "b - a", "restitution": 0.9}], 4.0,
    ),
    "a ball between two walls that swing": scene(
        "x'^2/2", {"x": (1.0, 1.3)},
        [{"gap": "x - sin(t)/4", "restitution": 1}, {"gap": "2 + cos(2*t)/4 - x", "restitution": 1}], 12.0,
    ),
    "two hits of walls that swing": scene(
        "x'^2/2", {"x": (1.0, 1.3)},
        [{"gap": "x - sin(t)/4", "restitution": 1}, {"gap": "2 + cos(2*t)/4 - x", "restitution": 1}], 3.0,
    ),
    "a bead on a hoop that turns, and a stop": scene(
        "u'^2/2 + 25*sin(u)^2/2 + 9.81*cos(u)", {"u": (0.1, 0.0)},
        [{"gap": "1 - u", "restitution": 0.8}], 3.0,
    ),
    "a spring that hits both of its ends": scene(
        "(r'^2 + r^2*u'^2)/2 - 40*(r - 1)^2/2 + 9.81*r*cos(u)", {"r": (1.0, 0.0), "u": (1.0, 2.0)},
        [{"gap": "1.3 - r"}, {"gap": "r - 0.95", "restitution": 0.5}], 2.0,
    ),
    "a wedge hits a wall while a block lies on it": scene(
        "a'^2 + (x'^2 + y'^2)/2 - 9.81*y + 3*a", {"a": (0.0, 1.0), "x": (0.0, 1.0), "y": (1.0, 0.0)},
        [{"gap": "0.6 - a", "restitution": 0.5}, {"gap": "y - 1 - (x - a)/2"}], 0.76,
    ),
    "three on a ring": scene(
        RING, {"a": (-1.0, 1.0), "b": (0.0, 0.0), "c": (0.5, 0.0)},
        [
            {"gap": "b - a", "restitution": 1}, {"gap": "c - b", "restitution": 0.7},
            {"gap": "a + 2*pi - c", "restitution": 1},
        ], 8.0,
    ),
    "two blocks on a table that shakes": scene(
        "b'^2 + y'^2/2 - 9.81*(2*b + y)", still(b=0, y=1),
        [{"gap": "b - sin(8*t)/5*t"}, {"gap": "y - b - 1"}], 1.2,
    ),
    "a pendulum on a cart between stops": scene(
        "x'^2 + x'^2/2 + x'*u'*cos(u) + u'^2/2 + 9.81*cos(u)", {"x": (0.0, 0.0), "u": (2.0, 0.0)},
        [{"gap": "0.3 - x", "restitution": 0.5}, {"gap": "x + 0.3", "restitution": 0.5}], 3.0,
    ),
    "a ball in a square that turns": scene(
        "(x'^2 + y'^2)/2", {"x": (0.2, 1.7), "y": (-0.1, 0.6)},
        [{"gap": gap, "restitution": 1} for gap in TURNED], 6.0,
    ),
    "a mass on a rod that a floor lifts": scene(
        "(1 + s^2)*u'^2/2 + s'^2/2 - 9.81*(s + 1)*sin(u)", {"s": (0.5, 0.0), "u": (0.3, 0.0)},
        [{"gap": "u - t/2"}, {"gap": "1 - s"}], 0.6,
    ),
}  # fmt: skip
QUICK = ("two hits of walls that swing",)


@pytest.mark.parametrize("name", [name if name in QUICK else slow(name) for name in SCENES])
def test_curved_motions_are_those_of_a_program_of_its_own(name: str) -> None:
    found = run(SCENES[name])
    assert found["outcome"] == "completed"
    assert found["final"]["positions"] == pytest.approx(by_complementarity(SCENES[name]), abs=1e-8)


def swung(
    document: Scene, places: Callable[[dict[str, float]], tuple[float, ...]]
) -> dict[str, float]:
    """The places on a sphere whose angles are those of a scene."""
    return dict(zip("xyz", places(by_complementarity(document)), strict=False))


PENDULUM = scene(
    "u'^2/2 + 9.81*cos(u)", still(u=np.pi / 2), [{"gap": "1/2 - cos(u)", "restitution": 0.8}], 1.2
)
SPHERE = scene(
    "(u'^2 + sin(u)^2*w'^2)/2 + 9.81*cos(u)", {"u": (1.0, 0.0), "w": (1.2, -1.0)},
    [{"gap": "0.4 - sin(u)*cos(w)", "restitution": 0.7}], 2.0,
)  # fmt: skip
ON_SPHERES: dict[str, tuple[Scene, Scene, Callable[[dict[str, float]], tuple[float, ...]]]] = {
    "a pendulum that a constraint holds hits a floor": (
        scene(
            POINT, still(x=1, y=0), [{"gap": "y + 1/2", "restitution": 0.8}], 1.2,
            parameters={"g": G}, system={"parameters": ["g"], "constraints": ["x*x' + y*y'"]},
        ),
        PENDULUM, lambda at: (np.sin(at["u"]), -np.cos(at["u"])),
    ),
    "a spherical pendulum that a constraint holds hits a wall": (
        scene(
            "(x'^2 + y'^2 + z'^2)/2 - 9.81*z",
            {
                "x": (np.sin(1) * np.cos(1.2), np.sin(1) * np.sin(1.2)),
                "y": (np.sin(1) * np.sin(1.2), -np.sin(1) * np.cos(1.2)), "z": (-np.cos(1), 0.0),
            },
            [{"gap": "0.4 - x", "restitution": 0.7}], 2.0, system={"constraints": ["x*x' + y*y' + z*z'"]},
        ),
        SPHERE,
        lambda at: (
            np.sin(at["u"]) * np.cos(at["w"]), np.sin(at["u"]) * np.sin(at["w"]), -np.cos(at["u"])
        ),
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ON_SPHERES)
def test_contacts_keep_constraints(name: str) -> None:
    document, angles, places = ON_SPHERES[name]
    found = run(document)
    assert found["outcome"] == "completed"
    assert found["final"]["positions"] == pytest.approx(swung(angles, places), abs=1e-8)


def carried(until: float) -> float:
    """A belt with velocity 1 takes a block from 0 to a wall at 1, which gives half back."""
    gain = 0.3 * G
    t = 1 / gain + (1 - 1 / (2 * gain))
    speed = 0.5
    while speed > 1e-12:
        if until < t + 2 * speed / gain:
            return 1 - speed * (until - t) + gain * (until - t) ** 2 / 2
        t, speed = t + 2 * speed / gain, speed / 2
    return 1.0


def shaken(until: float) -> float:
    """A block with friction 1/2 on a table with the velocity 2 cos(5 t), from rest."""
    gain, t, x, v, way = G / 2, 0.0, 0.0, 0.0, 1

    def next_zero(f: Callable[[float], float], begin: float) -> float:
        s = begin + 1e-4
        while f(s) * f(s + 1e-3) > 0:
            s += 1e-3
        return float(brentq(f, s, s + 1e-3, xtol=1e-15))

    while True:

        def slides(s: float, t: float = t, v: float = v, way: int = way) -> float:
            return float(2 * np.cos(5 * s) - v - way * gain * (s - t))

        meets = next_zero(slides, t)
        part = min(meets, until) - t
        x, v = x + v * part + way * gain * part**2 / 2, v + way * gain * part
        if until < meets:
            return x
        t = meets
        if abs(10 * np.sin(5 * t)) < gain:
            slips = next_zero(lambda s: abs(10 * np.sin(5 * s)) - gain, t)
            last = min(slips, until)
            x += 0.4 * (np.sin(5 * last) - np.sin(5 * t))
            if until < slips:
                return float(x)
            t, v, way = slips, 2 * np.cos(5 * slips), -int(np.sign(np.sin(5 * slips)))
        else:
            way = -way


LEFT, RIGHT = (np.array([np.sin(0.6), np.cos(0.6)]), np.array([-np.sin(0.9), np.cos(0.9)]))


def in_a_groove(until: float) -> tuple[Scene, dict[str, float]]:
    """A disk of radius 1, which spins with 6 between two planes with friction 1/4."""
    place = np.linalg.solve([LEFT, RIGHT], [1, 1])
    across = [np.array([-n[1], n[0]]) for n in (LEFT, RIGHT)]
    forces = np.linalg.solve(
        np.array([n + along / 4 for n, along in zip((LEFT, RIGHT), across, strict=True)]).T, [0, G]
    )
    brake = sum(forces) / 4 / 0.5
    t = min(until, 6 / brake)
    contacts = [
        {
            "gap": f"({n[0]})*x + ({n[1]})*y - 1", "friction": 0.25,
            "slides": f"({along[0]})*x' + ({along[1]})*y' - u'",
        }
        for n, along in zip((LEFT, RIGHT), across, strict=True)
    ]  # fmt: skip
    start: Start = {"x": (place[0], 0.0), "y": (place[1], 0.0), "u": (0.0, 6.0)}
    document = scene("(x'^2 + y'^2)/2 + u'^2/4 - g*y", start, contacts, until, **GRAVITY)
    return document, {"x": place[0], "y": place[1], "u": 6 * t - brake * t * t / 2}


DOWNHILL = "(a'^2 + b'^2 + x'^2 + y'^2)/2 + g*sin(1/2)*(a + b) - g*cos(1/2)*(x + y)"
DOWN = {mu: G * (np.sin(0.5) - mu * np.cos(0.5)) / 2 for mu in (0.1, 0.3, 0.5)}
UP = 12 * np.cos(0.5) - G * np.sin(0.5) - 0.2 * (G * np.cos(0.5) + 12 * np.sin(0.5))


def on_an_incline(upper: float, lower: float) -> Scene:
    contacts: list[Scene] = [
        {"gap": "x", "friction": upper, "slides": "a'"}, {"gap": "y", "friction": lower, "slides": "b'"},
        {"gap": "b - a - 1"},
    ]  # fmt: skip
    return scene(DOWNHILL, still(a=0, b=1, x=0, y=0), contacts, 1, **GRAVITY)


def on_a_belt(until: float) -> Scene:
    contacts: list[Scene] = [
        {"gap": "y", "friction": 0.3, "slides": "x' - 1"}, {"gap": "1 - x", "restitution": 0.5}
    ]  # fmt: skip
    return scene(POINT, still(x=0, y=0), contacts, until, **GRAVITY)


RUBBED: dict[str, Row] = {
    "a belt presses a block against a wall": (on_a_belt(2.0), {"x": 1, "y": 0}),
    "a belt takes a block back to a wall": (on_a_belt(1.3), {"x": carried(1.3), "y": 0}),
    "the rough block below holds the smooth one": (
        on_an_incline(0.1, 0.5), {"a": DOWN[0.3], "b": 1 + DOWN[0.3]}
    ),
    "the smooth block below leaves the rough one": (
        on_an_incline(0.5, 0.1), {"a": DOWN[0.5], "b": 1 + DOWN[0.1]}
    ),
    "an incline that is pushed lifts a block": (
        scene(
            POINT, still(x=0, y=0),
            [{
                "gap": "y*cos(1/2) - (x + 6*t^2)*sin(1/2)", "friction": 0.2,
                "slides": "(x' + 12*t)*cos(1/2) + y'*sin(1/2)",
            }],
            1, **GRAVITY,
        ),
        {"x": UP * np.cos(0.5) / 2 - 6, "y": UP * np.sin(0.5) / 2},
    ),
    "a disk spins in a groove": in_a_groove(0.3),
    "a disk stops in a groove": in_a_groove(3.0),
    "a block on a table that is shaken": (
        scene(
            POINT, still(x=0, y=0), [{"gap": "y", "friction": 0.5, "slides": "x' - 2*cos(5*t)"}], 3,
            **GRAVITY,
        ),
        {"x": shaken(3), "y": 0},
    ),
    "a disk that rolls into a wall": (
        scene(
            "x'^2/2 + u'^2/4 + 3*x", still(x=0, u=0), [{"gap": "1 - x", "restitution": 0.5}], 1.6,
            system={"constraints": ["x' - u'"]},
        ),
        {"x": 0.76, "u": 0.76},
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", RUBBED)
def test_friction_and_walls_are_exact(name: str) -> None:
    document, expected = RUBBED[name]
    found = run(document)
    assert found["outcome"] == "completed"
    assert found["final"]["positions"] == pytest.approx(expected, abs=1e-8)

"""Bodies on rough tables that swing, against a solver of one body that is written here: closed
forms between events, and roots for those.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.service.test_contacts import G, Scene, run, scene

UNTIL, SCANNED, SMALL_BOUNCE, NEAR = 2.0, 4000, 1e-10, 1e-4
Floats = Any


@dataclass(frozen=True)
class Rough:
    """A body of mass 1 over a table at height `lift` (1 - cos(pace t)), which is a belt of velocity
    `belt` sin(pace t) + `drift`; `push` acts along it.
    """

    lift: float
    pace: float
    belt: float
    drift: float
    push: float
    friction: float
    restitution: float
    height: float
    speed: float
    fall: float

    def table(self, t: Floats, order: int = 0) -> Floats:
        """Its height, or a derivative of that."""
        turned = self.pace * t + order * np.pi / 2
        found = -self.lift * self.pace**order * np.cos(turned)
        return found + self.lift if order == 0 else found

    def slides(self, t: Floats) -> Floats:
        return self.belt * np.sin(self.pace * t) + self.drift

    def pressed(self, t: Floats) -> Floats:
        return G + self.table(t, 2)

    def margin(self, t: Floats) -> Floats:
        """What friction can hold beyond what sticking asks of it."""
        asked = self.push - self.belt * self.pace * np.cos(self.pace * t)
        return self.friction * self.pressed(t) - np.abs(asked)


def first_root(value: Callable[[Floats], Floats], begin: float, end: float, least: float) -> float:
    """The first time after begin at which a function that is positive there is no longer; end."""
    steps = np.concatenate([np.geomspace(least, NEAR, 60), np.linspace(NEAR, end - begin, SCANNED)])
    steps = steps[steps <= end - begin]
    below = np.flatnonzero(value(steps) <= 0)
    if not len(below):
        return end
    k = int(below[0])
    low = steps[k - 1] if k else 0.0
    return begin + float(brentq(value, low, steps[k], xtol=1e-16, rtol=1e-14))


def moved(one: Rough) -> tuple[float, float]:
    """(x, y) at UNTIL."""
    t, x, v, r, w = 0.0, 0.0, one.speed, one.height, one.fall
    while t < UNTIL:
        if r > 0 or w > SMALL_BOUNCE:
            t, x, v, r, w = flown(one, t, x, v, r, w)
            continue
        r = w = 0.0
        if one.pressed(t) <= 0:  # it leaves: the next positive gap is that of a third power
            w = 2 * SMALL_BOUNCE
            continue
        t, x, v, w = rubbed(one, t, x, v)
    return x, float(one.table(UNTIL)) + r


def flown(one: Rough, t: float, x: float, v: float, r: float, w: float) -> tuple[float, ...]:
    """From a gap r with the rate w to the next impact, and through it."""

    def bent(s: Floats) -> Floats:  # of the table, beyond its tangent
        near = one.table(t, 2) * s**2 / 2 + one.table(t, 3) * s**3 / 6 + one.table(t, 4) * s**4 / 24
        far = one.table(t + s) - one.table(t) - one.table(t, 1) * s
        return np.where(s < NEAR, near, far)

    def gap(s: Floats) -> Floats:
        return r + w * s - G * s**2 / 2 - bent(s)

    end = first_root(gap, t, UNTIL, 1e-3 * max(w, 1e-9) / G)
    s = end - t
    x, v, left = x + v * s + one.push * s**2 / 2, v + one.push * s, float(gap(s))
    w -= G * s + float(one.table(end, 1) - one.table(t, 1))
    if end == UNTIL:
        return end, x, v, left, w
    hit, slip = (1 + one.restitution) * -w, v - one.slides(end)
    v -= np.sign(slip) * min(abs(slip), one.friction * hit)
    return end, x, float(v), 0.0, -one.restitution * w


def rubbed(one: Rough, t: float, x: float, v: float) -> tuple[float, ...]:
    """To the end of sliding, of sticking, or of the contact."""
    leaves = first_root(lambda s: one.pressed(t + s), t, UNTIL, 1e-9)
    slip, begins = v - one.slides(t), False
    if abs(slip) < 1e-12 and one.margin(t) > 1e-9:
        end = min(leaves, first_root(lambda s: one.margin(t + s), t, UNTIL, 1e-9))
        turned = (np.cos(one.pace * t) - np.cos(one.pace * end)) / one.pace
        return end, x + one.belt * turned + one.drift * (end - t), float(one.slides(end)), 0.0
    if abs(slip) < 1e-12:  # it begins to slide, at first by a power of the time
        begins = True
        slip = one.push - one.belt * one.pace * np.cos(one.pace * t)
    side, least = float(np.sign(slip)), NEAR / 2 if begins else 1e-7

    def speed(s: Floats) -> Floats:
        rubs = G * s + one.table(t + s, 1) - one.table(t, 1)
        return v + one.push * s - side * one.friction * rubs

    end = min(leaves, first_root(lambda s: side * (speed(s) - one.slides(t + s)), t, UNTIL, least))
    s = end - t
    rubs = G * s**2 / 2 + one.table(end) - one.table(t) - one.table(t, 1) * s
    x += v * s + one.push * s**2 / 2 - side * one.friction * rubs
    found = float(speed(s))
    return end, x, found if end in (leaves, UNTIL) else float(one.slides(end)), 0.0


def random_bodies(seed: int) -> list[Rough]:
    dice = random.Random(seed)

    def between(low: float, high: float) -> float:
        return round(dice.uniform(low, high), 2)

    return [
        Rough(
            dice.choice([0.0, between(0.01, 0.1), between(0.05, 0.3)]),
            between(1, 6),
            dice.choice([0.0, between(-1, 1)]),
            between(-1, 1),
            between(-4, 4),
            dice.choice([0.1, 0.3, 0.5, 0.9]),
            dice.choice([0, 0.2, 0.5, 0.7]),
            dice.choice([0.0, 0.0, between(0.1, 1)]),
            dice.choice([0.0, between(-2, 2)]),
            0.0,
        )
        for _ in range(dice.choice([1, 1, 2, 3]))
    ]


def scene_of(bodies: list[Rough]) -> Scene:
    parts, start, contacts = list[str](), dict[str, tuple[float, float]](), list[Scene]()
    for k, one in enumerate(bodies):
        parts.append(f"(x{k}'^2 + y{k}'^2)/2 + ({one.push})*x{k} - {G}*y{k}")
        start |= {f"x{k}": (0, one.speed), f"y{k}": (one.height, one.fall)}
        table = f"{one.lift}*(1 - cos({one.pace}*t))"
        belt = f"({one.belt})*sin({one.pace}*t) + ({one.drift})"
        contacts.append({"gap": f"y{k} - {table}", "restitution": one.restitution,
                         "friction": one.friction, "slides": f"x{k}' - ({belt})"})  # fmt: skip
    return scene(" + ".join(parts), start, contacts, UNTIL)


def assert_moved(seed: int) -> str:
    bodies = random_bodies(seed)
    found = run(scene_of(bodies))
    if found["outcome"] == "completed":
        expected = [place for one in bodies for place in moved(one)]
        assert [*found["final"]["positions"].values()] == pytest.approx(expected, abs=1e-8)
    return str(found["outcome"])


@pytest.mark.slow
def test_a_body_on_a_rough_table_that_swings_moves_as_its_closed_forms() -> None:
    assert assert_moved(4) == "completed"


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(80))
def test_random_bodies_on_rough_tables_move_as_their_closed_forms_or_end_by_name(seed: int) -> None:
    assert assert_moved(seed) in ("completed", "no_one_motion")

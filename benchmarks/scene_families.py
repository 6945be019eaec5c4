"""Scenes of any size: a pendulum of n links, n bodies in space, a chain of n nonlinear springs."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable
from typing import Any

Scene = dict[str, Any]
SEED = 11  # of the places of bodies


def pendulum(links: int) -> Scene:
    """Links of length 1 and mass 1 at the end of each, released from rest, all at 0.3 rad."""
    names = [f"q{k}" for k in range(1, links + 1)]
    terms = []
    for end in range(1, links + 1):
        across = " + ".join(f"cos({name})*{name}'" for name in names[:end])
        along = " + ".join(f"sin({name})*{name}'" for name in names[:end])
        heights = " + ".join(f"cos({name})" for name in names[:end])
        terms.append(f"({across})^2/2 + ({along})^2/2 + g*({heights})")
    start = dict.fromkeys(names, 0.3)
    return _scene(f"pendulum of {links} links", names, " + ".join(terms), {"g": 9.81}, start, {})


def bodies(count: int) -> Scene:
    """Masses 1/count that attract each other, G = 1, in a cube of edge 2, with velocities about
    0.3.
    """
    names = [f"{letter}{k}" for k in range(1, count + 1) for letter in "xyz"]
    draw = random.Random(SEED)
    kinetic = " + ".join(f"m*{name}'^2/2" for name in names)
    pairs = (
        "m^2/sqrt(" + " + ".join(f"({letter}{a} - {letter}{b})^2" for letter in "xyz") + ")"
        for a in range(1, count + 1) for b in range(a + 1, count + 1)
    )  # fmt: skip
    start = {name: round(draw.uniform(-1, 1), 3) for name in names}
    rates = {name: round(draw.gauss(0, 0.3), 3) for name in names}
    values = {"m": 1 / count}
    return _scene(
        f"{count} bodies", names, f"{kinetic} + {' + '.join(pairs)}", values, start, rates
    )


def oscillators(count: int) -> Scene:
    """The chain FPUT-alpha with alpha = 1/4 and both ends fixed, in its first mode."""
    names = [f"x{k}" for k in range(1, count + 1)]
    places = ["0", *names, "0"]
    springs = (f"({b} - {a})^2/2 + ({b} - {a})^3/12" for a, b in itertools.pairwise(places))
    potential = " - ".join(spring.replace(" + ", " - ") for spring in springs)
    start = {name: round(math.sin(math.pi * k / (count + 1)), 6) for k, name in enumerate(names, 1)}
    kinetic = " + ".join(f"{name}'^2/2" for name in names)
    return _scene(f"FPUT chain of {count}", names, f"{kinetic} - {potential}", {}, start, {})


def _scene(
    name: str, names: list[str], lagrangian: str, values: dict[str, float], start: dict[str, float],
    rates: dict[str, float],
) -> Scene:  # fmt: skip
    return {
        "system": {"name": name, "coordinates": names, "lagrangian": lagrangian}, "effects": ["kinetic", "potential"],
        "parameters": values, "initial": {"positions": start, "velocities": {key: rates.get(key, 0) for key in names}},
        "step": 0.01, "time": 10, "methods": [{"method": "adaptive"}], "observe": ["trajectory", "energy"],
    }  # fmt: skip


FAMILIES: dict[str, Callable[[int], Scene]] = {
    "pendulum": pendulum,
    "bodies": bodies,
    "FPUT": oscillators,
}

"""Transform a system to other coordinates, q = phi(Q), with L and f, so the verdict is unchanged.

f is transformed by itself, Q'' = J^-1 (f - (d/dt J) Q') with J = d phi / d Q, not derived from the
new L.
"""

from __future__ import annotations

import random

import sympy

from tests.generator.euler_lagrange import shortest
from tests.generator.ingredients import Space, space
from tests.generator.inverse import inverse
from tests.generator.systems import GeneratedSystem, assembled

CHANGES = ("rotation", "polar", "shear", "exponential")


def disguised(system: GeneratedSystem, seed: int) -> GeneratedSystem:
    """The same system in other coordinates; a single coordinate is only stretched or
    exponentiated.
    """
    rng = random.Random(f"disguise/{system.id}/{seed}")
    new = space([name.upper() for name in system.coordinates])
    change = rng.choice(CHANGES if system.n > 1 else CHANGES[2:])
    old = _change(rng, change, new)
    rates = [_rate(expression, new) for expression in old]
    before = (*system.space.coordinates, *system.space.velocities)
    table = dict(zip(before, (*old, *rates), strict=True))
    jacobian = sympy.Matrix(old).jacobian(new.coordinates)
    drift = [_rate(rate, new) for rate in rates]
    forces = sympy.Matrix(
        [f.subs(table, simultaneous=True) for f in system.accelerations]
    ) - sympy.Matrix(drift)
    f = [shortest(a) for a in inverse(jacobian).applyfunc(sympy.trigsimp) * forces]
    lagrangian = system.lagrangian_expression.subs(table, simultaneous=True)
    return assembled(f"{system.id}-{change}-{seed}", system.family, new, f, lagrangian)


def _rate(expression: sympy.Expr, s: Space) -> sympy.Expr:
    """d/dt along the velocities; for a rate this is the part of the acceleration without Q''."""
    pairs = zip(s.coordinates, s.velocities, strict=True)
    return sum((expression.diff(q) * v for q, v in pairs), sympy.Integer(0))


def _change(rng: random.Random, change: str, s: Space) -> list[sympy.Expr]:
    """phi(Q), regular with positive values near the points where systems are verified."""
    old: list[sympy.Expr] = list(s.coordinates)
    first = old[0]
    if change == "exponential":
        old[0] = sympy.exp(first)
    elif s.n == 1:
        old[0] = first + first**2
    elif change == "shear":
        old[0] = first + rng.choice((1, 2)) * old[1] ** 2
    elif change == "polar":
        old[:2] = [first * sympy.cos(old[1]), first * sympy.sin(old[1])]
    else:
        a, b = rng.choice(((3, 4), (5, 12), (8, 15)))
        c = sympy.Integer(round((a * a + b * b) ** 0.5))
        old[:2] = [(a * first + b * old[1]) / c, (a * old[1] - b * first) / c]
    return old

"""The exact right-hand sides of a regular Lagrangian, and their verification with 40 digits.

f solves M f = b with M = L_vv and b = L_q - L_vq v - L_vt.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

import mpmath
import sympy

from tests.generator.ingredients import TIME, Space
from tests.generator.inverse import inverse
from tests.generator.numbers import value

DIGITS = 40


def equations_of(lagrangian: sympy.Expr, s: Space) -> tuple[sympy.Matrix, list[sympy.Expr]]:
    """M (n, n) and b (n) of the Euler-Lagrange equations M q'' = b."""
    momenta = [lagrangian.diff(v) for v in s.velocities]
    mass = sympy.Matrix(s.n, s.n, lambda i, j: momenta[i].diff(s.velocities[j]))
    forces = []
    for p, q in zip(momenta, s.coordinates, strict=True):
        drift = sum(
            (p.diff(a) * v for a, v in zip(s.coordinates, s.velocities, strict=True)), p.diff(TIME)
        )
        forces.append(sympy.expand(lagrangian.diff(q) - drift))
    return mass, forces


def accelerations(lagrangian: sympy.Expr, s: Space) -> list[sympy.Expr]:
    """f with M f = b, exactly. Raises ValueError if M is singular."""
    mass, forces = equations_of(lagrangian, s)
    if mass.is_diagonal():
        return [_quotient(b, mass[i, i]) for i, b in enumerate(forces)]
    return [shortest(_over_one_bar(row, forces)) for row in inverse(mass).tolist()]


def _quotient(numerator: sympy.Expr, denominator: sympy.Expr) -> sympy.Expr:
    if denominator == 0:
        raise ValueError("the Lagrangian is singular")
    if denominator.is_Number:
        return sympy.expand(numerator / denominator)
    above, below = sympy.fraction(sympy.together(denominator))
    return sympy.factor_terms(sympy.expand(numerator * below / sympy.expand(above), deep=False))


def _over_one_bar(row: Sequence[sympy.Expr], forces: Sequence[sympy.Expr]) -> sympy.Expr:
    """Sum of row_j b_j; entries with the same denominator share it, and a constant row is
    multiplied out.
    """
    above: dict[sympy.Expr, sympy.Expr] = {}
    for entry, b in zip(row, forces, strict=True):
        numerator, denominator = sympy.fraction(entry)
        above[denominator] = above.get(denominator, 0) + sympy.expand(numerator * b)
    return sum(
        (numerator / denominator for denominator, numerator in above.items()), sympy.Integer(0)
    )


def shortest(expression: sympy.Expr) -> sympy.Expr:
    """The shortest of several equal forms."""
    numerator, denominator = sympy.fraction(sympy.together(expression))
    quotient = sympy.expand(numerator) / denominator
    forms = (sympy.factor_terms(expression), sympy.expand(expression), sympy.factor_terms(quotient))
    return min(forms, key=lambda form: len(str(form)))


def residual(
    lagrangian: sympy.Expr, f: Sequence[sympy.Expr], s: Space, seed: int
) -> tuple[mpmath.mpf, mpmath.mpf]:
    """(max |M f - b| / (1 + max |b|), |det M|) at a random point with 0 < q, v < 1/2, to 40
    digits.
    """
    rng = random.Random(seed)
    with mpmath.workdps(DIGITS):
        symbols = (*s.coordinates, *s.velocities, TIME)
        point = {a: mpmath.mpf(rng.randint(10**8, 4 * 10**8)) / 10**9 for a in symbols}
        mass, forces = equations_of(lagrangian, s)
        M = mpmath.matrix([[value(mass[i, j], point) for j in range(s.n)] for i in range(s.n)])
        b = [value(force, point) for force in forces]
        a = mpmath.matrix([value(expression, point) for expression in f])
        defect = max(abs(x - y) for x, y in zip(M * a, b, strict=True))
        return defect / (1 + max(map(abs, b))), abs(mpmath.det(M))

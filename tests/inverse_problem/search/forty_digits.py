"""Lagrangians and Hamiltonians tested by numbers with 40 digits, with SymPy's derivatives instead of ours."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import mpmath
import sympy

from benchmarks.sympy_form import to_sympy, velocity
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.solutions import Hamiltonian, Lagrangian
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from tests.catalogue.symbolic import DIGITS, Point, opaque_atoms, value

TIME = sympy.Symbol("t")
POINTS = 2
_DRAWS = 400


@dataclass(frozen=True)
class Motion:
    """q, v and f of a system as SymPy expressions."""

    q: tuple[sympy.Symbol, ...]
    v: tuple[sympy.Symbol, ...]
    f: tuple[sympy.Expr, ...]


def motion_of(system: SecondOrderSystem) -> Motion:
    names = system.coordinates
    return Motion(
        tuple(map(sympy.Symbol, names)), tuple(map(velocity, names)), tuple(map(to_sympy, system.accelerations))
    )


def in_domain(expressions: Sequence[sympy.Expr], positive: Sequence[sympy.Expr], seed: int) -> Iterator[Point]:
    """Random points with 0 < |a| < 1, or between the bounds of a, at which all is real and what must be positive is."""
    rng = random.Random(seed)
    atoms = sorted({*opaque_atoms([*expressions, *positive]), TIME}, key=str)
    between = {atom: sides for atom in atoms if len(sides := _bounds(atom, positive)) == 2}
    for draw in range(_DRAWS):
        signs = (1,) if draw < _DRAWS // 2 else (1, -1)
        point = {a: rng.choice(signs) * mpmath.mpf(rng.randint(10**9, (4 + draw % 6) * 10**9)) / 10**10 for a in atoms}
        for atom, (one, other) in between.items():
            point[atom] = one + (other - one) * mpmath.mpf(rng.randint(1, 10**9)) / (10**9 + 1)
        try:
            numbers = [value(expression, point) for expression in expressions]
            bounds = [value(expression, point) for expression in positive]
        except (ZeroDivisionError, ValueError):
            continue
        if all(not isinstance(x, mpmath.mpc) for x in (*numbers, *bounds)) and all(x > 0 for x in bounds):
            yield point


def _bounds(atom: sympy.Expr, positive: Sequence[sympy.Expr]) -> list[mpmath.mpf]:
    """The innermost bounds of a < atom < b among the conditions, as far as there are some."""
    ends = {True: list[mpmath.mpf](), False: list[mpmath.mpf]()}
    for tree in positive:
        slope = tree.diff(atom)
        if slope.is_Rational and slope and tree.free_symbols == {atom}:
            ends[slope > 0].append(value((slope * atom - tree) / slope, {}))
    return [innermost(found) for innermost, found in ((max, ends[True]), (min, ends[False])) if found]


def defects(
    system: SecondOrderSystem, lagrangian: Lagrangian, instead: sympy.Expr | None = None
) -> list[tuple[mpmath.mpf, mpmath.mpf]]:
    """(largest Euler-Lagrange residual relative to its terms, |det L_vv| relative to its entries) at each point.

    `instead`: another formula to test on the domain of the Lagrangian.
    """
    motion, tree = motion_of(system), to_sympy(lagrangian.expression) if instead is None else instead
    momenta = [tree.diff(v) for v in motion.v]
    hessian = sympy.Matrix(momenta).jacobian(motion.v)
    terms = [_euler_lagrange_terms(tree, p, q, motion) for p, q in zip(momenta, motion.q, strict=True)]
    with mpmath.workdps(DIGITS):
        points = in_domain([tree, *motion.f], [to_sympy(p) for p in lagrangian.positive], 5)
        return [_defect(terms, hessian, point) for point, _ in zip(points, range(POINTS), strict=False)]


def _euler_lagrange_terms(tree: sympy.Expr, p: sympy.Expr, q: sympy.Symbol, motion: Motion) -> list[sympy.Expr]:
    """The terms of Gamma(dL/dv_i) - dL/dq_i."""
    along = [p.diff(a) * b for a, b in zip(motion.q, motion.v, strict=True)]
    forced = [p.diff(a) * b for a, b in zip(motion.v, motion.f, strict=True)]
    return [p.diff(TIME), *along, *forced, -tree.diff(q)]


def _defect(
    terms: Sequence[Sequence[sympy.Expr]], hessian: sympy.Matrix, point: Point
) -> tuple[mpmath.mpf, mpmath.mpf]:
    numbers = [[value(term, point) for term in row] for row in terms]
    residual = max(abs(mpmath.fsum(row)) / (1 + max(map(abs, row))) for row in numbers)
    n = hessian.rows
    entries = mpmath.matrix([[value(hessian[i, j], point) for j in range(n)] for i in range(n)])
    size = max(map(abs, entries))
    return residual, abs(mpmath.det(entries)) / size**n if size else size


def legendre_defects(system: SecondOrderSystem, lagrangian: Lagrangian, hamiltonian: Hamiltonian) -> list[mpmath.mpf]:
    """|H(q, p(q, v)) - (p v - L)| relative to its terms at each point."""
    motion, tree = motion_of(system), to_sympy(lagrangian.expression)
    momenta = [tree.diff(v) for v in motion.v]
    written = to_sympy(hamiltonian.expression)
    symbols = [sympy.Symbol(symbol.name) for symbol in hamiltonian.symbols]
    found = []
    with mpmath.workdps(DIGITS):
        points = in_domain([tree, *motion.f], [to_sympy(p) for p in lagrangian.positive], 6)
        for point, _ in zip(points, range(POINTS), strict=False):
            p = [value(one, point) for one in momenta]
            energy = [a * point.get(b, 0) for a, b in zip(p, motion.v, strict=True)]
            here: Mapping[sympy.Expr, mpmath.mpf] = {**point, **dict(zip(symbols, p, strict=True))}
            parts = [*energy, -value(tree, point), -value(written, dict(here))]
            found.append(abs(mpmath.fsum(parts)) / (1 + max(map(abs, parts))))
    return found


def same_value(left: Expression | sympy.Expr, right: Expression | sympy.Expr) -> bool:
    """Whether two formulas agree with 30 digits at a random point with positive values."""
    pair = [one if isinstance(one, sympy.Expr) else to_sympy(one) for one in (left, right)]
    with mpmath.workdps(DIGITS):
        point = next(in_domain(pair, [], 9))
        a, b = (value(one, point) for one in pair)
        return bool(abs(a - b) < mpmath.mpf(10) ** -30 * (1 + abs(a)))

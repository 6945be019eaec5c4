"""Factors of multipliers that f itself asks for, from linear equations in exponents at random points modulo a prime.

Integrating factors exp(-int c dx) are products of powers of letters and one exponential:
c = sum_j e_j d(log p_j)/dx + sum_k r_k d(m_k)/dx is solved for rational e, r, over the letters p_j and the
antiderivatives m_k of the terms of c.

The factor e^(ct) follows from the divergence of f. (H2) gives Gamma(log det g) = 2 tr N = -div_v f. For g = e^(ct) g_0
with det g_0 a product of letters,
    -div_v f = n c + sum_j e_j Gamma(log p_j),
which is solved for the rational e_j, and for c as a rational multiple of a parameter monomial; the constants come last,
so that they are used only where they are needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import mpmath

from inverse_service import bounds
from inverse_service.decision.deciding import Analysis
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.evaluation import NoRealValue
from inverse_service.expressions.evaluation import evaluate as real_value
from inverse_service.expressions.tree import TIME, Apply, Expression, Sum, Velocity, is_exponential
from inverse_service.field import truncated_series as ps
from inverse_service.field.elementary import to_kernels
from inverse_service.field.point import Expansion, Variable, evaluate
from inverse_service.field.real_point import RealTable
from inverse_service.field.tower import draw_point
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.search.material import Material, antiderivatives, companions, moving_letters
from inverse_service.search.multiplier_ansatz import connection_and_endomorphism, tensors_of
from inverse_service.search.null_vectors import small_solution
from inverse_service.search.sampling import Sampler, letter_table, make_sampler
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    monomial,
    monomial_tree,
    times,
    tree_of,
)


def integrating_factor(material: Material, c: Terms, variable: Variable, seed: int) -> Monomial | None:
    """exp(-int c d variable), or None where it is no such product; logarithms alone are tried first."""
    own = dict.fromkeys(p for key in c for letter, _ in key for p in (letter, *companions(letter)))
    sums = [p for p in material.position_letters if isinstance(p, Sum)]
    letters = [p for p in dict.fromkeys([variable, *own, *sums]) if not is_exponential(p)]
    primitives = list(dict.fromkeys(m for key in c for m in antiderivatives(key, variable)))
    for extra in ([], primitives):
        fits = len(letters) + len(extra) <= bounds.COLUMNS
        solution = _solve(material, c, variable, letters, [monomial_tree(m) for m in extra], seed) if fits else None
        if solution is not None:
            return _assembled(letters, extra, solution)
    return None


def _assembled(letters: Sequence[Expression], primitives: Sequence[Monomial], solution: Sequence[Fraction]) -> Monomial:
    """prod p_j^-e_j exp(-sum r_k m_k)."""
    result = EMPTY
    for letter, e in zip(letters, solution, strict=False):
        if e:
            result = times(result, frozenset([(letter, -e)]))
    for m, r in zip(primitives, solution[len(letters) :], strict=True):
        if r:
            result = times(result, frozenset([(Apply("exp", monomial_tree(m)), -r)]))
    return result


def _solve(
    material: Material,
    c: Terms,
    variable: Variable,
    letters: Sequence[Expression],
    primitives: Sequence[Expression],
    seed: int,
) -> list[Fraction] | None:
    """The simplest rational solution: columns that depend on earlier ones are left out."""
    given = tree_of(c)
    try:
        sampler = make_sampler(material.analysis, [(tree, Fraction(1)) for tree in (*letters, *primitives, given)])
        points = [sampler.points(seed).point(k) for k in range(len(letters) + len(primitives) + 6)]
        rows = [_row(Expansion(point, [variable], 1), letters, primitives, given) for point in points]
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return None
    return small_solution(rows, points[0].prime)


def _row(
    expansion: Expansion, letters: Sequence[Expression], primitives: Sequence[Expression], c: Expression
) -> list[int]:
    """d(log p)/dx for each letter, dm/dx for each antiderivative, and c, at a point."""
    prime = expansion.point.prime
    row = []
    for p in letters:
        series = expansion.expand(to_kernels(p))
        if not ps.value_at_point(series):
            raise SingularPoint("a letter vanishes")
        row.append(_slope(series) * pow(ps.value_at_point(series), -1, prime) % prime)
    row += [_slope(expansion.expand(to_kernels(m))) for m in primitives]
    return [*row, evaluate(to_kernels(c), expansion.point)]


def _slope(series: ps.Series) -> int:
    return ps.value_at_point(ps.derivative(series, 0))


def divergence_factor(material: Material, seed: int) -> Monomial | None:
    """exp(ct) with c not 0, or None where the divergence asks for none or is no such combination."""
    letters: list[Expression] = [
        *material.motion.velocities,
        *material.position_letters,
        *dict.fromkeys([*material.velocity_letters, *moving_letters(material)]),
    ]
    constants = [monomial_tree(key) for key in material.parameter_monomials[: bounds.CANDIDATES]]
    try:
        solution = _constants_of_divergence(material, letters, constants, seed)
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return None
    if solution is None:
        return None
    found = [(k, c / material.motion.size) for k, c in enumerate(solution[len(letters) :]) if c]
    if len(found) != 1:
        return None
    k, c = found[0]
    rate = times(material.parameter_monomials[k], monomial(TIME))
    return frozenset([(Apply("exp", monomial_tree(rate)), c)])


def is_free_of_divergence(analysis: Analysis, seed: int) -> bool:
    """Whether div_v f vanishes at a random point."""
    try:
        point = draw_point(analysis.tower, seed)
        connection, _ = connection_and_endomorphism(Sampler(analysis, analysis.tower, analysis.real_point), point)
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return False
    return sum(row[i] for i, row in enumerate(connection)) % point.prime == 0


def _constants_of_divergence(
    material: Material, letters: list[Expression], constants: list[Expression], seed: int
) -> list[Fraction] | None:
    sampler = make_sampler(material.analysis, [(p, Fraction(1)) for p in (*letters, *constants)])
    width = len(letters) + len(constants)
    table = letter_table(sampler, letters, width + 6, seed)
    rows = []
    places = zip(table.points, table.derivatives.along.tolist(), tensors_of(sampler, table), strict=True)
    for point, along, (connection, _) in places:
        trace = 2 * sum(connection[i][i] for i in range(material.motion.size))
        rows.append([*along, *(evaluate(to_kernels(c), point) for c in constants), trace % table.prime])
    return small_solution(rows, table.prime)


def hidden_damping(analysis: Analysis) -> Fraction | None:
    """c where f = h - c v + F(q), h of degree 2 in v, as seen at multiples of v at the real point; else None."""
    system, table = analysis.system, analysis.real_point
    if table is None or system.depends_on_time:
        return None
    try:
        with mpmath.workdps(bounds.DIGITS):
            pairs = zip(system.coordinates, system.accelerations, strict=True)
            found = {_rate_of(f, Velocity(name), table) for name, f in pairs}
    except (NoRealValue, KeyError):
        return None
    return (found.pop() or None) if len(found) == 1 else None


def _rate_of(f: Expression, v: Velocity, table: RealTable) -> Fraction | None:
    """c where f at once, twice, three and four times all velocities fits a square, -c v and a constant."""
    first, second, third = (b - a for a, b in pairwise([real_value(f, _quicker(table, k)) for k in range(1, 5)]))
    rate = (3 * (second - first) / 2 - first) / table[v]
    near = Fraction(mpmath.nstr(rate, bounds.AGREEING)).limit_denominator(bounds.RATIO)
    defects = (third - 2 * second + first, rate - mpmath.mpf(near.numerator) / near.denominator)
    return near if max(map(abs, defects)) < mpmath.mpf(10) ** -bounds.AGREEING * (1 + abs(third)) else None


def _quicker(table: RealTable, times: int) -> RealTable:
    """The point with all velocities so many times as large."""
    return {leaf: value * times if isinstance(leaf, Velocity) else value for leaf, value in table.items()}

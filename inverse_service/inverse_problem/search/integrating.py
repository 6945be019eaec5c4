"""Integrating factors exp(-int c dx) as products of powers of letters and one exponential.

c = sum_j e_j d(log p_j)/dx + sum_k r_k d(m_k)/dx is solved for rational e, r at random points modulo a
prime, over the letters p_j and the antiderivatives m_k of the terms of c.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from flint import nmod_mat

from inverse_service.algebra import series as ps
from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import Expansion, Variable, evaluate
from inverse_service.algebra.primes import reconstruct
from inverse_service.algebra.series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Apply, Expression, Sum
from inverse_service.inverse_problem.search.material import Material, antiderivatives, companions
from inverse_service.inverse_problem.search.sampling import make_sampler
from inverse_service.inverse_problem.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    monomial_tree,
    times,
    tree_of,
)

_MOST_COLUMNS = 40
_BOUND = 1_000


def integrating_factor(material: Material, c: Terms, variable: Variable, seed: int) -> Monomial | None:
    """exp(-int c d variable), or None where it is no such product; logarithms alone are tried first."""
    own = dict.fromkeys(p for key in c for letter, _ in key for p in (letter, *companions(letter)))
    sums = [p for p in material.position_letters if isinstance(p, Sum)]
    letters = [p for p in dict.fromkeys([variable, *own, *sums]) if not _is_exponential(p)]
    primitives = list(dict.fromkeys(m for key in c for m in antiderivatives(key, variable)))
    for extra in ([], primitives):
        fits = len(letters) + len(extra) <= _MOST_COLUMNS
        solution = _solve(material, c, variable, letters, [monomial_tree(m) for m in extra], seed) if fits else None
        if solution is not None:
            return _assembled(letters, extra, solution)
    return None


def _is_exponential(letter: Expression) -> bool:
    return isinstance(letter, Apply) and letter.function == "exp"


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
    return _solution(rows, points[0].prime)


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


def _solution(rows: Sequence[Sequence[int]], prime: int) -> list[Fraction] | None:
    width = len(rows[0]) - 1
    reduced, rank = nmod_mat(len(rows), width + 1, [x % prime for row in rows for x in row], prime).rref()
    solution = [Fraction(0)] * width
    for i in range(rank):
        pivot = next(k for k in range(width + 1) if int(reduced[i, k]))
        if pivot == width:
            return None
        value = reconstruct(int(reduced[i, width]), prime, _BOUND)
        if value is None:
            return None
        solution[pivot] = value
    return solution

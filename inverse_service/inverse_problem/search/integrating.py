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
from inverse_service.algebra.point import Expansion, evaluate
from inverse_service.algebra.primes import reconstruct
from inverse_service.algebra.series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Apply, Expression, Sum
from inverse_service.inverse_problem.search.material import Material, antiderivatives, companions
from inverse_service.inverse_problem.search.sampling import make_sampler, sample_points
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


def integrating_factor(material: Material, c: Terms, variable: Expression, seed: int) -> Monomial | None:
    """exp(-int c d variable), or None where it is no such product; logarithms alone are tried first."""
    own = dict.fromkeys(p for key in c for letter, _ in key for p in (letter, *companions(letter)))
    sums = [p for p in material.position_letters if isinstance(p, Sum)]
    letters = [p for p in dict.fromkeys([variable, *own, *sums]) if not _is_exponential(p)]
    logarithms: list[Expression] = [Apply("log", p) for p in letters]
    primitives = list(dict.fromkeys(m for key in c for m in antiderivatives(key, variable)))
    for extra in ([], primitives):
        columns = logarithms + [monomial_tree(m) for m in extra]
        solution = _solve(material, c, variable, columns, seed) if len(columns) <= _MOST_COLUMNS else None
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
    material: Material, c: Terms, variable: Expression, columns: list[Expression], seed: int
) -> list[Fraction] | None:
    """The simplest rational solution: columns that depend on earlier ones are left out."""
    try:
        sampler = make_sampler(material.analysis, [(tree, Fraction(1)) for tree in (*columns, tree_of(c))])
        points = sample_points(sampler, len(columns) + 6, seed)
        rows = []
        for point in points:
            expansion = Expansion(point, [variable], 1)  # type: ignore[list-item]
            slopes = [ps.value_at_point(ps.derivative(expansion.expand(to_kernels(u)), 0)) for u in columns]
            rows.append([*slopes, evaluate(to_kernels(tree_of(c)), point)])
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return None
    prime, width = points[0].prime, len(columns)
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

"""Potentials and linear terms read off the residuals of a combination that has a multiplier as Hessian.

Its Euler-Lagrange expressions along f are those of some A_i(q) v_i - V(q), so they are linear in the
velocities once everything is brought to one denominator: terms T(q) and T(q) v_j, answered by B(q)
and B(q) v_k with dB/dq_j = T. Closures term by term cannot see this where polynomials in the velocities
are letters, as their relations to the velocities are used only here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.inverse_problem.search.deadline import check, end
from inverse_service.inverse_problem.search.material import Material, antiderivatives, distinct, oriented
from inverse_service.inverse_problem.search.motion import split_velocities
from inverse_service.inverse_problem.search.terms import Monomial, TooManyTerms, monomial, terms_of, times, tree_of
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual

_TERMS, _WORK = 4_000, 150_000
_MOST = 200


def answers(material: Material, combination: Mapping[Monomial, Fraction]) -> list[Monomial]:
    """B and B v_k for the residuals of a combination; none where they are too large to be written out."""
    system = material.analysis.system
    try:
        trees = euler_lagrange_residual(tree_of(combination), system.coordinates, system.accelerations)
        point = material.analysis.real_point
        residuals = [oriented(terms_of(tree), point) for tree in _settled(material, trees)]
    except (TooLarge, TooManyTerms, ZeroDivisionError, KeyError):
        return []
    return _primitives(material, (key for terms in residuals for key in terms))[:_MOST]


def _settled(material: Material, trees: Iterable[Expression]) -> list[Expression]:
    """The trees over their common denominators."""
    check()
    given = list(trees)
    symbols: list[Symbol | Velocity] = [TIME, *material.motion.coordinates, *material.motion.velocities]
    ring = exact_ring(given, symbols, 0, Budget(_TERMS, end(), _WORK), slopes=False)
    return [quotient_tree(ring, ring.value(tree)) for tree in given]


def _primitives(material: Material, keys: Iterable[Monomial]) -> list[Monomial]:
    """B and B v_k for each term T and T v_j."""
    motion = material.motion
    found: dict[Monomial, None] = {}
    for key in keys:
        position, moving = split_velocities(key)
        if moving and moving not in map(monomial, motion.velocities):
            continue
        for q in motion.coordinates:
            raised = antiderivatives(position, q)
            found.update(dict.fromkeys(raised))
            found.update(dict.fromkeys(times(m, monomial(v)) for m in raised for v in motion.velocities))
    return distinct(list(found))

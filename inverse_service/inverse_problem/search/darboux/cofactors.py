"""Cofactors that Darboux polynomials of first degree in the velocities can have.

For P = a_i(q) v_i with Gamma(P) = K P and K = K_0(q) + k_j(q) v_j the terms of first degree in v say
that a is a left eigenvector of B_ij, the coefficient of v_j in f_i, with eigenvalue K_0. Replacing P
by phi(q) P adds d(log phi)/dt to K, so k matters only up to exact forms: besides 0 the quotients f_i/v_i
are tried, as a whole and term by term, as they are the cofactors of the velocities themselves; and +-v_i.
"""

from __future__ import annotations

from fractions import Fraction

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_trees import quotient_tree
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.expressions.tree import Expression, Sum, Velocity
from inverse_service.inverse_problem.search.deadline import end
from inverse_service.inverse_problem.search.linear_systems.factors import factors_of
from inverse_service.inverse_problem.search.linear_systems.reading import EIGENVALUE
from inverse_service.inverse_problem.search.material import Material, coefficient
from inverse_service.inverse_problem.search.motion import MotionTerms, split_velocities
from inverse_service.inverse_problem.search.terms import (
    Monomial,
    Terms,
    TooManyTerms,
    add_terms,
    derivative_of_terms,
    letter_derivative,
    monomial,
    multiply_terms,
    terms_of,
    times,
    tree_of,
)

_MOST = 30
_MOST_OF_ONE_DEGREE = 12
_MOST_SUMS = 2
_TERMS, _WORK = 400, 75_000


def cofactors(material: Material) -> list[Terms]:
    """Candidates for K as sums, 0 among them, the simple ones first; each once."""
    motion = material.motion
    constant = [{}, *_eigenvalues(motion)]
    signed: list[Terms] = [{monomial(v): Fraction(sign)} for v in motion.velocities for sign in (1, -1)]
    linear = [{}, *_quotients(motion)[:_MOST_OF_ONE_DEGREE], *signed]
    found = [add_terms(root, rate) for root in constant[:_MOST_OF_ONE_DEGREE] for rate in linear]
    distinct = {frozenset(terms.items()): terms for terms in found}
    return sorted(distinct.values(), key=len)[:_MOST]


def divergences(material: Material) -> list[Terms]:
    """div_v f, and div_v f + 2 Gamma(log w) for sums w in f, such as the determinant of a change of coordinates.

    In coordinates X_i with X_i'' = K_i X_i' the divergence is the sum of the K_i, up to exact forms; in others
    twice the rate of log det(dX/dq) is subtracted. Empty where f is no polynomial in the velocities.
    """
    motion = material.motion
    total: Terms = {}
    for v, f in zip(motion.velocities, motion.forces, strict=True):
        total = add_terms(total, derivative_of_terms(f, v))
    if not all(_is_velocity(moving) or not moving for _, moving in map(split_velocities, total)):
        return []
    sums = [letter for letter in material.position_letters if isinstance(letter, Sum)][:_MOST_SUMS]
    return [terms for terms in (total, *(add_terms(total, _rate(motion, w), 2) for w in sums)) if terms]


def _rate(motion: MotionTerms, letter: Expression) -> Terms:
    """Gamma(log w)."""
    found: Terms = {}
    for q, v in zip(motion.coordinates, motion.velocities, strict=True):
        shape = times(monomial(v), monomial(letter), -1)
        found = add_terms(found, multiply_terms(letter_derivative(letter, q), {shape: Fraction(1)}))
    return found


def _eigenvalues(motion: MotionTerms) -> list[Terms]:
    """The eigenvalues of B that are rational in the atoms of f, up to a bound on the size of formulas."""
    names = motion.coordinates
    entries = [[tree_of(coefficient(f, monomial(w))) for w in motion.velocities] for f in motion.forces]
    try:
        trees = [tree for row in entries for tree in row]
        ring = exact_ring(trees, names, 0, Budget(_TERMS, end(), _WORK), further=(EIGENVALUE,))
        matrix = tuple(tuple(ring.value(tree) for tree in row) for row in entries)
        if all(entry.is_zero for row in matrix for entry in row):
            return []
        linear = [factor for factor, _ in factors_of(ring, matrix) if len(factor) == 2]
        roots = [-(low / high) for low, high in linear]
        return [terms_of(quotient_tree(ring, root)) for root in roots]
    except (TooLarge, TooManyTerms, ZeroDivisionError, KeyError):
        return []


def _quotients(motion: MotionTerms) -> list[Terms]:
    """The terms of first degree in f_i/v_i, together and alone."""
    whole: list[Terms] = []
    for v, f in zip(motion.velocities, motion.forces, strict=True):
        divided = {times(key, monomial(v), -1): value for key, value in f.items() if dict(key).get(v, 0) >= 1}
        whole.append({key: value for key, value in divided.items() if _is_velocity(split_velocities(key)[1])})
    alone = [{key: value} for terms in whole for key, value in terms.items()]
    return [terms for terms in [*whole, *alone] if terms]


def _is_velocity(moving: Monomial) -> bool:
    return len(moving) == 1 and all(isinstance(letter, Velocity) and e == 1 for letter, e in moving)

"""The part of L without velocity: for d2K/dv2 = g a last multiplier, E(K) depends on t and x only.

E(K) = f K_vv + v K_vx + K_vt - K_x has dE/dv = Gamma(g) + g df/dv = 0, so it may be taken at any v, and
L = K + U with dU/dx = E(K) fulfils the Euler-Lagrange equation.
"""

from __future__ import annotations

from fractions import Fraction

import mpmath

from inverse_service.algebra.real_point import RealTable
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
    number,
    substitute,
)
from inverse_service.inverse_problem.search.completion import solution
from inverse_service.inverse_problem.search.material import antiderivatives
from inverse_service.inverse_problem.search.one_coordinate.algebra import factored
from inverse_service.inverse_problem.search.one_coordinate.kinetic import Place
from inverse_service.inverse_problem.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    TooManyTerms,
    derivative,
    rank,
    terms_of,
    tree_of,
)

_SPEEDS = (Fraction(0), Fraction(1), Fraction(2), Fraction(1, 2), Fraction(-1))
_MOST_TERMS = 40
_LONGEST_INTEGRAND = 20
_DIGITS = 40
_TINY, _STEP = mpmath.mpf(10) ** -20, mpmath.mpf(129) / 128
_DEPTH = 4


def euler_lagrange(kinetic: Expression, force: Expression, x: Symbol, v: Velocity) -> Expression:
    """f K_vv + v K_vx + K_vt - K_x."""
    momentum = differentiate(kinetic, v)
    return add(
        multiply(force, differentiate(momentum, v)),
        multiply(v, differentiate(momentum, x)),
        differentiate(momentum, TIME),
        negate(differentiate(kinetic, x)),
    )


def potential(kinetic: Expression, force: Expression, place: Place) -> Expression | None:
    """U(t, x) with dU/dx = E(K), so that K + U is a Lagrangian; None where it is not found."""
    residual = euler_lagrange(kinetic, force, place.x, place.v)
    if not _is_free_of_velocity(residual, place):
        return None
    for speed in _SPEEDS:
        if not _is_defined(residual, {**place.point, place.v: mpmath.mpf(speed.numerator) / speed.denominator}):
            continue
        try:
            fixed = factored(substitute(residual, {place.v: number(speed)}), [place.x])
            found = antiderivative(terms_of(fixed), place.x)
        except TooManyTerms:
            continue
        if found is not None:
            return found
    return None


def _is_free_of_velocity(residual: Expression, place: Place) -> bool:
    """Seen in its values at the real point and close to it: what d2K/dv2 is no multiplier is left early."""
    with mpmath.workdps(_DIGITS):
        first = evaluate(residual, place.point)
        moved = {**place.point, place.v: place.point[place.v] * _STEP}
        second = evaluate(residual, moved)
        return bool(abs(first - second) < _TINY * (1 + abs(first)))


def _is_defined(tree: Expression, point: RealTable) -> bool:
    """Asked before a velocity is put in, since 0 times an infinite factor would fold to 0."""
    try:
        evaluate(tree, point)
    except NoRealValue:
        return False
    return True


def antiderivative(integrand: Terms, x: Symbol) -> Expression | None:
    """int integrand dx as a rational combination of monomials in letters, or None."""
    if not integrand:
        return ZERO
    if len(integrand) > _LONGEST_INTEGRAND:
        return None
    columns = _columns(integrand, x)
    found = solution(list(columns.values()), integrand)
    return None if found is None else tree_of({m: a for m, a in zip(columns, found, strict=True) if a})


def _columns(integrand: Terms, x: Symbol) -> dict[Monomial, Terms]:
    """Monomials with their derivatives, closed under the antiderivatives of what is left over."""
    found: dict[Monomial, Terms] = {}
    fresh = list(integrand)
    for _ in range(_DEPTH):
        wanted = dict.fromkeys(m for key in fresh for m in antiderivatives(key, x) if m not in found)
        fresh = []
        for m in sorted(wanted, key=rank)[: _MOST_TERMS - len(found)]:
            found[m] = derivative(m, x)
            fresh += list(found[m])
    found.pop(EMPTY, None)
    return found

"""L for one coordinate from its multiplier g: K with d2K/dv2 = g, and the part U without velocity.

K for g = P_1^e_1 P_2^e_2, P_j linear or quadratic in v. For Q = a v^2 + b v + c put u = dQ/dv, D = 4ac - b^2, so that
u^2 + D = 4aQ. With J_e = int int Q^e,
    J_e = (2a (e+2)(2e+3) J_(e+1) - Q^(e+2)) / ((e+1)(e+2) D)   for e < -1, e != -2,
    J_e = (Q^(e+1) + e (e+1) D J_(e-1)) / (2a (e+1)(2e+1))       for e > -1/2,
which follow from (Q^m)''; J_(-1), J_(-2) and J_(-1/2) hold arctangents or logarithms.

E(K) = f K_vv + v K_vx + K_vt - K_x has dE/dv = Gamma(g) + g df/dv = 0, so it may be taken at any v, and
L = K + U with dU/dx = E(K) satisfies the Euler-Lagrange equation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import mpmath

from inverse_service import bounds
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import (
    HALF,
    TIME,
    ZERO,
    Apply,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    negated,
    number,
    square_root,
    substitute,
)
from inverse_service.field.real_point import RealTable, real_sign
from inverse_service.search.completion import completed
from inverse_service.search.motion_terms import split_velocities
from inverse_service.search.one_coordinate.algebra import (
    expanded,
    extracted_root,
    factored,
    shortest,
)
from inverse_service.search.terms import (
    Terms,
    TooManyTerms,
    split_content,
    terms_of,
    tree_of,
)

Factor = tuple[Expression, Fraction]


class NotElementary(ArithmeticError):
    """The double integral has no form known here."""


@dataclass(frozen=True, slots=True)
class Place:
    """The names of coordinate and velocity, and the real point that says on which branch roots are."""

    x: Symbol
    v: Velocity
    point: RealTable


@dataclass(frozen=True, slots=True)
class _Quadratic:
    """Q with u = dQ/dv, its leading coefficient a, and D = 4ac - b^2 in factors."""

    q: Expression
    u: Expression
    a: Expression
    d: Expression


def coefficients(base: Expression, velocity: Velocity) -> list[Expression]:
    """[c_0, c_1, …] of a polynomial in v; NotElementary for other functions of v."""
    table: dict[int, Terms] = {}
    for key, value in terms_of(base).items():
        position, moving = split_velocities(key)
        if any(p != velocity or e.denominator != 1 or e < 0 for p, e in moving):
            raise NotElementary
        table.setdefault(int(dict(moving).get(velocity, 0)), {})[position] = value
    return [tree_of(table.get(k, {})) for k in range(max(table, default=0) + 1)]


def double_integral(weight: Expression, factors: Sequence[Factor], place: Place) -> Expression:
    """K with d2K/dv2 = weight times the factors, which are positive at the real point; else NotElementary.

    The weight is a function of t and x.
    """
    parts = [coefficients(base, place.v) for base, _ in factors]
    degrees = [len(part) - 1 for part in parts]
    if not factors:
        return HALF * weight * place.v**2
    if degrees == [1]:
        ((base, e),) = factors
        scale = factored(weight / parts[0][1] ** 2, [place.x])
        return scale * _linear(base, e, place.point)
    if degrees == [2]:
        ((base, e),) = factors
        form = _quadratic(base, parts[0], place)
        if e == -1:
            return factored(weight / form.a, [place.x]) * _with_arctangent(form, place)
        return weight * _recursion(form, e, place)
    if set(degrees) == {1} and all(e == -1 for _, e in factors):
        return weight * _partial_fractions([base for base, _ in factors], parts, place)
    if degrees == [1, 1]:
        return weight * _of_two(factors, parts, place)
    raise NotElementary


def _partial_fractions(bases: Sequence[Expression], parts: Sequence[Sequence[Expression]], place: Place) -> Expression:
    """int int 1/(P_1 … P_m), the sum of u log u / (a^2 c) over u = P_j = a v + b, c the others at u = 0."""
    terms = []
    for j, (b, a) in enumerate(parts):
        root = -(b / a)
        others = [part[1] * root + part[0] for k, part in enumerate(parts) if k != j]
        weight = factored(multiply(a**2, *others) ** -1, [place.x])
        terms.append(weight * _linear(bases[j], Fraction(-1), place.point))
    return add(*terms)


def _linear(u: Expression, e: Fraction, point: RealTable) -> Expression:
    """int int u^e du du."""
    if e == -1:
        return u * _logarithm(u, point)
    if e == -2:
        return -_logarithm(u, point)
    return 1 / ((e + 1) * (e + 2)) * u ** (e + 2)


def _logarithm(u: Expression, point: RealTable) -> Expression:
    """log |u| on the side of the real point, numeric factors dropped: they add terms linear in v."""
    terms = terms_of(u if real_sign(u, point) > 0 else negated(u))
    content = abs(split_content(terms)[0])
    return Apply("log", tree_of({key: value / content for key, value in terms.items()}))


def _of_two(factors: Sequence[Factor], parts: Sequence[Sequence[Expression]], place: Place) -> Expression:
    """(e_1 + 2)(e_2 + 2) W^2 K = -P_1^(e_1 + 2) P_2^(e_2 + 2) for linear factors with e_1 + e_2 = -3.

    W = a_1 b_2 - a_2 b_1 for P_j = a_j v + b_j.
    """
    (first, e), (second, h) = factors
    (b1, a1), (b2, a2) = parts
    if e + h != -3 or -2 in (e, h):
        raise NotElementary
    difference = factored(a1 * b2 - a2 * b1, [place.x])
    product = first ** (e + 2) * second ** (h + 2) * difference**-2
    return -1 / ((e + 2) * (h + 2)) * product


def _quadratic(q: Expression, parts: Sequence[Expression], place: Place) -> _Quadratic:
    c, b, a = parts
    d = factored(4 * a * c - b**2, [place.x])
    if d == ZERO:
        # A square: the linear factor stands for it.
        raise NotElementary
    return _Quadratic(q, expanded(differentiate(q, place.v)), a, d)


def _recursion(form: _Quadratic, e: Fraction, place: Place) -> Expression:
    """J_e."""
    if e == -1:
        return _with_arctangent(form, place) / form.a
    if e == -2:
        return _of_inverse_square(form, place)
    if e == Fraction(-1, 2):
        return _with_root(form, place)
    if abs(e) > bounds.POWER or e.denominator > 2:
        raise NotElementary
    if e < -1:
        weight = 2 * (e + 2) * (2 * e + 3)
        above = weight * form.a * _recursion(form, e + 1, place) if weight else ZERO
        return (above - form.q ** (e + 2)) / ((e + 1) * (e + 2) * form.d)
    weight = e * (e + 1)
    below = weight * form.d * _recursion(form, e - 1, place) if weight else ZERO
    return (form.q ** (e + 1) + below) / (2 * (e + 1) * (2 * e + 1) * form.a)


def _with_arctangent(form: _Quadratic, place: Place) -> Expression:
    """a J_(-1) = y atan y - log(Q)/2 with y = u/D^1/2; logarithms where D < 0."""
    if real_sign(form.d, place.point) < 0:
        return _with_logarithms(form, place)
    y = shortest(form.u / extracted_root(form.d), [place.x, place.v])
    return y * Apply("atan", y) - HALF * _logarithm(form.q, place.point)


def _with_logarithms(form: _Quadratic, place: Place) -> Expression:
    """a J_(-1) = ((u - R) log(u - R) - (u + R) log(u + R))/(2R) with R^2 = -D."""
    root = extracted_root(-form.d)
    low, high = expanded(form.u - root), expanded(form.u + root)
    first, second = _logarithm(low, place.point), _logarithm(high, place.point)
    difference = low * first - high * second
    return difference / (2 * root)


def _of_inverse_square(form: _Quadratic, place: Place) -> Expression:
    """J_(-2) = 2u atan(u/D^1/2)/D^3/2, for R^2 = -D > 0 it is u log((u - R)/(u + R))/(D R)."""
    if real_sign(form.d, place.point) > 0:
        root = extracted_root(form.d)
        y = shortest(form.u / root, [place.x, place.v])
        return 2 * y * Apply("atan", y) / form.d
    root = extracted_root(-form.d)
    low, high = expanded(form.u - root), expanded(form.u + root)
    difference = _logarithm(low, place.point) - _logarithm(high, place.point)
    return form.u * difference / (form.d * root)


def _with_root(form: _Quadratic, place: Place) -> Expression:
    """int int Q^(-1/2): a logarithm for a > 0, an arcsine for a < 0."""
    a, u, q = form.a, form.u, form.q
    last = square_root(q) / a
    if real_sign(a, place.point) > 0:
        root = extracted_root(factored(a, [place.x]))
        log = _logarithm(u + 2 * root * square_root(q), place.point)
        return u * log / (2 * a * root) - last
    root = extracted_root(factored(negated(a), [place.x]))
    arc = Apply("asin", u / extracted_root(-form.d))
    return -(u * arc / (2 * a * root)) - last


_SPEEDS = (Fraction(0), Fraction(1), Fraction(2), Fraction(1, 2), Fraction(-1))
_TINY, _STEP = mpmath.mpf(10) ** -20, mpmath.mpf(129) / 128


def euler_lagrange(kinetic: Expression, force: Expression, x: Symbol, v: Velocity) -> Expression:
    """f K_vv + v K_vx + K_vt - K_x."""
    momentum = differentiate(kinetic, v)
    return (
        force * differentiate(momentum, v)
        + v * differentiate(momentum, x)
        + differentiate(momentum, TIME)
        - differentiate(kinetic, x)
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
            found = completed([place.x.name], [terms_of(-fixed)])
        except TooManyTerms:
            continue
        if found is not None:
            return found
    return None


def _is_free_of_velocity(residual: Expression, place: Place) -> bool:
    """Seen in its values at the real point and close to it: what d2K/dv2 is no multiplier is left early."""
    with mpmath.workdps(bounds.DIGITS):
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

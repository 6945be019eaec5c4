"""The equations of motion as terms, and the Euler-Lagrange expressions of monomials along them."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from math import lcm

from inverse_service.expressions.tree import TIME, Apply, Expression, Number, Power, Symbol, Velocity, holds, walk
from inverse_service.field.rational_functions import factored
from inverse_service.search.terms import (
    Monomial,
    Terms,
    add_terms,
    derivative_of_terms,
    letter_derivative,
    monomial,
    multiply_terms,
    polynomial_of,
    split_content,
    terms_of,
    terms_of_polynomial,
    times,
)


@dataclass(frozen=True, slots=True)
class MotionTerms:
    """q'' = f with f expanded; `with_time` says whether L may contain t.

    `known` keeps what the residuals of monomials are made of, and these: families share many monomials.
    """

    coordinates: tuple[Symbol, ...]
    velocities: tuple[Velocity, ...]
    forces: tuple[Terms, ...]
    with_time: bool
    known: dict[Hashable, Terms] = field(default_factory=dict, compare=False, repr=False)

    @property
    def size(self) -> int:
        return len(self.coordinates)


def euler_lagrange(motion: MotionTerms, candidate: Monomial) -> tuple[Terms, ...]:
    """sum_j f^j m_{v_i v_j} + v^j m_{v_i q_j} + m_{v_i t} - m_{q_i} for each i.

    For m = prod p^e this is m times sum_p e_p (Gamma(V_i p) - Q_i p) + sum_pr e_p e_r G(p) V_i r, with the logarithmic
    derivatives V_i p = p_{v_i}/p, Q_i p = p_{q_i}/p and G(p) = Gamma(p)/p.
    """
    return tuple(_residual(motion, candidate, i) for i in range(motion.size))


def _residual(motion: MotionTerms, candidate: Monomial, i: int) -> Terms:
    key = candidate, i
    if key not in motion.known:
        total: Terms = {}
        moving = [(r, e) for r, e in candidate if _slope(motion, r, motion.velocities[i])]
        for p, e in candidate:
            _add(total, _own_part(motion, p, i), e)
            for r, factor in moving:
                _add(total, _common_part(motion, p, r, i), e * factor)
        motion.known[key] = {times(part, candidate): value for part, value in total.items() if value}
    return motion.known[key]


def _add(total: Terms, terms: Terms, factor: Fraction) -> None:
    for key, value in terms.items():
        more = value if factor == 1 else factor * value
        total[key] = total[key] + more if key in total else more


def _own_part(motion: MotionTerms, p: Expression, i: int) -> Terms:
    """Gamma(V_i p) - Q_i p."""
    key = "own part", p, i
    if key not in motion.known:
        rate = along(motion, _slope(motion, p, motion.velocities[i]))
        motion.known[key] = add_terms(rate, _slope(motion, p, motion.coordinates[i]), -1)
    return motion.known[key]


def _common_part(motion: MotionTerms, p: Expression, r: Expression, i: int) -> Terms:
    """G(p) V_i r."""
    key = "common part", p, r, i
    if key not in motion.known:
        rate = _divided(along(motion, {monomial(p): Fraction(1)}), p)
        motion.known[key] = multiply_terms(rate, _slope(motion, r, motion.velocities[i]))
    return motion.known[key]


def _slope(motion: MotionTerms, p: Expression, variable: Symbol | Velocity) -> Terms:
    """The derivative of log p."""
    key = "slope", p, variable
    if key not in motion.known:
        motion.known[key] = _divided(letter_derivative(p, variable), p)
    return motion.known[key]


def _divided(terms: Terms, p: Expression) -> Terms:
    return {times(key, monomial(p), -1): value for key, value in terms.items()}


def along(motion: MotionTerms, terms: Mapping[Monomial, Fraction]) -> Terms:
    """Gamma(terms)."""
    total = derivative_of_terms(terms, TIME)
    for q, v, f in zip(motion.coordinates, motion.velocities, motion.forces, strict=True):
        total = add_terms(total, multiply_terms(derivative_of_terms(terms, v), f))
        total = add_terms(total, multiply_terms(derivative_of_terms(terms, q), {monomial(v): Fraction(1)}))
    return total


@lru_cache(maxsize=4096)
def has_velocity(letter: Expression) -> bool:
    return any(isinstance(node, Velocity) for node in walk(letter))


def split_velocities(key: Monomial) -> tuple[Monomial, Monomial]:
    """(letters without velocities, letters with)."""
    moving = frozenset(item for item in key if has_velocity(item[0]))
    return key - moving, moving


@lru_cache(maxsize=1024)
def irreducible_factors(tree: Expression) -> tuple[Expression, ...]:
    """Its factors that are sums, as a polynomial in roots of letters over a monomial in them."""
    terms, exponents = terms_of(tree), dict[Expression, list[Fraction]]()
    for letter, e in (item for key in terms for item in key):
        exponents.setdefault(letter, [Fraction(0)]).append(e)
    root = {letter: lcm(*(e.denominator for e in found)) for letter, found in exponents.items()}
    lowest = frozenset((letter, min(found)) for letter, found in exponents.items())
    whole = {frozenset((p, e * root[p]) for p, e in times(key, lowest, -1)): value for key, value in terms.items()}
    polynomial, letters = polynomial_of(whole)
    found = [terms_of_polynomial(factor, letters) for factor, _ in factored(polynomial)[1]]
    sums = [{frozenset((p, e / root[p]) for p, e in key): c for key, c in one.items()} for one in found if len(one) > 1]
    return tuple(split_content(one)[2] for one in sums)


def reading_class(lagrangian: Expression) -> int:
    """0 for a polynomial in the velocities, 1 where it holds t, 2 for a rational function of them, 3 for all else."""
    kind = int(holds(lagrangian, TIME))
    for node in walk(lagrangian):
        if isinstance(node, Apply) and has_velocity(node):
            return 3
        if isinstance(node, Power) and has_velocity(node):
            exponent = node.exponent.value if isinstance(node.exponent, Number) else Fraction(1, 2)
            if exponent.denominator != 1:
                return 3
            kind = max(kind, 2 if exponent < 0 else 0)
    return kind

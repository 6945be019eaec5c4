"""Identities factor * P = sum of cofactor * fact between polynomials over Q: P = 0 where the factor is not 0.

P and the facts are polynomials in generators that mean anything; relations of the generators are facts like others.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from flint import fmpq_mpoly

from inverse_service.algebra.rational_functions import Budget


@dataclass(frozen=True, slots=True)
class Fact:
    """`polynomial` = 0, under a name."""

    name: str
    polynomial: fmpq_mpoly


@dataclass(frozen=True, slots=True)
class Identity:
    """factor * gives = sum of cofactor * fact, all with integer coefficients."""

    gives: Fact
    factor: fmpq_mpoly
    terms: tuple[tuple[fmpq_mpoly, Fact], ...]

    @property
    def holds(self) -> bool:
        """Whether both sides are the same polynomial: exact, without any point."""
        left = self.factor * self.gives.polynomial
        return bool((left - sum((c * fact.polynomial for c, fact in self.terms), left * 0)).is_zero())


@dataclass(frozen=True, slots=True)
class Divisor:
    """A fact that replaces powers of generator `index` from its own on; its leading coefficient is not zero."""

    fact: Fact
    index: int


@dataclass(frozen=True, slots=True)
class Remainder:
    """multiplier * P = sum of cofactor * fact + rest."""

    multiplier: fmpq_mpoly
    terms: tuple[tuple[fmpq_mpoly, Fact], ...]
    rest: fmpq_mpoly


def divided(polynomial: fmpq_mpoly, divisors: Sequence[Divisor], budget: Budget) -> Remainder:
    """Pseudo-division by one divisor after the other."""
    multiplier, rest, cofactors = polynomial * 0 + 1, polynomial, dict[str, tuple[fmpq_mpoly, Fact]]()
    for divisor in divisors:
        scale, quotient, rest = _pseudo_division(rest, divisor, budget)
        if not scale.is_one():
            multiplier, cofactors = multiplier * scale, {k: (c * scale, f) for k, (c, f) in cofactors.items()}
        known = cofactors.get(divisor.fact.name, (polynomial * 0, divisor.fact))[0]
        cofactors[divisor.fact.name] = known + quotient, divisor.fact
    return Remainder(multiplier, tuple(term for term in cofactors.values() if not term[0].is_zero()), rest)


def _pseudo_division(rest: fmpq_mpoly, divisor: Divisor, budget: Budget) -> tuple[fmpq_mpoly, fmpq_mpoly, fmpq_mpoly]:
    """(scale, quotient, rest) with scale * P = quotient * divisor + rest, of lower degree in the generator."""
    by, index = divisor.fact.polynomial, divisor.index
    degree = by.degrees()[index]
    leading, scale, quotient = coefficient(by, index, degree), rest * 0 + 1, rest * 0
    while not rest.is_zero() and (top := rest.degrees()[index]) >= degree:
        head = coefficient(rest, index, top)
        common = leading if leading.is_constant() else leading.gcd(head)
        up, step = leading / common, head / common * rest.context().gen(index) ** (top - degree)
        budget.charge(len(rest) * len(up) + len(step) * len(by))
        scale, quotient, rest = scale * up, quotient * up + step, rest * up - step * by
    return scale, quotient, rest


def coefficient(polynomial: fmpq_mpoly, index: int, power: int) -> fmpq_mpoly:
    """The coefficient of that power of a generator, a polynomial in the others."""
    table = {
        tuple(0 if k == index else e for k, e in enumerate(exponents)): value
        for exponents, value in polynomial.to_dict().items()
        if exponents[index] == power
    }
    return polynomial.context().from_dict(table)


def content(polynomial: fmpq_mpoly, unknowns: Iterable[int]) -> fmpq_mpoly:
    """The greatest common divisor of the coefficients of a polynomial that is linear in the unknowns."""
    parts = [coefficient(polynomial, index, 1) for index in unknowns]
    return functools.reduce(lambda a, b: a.gcd(b), parts)


def primitive(polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """A multiple by a rational number with coprime integer coefficients, the first one positive."""
    below = math.lcm(*(int(value.q) for value in polynomial.coeffs()))
    above = math.gcd(*(int((value * below).p) for value in polynomial.coeffs()))
    sign = -1 if polynomial.leading_coefficient() < 0 else 1
    return polynomial * (sign * below) / above if above else polynomial


def identity(gives: Fact, factor: fmpq_mpoly, terms: Sequence[tuple[fmpq_mpoly, Fact]]) -> Identity:
    """The identity, multiplied by a number so that no fraction is left; ArithmeticError where it does not hold."""
    listed = [(c, fact) for c, fact in terms if not c.is_zero()]
    below = math.lcm(*(int(value.q) for c in (factor, *(c for c, _ in listed)) for value in c.coeffs()))
    found = Identity(gives, factor * below, tuple((c * below, fact) for c, fact in listed))
    if not found.holds:
        raise ArithmeticError("an identity of a proof does not hold")
    return found

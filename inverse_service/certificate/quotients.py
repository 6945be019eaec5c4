"""Quotients of polynomials over the rational numbers: the checker's field of fractions.

A quotient has no common factor, and its divisor has the leading coefficient 1, so that equal ones
are equal objects. What is too long is for the caller to say.
"""

from __future__ import annotations

from typing import Any, NamedTuple

Polynomial = Any  # fmpq_mpoly


class Quotient(NamedTuple):
    """above/below."""

    above: Polynomial
    below: Polynomial


def reduced(above: Polynomial, below: Polynomial) -> Quotient:
    """above/below in lowest terms; below is not 0."""
    if not below.is_constant():
        common = above.gcd(below)
        above, below = above / common, below / common
    unit = below.leading_coefficient()
    return Quotient(above, below) if unit == 1 else Quotient(above / unit, below / unit)


def added(left: Quotient, right: Quotient, weight: int = 1) -> Quotient:
    """left + weight right, not in lowest terms."""
    if left.below == right.below:
        return Quotient(left.above + weight * right.above, left.below)
    common = left.below.gcd(right.below)
    rest = left.below / common
    above = left.above * (right.below / common) + weight * right.above * rest
    return Quotient(above, rest * right.below)


def multiplied(left: Quotient, right: Quotient) -> Quotient:
    """The product, in lowest terms if both are."""
    first, second = reduced(left.above, right.below), reduced(right.above, left.below)
    return Quotient(first.above * second.above, first.below * second.below)

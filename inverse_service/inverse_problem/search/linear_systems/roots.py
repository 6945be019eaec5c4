"""Whole squares taken out of radicands."""

from __future__ import annotations

from fractions import Fraction

from flint import fmpz

from inverse_service.expressions.tree import Expression, Number, Power, Product, multiply, number, power

_LARGEST_FACTORED = 10**15


def even_root(radicand: Expression) -> tuple[Expression, Expression]:
    """(a, b) with radicand = a^2 b; a sqrt(b) is a square root up to its sign, for use in even functions.

    5 d^2/4 gives (d/2, 5) whatever the sign of d.
    """
    outside: list[Expression] = []
    inside: list[Expression] = []
    for factor in radicand.factors if isinstance(radicand, Product) else (radicand,):
        match factor:
            case Number(value) if value > 0:
                whole, rest = _square_part(value.numerator * value.denominator)
                outside.append(number(Fraction(whole, value.denominator)))
                inside.append(number(rest))
            case Power(base, Number(exponent)) if exponent.denominator == 1:
                outside.append(power(base, exponent // 2))
                inside.append(power(base, exponent % 2))
            case _:
                inside.append(factor)
    return multiply(*outside), multiply(*inside)


def _square_part(value: int) -> tuple[int, int]:
    """(a, b) with value = a^2 b, b without squares where the number is small enough to be factored."""
    outside, inside = 1, 1
    if value > _LARGEST_FACTORED:
        return 1, value
    for prime, exponent in fmpz(value).factor():
        outside *= int(prime) ** (int(exponent) // 2)
        inside *= int(prime) ** (int(exponent) % 2)
    return outside, inside

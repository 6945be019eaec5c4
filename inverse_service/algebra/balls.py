"""Formulas on boxes, by Arb's balls: what is shown to be positive there is positive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

from flint import arb, fmpq

from inverse_service.algebra.point import Variable
from inverse_service.expressions.tree import PI, Apply, Expression, Number, Power, Product, Sum

_REST: dict[str, Callable[[arb], arb]] = {
    "cot": lambda u: u.cos() / u.sin(),
    "sec": lambda u: 1 / u.cos(),
    "csc": lambda u: 1 / u.sin(),
    "coth": lambda u: u.cosh() / u.sinh(),
    "sech": lambda u: 1 / u.cosh(),
    "csch": lambda u: 1 / u.sinh(),
}


def encloses_positive(
    tree: Expression, center: Mapping[Variable, Fraction], reach: Mapping[Variable, Fraction]
) -> bool:
    """Whether the tree is positive on all of the box |z - center| <= reach; False where that is not shown."""
    try:
        return bool(_ball(tree, center, reach) > 0)
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return False


def _ball(tree: Expression, center: Mapping[Variable, Fraction], reach: Mapping[Variable, Fraction]) -> arb:
    def value(part: Expression) -> arb:
        match part:
            case Number(exact):
                return arb(fmpq(exact.numerator, exact.denominator))
            case Sum(terms):
                return sum((value(term) for term in terms), arb(0))
            case Product(factors):
                product = arb(1)
                for factor in factors:
                    product *= value(factor)
                return product
            case Power(base, Number(exact)) if exact.denominator == 1:
                return value(base) ** int(exact)
            case Power(base, exponent):
                return (value(exponent) * value(base).log()).exp()
            case Apply(function, argument):
                inner = value(argument)
                known = _REST.get(function)
                return known(inner) if known else getattr(inner, function)()
            case _ if part == PI:
                return arb.pi()
            case _:
                middle, radius = center[part], reach[part]  # type: ignore[index]
                return arb(fmpq(middle.numerator, middle.denominator)) + arb(0, float(radius) * (1 + 1e-9))
        raise TypeError

    return value(tree)

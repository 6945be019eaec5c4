"""Sums in the scale in which their writer typed decimal numbers: m k - 0.000025, a quarter of
0.01^2, for 40000 m k - 1, the same times 40000, which an exact method clears.
"""

import math
from fractions import Fraction
from functools import cache, lru_cache
from typing import TypeGuard

from inverse_service.expressions import tree as ex

_MULTIPLES = (Fraction(1), Fraction(2), Fraction(4), Fraction(1, 2), Fraction(1, 4))


@lru_cache(maxsize=1024)
def in_typed_scale(tree: ex.Expression, typed: frozenset[Fraction]) -> ex.Expression:
    """An equal formula with sums in the scale of typed numbers, where that makes a root of one
    readable.
    """
    known = {one * k for one in typed for k in _MULTIPLES}
    known |= {one * other * k for one in typed for other in typed for k in _MULTIPLES}
    if not any(_is_root(node) and _scale(node.base, known) > 1 for node in ex.walk(tree)):
        return tree

    @cache
    def scaled(node: ex.Expression) -> ex.Expression:
        node = ex.rebuild(node, scaled)
        match node:
            case ex.Power(ex.Sum() as base, ex.Number(exponent)):
                return _factor(base, exponent)
            case ex.Product(factors):
                sums = [
                    _factor(one, Fraction(1)) if isinstance(one, ex.Sum) else one for one in factors
                ]
                return ex.multiply(*sums)
        return node

    def _factor(base: ex.Sum, exponent: Fraction) -> ex.Expression:
        scale = _scale(base, known)
        outside = _power(scale, exponent)
        if scale == 1 or outside is None:
            return ex.power(base, exponent)
        inside = ex.add(*(ex.multiply(term, ex.number(1 / scale)) for term in base.terms))
        return ex.multiply(ex.number(outside), ex.power(inside, exponent))

    return scaled(tree)


def _is_root(node: ex.Expression) -> TypeGuard[ex.Power]:
    return isinstance(node, ex.Power) and isinstance(node.base, ex.Sum) and _is_half(node.exponent)


def _is_half(exponent: ex.Expression) -> bool:
    return isinstance(exponent, ex.Number) and exponent.value.denominator == 2


def _scale(base: ex.Expression, known: set[Fraction]) -> Fraction:
    """The largest coefficient of a sum, if the others are typed ones times it; else 1."""
    sizes = [abs(ex.coefficient(term)) for term in ex.summands(base)]
    largest = max(sizes)
    left = [size / largest for size in sizes]
    typed = [one for one in left if one.denominator > 1]
    is_cleared = all(size.denominator == 1 for size in sizes) and largest > 1
    return largest if is_cleared and typed and known.issuperset(typed) else Fraction(1)


def _power(scale: Fraction, exponent: Fraction) -> Fraction | None:
    """The rational power of an integer; None if it is irrational."""
    if exponent.denominator == 1:
        return scale**exponent.numerator
    root = math.isqrt(int(scale))
    if exponent.denominator != 2 or root * root != scale:
        return None
    return Fraction(root) ** exponent.numerator

"""Where formulas end: what they divide by, and what they take logarithms and roots of.

A wall is a formula whose zeros are poles, ends or kinks of another: u of 1/u, log(u), sqrt(u), and u of sqrt(u^2);
cos(u) of tan(u). Along a motion it keeps its sign, or the motion has left the domain that it began in.
"""

from __future__ import annotations

from collections.abc import Iterator

from inverse_service.expressions.tree import Apply, Expression, Number, Power, Product, Velocity, walk

_POLES = {"tan": "cos", "sec": "cos", "cot": "sin", "csc": "sin"}
_AT_ZERO = frozenset({"log", "coth", "csch"})


def walls(tree: Expression, moving: set[Expression]) -> Iterator[Expression]:
    """The walls of the tree that hold a velocity or one of `moving`."""
    for node in walk(tree):
        for found in _walls_of(node):
            if any(isinstance(leaf, Velocity) or leaf in moving for leaf in walk(found)):
                yield found


def kinks(tree: Expression) -> Iterator[Expression]:
    """u of sqrt(u^2): zeros at which the formula is continuous, but not smooth."""
    for node in walk(tree):
        if isinstance(node, Power) and isinstance(node.exponent, Number) and node.exponent.value.denominator != 1:
            for factor in node.base.factors if isinstance(node.base, Product) else (node.base,):
                if isinstance(factor, Power):
                    yield factor.base


def _walls_of(node: Expression) -> Iterator[Expression]:
    if isinstance(node, Power) and isinstance(node.exponent, Number):
        exponent = node.exponent.value
        if exponent < 0 or exponent.denominator != 1:
            yield from _factors(node.base)
    elif isinstance(node, Power):
        yield from _factors(node.base)
    elif isinstance(node, Apply) and node.function in _POLES:
        yield Apply(_POLES[node.function], node.argument)
    elif isinstance(node, Apply) and node.function in _AT_ZERO:
        yield from _factors(node.argument)


def _factors(base: Expression) -> Iterator[Expression]:
    if isinstance(base, Product):
        for factor in base.factors:
            yield from _factors(factor)
    elif isinstance(base, Power):
        yield from _factors(base.base)
    elif not isinstance(base, Number):
        yield base

"""Circular functions of arctangents written as algebraic functions.

cos(k atan u) + i sin(k atan u) = ((1 + i u)/sqrt(1 + u^2))^k,    k a whole number
"""

from __future__ import annotations

from fractions import Fraction

from inverse_service.expressions.tree import (
    ONE,
    Apply,
    Expression,
    Number,
    Product,
    add,
    distinct_nodes,
    divide,
    multiply,
    number,
    power,
    square_root,
    substitute,
)

_LARGEST = 4
# (cos, sin) of k turns as rows of (coefficient, power of u): real and imaginary part of (1 + i u)^k.
_TURNS = {
    1: (((1, 0),), ((1, 1),)),
    2: (((1, 0), (-1, 2)), ((2, 1),)),
    3: (((1, 0), (-3, 2)), ((3, 1), (-1, 3))),
    4: (((1, 0), (-6, 2), (1, 4)), ((4, 1), (-4, 3))),
}


def without_arctangents(tree: Expression) -> Expression:
    """The tree with every sin and cos of a small multiple of an arctangent replaced by its algebraic form."""
    while table := {node: form for node in distinct_nodes((tree,)) if (form := _algebraic(node)) is not None}:
        tree = substitute(tree, table)
    return tree


def _algebraic(node: Expression) -> Expression | None:
    if not (isinstance(node, Apply) and node.function in ("sin", "cos")):
        return None
    turns, arctangent = _multiple(node.argument)
    if arctangent is None or turns.denominator != 1 or not 1 <= abs(turns) <= _LARGEST:
        return None
    u, k = arctangent.argument, abs(int(turns))
    terms = _TURNS[k][node.function == "sin"]
    sign = -1 if turns < 0 and node.function == "sin" else 1
    above = add(*(multiply(number(sign * a), power(u, e)) for a, e in terms))
    norm = add(ONE, power(u, 2))
    return divide(above, power(norm, k // 2) if k % 2 == 0 else multiply(power(norm, k // 2), square_root(norm)))


def _multiple(argument: Expression) -> tuple[Fraction, Apply | None]:
    """(k, atan u) of k atan u; (1, None) of anything else."""
    match argument:
        case Apply("atan", _):
            return Fraction(1), argument
        case Product((Number(value), Apply("atan", _) as inner)):
            return value, inner
    return Fraction(1), None

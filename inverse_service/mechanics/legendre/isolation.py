"""Solving F(v) = p for the one place where v occurs in F, from the outside to the inside."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.tree import (
    HALF,
    PI,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Velocity,
    add,
    apply,
    divide,
    multiply,
    negate,
    power,
    subtract,
    walk,
)

Rule = Callable[[Expression], Expression]


@dataclass(frozen=True, slots=True)
class Root:
    """A solution v, right where every tree of `conditions` (in q, v, p) is positive."""

    value: Expression
    conditions: tuple[Expression, ...] = ()


def occurrences(tree: Expression, leaf: Velocity) -> int:
    return sum(1 for node in walk(tree) if node == leaf)


def isolate(tree: Expression, leaf: Velocity, target: Expression) -> Iterator[Root]:
    """All solutions of tree = target for the leaf; none where it does not occur exactly once."""
    if occurrences(tree, leaf) == 1:
        yield from _inverted(tree, leaf, Root(target))


def _inverted(tree: Expression, leaf: Velocity, known: Root) -> Iterator[Root]:
    if tree == leaf:
        yield known
        return
    for inner, root in _peeled(tree, leaf, known):
        yield from _inverted(inner, leaf, root)


def _peeled(tree: Expression, leaf: Velocity, known: Root) -> Iterator[tuple[Expression, Root]]:
    """The part that holds the leaf, with what it must be equal to."""
    target = known.value
    match tree:
        case Sum(terms):
            holder = next(term for term in terms if occurrences(term, leaf))
            rest = add(*(term for term in terms if term is not holder))
            yield holder, Root(subtract(target, rest), known.conditions)
        case Product(factors):
            holder = next(factor for factor in factors if occurrences(factor, leaf))
            rest = multiply(*(factor for factor in factors if factor is not holder))
            yield holder, Root(divide(target, rest), known.conditions)
        case Power(base, exponent) if occurrences(base, leaf):
            for root in roots_of_power(base, exponent, target):
                yield base, Root(root.value, (*known.conditions, *root.conditions))
        case Power(base, exponent):
            yield exponent, Root(divide(apply("log", target), apply("log", base)), known.conditions)
        case Apply(function, argument):
            for root in _roots_of_function(function, argument, target):
                yield argument, Root(root.value, (*known.conditions, *root.conditions))


def roots_of_power(base: Expression, exponent: Expression, target: Expression) -> Iterator[Root]:
    """base with base^exponent = target; for odd exponents a form that is right for both signs."""
    if not isinstance(exponent, Number) or exponent.value.denominator != 1:
        yield Root(power(target, power(exponent, -1)))
        return
    whole = int(exponent.value)
    if whole in (1, -1):
        yield Root(power(target, whole))
    elif whole % 2:
        yield Root(multiply(target, power(power(target, 2), Fraction(1 - whole, 2 * whole))))
    else:
        root = power(target, Fraction(1, whole))
        yield Root(root, (base,))
        yield Root(negate(root), (negate(base),))


_INVERSES: dict[str, str] = {
    "exp": "log", "log": "exp", "tan": "atan", "sinh": "asinh", "tanh": "atanh", "asin": "sin", "acos": "cos",
    "atan": "tan", "asinh": "sinh", "acosh": "cosh", "atanh": "tanh",
}  # fmt: skip


def _roots_of_function(function: str, argument: Expression, target: Expression) -> Iterator[Root]:
    """argument with function(argument) = target, on the branches next to zero."""
    inverse = _INVERSES.get(function)
    if inverse:
        yield Root(apply(inverse, target), _branch_conditions(function, argument))
    elif function == "sin":
        yield Root(apply("asin", target), _branch_conditions("tan", argument))
    elif function in ("cos", "cosh"):
        root = apply("a" + function, target)
        yield Root(root, (argument,))
        yield Root(negate(root), (negate(argument),))


def _branch_conditions(function: str, argument: Expression) -> tuple[Expression, ...]:
    """tan and sin are undone by atan and asin only for |argument| < pi/2."""
    quarter_turn = multiply(HALF, PI)
    return (subtract(quarter_turn, argument), add(quarter_turn, argument)) if function == "tan" else ()

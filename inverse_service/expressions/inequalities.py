"""A tree that is positive, written as an inequality as a person would: x > 1, x^2 + y^2 < 1, y > x, u > 0."""

from __future__ import annotations

from collections.abc import Collection
from fractions import Fraction

from inverse_service.expressions.notation import Formula, row
from inverse_service.expressions.tree import (
    PI,
    ZERO,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
    number,
    walk,
)


def inequality(tree: Expression) -> Formula:
    """The condition that the tree is positive, in all forms of writing."""
    left, right, is_greater = _sides(tree)
    return row(left, " > " if is_greater else " < ", right)


def inequality_text(tree: Expression) -> str:
    """The same in plain text."""
    return inequality(tree).text


def is_plainly_positive(tree: Expression, known: Collection[Expression] = ()) -> bool:
    """Whether it is > 0 wherever it is defined and all of `known` are > 0, seen from its form: 1 + x^2, exp(u)."""
    if tree in known:
        return True
    match tree:
        case Number(value):
            return value > 0
        case Sum(terms):
            no_less = all(_is_plainly_no_less(term, known) for term in terms)
            return no_less and any(is_plainly_positive(term, known) for term in terms)
        case Product(factors):
            return all(is_plainly_positive(factor, known) for factor in factors)
        case Power(base, Number(exponent)) if exponent < 0:
            return _is_plainly_no_less(tree, known)  # and not 0: 1/u^2, 1/sqrt(u)
        case Power(base, _):
            return is_plainly_positive(base, known)
    return isinstance(tree, Apply) and tree.function in ("exp", "cosh")


def _is_plainly_no_less(tree: Expression, known: Collection[Expression]) -> bool:
    """The same for >= 0."""
    match tree:
        case Sum(parts) | Product(parts):
            return tree in known or all(_is_plainly_no_less(part, known) for part in parts)
        case Power(base, Number(exponent)):
            return exponent.numerator % 2 == 0 or exponent.denominator % 2 == 0 or _is_plainly_no_less(base, known)
    return tree == ZERO or is_plainly_positive(tree, known)


def is_plainly_nonzero(tree: Expression, known: Collection[Expression]) -> bool:
    """Whether it is not 0 wherever it is defined and none of `known` is 0, seen from its form alone."""
    if tree in known or negate(tree) in known or is_plainly_positive(tree):
        return True
    match tree:
        case Number(value):
            return value != 0
        case Product(factors):
            return all(is_plainly_nonzero(factor, known) for factor in factors)
        case Power(base, exponent):
            is_below = isinstance(exponent, Number) and exponent.value < 0
            return is_below or is_plainly_nonzero(base, known)
    return False


def _sides(tree: Expression) -> tuple[Expression, Expression, bool]:
    """(a, b, True) for a > b, (a, b, False) for a < b: one side a single term, and that of numbers on the right."""
    terms = getattr(tree, "terms", (tree,))
    varying = [term for term in terms if not _is_number(term)]
    if len(varying) == 1:
        return _bound(varying[0], add(*(term for term in terms if _is_number(term))))
    above = [term for term in terms if _coefficient(term) > 0]
    below = [negate(term) for term in terms if _coefficient(term) < 0]
    if not above or all(map(_is_number, above)):
        return add(*below), add(*above), False
    return (add(*above), add(*below), True) if min(len(above), len(below)) < 2 else (tree, ZERO, True)


def _bound(term: Expression, rest: Expression) -> tuple[Expression, Expression, bool]:
    """c u + rest > 0 solved for u."""
    coefficient = _coefficient(term)
    parts = rest.terms if isinstance(rest, Sum) else (rest,)
    return (
        multiply(number(1 / coefficient), term),
        add(*(multiply(number(-1 / coefficient), part) for part in parts)),
        coefficient > 0,
    )


def _coefficient(term: Expression) -> Fraction:
    parts = getattr(term, "factors", (term,))
    return parts[0].value if isinstance(parts[0], Number) else Fraction(1)


def _is_number(term: Expression) -> bool:
    """Whether no coordinate, velocity, parameter or function occurs."""
    return not any(isinstance(node, Symbol | Velocity | Arbitrary) and node != PI for node in walk(term))

"""Formulas in t, x and v put over one denominator, factored, and their roots and signs."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from inverse_service.expressions.tree import (
    TIME,
    Apply,
    Expression,
    Number,
    Power,
    Symbol,
    Velocity,
    is_exponential,
    multiply,
    number,
    powers_of,
    square_root,
    walk,
)
from inverse_service.field import exact_atoms
from inverse_service.field.modular import prime_factors
from inverse_service.field.rational_functions import Budget, TooLarge
from inverse_service.search.terms import TooManyTerms, terms_of, tree_of

_LARGEST_FACTORED = 10**15


def factored(tree: Expression, variables: Sequence[Symbol | Velocity]) -> Expression:
    """The tree over its common denominator as a product of factors; TooManyTerms where that is large."""
    try:
        return exact_atoms.factored([tree], [TIME, *variables], Budget.long())[0]
    except (TooLarge, ZeroDivisionError, KeyError) as problem:
        raise TooManyTerms from problem


def expanded(tree: Expression) -> Expression:
    """The tree as a sum of monomials in letters."""
    return tree_of(terms_of(tree))


def weight(tree: Expression) -> int:
    """The number of nodes, functions and roots counting more: how hard a formula is to read."""
    return sum(_node_weight(node) for node in walk(tree))


def _node_weight(node: Expression) -> int:
    if isinstance(node, Power) and isinstance(node.exponent, Number) and node.exponent.value.denominator > 1:
        return 30
    return 8 if isinstance(node, Apply) else 1


def shortest(tree: Expression, variables: Sequence[Symbol | Velocity]) -> Expression:
    """The lightest of the tree, its expansion and its factored form."""
    found = [tree]
    for change in (expanded, lambda given: factored(given, variables)):
        try:
            found.append(change(tree))
        except TooManyTerms:
            continue
    return min(found, key=weight)


def even_root(radicand: Expression) -> tuple[Expression, Expression]:
    """(a, b) with radicand = a^2 b; a sqrt(b) is a square root up to its sign.

    5 d^2/4 gives (d/2, 5) whatever the sign of d.
    """
    outside: list[Expression] = []
    inside: list[Expression] = []
    for base, e in powers_of(radicand):
        if isinstance(base, Number) and e == 1:
            above, below = base.value.as_integer_ratio()
            whole, rest = _square_part(abs(above) * below)
            outside.append(number(Fraction(whole, below)))
            inside.append(number(rest if above > 0 else -rest))
        elif is_exponential(base):
            outside.append(Apply("exp", e / 2 * base.argument))
        else:
            half = e // 2 if e.denominator == 1 else Fraction(0)
            outside.append(base**half)
            inside.append(base ** (e - 2 * half))
    return multiply(*outside), multiply(*inside)


def _square_part(value: int) -> tuple[int, int]:
    """(a, b) with value = a^2 b, b without squares where the number is small enough to be factored."""
    outside, inside = 1, 1
    if not 0 < value <= _LARGEST_FACTORED:
        return 1, value
    for prime, exponent in prime_factors(value):
        outside *= prime ** (exponent // 2)
        inside *= prime ** (exponent % 2)
    return outside, inside


def extracted_root(tree: Expression) -> Expression:
    """A square root of a product with the squares among its factors taken out; its sign is left open."""
    outside, inside = even_root(tree)
    return outside * square_root(expanded(inside))

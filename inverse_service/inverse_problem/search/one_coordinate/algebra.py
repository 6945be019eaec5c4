"""Formulas in t, x and v put over one denominator, factored, and their roots and signs."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from inverse_service import bounds
from inverse_service.algebra import exact_atoms
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.expressions.tree import (
    ONE,
    TIME,
    Apply,
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
    square_root,
    walk,
)
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of, tree_of


def factored(tree: Expression, variables: Sequence[Symbol | Velocity]) -> Expression:
    """The tree over its common denominator as a product of factors; TooManyTerms where that is large."""
    try:
        return exact_atoms.factored([tree], [TIME, *variables], Budget.long())[0]
    except (TooLarge, ZeroDivisionError, KeyError) as problem:
        raise TooManyTerms from problem


def factors_of(tree: Expression) -> list[tuple[Expression, Fraction]]:
    """(base, exponent) of each factor of a product; exp(u) is a base."""
    found = []
    for factor in tree.factors if isinstance(tree, Product) else (tree,):
        match factor:
            case Power(base, Number(exponent)):
                found.append((base, exponent))
            case _:
                found.append((factor, Fraction(1)))
    return found


def negated(tree: Expression) -> Expression:
    """-tree with the sign in each term of a sum."""
    return add(*map(negate, tree.terms)) if isinstance(tree, Sum) else -tree


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


def extracted_root(tree: Expression) -> Expression:
    """A square root of a product with the squares among its factors taken out; its sign is left open."""
    outside: list[Expression] = []
    inside: list[Expression] = []
    for base, e in factors_of(tree):
        if isinstance(base, Number) and e == 1:
            out, rest = _number_root(base.value)
            outside.append(number(out))
            inside.append(number(rest))
        elif isinstance(base, Apply) and base.function == "exp":
            outside.append(Apply("exp", e / 2 * base.argument))
        else:
            whole = e // 2 if e.denominator == 1 else Fraction(0)
            outside.append(base**whole)
            inside.append(base ** (e - 2 * whole))
    return multiply(*outside, square_root(expanded(multiply(*inside)) if inside else ONE))


def _number_root(value: Fraction) -> tuple[Fraction, Fraction]:
    """(r, s) with r^2 s = value, s an integer without small square factors."""
    rest, out = value.numerator * value.denominator, Fraction(1, value.denominator)
    for k in range(2, bounds.RATIO):
        while rest and rest % (k * k) == 0:
            rest, out = rest // (k * k), out * k
    return out, Fraction(rest)

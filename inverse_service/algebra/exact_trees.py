"""Ring elements as trees for people: factored, roots and exponentials merged, in the user's atoms."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from flint import fmpq_mpoly

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.rational_functions import Quotient, as_fraction, divided_out
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Power,
    Product,
    add,
    multiply,
    number,
    power,
)

# Factoring costs more than it helps the reader beyond this many terms.
FACTORED_TERMS = 120


def quotient_tree(ring: ExactRing, quotient: Quotient) -> Expression:
    """The element as constant * factors / denominators."""
    if quotient.is_zero:
        return number(0)
    constant, factors = _factors(ring, quotient.numerator)
    table = dict[Expression, Fraction]()
    for polynomial, exponent in factors:
        _collect(ring, table, polynomial, exponent)
    for index, exponent in quotient.exponents:
        _collect(ring, table, ring.field.denominators[index], -exponent)
    parts = [generator_power(tree, exponent) for tree, exponent in table.items() if exponent]
    return multiply(number(constant), *parts)


def _factors(ring: ExactRing, polynomial: fmpq_mpoly) -> tuple[Fraction, list[tuple[fmpq_mpoly, int]]]:
    """constant and factors; radicands and 1 - cos^2 are taken out whole, as powers of their generator."""
    found = []
    for relation in ring.field.relations.values():
        polynomial, exponent = divided_out(polynomial, relation.right)
        if exponent:
            found.append((ring.field.context.gen(relation.generator), exponent * relation.degree))
    if len(polynomial) > FACTORED_TERMS:
        return Fraction(1), [*found, (polynomial, 1)]
    content, factors = polynomial.factor()
    return as_fraction(content), [*found, *((factor, int(exponent)) for factor, exponent in factors)]


def _collect(ring: ExactRing, table: dict[Expression, Fraction], factor: fmpq_mpoly, exponent: int) -> None:
    """Multiply the power of a factor into the table of trees and exponents."""
    tree = polynomial_tree(ring, factor)
    for part in tree.factors if isinstance(tree, Product) else (tree,):
        base, inner = part, Fraction(1)
        if isinstance(part, Power) and isinstance(part.exponent, Number):
            base, inner = part.base, part.exponent.value
        table[base] = table.get(base, Fraction(0)) + inner * exponent


def polynomial_tree(ring: ExactRing, polynomial: fmpq_mpoly) -> Expression:
    """The polynomial as a sum of monomials."""
    return add(*(_monomial_tree(ring, exponents, as_fraction(c)) for exponents, c in polynomial.terms()))


def _monomial_tree(ring: ExactRing, exponents: Iterable[int], coefficient: Fraction) -> Expression:
    parts = [
        generator_power(ring.trees[index], Fraction(int(exponent)))
        for index, exponent in reversed(list(enumerate(exponents)))
        if exponent
    ]
    return multiply(number(coefficient), *parts)


def generator_power(tree: Expression, exponent: Fraction) -> Expression:
    """tree ^ exponent, with (u^c)^e = u^(c e) for a root and exp(u)^e = exp(e u)."""
    match tree:
        case Power(base, Number(inner)) if inner.denominator != 1:
            return power(base, inner * exponent)
        case Power(base, inner_exponent) if not isinstance(inner_exponent, Number):
            return power(base, multiply(number(exponent), inner_exponent))
        case Apply("exp", argument):
            return Apply("exp", multiply(number(exponent), argument)) if exponent != 1 else tree
    return power(tree, exponent)

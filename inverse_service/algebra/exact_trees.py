"""Ring elements as trees for people: factored, roots and exponentials merged, in the user's atoms."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from flint import fmpq, fmpq_mpoly

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.rational_functions import Quotient, as_fraction, divided_out
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    add,
    multiply,
    number,
    power,
)

# Factoring costs more than it helps the reader beyond this many terms, or this degree.
FACTORED_TERMS = 120
FACTORED_DEGREE = 60


def quotient_tree(ring: ExactRing, quotient: Quotient) -> Expression:
    """The element as constant * factors / denominators, or a sum of such where that is shorter."""
    if quotient.is_zero:
        return number(0)
    return add(*(_factored(ring, part) for part in _split_by_roots(ring, quotient)))


def _split_by_roots(ring: ExactRing, quotient: Quotient) -> list[Quotient]:
    """The parts by powers of each root in the denominator: (P + Q r^5)/r^5 = P/r^5 + Q, if that is shorter."""
    parts = [quotient]
    for index, relation in ring.field.relations.items():
        root = ring.field.context.gen(index)
        if any(ring.field.denominators[place] == root for place, _ in quotient.exponents):
            parts = [piece for part in parts for piece in _by_powers(part, index, relation.degree)]
    shorter = sum(len(part.numerator) for part in parts) < len(quotient.numerator)
    return parts if shorter else [quotient]


def _by_powers(quotient: Quotient, index: int, degree: int) -> list[Quotient]:
    """One quotient for each power of the generator in the numerator."""
    tables: list[dict[tuple[int, ...], fmpq]] = [{} for _ in range(degree)]
    for exponents, coefficient in quotient.numerator.to_dict().items():
        tables[exponents[index]][exponents] = coefficient
    owner = quotient.field
    return [owner.quotient(owner.context.from_dict(table), quotient.exponents) for table in tables if table]


def _factored(ring: ExactRing, quotient: Quotient) -> Expression:
    """constant * factors / denominators, monomials before sums."""
    constant, factors = _factors(ring, quotient.numerator)
    table = dict[Expression, Fraction]()
    for polynomial, exponent in factors:
        _collect(ring, table, polynomial, exponent)
    for index, exponent in quotient.exponents:
        _collect(ring, table, ring.field.denominators[index], -exponent)
    rank = {tree: _place(ring, index) for index, tree in ring.trees.items() if tree in table}
    ordered = sorted(table.items(), key=lambda item: (item[1] < 0, isinstance(item[0], Sum), rank.get(item[0], (3, 0))))
    return multiply(number(constant), *(generator_power(tree, exponent) for tree, exponent in ordered if exponent))


def factor_trees(ring: ExactRing, quotient: Quotient) -> list[Expression]:
    """The factors of the numerator that are not numbers, each once: where the element can vanish."""
    _, factors = _factors(ring, quotient.numerator)
    return [polynomial_tree(ring, factor) for factor, _ in factors if not factor.is_constant()]


def _factors(ring: ExactRing, polynomial: fmpq_mpoly) -> tuple[Fraction, list[tuple[fmpq_mpoly, int]]]:
    """constant and factors; radicands and 1 - cos^2 are taken out whole, as powers of their generator."""
    found = []
    for relation in ring.field.relations.values():
        polynomial, exponent = divided_out(polynomial, relation.right)
        if exponent:
            found.append((ring.field.context.gen(relation.generator), exponent * relation.degree))
    if len(polynomial) > FACTORED_TERMS or polynomial.total_degree() > FACTORED_DEGREE:
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
    used = (index for index, degree in enumerate(polynomial.degrees()) if degree > 0 and index in ring.trees)
    order = sorted(used, key=lambda index: _place(ring, index))
    powers: dict[tuple[int, int], Expression] = {}
    return add(*(_monomial_tree(ring, order, powers, e, as_fraction(c)) for e, c in polynomial.terms()))


def _monomial_tree(
    ring: ExactRing,
    order: Sequence[int],
    powers: dict[tuple[int, int], Expression],
    exponents: Sequence[int],
    coefficient: Fraction,
) -> Expression:
    """One term; `powers` keeps the powers of generators built so far."""
    parts = []
    for index in order:
        exponent = int(exponents[index])
        if exponent and (index, exponent) not in powers:
            powers[index, exponent] = generator_power(ring.trees[index], Fraction(exponent))
        if exponent:
            parts.append(powers[index, exponent])
    return multiply(number(coefficient), *parts)


def _place(ring: ExactRing, index: int) -> tuple[int, int]:
    """Parameters first, then coordinates and velocities, then functions."""
    tree = ring.trees.get(index)
    if isinstance(tree, Symbol) and tree not in ring.variables:
        return (0, index)
    return (1 if tree in ring.variables else 2, index)


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

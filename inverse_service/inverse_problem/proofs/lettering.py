"""Rows whose long factors are replaced by letters: what is proven with letters holds for what they stand for."""

from __future__ import annotations

import functools
from collections.abc import Mapping

from flint import fmpq_mpoly

from inverse_service.algebra.exact_ring import ExactRing, polynomial_tree, sum_of
from inverse_service.algebra.rational_functions import Budget, Quotient, QuotientField
from inverse_service.expressions.tree import Symbol
from inverse_service.inverse_problem.explanation.elimination import Linear, Unknown
from inverse_service.inverse_problem.explanation.hierarchy import EquationName
from inverse_service.inverse_problem.proofs.identities import coefficient

# A factor of more terms than this is replaced by a letter.
TERMS_OF_A_FACTOR = 4
Row = Mapping[Unknown, tuple[fmpq_mpoly, list[tuple[fmpq_mpoly, int]]]]


def lettered(
    ring: ExactRing, symbols: Mapping[Unknown, Symbol], equations: Mapping[EquationName, Linear], budget: Budget
) -> tuple[ExactRing, dict[EquationName, Linear]]:
    """The rows over a ring with a further generator for each long factor, which prints as that factor.

    Denominators and factors that all coefficients of a row share are left out.
    """
    rows = {name: _factored(ring, symbols, row) for name, row in equations.items()}
    factors = (factor for row in rows.values() for _, parts in row.values() for factor, _ in parts)
    long = list({str(factor): factor for factor in factors if len(factor) > TERMS_OF_A_FACTOR}.values())
    wider = _widened(ring, long, budget)
    letters = {str(factor): len(ring.field.context.names()) + k for k, factor in enumerate(long)}
    return wider, {
        name: {unknown: _in_letters(wider, letters, *parts) for unknown, parts in row.items()}
        for name, row in rows.items()
    }


def _factored(ring: ExactRing, symbols: Mapping[Unknown, Symbol], row: Linear) -> Row:
    """The coefficients, put over one denominator, as a number and irreducible factors that they do not all share."""
    places = {tree: index for index, tree in ring.trees.items()}
    whole = sum_of(ring.constant(0), [c * ring.atoms[symbols[unknown]] for unknown, c in row.items()]).numerator
    parts = {unknown: coefficient(whole, places[symbols[unknown]], 1) for unknown in row}
    shared = functools.reduce(lambda a, b: a.gcd(b), parts.values())
    split = {unknown: (part / shared).factor() for unknown, part in parts.items()}
    return {
        unknown: (shared * 0 + number, [(f, int(e)) for f, e in found]) for unknown, (number, found) in split.items()
    }


def _widened(ring: ExactRing, long: list[fmpq_mpoly], budget: Budget) -> ExactRing:
    """The same generators and relations, and one generator more for each long factor."""
    size = len(ring.field.context.names())
    field = QuotientField.with_generators(size + len(long), budget)
    wider = ExactRing(field, (), 0, slopes=False)
    for index, relation in ring.field.relations.items():
        field.relate(index, relation.degree, _moved(field, relation.right))
    wider.trees = ring.trees | {size + k: polynomial_tree(ring, factor) for k, factor in enumerate(long)}
    wider.atoms = {tree: wider.generator(index) for index, tree in wider.trees.items()}
    return wider


def _moved(field: QuotientField, polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """The polynomial among more generators."""
    more = (0,) * (len(field.context.names()) - len(polynomial.context().names()))
    return field.context.from_dict({(*exponents, *more): value for exponents, value in polynomial.to_dict().items()})


def _in_letters(
    ring: ExactRing, letters: Mapping[str, int], number: fmpq_mpoly, factors: list[tuple[fmpq_mpoly, int]]
) -> Quotient:
    value = Quotient(ring.field, _moved(ring.field, number), ())
    for factor, exponent in factors:
        index = letters.get(str(factor))
        part = Quotient(ring.field, _moved(ring.field, factor), ()) if index is None else ring.generator(index)
        value = value * part**exponent
    return value

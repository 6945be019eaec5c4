"""Quadratic blocks: L = v^T G v / 2 gives v = G^-1 p and H = p^T G^-1 p / 2.

G is inverted exactly by fraction-free elimination (Bareiss 1968) over polynomials in opaque atoms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from inverse_service import bounds
from inverse_service.errors import LimitError
from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import Term, merge_powers, terms_tree
from inverse_service.expressions.tree import HALF, ONE, ZERO, Expression, Number, Product, Sum, Symbol, add
from inverse_service.mechanics.implicit_equations import (
    OpaqueRing,
    Polynomial,
    Rows,
    cleared,
    common_denominator,
    solved_rows,
    times,
)
from inverse_service.mechanics.legendre.blocks import Block, Branch, degrees, without
from inverse_service.mechanics.legendre.short_forms import separated, shortest, trigonometric

Matrix = tuple[tuple[Expression, ...], ...]


@dataclass(frozen=True, slots=True)
class Inverse:
    """adjugate / determinant without a common factor, and the quotients entry by entry; all (n, n)."""

    adjugate: Matrix
    determinant: Expression
    entries: Matrix


def quadratic_branches(block: Block) -> Iterator[Branch]:
    """The one inverse of a quadratic block; none where the block is not quadratic or G is singular."""
    matrix = form_matrix(expand(block.function), block.names)
    inverse = invert(matrix) if matrix else None
    if inverse:
        momenta = [block.momenta[name] for name in block.names]
        velocities = tuple(_shorter_row(inverse, row, momenta) for row in range(len(momenta)))
        yield Branch(velocities, multiply_out(HALF, quadratic_form(inverse, momenta)))


def form_matrix(terms: Sequence[Term], names: Sequence[str]) -> Matrix | None:
    """The symmetric G with terms v^T G v / 2; None where there are others."""
    table: dict[tuple[str, str], list[Term]] = {}
    for monomial, value in terms:
        found = degrees(monomial, names)
        if found is None or sum(found.values()) != 2 or any(e not in (1, 2) for e in found.values()):
            return None
        pair = [name for name, exponent in found.items() for _ in range(int(exponent))]
        scale = 2 if pair[0] == pair[1] else 1
        for key in {(pair[0], pair[1]), (pair[1], pair[0])}:
            table.setdefault(key, []).append((without(monomial, names), value * scale))
    return tuple(tuple(terms_tree(table.get((i, j), ())) for j in names) for i in names)


def invert(matrix: Sequence[Sequence[Expression]]) -> Inverse | None:
    """The exact inverse; None where the determinant is the zero polynomial or everything is too large."""
    plain = [[separated(entry) for entry in row] for row in matrix]
    ring = OpaqueRing([entry for row in plain for entry in row])
    try:
        fractions = [[ring.fraction(entry) for entry in row] for row in plain]
        common = common_denominator(ring, [entry for row in fractions for entry in row], bounds.TERMS)
        rows = [cleared(row, common, bounds.TERMS) for row in fractions]
        solved = solved_rows(ring, rows, [ring.constant(1)] * len(rows), bounds.TERMS)
        return None if solved is None else _reduced(ring, solved[0], solved[1], common)
    except (LimitError, ZeroDivisionError):
        return None


def _reduced(ring: OpaqueRing, adjugate: Rows, determinant: Polynomial, scale: Polynomial) -> Inverse:
    """scale * adjugate / determinant, reduced as a whole and entry by entry."""
    rows = [[times(scale, entry, bounds.TERMS) for entry in row] for row in adjugate]
    common = determinant
    for row in rows:
        for entry in row:
            common = common.gcd(entry)
    short = [[divmod(entry, common)[0] for entry in row] for row in rows]
    bottom = divmod(determinant, common)[0]
    if _has_minus(_tree(ring, bottom, ring.constant(1))):
        short, bottom = [[-entry for entry in row] for row in short], -bottom
    return Inverse(
        tuple(tuple(_tree(ring, entry, ring.constant(1)) for entry in row) for row in short),
        _tree(ring, bottom, ring.constant(1)),
        tuple(tuple(_tree(ring, entry, bottom) for entry in row) for row in short),
    )


def _tree(ring: OpaqueRing, numerator: Polynomial, denominator: Polynomial) -> Expression:
    return trigonometric(merge_powers(ring.tree(ring.reduced(numerator, denominator))))


def _has_minus(tree: Expression) -> bool:
    """Whether a minus sign stands before the tree."""
    first = tree.factors[0] if isinstance(tree, Product) else tree
    return isinstance(first, Number) and first.value < 0


def quadratic_form(inverse: Inverse, momenta: Sequence[Symbol]) -> Expression:
    """p^T G^-1 p: one quotient, or a sum of such where that is shorter."""
    forms = [
        add(*(_entry_term(matrix, momenta, i, j) for i in range(len(momenta)) for j in range(i, len(momenta))))
        for matrix in (inverse.adjugate, inverse.entries)
    ]
    return shortest([forms[1], over(forms[0], inverse.determinant)])


def _entry_term(matrix: Matrix, momenta: Sequence[Symbol], i: int, j: int) -> Expression:
    square = momenta[i] ** 2 if i == j else 2 * momenta[i] * momenta[j]
    return matrix[i][j] * square


def _shorter_row(inverse: Inverse, row: int, momenta: Sequence[Symbol]) -> Expression:
    """One row of G^-1 p."""
    sums = [
        add(*(entry * p for entry, p in zip(matrix[row], momenta, strict=True) if entry != ZERO))
        for matrix in (inverse.adjugate, inverse.entries)
    ]
    return shortest([sums[1], over(sums[0], inverse.determinant)])


def over(numerator: Expression, denominator: Expression) -> Expression:
    return numerator if denominator == ONE else merge_powers(numerator / denominator)


def multiply_out(factor: Expression, tree: Expression) -> Expression:
    """factor * tree, into each term of a sum."""
    if isinstance(tree, Sum):
        return add(*(factor * term for term in tree.terms))
    return factor * tree

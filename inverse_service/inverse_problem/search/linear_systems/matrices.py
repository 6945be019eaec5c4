"""Exact linear algebra over the field of the constants of a linear system.

Matrices are tuples of rows of ring elements; a symmetric matrix is also a vector of its entries, those
off the diagonal first, so that a kernel gets the entries on the diagonal as its free unknowns.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction

from flint import fmpq, fmpq_mat

from inverse_service.algebra.exact_ring import sum_of
from inverse_service.algebra.rational_functions import Quotient, QuotientField, as_fraction
from inverse_service.mechanics.quotient_matrices import dot, reduced_rows

Vector = tuple[Quotient, ...]
Matrix = tuple[Vector, ...]


def product(left: Matrix, right: Matrix) -> Matrix:
    """left right."""
    columns = transpose(right)
    return tuple(tuple(_dot(row, column) for column in columns) for row in left)


def apply(matrix: Matrix, vector: Vector) -> Vector:
    """matrix vector."""
    return tuple(_dot(row, vector) for row in matrix)


def _dot(left: Vector, right: Vector) -> Quotient:
    return dot(left[0].field.constant(0), left, right)


def transpose(matrix: Matrix) -> Matrix:
    return tuple(zip(*matrix, strict=True))


def plus(left: Matrix, right: Matrix, factor: Fraction | int = 1) -> Matrix:
    """left + factor right, factor a rational number."""
    rows = zip(left, right, strict=True)
    return tuple(tuple(a + b.scaled(factor) for a, b in zip(*pair, strict=True)) for pair in rows)


def times(matrix: Matrix, factor: Quotient) -> Matrix:
    return tuple(tuple(entry * factor for entry in row) for row in matrix)


def trace(matrix: Matrix) -> Quotient:
    return sum_of(matrix[0][0].field.constant(0), [matrix[i][i] for i in range(len(matrix))])


def identity(owner: QuotientField, size: int) -> Matrix:
    return tuple(tuple(owner.constant(int(i == j)) for j in range(size)) for i in range(size))


def is_zero(matrix: Matrix) -> bool:
    return all(entry.is_zero for row in matrix for entry in row)


def places(size: int) -> list[tuple[int, int]]:
    """The entries i <= j of a symmetric matrix in the order of its vector."""
    return [*itertools.combinations(range(size), 2), *((i, i) for i in range(size))]


def symmetric(vector: Vector, size: int) -> Matrix:
    """The symmetric matrix with these entries."""
    table = dict(zip(places(size), vector, strict=True))
    return tuple(tuple(table[min(i, j), max(i, j)] for j in range(size)) for i in range(size))


def entries(matrix: Matrix) -> Vector:
    """The entries of a symmetric matrix."""
    return tuple(matrix[i][j] for i, j in places(len(matrix)))


def echelon(rows: Sequence[Vector]) -> tuple[list[Vector], list[int]]:
    """(nonzero rows of the reduced echelon form, their pivots)."""
    found = reduced_rows(rows, range(len(rows[0]) if rows else 0))
    return list(found.rows), list(found.pivots)


def kernel(rows: Sequence[Vector], width: int, owner: QuotientField) -> tuple[list[Vector], list[int]]:
    """(basis of the vectors that every row annihilates, the unknown that each has to itself)."""
    reduced, pivots = echelon(rows)
    free = [k for k in range(width) if k not in pivots]
    basis = []
    for unknown in free:
        vector = [owner.constant(int(k == unknown)) for k in range(width)]
        for pivot, row in zip(pivots, reduced, strict=True):
            vector[pivot] = -row[unknown]
        basis.append(tuple(vector))
    return basis, free


def combination(weights: Sequence[Quotient], vectors: Sequence[Vector]) -> Vector:
    """sum_k weights_k vectors_k."""
    return tuple(_dot(tuple(weights), column) for column in zip(*vectors, strict=True))


def characteristic_polynomial(matrix: Matrix) -> list[Quotient]:
    """The coefficients of det(x - matrix), the constant one first (Faddeev and LeVerrier)."""
    owner, size = matrix[0][0].field, len(matrix)
    numbers = [entry.constant_value for row in matrix for entry in row]
    if all(value is not None for value in numbers):
        rational = fmpq_mat(size, size, [fmpq(x.numerator, x.denominator) for x in numbers if x is not None])
        return [owner.constant(as_fraction(c)) for c in rational.charpoly().coeffs()]
    found = [owner.constant(1)]
    auxiliary = identity(owner, size)
    for k in range(1, size + 1):
        moved = product(matrix, auxiliary)
        coefficient = trace(moved).scaled(Fraction(-1, k))
        found.append(coefficient)
        auxiliary = plus(moved, times(identity(owner, size), coefficient))
    return found[::-1]

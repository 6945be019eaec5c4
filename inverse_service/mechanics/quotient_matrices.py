"""Linear algebra over an exact quotient field: reduced rows, determinants, solutions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.algebra.exact_derivations import sum_of
from inverse_service.algebra.rational_functions import Quotient

Row = list[Quotient]


@dataclass(frozen=True, slots=True)
class ReducedRows:
    """Rows with a leading 1 in the columns `pivots`; `sources[i]` is the given row that made row i.

    `dropped` are the given rows that became zero in the columns reduced, each as (row, what is left of it).
    """

    rows: tuple[tuple[Quotient, ...], ...]
    pivots: tuple[int, ...]
    sources: tuple[int, ...]
    dropped: tuple[tuple[int, tuple[Quotient, ...]], ...]


def weight(element: Quotient) -> int:
    """How long an element is when it is written down."""
    return len(element.numerator) + sum(len(element.field.denominators[index]) for index, _ in element.exponents)


def dot(zero: Quotient, left: Sequence[Quotient], right: Sequence[Quotient]) -> Quotient:
    """The sum of left_i right_i."""
    return sum_of(zero, [a * b for a, b in zip(left, right, strict=True) if not (a.is_zero or b.is_zero)])


def reduced_rows(rows: Sequence[Sequence[Quotient]], columns: Sequence[int]) -> ReducedRows:
    """Gauss-Jordan elimination in the given columns, in their order; other columns are carried along."""
    table = [(place, list(row)) for place, row in enumerate(rows)]
    done: list[tuple[int, int, Row]] = []
    for column in columns:
        candidates = [item for item in table if not item[1][column].is_zero]
        if not candidates:
            continue
        source, row = min(candidates, key=lambda item: weight(item[1][column]))
        table.remove((source, row))
        inverse = row[column].inverse()
        row = [entry * inverse for entry in row]
        table = [(place, _cleared(other, row, column)) for place, other in table]
        done = [(pivot, place, _cleared(other, row, column)) for pivot, place, other in done]
        done.append((column, source, row))
    return ReducedRows(
        tuple(tuple(row) for _, _, row in done),
        tuple(pivot for pivot, _, _ in done),
        tuple(place for _, place, _ in done),
        tuple((place, tuple(row)) for place, row in table),
    )


def _cleared(row: Row, pivot_row: Row, column: int) -> Row:
    """row - row[column] * pivot_row."""
    head = row[column]
    if head.is_zero:
        return row
    return [a if b.is_zero else a - head * b for a, b in zip(row, pivot_row, strict=True)]


def solve_square(matrix: Sequence[Sequence[Quotient]], right: Sequence[Quotient]) -> tuple[Quotient, ...] | None:
    """x with matrix x = right, None where the matrix is singular."""
    size = len(matrix)
    found = reduced_rows([[*row, value] for row, value in zip(matrix, right, strict=True)], range(size))
    if len(found.pivots) < size:
        return None
    return tuple(row[size] for _, row in sorted(zip(found.pivots, found.rows, strict=True), key=lambda item: item[0]))


def determinant(matrix: Sequence[Sequence[Quotient]], one: Quotient) -> Quotient:
    """The determinant, by expansion along the row with fewest entries; 1 for the empty matrix."""
    if not matrix:
        return one
    counts = [sum(not entry.is_zero for entry in row) for row in matrix]
    place = min(range(len(matrix)), key=lambda row: counts[row])
    terms = []
    for column, entry in enumerate(matrix[place]):
        if entry.is_zero:
            continue
        minor = [[e for k, e in enumerate(row) if k != column] for i, row in enumerate(matrix) if i != place]
        value = entry * determinant(minor, one)
        terms.append(value if (place + column) % 2 == 0 else -value)
    return sum_of(one - one, terms)

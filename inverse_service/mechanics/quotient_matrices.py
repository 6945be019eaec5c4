"""Linear algebra over an exact quotient field: reduced rows, determinants, solutions.

Linear relations with constant coefficients among elements of an exact ring.

Constants are numbers and whatever depends on no variable of the ring: parameters, their functions and roots. What
multiplies a product of the other generators is one linear equation for the coefficients, over the field of constants.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations

from flint import fmpq, fmpq_mat, fmpq_mpoly

from inverse_service.field.exact_ring import ExactRing, sum_of
from inverse_service.field.rational_functions import Quotient, as_fraction, coefficients_of

Row = list[Quotient]


@dataclass(frozen=True, slots=True)
class ReducedRows:
    """Rows with a leading 1 in the columns `pivots`.

    `dropped` are the given rows that became zero in the columns reduced, each as (row, what is left of it).
    """

    rows: tuple[tuple[Quotient, ...], ...]
    pivots: tuple[int, ...]
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
    done: list[tuple[int, Row]] = []
    for column in columns:
        candidates = [item for item in table if not item[1][column].is_zero]
        if not candidates:
            continue
        source, row = min(candidates, key=lambda item: weight(item[1][column]))
        table.remove((source, row))
        inverse = row[column].inverse()
        row = [entry * inverse for entry in row]
        table = [(place, _cleared(other, row, column)) for place, other in table]
        done = [(pivot, _cleared(other, row, column)) for pivot, other in done]
        done.append((column, row))
    return ReducedRows(
        tuple(tuple(row) for _, row in done),
        tuple(pivot for pivot, _ in done),
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
    """The determinant, by expansion along the rows, those with fewest entries first, each minor once."""
    order = sorted(range(len(matrix)), key=lambda i: sum(not entry.is_zero for entry in matrix[i]))

    @cache
    def minor(columns: tuple[int, ...]) -> Quotient:
        """That of the last rows of the order and of `columns`."""
        if not columns:
            return one
        row = matrix[order[len(matrix) - len(columns)]]
        kept = [(k, column) for k, column in enumerate(columns) if not row[column].is_zero]
        terms = [row[column] * minor(columns[:k] + columns[k + 1 :]) for k, column in kept]
        return sum_of(one - one, [-term if k % 2 else term for (k, _), term in zip(kept, terms, strict=True)])

    whole = minor(tuple(range(len(matrix))))
    return -whole if sum(a > b for a, b in combinations(order, 2)) % 2 else whole


def null_vectors(ring: ExactRing, columns: Sequence[Sequence[Quotient]]) -> list[list[Quotient]]:
    """A basis of the constant c with sum_k c_k columns[k] = 0, entry by entry."""
    return list(null_space(_equations(ring, columns), len(columns), ring.constant(1)).values())


def null_space(rows: Sequence[Sequence[Quotient]], size: int, one: Quotient) -> dict[int, list[Quotient]]:
    """A basis of the vectors orthogonal to all rows, one for each column that is free: the one it has to itself."""
    found = _reduced_numbers(rows, size, one) or reduced_rows(rows, range(size))
    basis, zero = {}, one - one
    for free in (k for k in range(size) if k not in found.pivots):
        vector = [one if k == free else zero for k in range(size)]
        for row, pivot in zip(found.rows, found.pivots, strict=True):
            vector[pivot] = zero - row[free]
        basis[free] = vector
    return basis


def _reduced_numbers(rows: Sequence[Sequence[Quotient]], size: int, one: Quotient) -> ReducedRows | None:
    """The same of rational numbers, as a matrix of these; None where some entry is none."""
    values = []
    for entry in (entry for row in rows for entry in row):
        value = entry.constant_value
        if value is None:
            return None
        values.append(fmpq(value.numerator, value.denominator))
    reduced, rank = fmpq_mat(len(rows), size, values).rref()
    lines = [[as_fraction(reduced[i, k]) for k in range(size)] for i in range(rank)]
    pivots = tuple(next(k for k, value in enumerate(line) if value) for line in lines)
    return ReducedRows(tuple(tuple(map(one.scaled, line)) for line in lines), pivots, ())


def solution(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]], right: Sequence[Quotient]
) -> list[Quotient] | None:
    """Constant c with sum_k c_k columns[k] = right, free ones 0; None where there are none."""
    size = len(columns)
    found = reduced_rows(_equations(ring, [*columns, right]), range(size + 1))
    if size in found.pivots:
        return None
    values = dict(zip(found.pivots, found.rows, strict=True))
    return [values[k][size] if k in values else ring.constant(0) for k in range(size)]


def numerators(ring: ExactRing, elements: Iterable[Quotient]) -> list[fmpq_mpoly]:
    """The elements times the least product of listed denominators that all of theirs divide, as polynomials.

    Numerators are multiplied by what they lack: where r^2 = x^2 + y^2, trial division does not see that
    (r + x^2 + y^2)/(r + 1) is r.
    """
    elements, greatest = list(elements), Counter[int]()
    for element in elements:
        greatest |= Counter(dict(element.exponents))
    missing = [greatest - Counter(dict(element.exponents)) for element in elements]
    return [
        ring.field.product(element.numerator, ring.field.expand(tuple(sorted(lacks.items()))))
        for element, lacks in zip(elements, missing, strict=True)
    ]


def _equations(ring: ExactRing, columns: Sequence[Sequence[Quotient]]) -> list[list[Quotient]]:
    varying = sorted({index for table in ring.images for index in table})
    zero, rows = ring.constant(0), list[Row]()
    for entries in zip(*columns, strict=True):
        parts: defaultdict[tuple[int, ...], Row] = defaultdict(lambda: [zero] * len(columns))
        for k, numerator in enumerate(numerators(ring, entries)):
            for powers, part in coefficients_of(numerator, varying).items():
                parts[powers][k] = Quotient(ring.field, part, ())
        rows += parts.values()
    return rows

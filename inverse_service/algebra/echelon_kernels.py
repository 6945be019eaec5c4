"""Kernels of the sparse echelon form modulo a prime, compiled: rows unpacked, reduced, kept, traced, combined."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.montgomery import compiled, multiply, power

Words = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]
Columns = npt.NDArray[np.int32]

# The state of a basis: rows, entries, recorded multiples.
ROWS, ENTRIES, USES = 0, 1, 2


@compiled
def _minus(a: np.uint64, b: np.uint64, prime: np.uint64) -> np.uint64:
    return a - b if a >= b else a + (prime - b)


@compiled
def _add_row(
    start: int, stop: int, columns: Indices, values: Words, factor: np.uint64, work: Words,
    prime: np.uint64, negative_inverse: np.uint64,
) -> int:
    """Add a multiple of a row to the dense `work`, the product in Montgomery's form; its last column."""
    top = -1
    for k in range(start, stop):
        column = columns[k]
        total = work[column] + multiply(values[k], factor, prime, negative_inverse)
        work[column] = total - prime if total >= prime else total
        top = max(top, column)
    return top


@compiled
def _subtract_basis_row(
    used: int, factor: np.uint64, work: Words, basis_starts: Indices, basis_columns: Columns, basis_values: Words,
    prime: np.uint64, negative_inverse: np.uint64,
) -> None:
    for k in range(basis_starts[used], basis_starts[used + 1]):
        product = multiply(factor, basis_values[k], prime, negative_inverse)
        work[basis_columns[k]] = _minus(work[basis_columns[k]], product, prime)


@compiled
def _reduce(
    top: int, work: Words, pivot_of: Indices, basis_starts: Indices, basis_columns: Columns, basis_values: Words,
    use_rows: Columns, use_factors: Words, state: Indices, prime: np.uint64, negative_inverse: np.uint64,
) -> int:
    """Reduce `work` by the basis as far as its pivot and record the multiples used; the pivot, or -1."""
    pivot, uses = -1, state[USES]
    for column in range(top, -1, -1):
        factor = work[column]
        if factor == np.uint64(0):
            continue
        used = pivot_of[column]
        if used < 0:
            pivot = column
            break
        use_rows[uses], use_factors[uses] = used, factor
        uses += 1
        _subtract_basis_row(
            used, factor, work, basis_starts, basis_columns, basis_values, prime, negative_inverse
        )
    if pivot >= 0:
        state[USES] = uses
    return pivot


@compiled
def _store(
    pivot: int, inverse: np.uint64, work: Words, basis_columns: Columns, basis_values: Words, state: Indices,
    prime: np.uint64, negative_inverse: np.uint64,
) -> None:
    """Move `work` times `inverse` into the basis and clear it."""
    entries = state[ENTRIES]
    for column in range(pivot, -1, -1):
        if work[column] != np.uint64(0):
            basis_columns[entries] = column
            basis_values[entries] = multiply(work[column], inverse, prime, negative_inverse)
            work[column] = np.uint64(0)
            entries += 1
    state[ENTRIES] = entries


@compiled
def combine(
    rows: Indices, row_starts: Indices, columns: Indices, values: Words, work: Words, state: np.uint64,
    prime: np.uint64, negative_inverse: np.uint64,
) -> int:
    """Add a random combination of rows to the dense `work`; its last column. `state` seeds the weights."""
    top = -1
    for row in rows:
        # splitmix64 (Steele, Lea and Flood, OOPSLA 2014): the weights need no more than to be unforeseen.
        state += np.uint64(0x9E3779B97F4A7C15)
        word = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        weight = (word ^ (word >> np.uint64(31))) % prime
        first, last = row_starts[row], row_starts[row + 1]
        top = max(top, _add_row(first, last, columns, values, weight, work, prime, negative_inverse))
    return top


@compiled
def vanishes(
    top: int, work: Words, pivot_of: Indices, basis_starts: Indices, basis_columns: Columns, basis_values: Words,
    prime: np.uint64, negative_inverse: np.uint64,
) -> bool:
    """Whether the basis reduces `work` to zero; nothing is recorded."""
    for column in range(top, -1, -1):
        factor = work[column]
        if factor == np.uint64(0):
            continue
        used = pivot_of[column]
        if used < 0:
            return False
        _subtract_basis_row(
            used, factor, work, basis_starts, basis_columns, basis_values, prime, negative_inverse
        )
    return True


@compiled
def reduce_rows(
    start: int, rows: Indices, row_starts: Indices, columns: Indices, values: Words, work: Words,
    pivot_of: Indices, basis_starts: Indices, basis_columns: Columns, basis_values: Words, origin: Indices,
    use_starts: Indices, use_rows: Columns, use_factors: Words, state: Indices,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64, square: np.uint64,
) -> int:
    """Insert rows[start], rows[start + 1], …; stop early (returning the place) where an array is full."""
    for place in range(start, len(rows)):
        row = rows[place]
        first, last = row_starts[row], row_starts[row + 1]
        top = _add_row(first, last, columns, values, square, work, prime, negative_inverse)
        room = state[ENTRIES] + top + 1 <= len(basis_columns) and state[USES] + top + 2 <= len(use_rows)
        if not room or state[ROWS] + 2 > len(basis_starts):
            for k in range(first, last):
                work[columns[k]] = np.uint64(0)
            return place
        pivot = _reduce(
            top, work, pivot_of, basis_starts, basis_columns, basis_values, use_rows, use_factors, state,
            prime, negative_inverse,
        )
        if pivot < 0:
            continue
        inverse = power(work[pivot], prime - np.uint64(2), one, prime, negative_inverse)
        _store(pivot, inverse, work, basis_columns, basis_values, state, prime, negative_inverse)
        count, uses = state[ROWS], state[USES]
        origin[count], pivot_of[pivot] = row, count
        use_rows[uses], use_factors[uses] = -1, inverse
        state[ROWS], state[USES] = count + 1, uses + 1
        basis_starts[count + 1], use_starts[count + 1] = state[ENTRIES], uses + 1
    return len(rows)


@compiled
def trace_weights(
    weights: Words, use_starts: Indices, use_rows: Columns, use_factors: Words,
    prime: np.uint64, negative_inverse: np.uint64,
) -> None:
    """Turn weights on basis rows into weights on original rows, last inserted first (in place)."""
    for k in range(len(weights) - 1, -1, -1):
        if weights[k] == np.uint64(0):
            continue
        last = use_starts[k + 1] - 1
        weight = multiply(weights[k], use_factors[last], prime, negative_inverse)
        weights[k] = weight
        for u in range(use_starts[k], last):
            product = multiply(weight, use_factors[u], prime, negative_inverse)
            weights[use_rows[u]] = _minus(weights[use_rows[u]], product, prime)


@compiled
def cut(
    numbers: Indices, first: int, basis_starts: Indices, basis_columns: Columns, basis_values: Words,
    starts: Indices, columns: Indices, values: Words,
) -> None:
    """The entries from column `first` on of those basis rows; each row ends with its smallest column."""
    entries = 0
    for row in range(len(numbers)):
        for k in range(basis_starts[numbers[row]], basis_starts[numbers[row] + 1]):
            if basis_columns[k] < first:
                break
            columns[entries], values[entries] = basis_columns[k] - first, basis_values[k]
            entries += 1
        starts[row + 1] = entries

"""Kernels of the sparse echelon form modulo a prime, compiled: rows unpacked, reduced, kept, traced, tested."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.modular import GOLDEN, compiled, leading_zeros, mixed, multiply, power

Words = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]
Columns = npt.NDArray[np.int32]

# P, -1/P modulo 2^64, and 1 in Montgomery form.
Field = tuple[np.uint64, np.uint64, np.uint64]
# Rows in compressed form: starts, columns, values; those of a basis, the pivots in front: row of each column or -1.
Rows = tuple[Indices, Indices, Words]
Basis = tuple[Indices, Indices, Columns, Words]
# The multiples of basis rows that each row was reduced by: starts, rows, factors; its own factor is the last.
Uses = tuple[Indices, Columns, Words]
# A dense row, and a bit for each of its columns that may not be zero.
Dense = tuple[Words, Words]

# The state of a basis: rows, entries, recorded multiples, rows put off.
ROWS, ENTRIES, USES, LATER = 0, 1, 2, 3
# What the reduction of a row may end with, besides the column of its pivot.
_ZERO, _TOO_LONG = -1, -2


@compiled
def _less_product(value: np.uint64, a: np.uint64, b: np.uint64, field: Field) -> np.uint64:
    """value - a b."""
    product = multiply(a, b, field[0], field[1])
    return value - product if value >= product else value + (field[0] - product)


@compiled
def _mark(touched: Words, column: int) -> None:
    touched[column >> 6] |= np.uint64(1) << np.uint64(column & 63)


@compiled
def _last_marked(touched: Words, word: int) -> int:
    """The last marked column in this word of bits or before it, or -1."""
    while word >= 0:
        if touched[word] != np.uint64(0):
            return (word << 6) + 63 - leading_zeros(touched[word])
        word -= 1
    return -1


@compiled
def _unmark(touched: Words, column: int) -> None:
    touched[column >> 6] ^= np.uint64(1) << np.uint64(column & 63)


@compiled
def _add_row(row: int, rows: Rows, dense: Dense, prime: np.uint64) -> int:
    """Add a row to the dense one; its last column. A row not in Montgomery's form is taken for a multiple of one."""
    starts, columns, values = rows
    work, touched = dense
    top = -1
    for k in range(starts[row], starts[row + 1]):
        column = columns[k]
        total = work[column] + values[k]
        work[column] = total - prime if total >= prime else total
        _mark(touched, column)
        top = max(top, column)
    return top


@compiled
def _scale(row: int, factor: np.uint64, basis: Basis, uses: Uses, field: Field) -> None:
    """Multiply a basis row that is still as it was reduced."""
    _, starts, _, values = basis
    for k in range(starts[row], starts[row + 1]):
        values[k] = multiply(values[k], factor, field[0], field[1])
    uses[2][uses[0][row + 1] - 1] = factor


@compiled
def _normalise(row: int, basis: Basis, uses: Uses, field: Field) -> None:
    """Make the pivot of a basis row 1: before it is first subtracted, the others are all done at the end."""
    prime, negative_inverse, one = field
    pivot = basis[3][basis[1][row]]
    if pivot != one:
        _scale(row, power(pivot, prime - np.uint64(2), one, prime, negative_inverse), basis, uses, field)


@compiled
def _subtract_basis_row(row: int, factor: np.uint64, dense: Dense, basis: Basis, field: Field) -> None:
    _, starts, columns, values = basis
    work, touched = dense
    for k in range(starts[row], starts[row + 1]):
        work[columns[k]] = _less_product(work[columns[k]], factor, values[k], field)
        _mark(touched, columns[k])


@compiled
def _reduce(top: int, most: int, dense: Dense, basis: Basis, uses: Uses, state: Indices, field: Field) -> int:
    """Reduce the dense row as far as its pivot, with `most` multiples at most, and record these."""
    work, touched = dense
    count = state[USES]
    column = _last_marked(touched, top >> 6)
    while column >= 0:
        factor = work[column]
        if factor != np.uint64(0):
            row = basis[0][column]
            if row < 0:
                state[USES] = count
                return column
            if count - state[USES] == most:
                return _TOO_LONG
            _normalise(row, basis, uses, field)
            uses[1][count], uses[2][count] = row, factor
            count += 1
            _subtract_basis_row(row, factor, dense, basis, field)
        _unmark(touched, column)
        column = _last_marked(touched, column >> 6)
    return _ZERO


@compiled
def _store(pivot: int, dense: Dense, basis: Basis, state: Indices) -> None:
    """Move the dense row into the basis and clear it."""
    work, touched = dense
    _, _, columns, values = basis
    entries, column = state[ENTRIES], pivot
    while column >= 0:
        if work[column] != np.uint64(0):
            columns[entries], values[entries] = column, work[column]
            work[column] = np.uint64(0)
            entries += 1
        _unmark(touched, column)
        column = _last_marked(touched, column >> 6)
    state[ENTRIES] = entries


@compiled
def _has_room(top: int, basis: Basis, uses: Uses, state: Indices) -> bool:
    """Whether one row more with this last column, and the multiples used for it, fit the arrays."""
    room = state[ENTRIES] + top + 1 <= len(basis[2]) and state[USES] + top + 2 <= len(uses[1])
    return bool(room and state[ROWS] + 2 <= len(basis[1]))


@compiled
def _clear(top: int, dense: Dense) -> None:
    """Make the dense row zero."""
    work, touched = dense
    for word in range(top >> 6, -1, -1):
        if touched[word] != np.uint64(0):
            touched[word] = np.uint64(0)
            for column in range(word << 6, min((word + 1) << 6, len(work))):
                work[column] = np.uint64(0)


@compiled
def reduce_rows(
    start: int, most: int, places: Indices, later: Indices, row_starts: Indices, row_columns: Indices,
    row_values: Words, work: Words, touched: Words, pivot_of: Indices, starts: Indices, columns: Columns,
    values: Words, origin: Indices, use_starts: Indices, use_rows: Columns, use_factors: Words, state: Indices,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64,
) -> int:  # fmt: skip
    """Insert rows places[start], places[start + 1], …; stop early (returning the place) where an array is full.

    Rows that need more than `most` rows of the basis are put into `later` instead.
    """
    rows, dense, field = (row_starts, row_columns, row_values), (work, touched), (prime, negative_inverse, one)
    basis, uses = (pivot_of, starts, columns, values), (use_starts, use_rows, use_factors)
    for place in range(start, len(places)):
        top = _add_row(places[place], rows, dense, prime)
        if not _has_room(top, basis, uses, state):
            _clear(top, dense)
            return place
        pivot = _reduce(top, most, dense, basis, uses, state, field)
        if pivot == _TOO_LONG:
            _clear(top, dense)
            later[state[LATER]] = places[place]
            state[LATER] += 1
        if pivot < 0:
            continue
        _store(pivot, dense, basis, state)
        count, last = state[ROWS], state[USES]
        origin[count], pivot_of[pivot] = places[place], count
        use_rows[last], use_factors[last] = -1, one
        state[ROWS], state[USES] = count + 1, last + 1
        starts[count + 1], use_starts[count + 1] = state[ENTRIES], last + 1
    return len(places)


@compiled
def normalise_rows(
    first: int, last: int, products: Words, pivot_of: Indices, starts: Indices, columns: Columns, values: Words,
    use_starts: Indices, use_rows: Columns, use_factors: Words,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64,
) -> None:  # fmt: skip
    """As `_normalise` for rows first … last - 1, with one inversion (Montgomery's trick); `products` is scratch."""
    basis, uses = (pivot_of, starts, columns, values), (use_starts, use_rows, use_factors)
    product = one
    for row in range(first, last):
        products[row - first] = product
        product = multiply(product, values[starts[row]], prime, negative_inverse)
    inverse = power(product, prime - np.uint64(2), one, prime, negative_inverse)
    for row in range(last - 1, first - 1, -1):
        pivot = values[starts[row]]
        factor = multiply(inverse, products[row - first], prime, negative_inverse)
        inverse = multiply(inverse, pivot, prime, negative_inverse)
        if pivot != one:
            _scale(row, factor, basis, uses, (prime, negative_inverse, one))


@compiled
def solve_at_random(
    solution: Words, state: np.uint64, pivot_of: Indices, starts: Indices, columns: Columns, values: Words,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64,
) -> None:  # fmt: skip
    """A random vector on which all rows of the basis vanish; their pivots are 1. `state` seeds it."""
    field = (prime, negative_inverse, one)
    for column in range(len(solution)):
        row = pivot_of[column]
        if row < 0:
            state += GOLDEN
            solution[column] = mixed(state) % prime
            continue
        total = np.uint64(0)
        for k in range(starts[row] + 1, starts[row + 1]):
            total = _less_product(total, values[k], solution[columns[k]], field)
        solution[column] = total


@compiled
def keep_those_that_do_not_vanish(
    places: Indices, row_starts: Indices, columns: Indices, values: Words, solution: Words, kept: Indices,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64,
) -> int:  # fmt: skip
    """Put into `kept` the rows that do not vanish on the vector; their number."""
    count = 0
    for row in places:
        total = np.uint64(0)
        for k in range(row_starts[row], row_starts[row + 1]):
            total = _less_product(total, values[k], solution[columns[k]], (prime, negative_inverse, one))
        if total != np.uint64(0):
            kept[count] = row
            count += 1
    return count


@compiled
def trace_weights(
    weights: Words, use_starts: Indices, use_rows: Columns, use_factors: Words,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64,
) -> None:  # fmt: skip
    """Turn weights on basis rows into weights on original rows, last inserted first (in place)."""
    for k in range(len(weights) - 1, -1, -1):
        if weights[k] == np.uint64(0):
            continue
        last = use_starts[k + 1] - 1
        weights[k] = weight = multiply(weights[k], use_factors[last], prime, negative_inverse)
        for u in range(use_starts[k], last):
            row = use_rows[u]
            weights[row] = _less_product(weights[row], weight, use_factors[u], (prime, negative_inverse, one))


@compiled
def cut(
    numbers: Indices, first: int, basis_starts: Indices, basis_columns: Columns, basis_values: Words,
    starts: Indices, columns: Indices, values: Words,
) -> None:  # fmt: skip
    """The entries from column `first` on of those basis rows; each row ends with its smallest column."""
    entries = 0
    for row in range(len(numbers)):
        for k in range(basis_starts[numbers[row]], basis_starts[numbers[row] + 1]):
            if basis_columns[k] < first:
                break
            columns[entries], values[entries] = basis_columns[k] - first, basis_values[k]
            entries += 1
        starts[row + 1] = entries

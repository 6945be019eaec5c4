"""Kernels of the sparse echelon form modulo a prime, compiled: rows unpacked, reduced, kept, traced, tested."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.montgomery import GOLDEN, compiled, leading_zeros, mixed, multiply, power

Words = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]
Columns = npt.NDArray[np.int32]

# The state of a basis: rows, entries, recorded multiples, rows put off.
ROWS, ENTRIES, USES, LATER = 0, 1, 2, 3
# What the reduction of a row may end with, besides the column of its pivot.
_ZERO, _TOO_LONG = -1, -2


@compiled
def _minus(a: np.uint64, b: np.uint64, prime: np.uint64) -> np.uint64:
    return a - b if a >= b else a + (prime - b)


@compiled
def _mark(touched: Words, column: int) -> None:
    """Set the bit of a column; `touched` has one for each column of `work` that may not be zero."""
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
def _add_row(
    start: int, stop: int, columns: Indices, values: Words, work: Words, touched: Words, prime: np.uint64
) -> int:
    """Add a row to the dense `work`; its last column. A row not in Montgomery's form is taken for a multiple of one."""
    top = -1
    for k in range(start, stop):
        column = columns[k]
        total = work[column] + values[k]
        work[column] = total - prime if total >= prime else total
        _mark(touched, column)
        top = max(top, column)
    return top


@compiled
def _scale(
    row: int,
    factor: np.uint64,
    basis_starts: Indices,
    basis_values: Words,
    use_starts: Indices,
    use_factors: Words,
    prime: np.uint64,
    negative_inverse: np.uint64,
) -> None:
    """Multiply a basis row that is still as it was reduced."""
    for k in range(basis_starts[row], basis_starts[row + 1]):
        basis_values[k] = multiply(basis_values[k], factor, prime, negative_inverse)
    use_factors[use_starts[row + 1] - 1] = factor


@compiled
def _normalise(
    row: int,
    basis_starts: Indices,
    basis_values: Words,
    use_starts: Indices,
    use_factors: Words,
    prime: np.uint64,
    negative_inverse: np.uint64,
    one: np.uint64,
) -> None:
    """Make the pivot of a basis row 1: before it is first subtracted, the others are all done at the end."""
    pivot = basis_values[basis_starts[row]]
    if pivot != one:
        inverse = power(pivot, prime - np.uint64(2), one, prime, negative_inverse)
        _scale(row, inverse, basis_starts, basis_values, use_starts, use_factors, prime, negative_inverse)


@compiled
def _subtract_basis_row(
    used: int,
    factor: np.uint64,
    work: Words,
    touched: Words,
    basis_starts: Indices,
    basis_columns: Columns,
    basis_values: Words,
    prime: np.uint64,
    negative_inverse: np.uint64,
) -> None:
    for k in range(basis_starts[used], basis_starts[used + 1]):
        product = multiply(factor, basis_values[k], prime, negative_inverse)
        work[basis_columns[k]] = _minus(work[basis_columns[k]], product, prime)
        _mark(touched, basis_columns[k])


@compiled
def _reduce(
    top: int,
    most: int,
    work: Words,
    touched: Words,
    pivot_of: Indices,
    basis_starts: Indices,
    basis_columns: Columns,
    basis_values: Words,
    use_starts: Indices,
    use_rows: Columns,
    use_factors: Words,
    state: Indices,
    prime: np.uint64,
    negative_inverse: np.uint64,
    one: np.uint64,
) -> int:
    """Reduce `work` by the basis as far as its pivot, with `most` multiples at most, and record these."""
    uses = state[USES]
    column = _last_marked(touched, top >> 6)
    while column >= 0:
        factor = work[column]
        if factor != np.uint64(0):
            used = pivot_of[column]
            if used < 0:
                state[USES] = uses
                return column
            if uses - state[USES] == most:
                return _TOO_LONG
            _normalise(used, basis_starts, basis_values, use_starts, use_factors, prime, negative_inverse, one)
            use_rows[uses], use_factors[uses] = used, factor
            uses += 1
            _subtract_basis_row(
                used, factor, work, touched, basis_starts, basis_columns, basis_values, prime, negative_inverse
            )
        _unmark(touched, column)
        column = _last_marked(touched, column >> 6)
    return _ZERO


@compiled
def _store(
    pivot: int, work: Words, touched: Words, basis_columns: Columns, basis_values: Words, state: Indices
) -> None:
    """Move `work` into the basis and clear it."""
    entries, column = state[ENTRIES], pivot
    while column >= 0:
        if work[column] != np.uint64(0):
            basis_columns[entries] = column
            basis_values[entries] = work[column]
            work[column] = np.uint64(0)
            entries += 1
        _unmark(touched, column)
        column = _last_marked(touched, column >> 6)
    state[ENTRIES] = entries


@compiled
def _has_room(top: int, basis_starts: Indices, basis_columns: Columns, use_rows: Columns, state: Indices) -> bool:
    """Whether one row more with this last column, and the multiples used for it, fit the arrays."""
    room = state[ENTRIES] + top + 1 <= len(basis_columns) and state[USES] + top + 2 <= len(use_rows)
    return bool(room and state[ROWS] + 2 <= len(basis_starts))


@compiled
def _clear(top: int, work: Words, touched: Words) -> None:
    """Make `work` zero."""
    for word in range(top >> 6, -1, -1):
        if touched[word] != np.uint64(0):
            touched[word] = np.uint64(0)
            for column in range(word << 6, min((word + 1) << 6, len(work))):
                work[column] = np.uint64(0)


@compiled
def reduce_rows(
    start: int,
    most: int,
    rows: Indices,
    later: Indices,
    row_starts: Indices,
    columns: Indices,
    values: Words,
    work: Words,
    touched: Words,
    pivot_of: Indices,
    basis_starts: Indices,
    basis_columns: Columns,
    basis_values: Words,
    origin: Indices,
    use_starts: Indices,
    use_rows: Columns,
    use_factors: Words,
    state: Indices,
    prime: np.uint64,
    negative_inverse: np.uint64,
    one: np.uint64,
) -> int:
    """Insert rows[start], rows[start + 1], …; stop early (returning the place) where an array is full.

    Rows that need more than `most` rows of the basis are put into `later` instead.
    """
    for place in range(start, len(rows)):
        row = rows[place]
        first, last = row_starts[row], row_starts[row + 1]
        top = _add_row(first, last, columns, values, work, touched, prime)
        if not _has_room(top, basis_starts, basis_columns, use_rows, state):
            _clear(top, work, touched)
            return place
        pivot = _reduce(
            top,
            most,
            work,
            touched,
            pivot_of,
            basis_starts,
            basis_columns,
            basis_values,
            use_starts,
            use_rows,
            use_factors,
            state,
            prime,
            negative_inverse,
            one,
        )
        if pivot == _TOO_LONG:
            _clear(top, work, touched)
            later[state[LATER]] = row
            state[LATER] += 1
        if pivot < 0:
            continue
        _store(pivot, work, touched, basis_columns, basis_values, state)
        count, uses = state[ROWS], state[USES]
        origin[count], pivot_of[pivot] = row, count
        use_rows[uses], use_factors[uses] = -1, one
        state[ROWS], state[USES] = count + 1, uses + 1
        basis_starts[count + 1], use_starts[count + 1] = state[ENTRIES], uses + 1
    return len(rows)


@compiled
def normalise_rows(
    first: int,
    last: int,
    products: Words,
    basis_starts: Indices,
    basis_values: Words,
    use_starts: Indices,
    use_factors: Words,
    prime: np.uint64,
    negative_inverse: np.uint64,
    one: np.uint64,
) -> None:
    """As `_normalise` for rows first … last - 1, with one inversion (Montgomery's trick); `products` is scratch."""
    product = one
    for row in range(first, last):
        products[row - first] = product
        product = multiply(product, basis_values[basis_starts[row]], prime, negative_inverse)
    inverse = power(product, prime - np.uint64(2), one, prime, negative_inverse)
    for row in range(last - 1, first - 1, -1):
        pivot = basis_values[basis_starts[row]]
        factor = multiply(inverse, products[row - first], prime, negative_inverse)
        inverse = multiply(inverse, pivot, prime, negative_inverse)
        if pivot != one:
            _scale(row, factor, basis_starts, basis_values, use_starts, use_factors, prime, negative_inverse)


@compiled
def solve_at_random(
    solution: Words,
    state: np.uint64,
    pivot_of: Indices,
    basis_starts: Indices,
    basis_columns: Columns,
    basis_values: Words,
    prime: np.uint64,
    negative_inverse: np.uint64,
) -> None:
    """A random vector on which all rows of the basis vanish; their pivots are 1. `state` seeds it."""
    for column in range(len(solution)):
        row = pivot_of[column]
        if row < 0:
            state += GOLDEN
            solution[column] = mixed(state) % prime
            continue
        total = np.uint64(0)
        for k in range(basis_starts[row] + 1, basis_starts[row + 1]):
            product = multiply(basis_values[k], solution[basis_columns[k]], prime, negative_inverse)
            total = _minus(total, product, prime)
        solution[column] = total


@compiled
def keep_those_that_do_not_vanish(
    rows: Indices,
    row_starts: Indices,
    columns: Indices,
    values: Words,
    solution: Words,
    kept: Indices,
    prime: np.uint64,
    negative_inverse: np.uint64,
) -> int:
    """Put into `kept` the rows that do not vanish on the vector; their number."""
    count = 0
    for row in rows:
        total = np.uint64(0)
        for k in range(row_starts[row], row_starts[row + 1]):
            product = multiply(values[k], solution[columns[k]], prime, negative_inverse)
            total = _minus(total, product, prime)
        if total != np.uint64(0):
            kept[count] = row
            count += 1
    return count


@compiled
def trace_weights(
    weights: Words,
    use_starts: Indices,
    use_rows: Columns,
    use_factors: Words,
    prime: np.uint64,
    negative_inverse: np.uint64,
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
    numbers: Indices,
    first: int,
    basis_starts: Indices,
    basis_columns: Columns,
    basis_values: Words,
    starts: Indices,
    columns: Indices,
    values: Words,
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

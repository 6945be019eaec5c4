"""Kernels of the sparse echelon form modulo a prime, compiled: rows unpacked, reduced, kept, traced, tested."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from inverse_service.field.modular import GOLDEN, Field, compiled, leading_zeros, minus, mixed, multiply, plus, power

Words = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]
Columns = npt.NDArray[np.int32]
Marks = npt.NDArray[np.int8]


class SparseRows(NamedTuple):
    """Rows in compressed form: the entries of row k are those from starts[k] to starts[k + 1]."""

    starts: Indices
    columns: Indices
    values: Words


class Basis(NamedTuple):
    """The rows of an echelon form, their largest column first, and the row whose pivot a column is, or -1."""

    pivot_of: Indices
    starts: Indices
    columns: Columns
    values: Words


class Uses(NamedTuple):
    """The multiples of basis rows that each row was reduced by; its own factor is the last."""

    starts: Indices
    rows: Columns
    factors: Words


class Dense(NamedTuple):
    """A dense row, and a bit for each of its columns that may not be zero."""

    values: Words
    touched: Words


class Growing(NamedTuple):
    """What rows are inserted into: the basis, the number of the given row that each row comes from, what was used.

    `state` counts: see ROWS. `dense` is the row in work, zero between calls, `solution` a vector for tests.
    """

    basis: Basis
    origin: Indices
    uses: Uses
    state: Indices
    dense: Dense
    solution: Words


# The state of a basis: rows, entries, recorded multiples, rows whose pivot is 1.
ROWS, ENTRIES, USES, NORMAL = 0, 1, 2, 3
# What became of a row so far; flags say 1 of those that should depend on all others. PUT_OFF: needs too many rows.
WAITING, EXPECTED, PUT_OFF, DEPENDENT, KEPT, _NO_ROOM = 0, 1, 2, 3, 4, 5
# How many of these are inserted before the rest are tested again.
_FEW = 4
# What the reduction of a row may end with, besides the column of its pivot.
_ZERO, _TOO_LONG = -1, -2
# The prime is random itself, and so are numbers that come from it.
_SEED = np.uint64(0x2545F4914F6CDD1D)


@compiled
def _less_product(value: np.uint64, a: np.uint64, b: np.uint64, field: Field) -> np.uint64:
    """value - a b."""
    return minus(value, multiply(a, b, field), field)


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
def _add_row(row: int, rows: SparseRows, dense: Dense, field: Field) -> int:
    """Add a row to the dense one; its last column. A row not in Montgomery's form is taken for a multiple of one."""
    top = -1
    for k in range(rows.starts[row], rows.starts[row + 1]):
        column = rows.columns[k]
        dense.values[column] = plus(dense.values[column], rows.values[k], field)
        _mark(dense.touched, column)
        top = max(top, column)
    return top


@compiled
def _scale(row: int, factor: np.uint64, basis: Basis, uses: Uses, field: Field) -> None:
    """Multiply a basis row that is still as it was reduced."""
    for k in range(basis.starts[row], basis.starts[row + 1]):
        basis.values[k] = multiply(basis.values[k], factor, field)
    uses.factors[uses.starts[row + 1] - 1] = factor


@compiled
def _normalise(row: int, basis: Basis, uses: Uses, field: Field) -> None:
    """Make the pivot of a basis row 1: before it is first subtracted, the others are all done at the end."""
    pivot = basis.values[basis.starts[row]]
    if pivot != field.one:
        _scale(row, power(pivot, field.prime - np.uint64(2), field), basis, uses, field)


@compiled
def _subtract_basis_row(row: int, factor: np.uint64, dense: Dense, basis: Basis, field: Field) -> None:
    for k in range(basis.starts[row], basis.starts[row + 1]):
        column = basis.columns[k]
        dense.values[column] = _less_product(dense.values[column], factor, basis.values[k], field)
        _mark(dense.touched, column)


@compiled
def _reduce(top: int, most: int, form: Growing, field: Field) -> int:
    """Reduce the dense row as far as its pivot, with `most` multiples at most, and record these."""
    basis, uses, state, dense = form.basis, form.uses, form.state, form.dense
    count = state[USES]
    column = _last_marked(dense.touched, top >> 6)
    while column >= 0:
        factor = dense.values[column]
        if factor != np.uint64(0):
            row = basis.pivot_of[column]
            if row < 0:
                state[USES] = count
                return column
            if count - state[USES] == most:
                return _TOO_LONG
            _normalise(row, basis, uses, field)
            uses.rows[count], uses.factors[count] = row, factor
            count += 1
            _subtract_basis_row(row, factor, dense, basis, field)
        _unmark(dense.touched, column)
        column = _last_marked(dense.touched, column >> 6)
    return _ZERO


@compiled
def _store(pivot: int, dense: Dense, basis: Basis, state: Indices) -> None:
    """Move the dense row into the basis and clear it."""
    entries, column = state[ENTRIES], pivot
    while column >= 0:
        if dense.values[column] != np.uint64(0):
            basis.columns[entries], basis.values[entries] = column, dense.values[column]
            dense.values[column] = np.uint64(0)
            entries += 1
        _unmark(dense.touched, column)
        column = _last_marked(dense.touched, column >> 6)
    state[ENTRIES] = entries


@compiled
def _has_room(top: int, form: Growing) -> bool:
    """Whether one row more with this last column, and the multiples used for it, fit the arrays."""
    state = form.state
    room = state[ENTRIES] + top + 1 <= len(form.basis.columns) and state[USES] + top + 2 <= len(form.uses.rows)
    return bool(room and state[ROWS] + 2 <= len(form.basis.starts))


@compiled
def _clear(top: int, dense: Dense) -> None:
    """Make the dense row zero."""
    for word in range(top >> 6, -1, -1):
        if dense.touched[word] != np.uint64(0):
            dense.touched[word] = np.uint64(0)
            for column in range(word << 6, min((word + 1) << 6, len(dense.values))):
                dense.values[column] = np.uint64(0)


@compiled
def _insert_row(row: int, number: int, most: int, rows: SparseRows, form: Growing, field: Field) -> int:
    """Insert a row, `number` of all given ones, where `most` rows of the basis suffice; what became of it."""
    basis, uses, state, dense = form.basis, form.uses, form.state, form.dense
    top = _add_row(row, rows, dense, field)
    if not _has_room(top, form):
        _clear(top, dense)
        return _NO_ROOM
    pivot = _reduce(top, most, form, field)
    if pivot == _TOO_LONG:
        _clear(top, dense)
        return PUT_OFF
    if pivot == _ZERO:
        return DEPENDENT
    _store(pivot, dense, basis, state)
    count, last = state[ROWS], state[USES]
    form.origin[count], basis.pivot_of[pivot] = number, count
    uses.rows[last], uses.factors[last] = -1, field.one
    state[ROWS], state[USES] = count + 1, last + 1
    basis.starts[count + 1], uses.starts[count + 1] = state[ENTRIES], last + 1
    return KEPT


@compiled
def _insert_marked(
    mark: int, some: int, first: int, most: int, marks: Marks, rows: SparseRows, form: Growing, field: Field
) -> bool:
    """Insert `some` rows of this mark in order; False where an array is full."""
    for row in range(len(marks)):
        if marks[row] == mark and some > 0:
            became = _insert_row(row, first + row, most, rows, form, field)
            if became == _NO_ROOM:
                return False
            marks[row] = became
            some -= 1
    _normalise_rows(form.state[NORMAL], form.state[ROWS], form, field)
    form.state[NORMAL] = form.state[ROWS]
    return True


@compiled
def insert_rows(first: int, most: int, width: int, marks: Marks, rows: SparseRows, form: Growing, field: Field) -> bool:
    """Insert all rows and mark what became of each; False where an array is full: to be called again with longer ones.

    Those that need more than `most` rows of the basis come after all others, then those that are EXPECTED to depend;
    both are tested first, some inserted, then the rest tested again.
    """
    if not _insert_marked(WAITING, len(marks), first, most, marks, rows, form, field):
        return False
    for mark in (PUT_OFF, EXPECTED):
        some = _FEW
        while _some_independent(mark, first, width, marks, rows, form, field):
            before = form.state[ROWS]
            if not _insert_marked(mark, some, first, width, marks, rows, form, field):
                return False
            if form.state[ROWS] - before == some:
                some *= 2
    return True


@compiled
def _normalise_rows(first: int, last: int, form: Growing, field: Field) -> None:
    """As `_normalise` for rows first … last - 1, with one inversion (Montgomery's trick)."""
    basis, products, product = form.basis, form.dense.values, field.one
    for row in range(first, last):
        products[row - first] = product
        product = multiply(product, basis.values[basis.starts[row]], field)
    inverse = power(product, field.prime - np.uint64(2), field)
    for row in range(last - 1, first - 1, -1):
        pivot = basis.values[basis.starts[row]]
        factor = multiply(inverse, products[row - first], field)
        products[row - first] = np.uint64(0)
        inverse = multiply(inverse, pivot, field)
        if pivot != field.one:
            _scale(row, factor, basis, form.uses, field)


@compiled
def solve_at_random(number: int, width: int, form: Growing, field: Field) -> None:
    """The `number`-th random vector on which all rows of the basis vanish; their pivots are 1."""
    basis, solution, state = form.basis, form.solution, field.prime * _SEED + np.uint64(number)
    for column in range(width):
        row = basis.pivot_of[column]
        if row < 0:
            state += GOLDEN
            solution[column] = mixed(state) % field.prime
            continue
        total = np.uint64(0)
        for k in range(basis.starts[row] + 1, basis.starts[row + 1]):
            total = _less_product(total, basis.values[k], solution[basis.columns[k]], field)
        solution[column] = total


@compiled
def _some_independent(
    mark: int, first: int, width: int, marks: Marks, rows: SparseRows, form: Growing, field: Field
) -> bool:
    """Whether there are rows of this mark; those that vanish on a random vector on which the basis does, are not."""
    found, tested = False, False
    for row in range(len(marks)):
        if marks[row] != mark:
            continue
        if not tested:
            solve_at_random(first, width, form, field)
            tested = True
        total = np.uint64(0)
        for k in range(rows.starts[row], rows.starts[row + 1]):
            total = _less_product(total, rows.values[k], form.solution[rows.columns[k]], field)
        if total == np.uint64(0):
            marks[row] = DEPENDENT
        else:
            found = True
    return found


@compiled
def trace_weights(weights: Words, form: Growing, field: Field) -> None:
    """Turn weights on basis rows into weights on original rows, last inserted first (in place)."""
    uses = form.uses
    for k in range(len(weights) - 1, -1, -1):
        if weights[k] == np.uint64(0):
            continue
        last = uses.starts[k + 1] - 1
        weights[k] = weight = multiply(weights[k], uses.factors[last], field)
        for u in range(uses.starts[k], last):
            row = uses.rows[u]
            weights[row] = _less_product(weights[row], weight, uses.factors[u], field)


@compiled
def cut(numbers: Indices, first: int, form: Growing, found: SparseRows) -> None:
    """The entries from column `first` on of those basis rows; each row ends with its smallest column."""
    basis, entries = form.basis, 0
    for row in range(len(numbers)):
        for k in range(basis.starts[numbers[row]], basis.starts[numbers[row] + 1]):
            if basis.columns[k] < first:
                break
            found.columns[entries], found.values[entries] = basis.columns[k] - first, basis.values[k]
            entries += 1
        found.starts[row + 1] = entries

"""A sparse echelon form modulo a prime, built row by row with compiled kernels.

The pivot of a row is its last nonzero column, so with columns in ascending degree, the rows with
pivots in the first k columns are all consequences on those columns. Each new row is reduced by the
previous rows until its pivot is known (full reduction costs two to three times as much and saves
nothing later). The multiples used are recorded, so that each consequence can be traced to the
original rows.

Dependent rows cost most and give nothing. Rows that are expected to be dependent, and rows that
need many rows of the basis, are not reduced but tested on a random vector on which the basis
vanishes. An independent row vanishes there with probability 1/P only (Freivalds 1977); rows that do
not vanish are inserted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar, cast

import numpy as np
import numpy.typing as npt

from inverse_service.field import modular
from inverse_service.field.modular import (
    GOLDEN,
    Field,
    compiled,
    leading_zeros,
    minus,
    mixed,
    montgomery_power,
    multiply,
    plus,
)
from inverse_service.kernels.machine_code.argument_kinds import Kept

Words = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]
Columns = npt.NDArray[np.int32]
Marks = npt.NDArray[np.int8]
# The state of a basis: rows, entries, recorded multiples, rows whose pivot is 1.
ROWS, ENTRIES, USES, NORMAL = 0, 1, 2, 3
# The status of a row; flags are 1 for rows that should depend on all others. PUT_OFF: needs too
# many rows.
WAITING, EXPECTED, PUT_OFF, DEPENDENT, KEPT, _NO_ROOM = 0, 1, 2, 3, 4, 5
# The number of postponed rows inserted before the remaining ones are tested again.
_FEW = 4
# Results of the reduction of a row other than the column of its pivot.
_ZERO, _TOO_LONG = -1, -2
# The prime is random, and so are numbers derived from it.
_SEED = np.uint64(0x2545F4914F6CDD1D)

Flags = npt.NDArray[np.bool_]
# A row that needs more rows of the basis than this usually depends on it, so it is reduced last.
MOST = 96
# The room at the beginning.
_ROWS, _ENTRIES = 512, 16_384
Kind = TypeVar("Kind", bound=np.generic)
# Storage of deleted forms for reuse, because allocating it takes as long as inserting many rows.
_free: list[Kept[Growing]] = []
_MOST_FREE = 4


class SparseRows(NamedTuple):
    """Rows in compressed form: the entries of row k are at starts[k] to starts[k + 1]."""

    starts: Indices
    columns: Indices
    values: Words


class Basis(NamedTuple):
    """The rows of an echelon form, largest column first, and for each column the row with that
    pivot, or -1.
    """

    pivot_of: Indices
    starts: Indices
    columns: Columns
    values: Words


class Uses(NamedTuple):
    """The multiples of basis rows by which each row was reduced; the row's own factor is last."""

    starts: Indices
    rows: Columns
    factors: Words


class Dense(NamedTuple):
    """A dense row, with a bit for each column that may be nonzero."""

    values: Words
    touched: Words


class Growing(NamedTuple):
    """The form under construction: the basis, the number of the given row of each basis row, and
    the multiples used.

    `state` holds counts (see ROWS). `dense` is the current row, zero between calls; `solution` is a
    vector for tests.
    """

    basis: Basis
    origin: Indices
    uses: Uses
    state: Indices
    dense: Dense
    solution: Words


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
    """Add a row to the dense row; return its last column.

    A row not in Montgomery form counts as a multiple of one that is.
    """
    top = -1
    for k in range(rows.starts[row], rows.starts[row + 1]):
        column = rows.columns[k]
        dense.values[column] = plus(dense.values[column], rows.values[k], field)
        _mark(dense.touched, column)
        top = max(top, column)
    return top


@compiled
def _scale(row: int, factor: np.uint64, basis: Basis, uses: Uses, field: Field) -> None:
    """Multiply a basis row that is not yet normalized."""
    for k in range(basis.starts[row], basis.starts[row + 1]):
        basis.values[k] = multiply(basis.values[k], factor, field)
    uses.factors[uses.starts[row + 1] - 1] = factor


@compiled
def _normalise(row: int, basis: Basis, uses: Uses, field: Field) -> None:
    """Make the pivot of a basis row 1, either before the row is first subtracted or, for the
    others, at the end.
    """
    pivot = basis.values[basis.starts[row]]
    if pivot != field.one:
        _scale(row, montgomery_power(pivot, field.prime - np.uint64(2), field), basis, uses, field)


@compiled
def _subtract_basis_row(
    row: int, factor: np.uint64, dense: Dense, basis: Basis, field: Field
) -> None:
    for k in range(basis.starts[row], basis.starts[row + 1]):
        column = basis.columns[k]
        dense.values[column] = _less_product(dense.values[column], factor, basis.values[k], field)
        _mark(dense.touched, column)


@compiled
def _reduce(top: int, most: int, form: Growing, field: Field) -> int:
    """Reduce the dense row up to its pivot with at most `most` multiples, and record these."""
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
    """Whether another row with this last column, and its multiples, fit into the arrays."""
    state = form.state
    room = state[ENTRIES] + top + 1 <= len(form.basis.columns) and state[USES] + top + 2 <= len(
        form.uses.rows
    )
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
def _insert_row(
    row: int, number: int, most: int, rows: SparseRows, form: Growing, field: Field
) -> int:
    """Insert row `number` of all given rows if at most `most` rows of the basis are needed; return
    its status.
    """
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
    mark: int,
    some: int,
    first: int,
    most: int,
    marks: Marks,
    rows: SparseRows,
    form: Growing,
    field: Field,
) -> bool:
    """Insert up to `some` rows with this mark in order; False if an array is full."""
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
def insert_rows(
    first: int, most: int, width: int, marks: Marks, rows: SparseRows, form: Growing, field: Field
) -> bool:
    """Insert all rows and mark the status of each; False if an array is full: call again with
    longer arrays.

    Rows that need more than `most` rows of the basis come after all others, and rows EXPECTED to be
    dependent come last. Both are tested first; some are inserted, and the remaining ones are tested
    again.
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
    """`_normalise` for rows first … last - 1 with a single inversion (Montgomery's trick)."""
    basis, products, product = form.basis, form.dense.values, field.one
    for row in range(first, last):
        products[row - first] = product
        product = multiply(product, basis.values[basis.starts[row]], field)
    inverse = montgomery_power(product, field.prime - np.uint64(2), field)
    for row in range(last - 1, first - 1, -1):
        pivot = basis.values[basis.starts[row]]
        factor = multiply(inverse, products[row - first], field)
        products[row - first] = np.uint64(0)
        inverse = multiply(inverse, pivot, field)
        if pivot != field.one:
            _scale(row, factor, basis, form.uses, field)


@compiled
def solve_at_random(number: int, width: int, form: Growing, field: Field) -> None:
    """Compute the `number`-th random vector on which all rows of the basis, with pivots 1,
    vanish.
    """
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
    """Mark rows that vanish on a random vector of the basis's kernel as dependent; whether others
    remain.
    """
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
    """Convert weights on basis rows into weights on original rows, last inserted first, in
    place.
    """
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
    """The entries of these basis rows from column `first` on; each row ends with its smallest
    column.
    """
    basis, entries = form.basis, 0
    for row in range(len(numbers)):
        for k in range(basis.starts[numbers[row]], basis.starts[numbers[row] + 1]):
            if basis.columns[k] < first:
                break
            found.columns[entries], found.values[entries] = (
                basis.columns[k] - first,
                basis.values[k],
            )
            entries += 1
        found.starts[row + 1] = entries


@dataclass(slots=True)
class Echelon:
    """An echelon basis of rows over `width` columns; `width` may grow (new columns come last)."""

    prime: int
    width: int = 0
    count: int = 0
    inserted: int = 0
    kept: Kept[Growing] = field(default_factory=lambda: _room())

    def __del__(self) -> None:
        if len(_free) < _MOST_FREE and len(self.form.basis.columns) <= _ENTRIES:
            _free.append(self.kept)

    @property
    def form(self) -> Growing:
        return self.kept.struct

    @property
    def _field(self) -> modular.Field:
        return modular.field_of(self.prime)

    def widen(self, width: int) -> None:
        """Append columns."""
        self.width, before = width, self.form.basis.pivot_of
        if width <= len(before):
            return
        room = max(width, 2 * len(before))
        pivots, dense, solution = _of_columns(room)
        pivots[: len(before)] = before
        basis = self.form.basis._replace(pivot_of=pivots)
        self.kept = Kept(self.form._replace(basis=basis, dense=dense, solution=solution))

    def insert(
        self,
        rows: SparseRows,
        expected: Flags | None = None,
        most: int | None = None,
    ) -> Flags:
        """Insert rows; entries of a row in the same column are added.

        `expected` marks rows that should depend on all others, which is then tested at once, as it
        is for rows that need more than `most` rows of the basis; None: none need too many. The
        result marks the dependent rows. The marks do not change how many rows are inserted.
        """
        marks = (
            np.zeros(len(rows.starts) - 1, np.int8)
            if expected is None
            else expected.astype(np.int8)
        )
        total, most = len(marks), self.width if most is None else most
        while not insert_rows(self.inserted, most, self.width, marks, rows, self.form, self._field):
            self._grow()
        self.count, self.inserted = int(self.form.state[ROWS]), self.inserted + total
        return np.equal(marks, DEPENDENT)

    def _grow(self) -> None:
        """Extend the arrays that may lack room for another row."""
        (pivots, starts, columns, values), origin, (use_starts, use_rows, factors), state, _, _ = (
            self.form
        )
        rows, entries, uses = (
            state[ROWS] + 2,
            state[ENTRIES] + self.width + 1,
            state[USES] + self.width + 1,
        )
        basis = Basis(
            pivots, _longer(starts, rows), _longer(columns, entries), _longer(values, entries)
        )
        used = Uses(_longer(use_starts, rows), _longer(use_rows, uses), _longer(factors, uses))
        self.kept = Kept(self.form._replace(basis=basis, origin=_longer(origin, rows), uses=used))

    def ranks_within(self, widths: Sequence[int]) -> list[int]:
        """The number of independent consequences on the first columns, for each of the ascending
        widths.
        """
        pivots = (self.form.basis.pivot_of[: widths[-1]] >= 0).nonzero()[0]
        return cast(list[int], pivots.searchsorted(widths).tolist())

    def random_solution(self, number: int, width: int) -> list[int]:
        """The first entries of the `number`-th random vector on which all rows vanish; free entries
        are random.
        """
        solve_at_random(number, width, self.form, self._field)
        return cast(list[int], self.form.solution[:width].tolist())

    def rows_within(self, first: int, width: int) -> dict[int, dict[int, int]]:
        """{basis row: {column: value}} for rows with pivots in columns first … width - 1."""
        numbers = [int(k) for k in self.form.basis.pivot_of[first:width] if k >= 0]
        return {number: self._row(number) for number in numbers}

    def cut_rows(self, first: int, width: int) -> SparseRows:
        """The rows with pivots in columns first … width - 1, restricted to these columns, in
        Montgomery form.
        """
        basis = self.form.basis
        numbers = basis.pivot_of[first:width]
        numbers = numbers[numbers >= 0]
        starts = np.zeros(len(numbers) + 1, np.int64)
        room = int((basis.starts[numbers + 1] - basis.starts[numbers]).sum())
        columns, values = np.empty(room, np.int64), np.empty(room, np.uint64)
        cut(numbers, first, self.form, SparseRows(starts, columns, values))
        return SparseRows(starts, columns[: starts[-1]], values[: starts[-1]])

    def _row(self, number: int) -> dict[int, int]:
        _, starts, columns, values = self.form.basis
        part = slice(int(starts[number]), int(starts[number + 1]))
        inverse = pow(1 << 64, -1, self.prime)
        return {
            int(c): int(v) * inverse % self.prime
            for c, v in zip(columns[part], values[part], strict=True)
        }

    def trace(self, weights: Mapping[int, int]) -> list[int]:
        """The original rows that occur in a combination of basis rows, in order of insertion."""
        vector = np.zeros(self.count, np.uint64)
        for number, weight in weights.items():
            vector[number] = weight % self.prime
        trace_weights(vector, self.form, self._field)
        return [int(self.form.origin[k]) for k in np.flatnonzero(vector)]


def _room() -> Kept[Growing]:
    """The emptied storage of a deleted form, or new storage."""
    try:
        kept = _free.pop()
    except IndexError:
        return Kept(_without_rows())
    kept.struct.basis.pivot_of.fill(-1)
    kept.struct.state.fill(0)
    return kept


def _without_rows() -> Growing:
    pivots, dense, solution = _of_columns(_ROWS)
    columns, rows = np.empty((2, _ENTRIES), np.int32)
    values, factors = np.empty((2, _ENTRIES), np.uint64)
    basis = Basis(pivots, np.zeros(_ROWS, np.int64), columns, values)
    uses = Uses(np.zeros(_ROWS, np.int64), rows, factors)
    return Growing(basis, np.empty(_ROWS, np.int64), uses, np.zeros(4, np.int64), dense, solution)


def _of_columns(room: int) -> tuple[Indices, Dense, Words]:
    """Arrays by column: pivots (none), the current row, and the vector for tests."""
    dense = Dense(np.zeros(room, np.uint64), np.zeros((room >> 6) + 1, np.uint64))
    return np.full(room, -1, np.int64), dense, np.empty(room, np.uint64)


def _longer(array: npt.NDArray[Kind], needed: int) -> npt.NDArray[Kind]:
    """The array, doubled until it has room for `needed` elements."""
    length = len(array)
    while length < needed:
        length *= 2
    if length == len(array):
        return array
    longer = np.empty(length, array.dtype)
    longer[: len(array)] = array
    return longer

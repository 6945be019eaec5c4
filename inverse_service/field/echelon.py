"""Sparse echelon form modulo a prime, grown row by row.

The pivot of a row is its last nonzero column, so with columns in ascending degree the rows whose
pivot lies in the first k columns are all consequences on those columns. Each new row is reduced by the
rows before it until its pivot stands (to reduce it further costs two to three times as much and spares
nothing later on) and the multiples used are recorded, so that each consequence can be traced to the
original rows.

Rows that depend on the others cost most and give nothing. Those that are expected to, and those that
need many rows of the basis, are not reduced: they are tested on a random vector on which the basis vanishes.
A row that does not depend on the basis vanishes there with probability 1/P (Freivalds 1977), and is inserted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar, cast

import numpy as np
import numpy.typing as npt

from inverse_service.field import modular
from inverse_service.field.echelon_kernels import (
    DEPENDENT,
    ENTRIES,
    ROWS,
    USES,
    Basis,
    Dense,
    Growing,
    Indices,
    SparseRows,
    Uses,
    Words,
    cut,
    insert_rows,
    solve_at_random,
    trace_weights,
)
from inverse_service.kernels.machine_code.kernels import Kept

Flags = npt.NDArray[np.bool_]
# A row that needs more rows of the basis than this mostly depends on it, and is put off until all others stand.
MOST = 96
# The room at the beginning.
_ROWS, _ENTRIES = 512, 16_384
Kind = TypeVar("Kind", bound=np.generic)


@dataclass(slots=True)
class Echelon:
    """An echelon basis of rows over `width` columns; `width` may grow (new columns are last)."""

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
        in_order: bool = True,
    ) -> Flags:
        """Insert rows; entries of equal column in a row are added up.

        `expected` marks rows that should depend on all others, which is then tested at once; no more are inserted
        than it marks or not. The answer marks those that do.
        """
        marks = np.zeros(len(rows.starts) - 1, np.int8) if expected is None else expected.astype(np.int8)
        total, most = len(marks), self.width if in_order else MOST
        while not insert_rows(self.inserted, most, self.width, marks, rows, self.form, self._field):
            self._grow()
        self.count, self.inserted = int(self.form.state[ROWS]), self.inserted + total
        return np.equal(marks, DEPENDENT)

    def _grow(self) -> None:
        """Make longer those arrays in which one row more might not have room."""
        (pivots, starts, columns, values), origin, (use_starts, use_rows, factors), state, _, _ = self.form
        rows, entries, uses = state[ROWS] + 2, state[ENTRIES] + self.width + 1, state[USES] + self.width + 1
        basis = Basis(pivots, _longer(starts, rows), _longer(columns, entries), _longer(values, entries))
        used = Uses(_longer(use_starts, rows), _longer(use_rows, uses), _longer(factors, uses))
        self.kept = Kept(self.form._replace(basis=basis, origin=_longer(origin, rows), uses=used))

    def ranks_within(self, widths: Sequence[int]) -> list[int]:
        """The numbers of independent consequences on the first columns, for ascending widths."""
        pivots = (self.form.basis.pivot_of[: widths[-1]] >= 0).nonzero()[0]
        return cast(list[int], pivots.searchsorted(widths).tolist())

    def random_solution(self, number: int, width: int) -> list[int]:
        """The first entries of the `number`-th random vector on which all rows vanish; what is unknown is random."""
        solve_at_random(number, width, self.form, self._field)
        return cast(list[int], self.form.solution[:width].tolist())

    def rows_within(self, first: int, width: int) -> dict[int, dict[int, int]]:
        """{basis row: {column: value}} for rows whose pivot is in columns first … width - 1."""
        numbers = [int(k) for k in self.form.basis.pivot_of[first:width] if k >= 0]
        return {number: self._row(number) for number in numbers}

    def cut_rows(self, first: int, width: int) -> SparseRows:
        """The rows whose pivot is in columns first … width - 1, cut to these columns, each in Montgomery form."""
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
        return {int(c): int(v) * inverse % self.prime for c, v in zip(columns[part], values[part], strict=True)}

    def trace(self, weights: Mapping[int, int]) -> list[int]:
        """The original rows of which a combination of basis rows is made, in order of insertion."""
        vector = np.zeros(self.count, np.uint64)
        for number, weight in weights.items():
            vector[number] = weight % self.prime
        trace_weights(vector, self.form, self._field)
        return [int(self.form.origin[k]) for k in np.flatnonzero(vector)]


# Of forms that are gone, for the next ones: to make it takes as long as to insert many rows.
_free: list[Kept[Growing]] = []
_MOST_FREE = 4


def _room() -> Kept[Growing]:
    """That of a form that is gone, emptied, or new."""
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
    """What has a place for each column: no pivots, the row in work, the vector for tests."""
    dense = Dense(np.zeros(room, np.uint64), np.zeros((room >> 6) + 1, np.uint64))
    return np.full(room, -1, np.int64), dense, np.empty(room, np.uint64)


def _longer(array: npt.NDArray[Kind], needed: int) -> npt.NDArray[Kind]:
    """The array with room for so many elements: doubled until it has."""
    length = len(array)
    while length < needed:
        length *= 2
    if length == len(array):
        return array
    longer = np.empty(length, array.dtype)
    longer[: len(array)] = array
    return longer

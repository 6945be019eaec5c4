"""Sparse echelon form modulo a prime, grown row by row.

The pivot of a row is its last nonzero column, so with columns in ascending degree the rows whose
pivot lies in the first k columns are all consequences on those columns. Each new row is reduced by the
rows before it until its pivot stands (to reduce it further costs two to three times as much and spares
nothing later on) and the multiples used are recorded, so that each consequence can be traced to the
original rows.

SparseRows that depend on the others cost most and give nothing. Those that are expected to, and those that
need many rows of the basis, are not reduced: they are tested on a random vector on which the basis vanishes.
A row that does not depend on the basis vanishes there with probability 1/P (Freivalds 1977), and is inserted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from inverse_service.algebra import modular
from inverse_service.algebra.echelon_kernels import (
    ENTRIES,
    LATER,
    ROWS,
    USES,
    Basis,
    Columns,
    Dense,
    Growing,
    Indices,
    SparseRows,
    Uses,
    Words,
    cut,
    keep_those_that_do_not_vanish,
    normalise_rows,
    reduce_rows,
    solve_at_random,
    trace_weights,
)

Flags = npt.NDArray[np.bool_]
# A row that needs more rows of the basis than this mostly depends on it, and is put off until all others stand.
MOST = 96
# How many rows are inserted before the rest are tested again.
FEW = 4
Kind = TypeVar("Kind", bound=np.generic)


@dataclass(slots=True)
class Echelon:
    """An echelon basis of rows over `width` columns; `width` may grow (new columns are last)."""

    prime: int
    width: int = 0
    count: int = 0
    inserted: int = 0
    pivot_of: Indices = field(default_factory=lambda: np.empty(0, np.int64))
    starts: Indices = field(default_factory=lambda: np.zeros(512, np.int64))
    columns: Columns = field(default_factory=lambda: np.empty(16_384, np.int32))
    values: Words = field(default_factory=lambda: np.empty(16_384, np.uint64))
    origin: Indices = field(default_factory=lambda: np.empty(512, np.int64))
    use_starts: Indices = field(default_factory=lambda: np.zeros(512, np.int64))
    use_rows: Columns = field(default_factory=lambda: np.empty(16_384, np.int32))
    use_factors: Words = field(default_factory=lambda: np.empty(16_384, np.uint64))
    state: Indices = field(default_factory=lambda: np.zeros(4, np.int64))

    @property
    def _field(self) -> modular.Field:
        return modular.field_of(self.prime)

    @property
    def _basis(self) -> Basis:
        return Basis(self.pivot_of, self.starts, self.columns, self.values)

    @property
    def _uses(self) -> Uses:
        return Uses(self.use_starts, self.use_rows, self.use_factors)

    def widen(self, width: int) -> None:
        """Append columns."""
        more = np.full(width - self.width, -1, np.int64)
        self.pivot_of = np.concatenate([self.pivot_of, more])
        self.width = width

    def insert(
        self,
        rows: SparseRows,
        expected: Flags | None = None,
        in_order: bool = True,
    ) -> Flags:
        """Insert rows; entries of equal column in a row are added up.

        `expected` marks rows that should depend on all others, which is then tested at once. The answer
        marks those that do.
        """
        total, first = len(rows.starts) - 1, self.count
        most = self.width if in_order else MOST
        if expected is None or not expected.any():
            self._settle(self._insert(np.arange(total), rows, most), rows)
        else:
            later = self._insert((~expected).nonzero()[0], rows, most)
            self._settle(np.concatenate([later, expected.nonzero()[0]]), rows)
        dependent = np.ones(total, np.bool_)
        dependent[self.origin[first : self.count]] = False
        self.origin[first : self.count] += self.inserted
        self.inserted += total
        return dependent

    def _settle(self, places: Indices, rows: SparseRows) -> None:
        """Insert those of the rows that do not depend on the basis; most should. Some at a time: then test again."""
        some = FEW
        while len(places := self._independent(places, rows)):
            before, tried, places = self.count, places[:some], places[some:]
            self._insert(tried, rows, self.width)
            some = 2 * some if self.count - before == len(tried) else some

    def _independent(self, places: Indices, rows: SparseRows) -> Indices:
        """Those of the rows that do not depend on the basis."""
        if not len(places):
            return places
        # The prime is random itself, and so are numbers that come from it.
        seed = np.uint64(self.prime * 0x2545F4914F6CDD1D + self.inserted & 0xFFFFFFFFFFFFFFFF)
        solution, kept = np.empty(self.width, np.uint64), np.empty(len(places), np.int64)
        solve_at_random(solution, seed, self._basis, self._field)
        count = keep_those_that_do_not_vanish(places, rows, solution, kept, self._field)
        return kept[:count]

    def _insert(self, places: Indices, rows: SparseRows, most: int) -> Indices:
        """Insert those rows one by one; the answer has those left out that need over `most` rows of the basis."""
        dense = Dense(np.zeros(self.width, np.uint64), np.zeros((self.width >> 6) + 1, np.uint64))
        later, self.state[LATER] = np.empty(len(places), np.int64), 0
        place = 0
        while True:
            into = Growing(self._basis, self.origin, self._uses, self.state)
            place = reduce_rows(place, most, places, later, rows, dense, into, self._field)
            if place == len(places):
                break
            self._grow()
        first, self.count = self.count, int(self.state[ROWS])
        if self.count > first:
            products = np.empty(self.count - first, np.uint64)
            normalise_rows(first, self.count, products, self._basis, self._uses, self._field)
        return later[: self.state[LATER]]

    def _grow(self) -> None:
        if self.state[ROWS] + 2 > len(self.starts):
            self.starts, self.use_starts = _doubled(self.starts), _doubled(self.use_starts)
            self.origin = _doubled(self.origin)
        while self.state[ENTRIES] + self.width + 1 > len(self.columns):
            self.columns, self.values = _doubled(self.columns), _doubled(self.values)
        while self.state[USES] + self.width + 1 > len(self.use_rows):
            self.use_rows, self.use_factors = _doubled(self.use_rows), _doubled(self.use_factors)

    def rank_within(self, width: int) -> int:
        """The number of independent consequences on the first `width` columns."""
        return int(np.count_nonzero(self.pivot_of[:width] >= 0))

    def rows_within(self, first: int, width: int) -> dict[int, dict[int, int]]:
        """{basis row: {column: value}} for rows whose pivot is in columns first … width - 1."""
        numbers = [int(k) for k in self.pivot_of[first:width] if k >= 0]
        return {number: self._row(number) for number in numbers}

    def cut_rows(self, first: int, width: int) -> SparseRows:
        """The rows whose pivot is in columns first … width - 1, cut to these columns, each in Montgomery form."""
        numbers = self.pivot_of[first:width]
        numbers = numbers[numbers >= 0]
        starts = np.zeros(len(numbers) + 1, np.int64)
        room = int((self.starts[numbers + 1] - self.starts[numbers]).sum())
        columns, values = np.empty(room, np.int64), np.empty(room, np.uint64)
        cut(numbers, first, self._basis, SparseRows(starts, columns, values))
        return SparseRows(starts, columns[: starts[-1]], values[: starts[-1]])

    def _row(self, number: int) -> dict[int, int]:
        part = slice(int(self.starts[number]), int(self.starts[number + 1]))
        inverse = pow(1 << 64, -1, self.prime)
        return {
            int(c): int(v) * inverse % self.prime for c, v in zip(self.columns[part], self.values[part], strict=True)
        }

    def trace(self, weights: Mapping[int, int]) -> list[int]:
        """The original rows of which a combination of basis rows is made, in order of insertion."""
        vector = np.zeros(self.count, np.uint64)
        for number, weight in weights.items():
            vector[number] = weight % self.prime
        trace_weights(vector, self._uses, self._field)
        return [int(self.origin[k]) for k in np.flatnonzero(vector)]


def _doubled(array: npt.NDArray[Kind]) -> npt.NDArray[Kind]:
    longer = np.empty(2 * len(array), array.dtype)
    longer[: len(array)] = array
    return longer

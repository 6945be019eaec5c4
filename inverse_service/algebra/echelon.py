"""Sparse echelon form modulo a prime, grown row by row.

The pivot of a row is its last nonzero column, so with columns in ascending degree the rows whose
pivot lies in the first k columns are all consequences on those columns. Each new row is reduced by the
rows before it until its pivot stands (to reduce it further costs two to three times as much and spares
nothing later on) and the multiples used are recorded, so that each consequence can be traced to the
original rows.

Rows that are expected to depend on the others cost most and give nothing. They are not reduced one by
one: a random combination of all of them is, and where it vanishes, so do they (a row that does not lets it
vanish with probability 1/P; Freivalds 1977). Where it does not vanish they are inserted like the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from inverse_service.algebra import montgomery
from inverse_service.algebra.echelon_kernels import (
    ENTRIES,
    ROWS,
    USES,
    Columns,
    Indices,
    Words,
    combine,
    cut,
    reduce_rows,
    trace_weights,
    vanishes,
)

Flags = npt.NDArray[np.bool_]
Kind = TypeVar("Kind", bound=np.generic)


@dataclass(frozen=True, slots=True)
class SparseRows:
    """Rows in compressed form: starts (rows + 1), columns, values."""

    starts: Indices
    columns: Indices
    values: Words

    def __len__(self) -> int:
        return len(self.starts) - 1


@dataclass(slots=True)
class Echelon:
    """An echelon basis of rows over `width` columns; `width` may grow (new columns are last)."""

    prime: int
    width: int = 0
    count: int = 0
    inserted: int = 0
    pivot_of: Indices = field(default_factory=lambda: np.empty(0, np.int64))
    starts: Indices = field(default_factory=lambda: np.zeros(64, np.int64))
    columns: Columns = field(default_factory=lambda: np.empty(4096, np.int32))
    values: Words = field(default_factory=lambda: np.empty(4096, np.uint64))
    origin: Indices = field(default_factory=lambda: np.empty(64, np.int64))
    use_starts: Indices = field(default_factory=lambda: np.zeros(64, np.int64))
    use_rows: Columns = field(default_factory=lambda: np.empty(4096, np.int32))
    use_factors: Words = field(default_factory=lambda: np.empty(4096, np.uint64))
    state: Indices = field(default_factory=lambda: np.zeros(3, np.int64))

    def widen(self, width: int) -> None:
        """Append columns."""
        more = np.full(width - self.width, -1, np.int64)
        self.pivot_of = np.concatenate([self.pivot_of, more])
        self.width = width

    def insert(
        self, row_starts: Indices, columns: Indices, values: Words, expected: Flags | None = None
    ) -> Flags:
        """Insert rows in compressed form; entries of equal column in a row are added up.

        `expected` marks rows that should depend on all others, which is then tested at once. The answer
        marks those that do.
        """
        total, first = len(row_starts) - 1, self.count
        given = (row_starts, columns, values)
        if expected is None or not expected.any():
            self._insert(np.arange(total), *given)
        else:
            self._insert(np.flatnonzero(~expected), *given)
            rest = np.flatnonzero(expected)
            if not self._depend(rest, *given):
                self._insert(rest, *given)
        dependent = np.ones(total, np.bool_)
        dependent[self.origin[first : self.count]] = False
        self.origin[first : self.count] += self.inserted
        self.inserted += total
        return dependent

    def _insert(self, rows: Indices, row_starts: Indices, columns: Indices, values: Words) -> None:
        """Insert those rows one by one."""
        prime, negative_inverse, one, square = montgomery.constants(self.prime)
        work = np.zeros(self.width, np.uint64)
        place = 0
        while True:
            place = reduce_rows(
                place, rows, row_starts, columns, values, work, self.pivot_of, self.starts, self.columns, self.values,
                self.origin, self.use_starts, self.use_rows, self.use_factors, self.state,
                prime, negative_inverse, one, square,
            )
            if place == len(rows):
                break
            self._grow()
        self.count = int(self.state[ROWS])

    def _depend(self, rows: Indices, row_starts: Indices, columns: Indices, values: Words) -> bool:
        """Whether a random combination of those rows depends on the basis."""
        prime, negative_inverse, _, _ = montgomery.constants(self.prime)
        work = np.zeros(self.width, np.uint64)
        # The prime is random itself, and so are weights that come from it.
        seed = np.uint64(self.prime * 0x2545F4914F6CDD1D + self.inserted & 0xFFFFFFFFFFFFFFFF)
        top = combine(rows, row_starts, columns, values, work, seed, prime, negative_inverse)
        basis = (self.pivot_of, self.starts, self.columns, self.values)
        return bool(vanishes(top, work, *basis, prime, negative_inverse))

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
        cut(numbers, first, self.starts, self.columns, self.values, starts, columns, values)
        return SparseRows(starts, columns[: starts[-1]], values[: starts[-1]])

    def _row(self, number: int) -> dict[int, int]:
        part = slice(int(self.starts[number]), int(self.starts[number + 1]))
        inverse = pow(1 << 64, -1, self.prime)
        return {
            int(c): int(v) * inverse % self.prime for c, v in zip(self.columns[part], self.values[part], strict=True)
        }

    def trace(self, weights: Mapping[int, int]) -> list[int]:
        """The original rows of which a combination of basis rows is made, in order of insertion."""
        prime, negative_inverse, _, _ = montgomery.constants(self.prime)
        vector = np.zeros(self.count, np.uint64)
        for number, weight in weights.items():
            vector[number] = weight % self.prime
        trace_weights(vector, self.use_starts, self.use_rows, self.use_factors, prime, negative_inverse)
        return [int(self.origin[k]) for k in np.flatnonzero(vector)]


def _doubled(array: npt.NDArray[Kind]) -> npt.NDArray[Kind]:
    longer = np.empty(2 * len(array), array.dtype)
    longer[: len(array)] = array
    return longer

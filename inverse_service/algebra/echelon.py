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
from inverse_service.algebra.montgomery import compiled, multiply, power

Words = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]
Columns = npt.NDArray[np.int32]
Flags = npt.NDArray[np.bool_]
Kind = TypeVar("Kind", bound=np.generic)


# The state of a basis: rows, entries, recorded multiples.
_ROWS, _ENTRIES, _USES = 0, 1, 2


@compiled
def _minus(a: np.uint64, b: np.uint64, prime: np.uint64) -> np.uint64:
    return a - b if a >= b else a + (prime - b)


@compiled
def _unpack(
    start: int, stop: int, columns: Indices, values: Words, work: Words,
    prime: np.uint64, negative_inverse: np.uint64, square: np.uint64,
) -> int:
    """Add a row to the dense `work`, in Montgomery form; its last column."""
    top = -1
    for k in range(start, stop):
        column = columns[k]
        total = work[column] + multiply(values[k], square, prime, negative_inverse)
        work[column] = total - prime if total >= prime else total
        top = max(top, column)
    return top


@compiled
def _reduce(
    top: int, work: Words, pivot_of: Indices, basis_starts: Indices, basis_columns: Columns, basis_values: Words,
    use_rows: Columns, use_factors: Words, state: Indices, prime: np.uint64, negative_inverse: np.uint64,
) -> int:
    """Reduce `work` by the basis as far as its pivot and record the multiples used; the pivot, or -1."""
    pivot, uses = -1, state[_USES]
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
        for k in range(basis_starts[used], basis_starts[used + 1]):
            product = multiply(factor, basis_values[k], prime, negative_inverse)
            work[basis_columns[k]] = _minus(work[basis_columns[k]], product, prime)
    if pivot >= 0:
        state[_USES] = uses
    return pivot


@compiled
def _store(
    pivot: int, inverse: np.uint64, work: Words, basis_columns: Columns, basis_values: Words, state: Indices,
    prime: np.uint64, negative_inverse: np.uint64,
) -> None:
    """Move `work` times `inverse` into the basis and clear it."""
    entries = state[_ENTRIES]
    for column in range(pivot, -1, -1):
        if work[column] != np.uint64(0):
            basis_columns[entries] = column
            basis_values[entries] = multiply(work[column], inverse, prime, negative_inverse)
            work[column] = np.uint64(0)
            entries += 1
    state[_ENTRIES] = entries


@compiled
def _combine(
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
        for k in range(row_starts[row], row_starts[row + 1]):
            column = columns[k]
            total = work[column] + multiply(values[k], weight, prime, negative_inverse)
            work[column] = total - prime if total >= prime else total
            top = max(top, column)
    return top


@compiled
def _vanishes(
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
        for k in range(basis_starts[used], basis_starts[used + 1]):
            product = multiply(factor, basis_values[k], prime, negative_inverse)
            work[basis_columns[k]] = _minus(work[basis_columns[k]], product, prime)
    return True


@compiled
def _reduce_rows(
    start: int, rows: Indices, row_starts: Indices, columns: Indices, values: Words, work: Words,
    pivot_of: Indices, basis_starts: Indices, basis_columns: Columns, basis_values: Words, origin: Indices,
    use_starts: Indices, use_rows: Columns, use_factors: Words, state: Indices,
    prime: np.uint64, negative_inverse: np.uint64, one: np.uint64, square: np.uint64,
) -> int:
    """Insert rows[start], rows[start + 1], …; stop early (returning the place) where an array is full."""
    for place in range(start, len(rows)):
        row = rows[place]
        first, last = row_starts[row], row_starts[row + 1]
        top = _unpack(first, last, columns, values, work, prime, negative_inverse, square)
        room = state[_ENTRIES] + top + 1 <= len(basis_columns) and state[_USES] + top + 2 <= len(use_rows)
        if not room or state[_ROWS] + 2 > len(basis_starts):
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
        count, uses = state[_ROWS], state[_USES]
        origin[count], pivot_of[pivot] = row, count
        use_rows[uses], use_factors[uses] = -1, inverse
        state[_ROWS], state[_USES] = count + 1, uses + 1
        basis_starts[count + 1], use_starts[count + 1] = state[_ENTRIES], uses + 1
    return len(rows)


@compiled
def _trace(
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
def _cut(
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
            place = _reduce_rows(
                place, rows, row_starts, columns, values, work, self.pivot_of, self.starts, self.columns, self.values,
                self.origin, self.use_starts, self.use_rows, self.use_factors, self.state,
                prime, negative_inverse, one, square,
            )
            if place == len(rows):
                break
            self._grow()
        self.count = int(self.state[_ROWS])

    def _depend(self, rows: Indices, row_starts: Indices, columns: Indices, values: Words) -> bool:
        """Whether a random combination of those rows depends on the basis."""
        prime, negative_inverse, _, _ = montgomery.constants(self.prime)
        work = np.zeros(self.width, np.uint64)
        # The prime is random itself, and so are weights that come from it.
        seed = np.uint64(self.prime * 0x2545F4914F6CDD1D + self.inserted & 0xFFFFFFFFFFFFFFFF)
        top = _combine(rows, row_starts, columns, values, work, seed, prime, negative_inverse)
        basis = (self.pivot_of, self.starts, self.columns, self.values)
        return bool(_vanishes(top, work, *basis, prime, negative_inverse))

    def _grow(self) -> None:
        if self.state[_ROWS] + 2 > len(self.starts):
            self.starts, self.use_starts = _doubled(self.starts), _doubled(self.use_starts)
            self.origin = _doubled(self.origin)
        while self.state[_ENTRIES] + self.width + 1 > len(self.columns):
            self.columns, self.values = _doubled(self.columns), _doubled(self.values)
        while self.state[_USES] + self.width + 1 > len(self.use_rows):
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
        _cut(numbers, first, self.starts, self.columns, self.values, starts, columns, values)
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
        _trace(vector, self.use_starts, self.use_rows, self.use_factors, prime, negative_inverse)
        return [int(self.origin[k]) for k in np.flatnonzero(vector)]


def _doubled(array: npt.NDArray[Kind]) -> npt.NDArray[Kind]:
    longer = np.empty(2 * len(array), array.dtype)
    longer[: len(array)] = array
    return longer

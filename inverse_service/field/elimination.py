"""Dense elimination modulo a prime with compiled kernels: echelon forms and kernels of matrices.

A row is reduced by those before it, four at a time, in sums of 128 bits that are reduced once per
column. The numbers come as words of numpy: their conversion for FLINT takes longer than its
elimination up to some hundred unknowns.

A row that depends on those before it costs most and gives nothing. After the first such row the
others are tested on a random vector on which those before vanish, if the prime P is large; an
independent row vanishes there with probability 1/P only (Freivalds 1977).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from inverse_service.field.modular import (
    GOLDEN,
    Field,
    add_product,
    compiled,
    field_of,
    mixed,
    montgomery_power,
    multiply,
)

Words = npt.NDArray[np.uint64]
Indices = npt.NDArray[np.int64]
# The prime is random, and so are numbers derived from it.
_SEED = np.uint64(0x2545F4914F6CDD1D)
_LARGE = np.uint64(1 << 30)


class Room(NamedTuple):
    """The sums of a row, in two words for each column; a vector for tests; up to four multiples and
    their rows.
    """

    low: Words
    high: Words
    vector: Words
    factors: Words
    rows: Indices


@compiled
def _reduced(low: np.uint64, high: np.uint64, field: Field) -> np.uint64:
    """(2^64 high + low) / R modulo the prime, for high < the prime."""
    _, quotient = add_product(low, high, low * field.negative_inverse, field.prime)
    return quotient - field.prime if quotient >= field.prime else quotient


@compiled
def _dot(left: Words, right: Words, first: int, last: int, field: Field) -> np.uint64:
    """The sum of the products of these entries, over R."""
    low, high = np.uint64(0), np.uint64(0)
    for k in range(first, last):
        low, high = add_product(low, high, left[k], right[k])
        if high >= field.prime:
            high -= field.prime
    return _reduced(low, high, field)


@compiled
def _add_four(matrix: Words, first: int, room: Room, field: Field) -> None:
    """Add the multiples of four rows from a column on.

    Four products add less than P R for P < 2^62, so that one subtraction keeps the sum below it.
    """
    low, high, factors, rows = room.low, room.high, room.factors, room.rows
    a, b, c, d = matrix[rows[0]], matrix[rows[1]], matrix[rows[2]], matrix[rows[3]]
    of_a, of_b, of_c, of_d = factors[0], factors[1], factors[2], factors[3]
    for k in range(first, len(low)):
        least, most = add_product(low[k], high[k], of_a, a[k])
        least, most = add_product(least, most, of_b, b[k])
        least, most = add_product(least, most, of_c, c[k])
        least, most = add_product(least, most, of_d, d[k])
        low[k] = least
        high[k] = most - field.prime if most >= field.prime else most


@compiled
def _reduce(matrix: Words, row_of: Indices, room: Room, field: Field) -> int:
    """Reduce the sums up to the pivot; its column, or the width for a row that depends on others.

    There the upper word is the entry, and beyond there the sum over R.
    """
    low, high, factors, rows, count = room.low, room.high, room.factors, room.rows, 0
    for column in range(len(low)):
        least, most = low[column], high[column]
        for k in range(count):
            least, most = add_product(least, most, factors[k], matrix[rows[k], column])
        if most >= field.prime:
            most -= field.prime
        value = _reduced(least, most, field)
        low[column], high[column] = np.uint64(0), value
        if value == np.uint64(0):
            continue
        row = row_of[column]
        if row >= 0:
            factors[count], rows[count] = field.prime - value, row
            count += 1
        if (row < 0 and count > 0) or count == 4:
            for k in range(count, 4):
                factors[k], rows[k] = np.uint64(0), 0
            _add_four(matrix, column + 1, room, field)
            count = 0
        if row < 0:
            return column
    return len(low)


@compiled
def _solve_at_random(
    number: int, matrix: Words, row_of: Indices, vector: Words, field: Field
) -> None:
    """The `number`-th random vector on which the rows of the echelon form vanish."""
    state, width = field.prime * _SEED + np.uint64(number), len(row_of)
    for column in range(width - 1, -1, -1):
        row = row_of[column]
        if row < 0:
            state += GOLDEN
            vector[column] = mixed(state) % field.prime
        else:
            value = _dot(matrix[row], vector, column + 1, width, field)
            vector[column] = field.prime - value if value != np.uint64(0) else value


@compiled
def to_echelon(matrix: Words, row_of: Indices, room: Room, field: Field) -> int:
    """Write the echelon form of a matrix, with pivots 1, into its first rows; its rank.

    `row_of` is -1 in each column, and becomes the row of the pivot there. The entries may be
    residues: these are multiples of Montgomery forms by one number.
    """
    low, high, vector = room.low, room.high, room.vector
    width, rank, tested = matrix.shape[1], 0, False
    for i in range(matrix.shape[0]):
        if rank == width:
            break
        if tested and _dot(matrix[i], vector, 0, width, field) == np.uint64(0):
            continue
        for k in range(width):
            low[k], high[k] = np.uint64(0), matrix[i, k]
        pivot = _reduce(matrix, row_of, room, field)
        if pivot == width:
            tested = bool(field.prime > _LARGE)
            _solve_at_random(i, matrix, row_of, vector, field)
            continue
        tested = False
        inverse = montgomery_power(high[pivot], field.prime - np.uint64(2), field)
        for k in range(pivot):
            matrix[rank, k] = np.uint64(0)
        matrix[rank, pivot] = field.one
        for k in range(pivot + 1, width):
            matrix[rank, k] = multiply(_reduced(low[k], high[k], field), inverse, field)
        row_of[pivot] = rank
        rank += 1
    return rank


@compiled
def fill_kernel(matrix: Words, row_of: Indices, found: Words, field: Field) -> None:
    """A basis of the kernel of an echelon form, as residues, into zeros, (nullity, width).

    Each vector is 1 in its own column, the last one that is not 0, where the others are 0.
    """
    number = 0
    for own in range(len(row_of)):
        if row_of[own] >= 0:
            continue
        vector = found[number]
        vector[own] = field.one
        for column in range(own - 1, -1, -1):
            row = row_of[column]
            if row >= 0:
                value = _dot(matrix[row], vector, column + 1, own + 1, field)
                vector[column] = field.prime - value if value != np.uint64(0) else value
        for k in range(own + 1):
            vector[k] = _reduced(vector[k], np.uint64(0), field)
        number += 1


@compiled
def fill_products(left: Words, right: Words, found: Words, field: Field) -> None:
    """found[i, j] = the dot product of rows of both matrices."""
    for i in range(left.shape[0]):
        for j in range(right.shape[0]):
            value = _dot(left[i], right[j], 0, left.shape[1], field)
            found[i, j] = multiply(value, field.square, field)


@dataclass(frozen=True, slots=True)
class Form:
    """An echelon form, in the first rows, and the row of the pivot of each column, or -1."""

    prime: int
    rows: Words
    row_of: Indices

    @property
    def pivots(self) -> list[int]:
        """The columns that are not combinations of earlier ones."""
        return [int(k) for k in np.flatnonzero(self.row_of >= 0)]

    @property
    def free(self) -> list[int]:
        """The other columns."""
        return [int(k) for k in np.flatnonzero(self.row_of < 0)]


def echelon(matrix: Words, prime: int) -> Form:
    """The echelon form of a matrix of residues."""
    rows, width = np.array(matrix, np.uint64, order="C"), matrix.shape[1]
    low, high, vector = np.zeros((3, width), np.uint64)
    room = Room(low, high, vector, np.zeros(4, np.uint64), np.zeros(4, np.int64))
    form = Form(prime, rows, np.full(width, -1, np.int64))
    to_echelon(rows, form.row_of, room, field_of(prime))
    return form


def kernel(form: Form) -> Words:
    """A basis of the kernel, (nullity, width), by the free columns: each vector is 1 in its own
    one, the last one where it is not 0, and the others are 0 there.
    """
    found = np.zeros((len(form.free), len(form.row_of)), np.uint64)
    fill_kernel(form.rows, form.row_of, found, field_of(form.prime))
    return found


def products(left: Words, right: Words, prime: int) -> Words:
    """The dot products of the rows of two matrices of residues, (rows of left, rows of right)."""
    found = np.zeros((len(left), len(right)), np.uint64)
    fill_products(np.ascontiguousarray(left), np.ascontiguousarray(right), found, field_of(prime))
    return found

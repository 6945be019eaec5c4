"""Elimination modulo a prime: leading columns, null vectors, and rational null vectors.

A common factor of all entries does not matter, so matrices may be in Montgomery form. Bases are in reduced form: the
last column of each vector has the entry 1, and 0 in all other vectors.
"""

import random
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from inverse_service import bounds, deadline
from inverse_service.field import modular
from inverse_service.field.echelon import Words

Numbers = npt.NDArray[np.int64]
# The number of equations minus the number of unknowns; a random equation is satisfied by accident with probability 1/P,
# P the prime.
SPARE = 12


@dataclass(frozen=True, slots=True)
class Kernel:
    """A basis modulo the prime, (nullity, width), and the own column of each vector, where the others are 0."""

    basis: nmod_mat
    columns: tuple[int, ...]

    @property
    def nullity(self) -> int:
        return len(self.columns)

    def rational_vectors(self) -> list[dict[int, Fraction]]:
        """The vectors with small rational entries, as tables of the nonzero entries."""
        vectors = [_rational([int(x) for x in row], int(self.basis.modulus())) for row in self.basis.tolist()]
        return [vector for vector in vectors if vector is not None]


def _rational(row: list[int], prime: int) -> dict[int, Fraction] | None:
    vector: dict[int, Fraction] = {}
    for k, x in enumerate(row):
        if x:
            value = modular.reconstruct(x, prime, bounds.NUMBER)
            if value is None:
                return None
            vector[k] = value
    return vector


def leading_columns(reduced: nmod_mat, rank: int) -> list[int]:
    """The pivot columns of a reduced echelon form: they are not combinations of earlier columns."""
    found: list[int] = []
    for i in range(rank):
        first = found[-1] + 1 if found else 0
        found.append(next(k for k in range(first, reduced.ncols()) if int(reduced[i, k])))
    return found


def kernel(matrix: Words | Numbers, prime: int) -> Kernel:
    """The kernel of a matrix, (equations, unknowns)."""
    return kernel_of(_over_field(matrix, prime))


def null_rows(rows: Sequence[Sequence[int]], width: int, prime: int) -> list[list[int]]:
    """A basis of the vectors orthogonal to the rows."""
    found = kernel_of(nmod_mat(len(rows), width, [entry for row in rows for entry in row], prime))
    return [list(map(int, row)) for row in found.basis.tolist()]


def table_of(rows: Collection[Mapping[int, int]], width: int, prime: int) -> nmod_mat:
    """The matrix of rows given by their nonzero entries."""
    found = nmod_mat(max(len(rows), 1), width, prime)
    for i, row in enumerate(rows):
        for column, value in row.items():
            found[i, column] = value
    return found


def _check_work(rows: int, columns: int) -> None:
    """Charge the cost of an elimination, in units of the search."""
    deadline.check(1 + rows * columns // 100 + rows * columns * min(rows, columns) // 10_000)


def _over_field(matrix: Words | Numbers, prime: int) -> nmod_mat:
    rows, columns = matrix.shape
    _check_work(rows, columns)
    return nmod_mat(int(rows), int(columns), matrix.ravel().tolist(), prime)


def random_null_vector(matrix: Words, prime: int, generator: random.Random) -> list[int]:
    """A random element of the kernel of a matrix, (equations, unknowns)."""
    reduced, rank = _over_field(matrix, prime).rref()
    leading, width = leading_columns(reduced, rank), reduced.ncols()
    vector = [generator.randrange(prime) for _ in range(width)]
    for pivot in leading:
        vector[pivot] = 0
    needed = (reduced * nmod_mat(width, 1, vector, prime)).entries()
    for pivot, value in zip(leading, needed, strict=False):
        vector[pivot] = -int(value) % prime
    return vector


def pivots(matrix: Words | Numbers, prime: int) -> list[int]:
    """The columns that are not combinations of earlier ones."""
    return leading_columns(*_over_field(matrix, prime).rref())


def kernel_of(matrix: nmod_mat) -> Kernel:
    """The kernel of a flint matrix."""
    reduced, rank = matrix.rref()
    width, leading = matrix.ncols(), leading_columns(reduced, rank)
    taken = set(leading)
    free = [k for k in range(width) if k not in taken]
    prime = int(matrix.modulus())
    basis = [0] * (len(free) * width)
    for row, unknown in enumerate(free):
        basis[row * width + unknown] = 1
        for i, pivot in enumerate(leading):
            if pivot > unknown:
                break
            basis[row * width + pivot] = -int(reduced[i, unknown]) % prime
    return Kernel(nmod_mat(len(free), width, basis, prime), tuple(free))


def restricted(known: Kernel, matrix: Words) -> Kernel:
    """The vectors of a kernel that also satisfy more equations."""
    further = _over_field(matrix, int(known.basis.modulus()))
    inside = kernel_of(further * known.basis.transpose())
    return Kernel(inside.basis * known.basis, tuple(known.columns[k] for k in inside.columns))


def settled_kernel(unknowns: int, equations: Callable[[int, int], Words], width: int, prime: int) -> Kernel:
    """The kernel of the equations at enough samples that more samples do not shrink it.

    `equations(begin, end)` returns `width` equations for each of these samples.
    """
    taken = (unknowns + SPARE) // width + 1
    found = kernel(equations(0, taken), prime)
    while found.nullity:
        before, end = found.nullity, taken + (found.nullity + SPARE) // width + 1
        found, taken = restricted(found, equations(taken, end)), end
        if found.nullity == before:
            break
    return found

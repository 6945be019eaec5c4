"""The space of values g(p), the symbol of the projected system, and Cartan's test."""

from __future__ import annotations

import itertools
import random
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from inverse_service.algebra.echelon import Echelon
from inverse_service.algebra.monomials import MonomialKeys, keys_of
from inverse_service.inverse_problem.emission import Exponents
from inverse_service.inverse_problem.prolongation import Prolongation, unknown_block

Rows = list[dict[int, int]]


def kernel(rows: Rows, width: int, prime: int) -> nmod_mat:
    """A basis of {x : rows x = 0} as the rows of a matrix, (dimension, width)."""
    matrix = nmod_mat(max(len(rows), 1), width, prime)
    for i, row in enumerate(rows):
        for column, value in row.items():
            matrix[i, column] = value
    basis, nullity = matrix.nullspace()
    transposed = basis.transpose()
    return nmod_mat(nullity, width, transposed.entries()[: nullity * width], prime)


def value_rows(prolongation: Prolongation) -> dict[int, dict[int, int]]:
    """All consequences on g(p): {number of basis row: {column: value}}."""
    return prolongation.echelon.rows_within(0, prolongation.width(0))


def is_singular_everywhere(prolongation: Prolongation, rows: Rows, seed: int) -> bool:
    """Whether det vanishes on all g(p) that satisfy the rows (two random elements are singular)."""
    prime = prolongation.local.ring.prime
    basis = kernel(rows, prolongation.width(0), prime)
    generator = random.Random(f"regular {seed}")
    return all(_random_determinant(prolongation, basis, generator) == 0 for _ in range(2))


def _random_determinant(prolongation: Prolongation, basis: nmod_mat, generator: random.Random) -> int:
    prime = prolongation.local.ring.prime
    count, width = basis.nrows(), basis.ncols()
    if count == 0:
        return 0
    weights = nmod_mat(1, count, [generator.randrange(prime) for _ in range(count)], prime)
    element = [int(x) for x in (weights * basis).entries()]
    n, first = prolongation.local.dimension, prolongation.first_velocity
    matrix = nmod_mat(n, n, prime)
    for column in range(width):
        i, j = velocity_pair(prolongation.blocks[0][column], first)
        matrix[i, j] = matrix[j, i] = element[column] * (2 if i == j else 1)
    return int(matrix.det())


def velocity_pair(exponents: np.typing.NDArray[np.int8], first: int) -> tuple[int, int]:
    """(i, j) of the monomial v_i v_j."""
    places = [k for k, e in enumerate(exponents[first:]) for _ in range(int(e))]
    return places[0], places[1]


@dataclass(frozen=True, slots=True)
class Symbol:
    """dim M_d, dim of its prolongation, Cartan characters; involutive by Cartan's equality."""

    dimension: int
    prolonged: int
    characters: tuple[int, ...]

    @property
    def involutive(self) -> bool:
        return self.prolonged == sum(k * a for k, a in enumerate(self.characters, start=1))


def symbol(prolongation: Prolongation, degree: int, seed: int) -> Symbol:
    """M_d of the projected system at degree d = `degree` >= 1, tested in random directions.

    M_d^(k) are the elements killed by k random constant derivatives; alpha_k = dim M^(k-1) - dim
    M^(k); involutive iff dim M_(d+1) = sum k alpha_k (Cartan; Bryant et al., Exterior Differential
    Systems, chapter VIII).
    """
    low, high = prolongation.width(degree - 1), prolongation.width(degree)
    rows = prolongation.echelon.rows_within(low, high)
    top = [{c - low: v for c, v in row.items() if c >= low} for row in rows.values()]
    dimension = high - low - len(top)
    if dimension == 0:
        return Symbol(0, 0, (0,) * prolongation.size)
    basis = kernel(top, high - low, prolongation.local.ring.prime)
    return Symbol(dimension, _prolonged(prolongation, degree, top), _characters(prolongation, degree, basis, seed))


def _columns_of(
    prolongation: Prolongation, block: Exponents, wanted: Exponents
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """The places in `block` of the monomials `wanted`, and which of them are there at all."""
    keys = MonomialKeys(prolongation.size)
    known = keys_of(keys, block)
    order = np.argsort(known)
    sought = keys_of(keys, wanted)
    places = np.minimum(np.searchsorted(known, sought, sorter=order), len(known) - 1)
    return order[places], known[order[places]] == sought


def _prolonged(prolongation: Prolongation, degree: int, top: Rows) -> int:
    """dim {L of degree d + 3 : all partial derivatives lie in M_d}."""
    block, above = prolongation.blocks[degree], unknown_block(prolongation, degree + 1)
    prime, size = prolongation.local.ring.prime, prolongation.size
    echelon = Echelon(prime)
    echelon.widen(len(above))
    entries = np.array([column for row in top for column in row], np.int64)
    values = [value for row in top for value in row.values()]
    lengths = np.array([len(row) for row in top], np.int64)
    starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    for a in range(size):
        raised = block[entries] + np.eye(size, dtype=np.int8)[a]
        columns, _ = _columns_of(prolongation, above, raised)
        scaled = [value * factor % prime for value, factor in zip(values, raised[:, a].tolist(), strict=True)]
        echelon.insert(starts, columns, np.array(scaled, np.uint64))
    return len(above) - echelon.count


def _characters(prolongation: Prolongation, degree: int, basis: nmod_mat, seed: int) -> tuple[int, ...]:
    """alpha_1, …, alpha_m from the ranks of successive random derivatives on M_d."""
    generator = random.Random(f"directions {seed}")
    prime, size = prolongation.local.ring.prime, prolongation.size
    total, dimensions = None, [basis.nrows()]
    for _ in range(size):
        if dimensions[-1] == 0:
            dimensions.append(0)
            continue
        direction = [generator.randrange(1, prime) for _ in range(size)]
        image = (basis * _derivative_matrix(prolongation, degree, direction)).transpose()
        stacked = image if total is None else nmod_mat(
            total.nrows() + image.nrows(), image.ncols(), total.entries() + image.entries(), prime
        )
        reduced, rank = stacked.rref()
        total = nmod_mat(rank, image.ncols(), reduced.entries()[: rank * image.ncols()], prime) if rank else None
        dimensions.append(basis.nrows() - rank)
    return tuple(a - b for a, b in itertools.pairwise(dimensions))


def _derivative_matrix(prolongation: Prolongation, degree: int, direction: list[int]) -> nmod_mat:
    """L -> sum_a direction_a d_a L modulo v-degree <= 1, (unknowns of degree d, of degree d - 1)."""
    block, below = prolongation.blocks[degree], prolongation.blocks[degree - 1]
    prime, size = prolongation.local.ring.prime, prolongation.size
    matrix = nmod_mat(len(block), len(below), prime)
    for a in range(size):
        rows = np.flatnonzero(block[:, a])
        columns, there = _columns_of(prolongation, below, block[rows] - np.eye(size, dtype=np.int8)[a])
        for row, column in zip(rows[there].tolist(), columns[there].tolist(), strict=True):
            matrix[row, column] = int(block[row, a]) * direction[a] % prime
    return matrix

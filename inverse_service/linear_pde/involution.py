"""The rank that a solution can have at the point, the symbol of the projected system, and Cartan's test."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from flint import nmod_mat

from inverse_service.field import modular
from inverse_service.field.echelon import Echelon
from inverse_service.field.echelon_kernels import Indices, SparseRows, Words
from inverse_service.field.modular import GOLDEN, Field, compiled, mixed, multiply
from inverse_service.linear_pde.emission import Prolongation
from inverse_service.linear_pde.unknowns import (
    Derivative,
    Raised,
    Unknowns,
    column_of,
    count_of_degree,
    raised_unknowns,
)

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


@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """Derivatives of the unknowns at the point, a matrix that has to reach a rank."""

    entries: tuple[tuple[Derivative, ...], ...]
    rank: int


@lru_cache(maxsize=64)
def degree_of(unknowns: Unknowns, matrix: Matrix) -> int:
    """The degree of the unknowns that the matrix is made of."""
    return max(len(by) - unknowns.functions[number].order for row in matrix.entries for number, by in row)


@lru_cache(maxsize=64)
def _places(unknowns: Unknowns, matrix: Matrix) -> tuple[tuple[int, int, int, int], ...]:
    """Row, column, unknown and factor of each entry."""
    return tuple(
        (i, j, *column_of(unknowns, derivative))
        for i, row in enumerate(matrix.entries)
        for j, derivative in enumerate(row)
    )


def matrix_at(unknowns: Unknowns, matrix: Matrix, values: Mapping[int, int] | Sequence[int], prime: int) -> nmod_mat:
    """The matrix of a solution, from the values of the unknowns by their columns."""
    found = nmod_mat(len(matrix.entries), len(matrix.entries[0]), prime)
    for i, j, column, factor in _places(unknowns, matrix):
        found[i, j] = values[column] * factor
    return found


def consequences(prolongation: Prolongation, degree: int) -> dict[int, dict[int, int]]:
    """All consequences on the unknowns to this degree: {number of basis row: {column: value}}."""
    return prolongation.echelon.rows_within(0, prolongation.width(degree))


def generic_rank(prolongation: Prolongation, matrix: Matrix) -> int:
    """The rank of the matrix at the generic solution of all rows: the larger of two random ones."""
    width = prolongation.width(degree_of(prolongation.unknowns, matrix))
    return _larger_rank(prolongation, matrix, lambda k: prolongation.echelon.random_solution(k, width))


def rank_of_rows(prolongation: Prolongation, matrix: Matrix, rows: Rows, seed: int) -> int:
    """The same at the generic solution of some consequences on the unknowns that the matrix is made of."""
    prime, width = prolongation.local.prime, prolongation.width(degree_of(prolongation.unknowns, matrix))
    basis = kernel(rows, width, prime)
    if basis.nrows() == 0:
        return 0
    generator = random.Random(f"regular {seed}")

    def element(_: int) -> list[int]:
        weights = nmod_mat(1, basis.nrows(), [generator.randrange(prime) for _ in range(basis.nrows())], prime)
        return list(map(int, (weights * basis).entries()))

    return _larger_rank(prolongation, matrix, element)


def _larger_rank(prolongation: Prolongation, matrix: Matrix, element: Callable[[int], Sequence[int]]) -> int:
    rank = 0
    for k in range(2):
        if rank < matrix.rank:
            found = matrix_at(prolongation.unknowns, matrix, element(k), prolongation.local.prime)
            rank = max(rank, found.rank())
    return rank


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
    rows = prolongation.echelon.cut_rows(low, high)
    dimension = high - low - (len(rows.starts) - 1)
    if dimension == 0:
        return Symbol(0, 0, (0,) * prolongation.size)
    characters = _characters(prolongation, degree, rows, seed)
    return Symbol(dimension, _prolonged(prolongation, degree, rows), characters)


@compiled
def _raise(rows: SparseRows, step: Raised, small: Words, field: Field, raised: Indices, scaled: Words) -> None:
    """Each entry, for the coefficient of m in d_a y, as one for that of x_a m in y: all entries for each a."""
    entries = len(rows.columns)
    for a in range(step.places.shape[1]):
        for k in range(entries):
            column = rows.columns[k]
            raised[a * entries + k] = step.places[column, a]
            scaled[a * entries + k] = multiply(rows.values[k], small[step.factors[column, a]], field)


def _prolonged(prolongation: Prolongation, degree: int, rows: SparseRows) -> int:
    """dim {y of degree d + 1 : all partial derivatives lie in M_d}."""
    size, prime = prolongation.size, prolongation.local.prime
    step = raised_unknowns(prolongation.unknowns, degree)
    entries = len(rows.columns)
    columns, values = np.empty(size * entries, np.int64), np.empty(size * entries, np.uint64)
    small = modular.small_numbers(prime, degree + prolongation.unknowns.most + 2)
    _raise(rows, step, small, modular.field_of(prime), columns, values)
    starts = rows.starts[None, :-1] + entries * np.arange(size)[:, None]
    echelon = Echelon(prime)
    echelon.widen(count_of_degree(prolongation.unknowns, degree + 1))
    echelon.insert(SparseRows(np.append(starts.ravel(), size * entries), columns, values))
    return echelon.width - echelon.count


@compiled
def _derive(state: np.uint64, factors: Indices, small: Words, directions: Words, values: Words, field: Field) -> None:
    """values[k, m, a] = directions[k, a] * (the exponent of x_a in x_a m), the directions random."""
    for k in range(directions.shape[0]):
        for a in range(directions.shape[1]):
            state += GOLDEN
            directions[k, a] = mixed(state) % field.prime
    for k in range(values.shape[0]):
        for m in range(values.shape[1]):
            for a in range(values.shape[2]):
                values[k, m, a] = multiply(directions[k, a], small[factors[m, a]], field)


def _characters(prolongation: Prolongation, degree: int, rows: SparseRows, seed: int) -> tuple[int, ...]:
    """alpha_1, …, alpha_m: how many of the equations D_k y = 0 are new, D_k the k-th random derivative.

    The equations for the coefficient of a monomial m in D y, m of one degree less.
    """
    prime, size = prolongation.local.prime, prolongation.size
    step = raised_unknowns(prolongation.unknowns, degree - 1)
    values, directions = np.empty((size, *step.places.shape), np.uint64), np.empty((size, size), np.uint64)
    small = modular.small_numbers(prime, degree + prolongation.unknowns.most + 1)
    _derive(np.uint64(seed), step.factors, small, directions, values, modular.field_of(prime))
    echelon = Echelon(prime)
    echelon.widen(count_of_degree(prolongation.unknowns, degree))
    echelon.insert(rows)
    columns = np.tile(step.places.ravel(), size)
    dependent = echelon.insert(SparseRows(np.arange(0, len(columns) + 1, size), columns, values.ravel()))
    return tuple(int(k) for k in np.count_nonzero(~dependent.reshape(size, -1), axis=1))

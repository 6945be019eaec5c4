"""Is there a regular L(q, v), or L(t, q, v)? The Helmholtz conditions for g_ij = d2L/dv_i dv_j, so that (H1) holds.

With x = (t?, q, v) and X = (1, v, f) the components of Gamma

    H2_ij  sum_a X^a d_a g_ij - sum_k (g_ik N^k_j + g_jk N^k_i)    i <= j
    H3_ij  sum_k (g_ik Phi^k_j - g_jk Phi^k_i)                     i <  j

with N = -1/2 df/dv, Phi = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv)(df/dv) (Helmholtz 1887; Douglas,
Trans. AMS 50 (1941), section 2; signs as in Mestdag, Bloch and Fernandez); g has to be of rank n.
The instructions for N and Phi follow those for f. Their registers are the first ones: X, then df/dv, N, Phi (n, n
each), and one for derivatives in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, combinations_with_replacement
from typing import Literal

import numpy as np
import numpy.typing as npt

from inverse_service.expressions.tree import Expression
from inverse_service.field import series_kernels as machine
from inverse_service.field.point import Variable
from inverse_service.field.series_program import Registers, SeriesProgram
from inverse_service.linear_pde.emission import NO_DERIVATIVE, Equations, LocalEquations, TermTable
from inverse_service.linear_pde.involution import Matrix
from inverse_service.linear_pde.unknowns import Function, Unknowns

Integers = npt.NDArray[np.int64]
Kind = Literal["H2", "H3"]
# The rows of H2 have a derivative of g.
KINDS: tuple[tuple[Kind, int], ...] = (("H2", 1), ("H3", 0))


@lru_cache(maxsize=64)
def unknowns_of(n: int, size: int) -> Unknowns:
    """L of v-degree >= 2 and the entries g_ij, i <= j, over `size` displacements, the velocities last."""
    first = size - n
    pairs = combinations_with_replacement(range(first, size), 2)
    return Unknowns(size, (Function(2, first),), tuple((0, pair) for pair in pairs))


@lru_cache(maxsize=64)
def matrix_of(n: int, size: int) -> Matrix:
    """g, of rank n."""
    velocities = range(size - n, size)
    return Matrix(tuple(tuple((0, (min(i, j), max(i, j))) for j in velocities) for i in velocities), n)


@dataclass(frozen=True, slots=True)
class Summand:
    """(-) s g or (-) s d_a g in one equation, g an entry; s is X^row, N^row_column or Phi^row_column."""

    equation: int
    entry: int
    derivative: int
    row: int
    column: int = 0
    negative: bool = False


@lru_cache(maxsize=64)
def pairs_of(kind: Kind, n: int) -> tuple[tuple[int, int], ...]:
    """(i, j) of each equation."""
    return tuple(combinations_with_replacement(range(n), 2) if kind == "H2" else combinations(range(n), 2))


@lru_cache(maxsize=64)
def summands(kind: Kind, n: int, size: int) -> tuple[Summand, ...]:
    """Of all equations of a kind for n coordinates and `size` displacements; those with a derivative have X."""
    found, entry = [], {pair: place for place, pair in enumerate(pairs_of("H2", n))}
    for equation, (i, j) in enumerate(pairs_of(kind, n)):
        if kind == "H2":
            found += [Summand(equation, entry[i, j], a, a) for a in range(size)]
        for k in range(n):
            for a, b, negative in ((i, j, kind == "H2"), (j, i, True)):
                found.append(Summand(equation, entry[min(a, k), max(a, k)], NO_DERIVATIVE, k, b, negative))
    return tuple(found)


def compiled_equations(n: int, size: int, prime: int, order: int, registers: Registers) -> LocalEquations:
    """H2, then H3, from the registers of `written`, for prolongation to this order."""
    series = registers.coefficients(_series(n, size - 2 * n), order)
    unknowns = unknowns_of(n, size)
    blocks = ((kind, k, pairs_of(kind, n)) for kind, k in KINDS)
    return LocalEquations(
        unknowns,
        prime,
        tuple(
            Equations(kind, pairs, k, TermTable(unknowns, len(pairs), series, _terms(kind, n, size)))
            for kind, k, pairs in blocks
        ),
    )


def written(
    variables: Sequence[Variable], velocities: Sequence[Variable], forces: Sequence[Expression], order: int
) -> tuple[SeriesProgram, Integers]:
    """X, N, Phi for f to this order at most, in (t?, q, v); TooLarge where sparse series are better."""
    n, m = len(velocities), len(variables)
    offset = m - 2 * n
    series = SeriesProgram(variables, order)
    series.register(m + 3 * n * n + 1)
    half, two = series.number(Fraction(-1, 2)), series.number(Fraction(-2))
    if offset:
        series.write(machine.CONSTANT, 0)
    for register, tree in enumerate([*velocities, *forces], start=offset):
        series.write(machine.ADD, register, series.expand(tree))
    instructions = np.array(series.instructions, np.int64).ravel()
    return series, np.concatenate([instructions, _geometry(n, offset, half, two)])


@lru_cache(maxsize=64)
def _geometry(n: int, offset: int, half: int, two: int) -> Integers:
    """The instructions for df/dv, N and Phi; Phi comes out to order D - 2."""
    size, last = range(n), 2 * n + offset + 3 * n * n
    found: list[tuple[int, int, int, int, int, int]] = []
    for i in size:
        for j in size:
            slope, N = _matrix(n, offset, 0, i, j), _matrix(n, offset, 1, i, j)
            found.append((machine.DERIVATIVE, slope, offset + n + i, offset + n + j, 0, 0))
            found.append((machine.ADD, N, slope, 0, half, 0))
    for i in size:
        for j in size:
            slope, Phi = _matrix(n, offset, 0, i, j), _matrix(n, offset, 2, i, j)
            for a in range(2 * n + offset):
                found.append((machine.DERIVATIVE, last, slope, a, 0, 0))
                found.append((machine.PRODUCT, Phi, a, last, 0, 2))
            found.append((machine.DERIVATIVE, last, offset + n + i, offset + j, 0, 0))
            found.append((machine.ADD, Phi, last, 0, two, 2))
            for k in size:
                product = (_matrix(n, offset, 0, i, k), _matrix(n, offset, 0, k, j))
                found.append((machine.PRODUCT, Phi, *product, half, 2))
    return np.array(found, np.int64).ravel()


def tensors(n: int, size: int, registers: Registers) -> tuple[list[list[int]], list[list[int]]]:
    """(N, Phi) at the point, each (n, n), from the registers of `written`."""
    N, Phi = (
        [[registers.value(_matrix(n, size - 2 * n, number, i, j)) for j in range(n)] for i in range(n)]
        for number in (1, 2)
    )
    return N, Phi


def _matrix(n: int, offset: int, number: int, i: int, j: int) -> int:
    """The register of an entry of df/dv, N or Phi (number 0, 1, 2)."""
    return offset + 2 * n + number * n * n + i * n + j


@lru_cache(maxsize=64)
def _series(n: int, offset: int) -> Integers:
    """The registers of X, N and Phi."""
    first = _matrix(n, offset, 1, 0, 0)
    return np.array([*range(offset + 2 * n), *range(first, first + 2 * n * n)], np.int64)


@lru_cache(maxsize=64)
def _terms(kind: Kind, n: int, size: int) -> Integers:
    """The summands of the equations of a kind, as a `TermTable` has them, their series numbered as by `_series`."""
    rows = [(s.equation, _number(kind, s, n, size), s.negative, s.entry, s.derivative) for s in summands(kind, n, size)]
    return np.array(rows, np.int64).reshape(-1, 5)


def _number(kind: Kind, summand: Summand, n: int, size: int) -> int:
    if summand.derivative != NO_DERIVATIVE:
        return summand.row
    return size + (0 if kind == "H2" else n * n) + summand.row * n + summand.column

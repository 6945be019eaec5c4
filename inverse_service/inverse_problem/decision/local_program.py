"""X, N and Phi about a point, computed by compiled series: one program for all points of a decision.

The instructions for N = -1/2 df/dv and Phi = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv)(df/dv) follow those for f.
Their registers are the first ones: X, then df/dv, N, Phi (n, n each), and one for derivatives in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from inverse_service.algebra import series_kernels as machine
from inverse_service.algebra.point import Variable
from inverse_service.algebra.series import SeriesRing
from inverse_service.algebra.series_program import Registers, SeriesProgram, run
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.decision.emission import NO_DERIVATIVE, TermTable, pair_number
from inverse_service.inverse_problem.decision.equations import KINDS, Equations, Kind, Summand, pairs_of, summands

Integers = npt.NDArray[np.int64]
Words = npt.NDArray[np.uint64]


@dataclass(frozen=True, slots=True)
class LocalProgram:
    """The program of a system, its instructions as one array."""

    series: SeriesProgram
    instructions: Integers
    offset: int
    dimension: int

    def at(self, prime: int, constants: Words, order: int) -> CompiledSystem:
        """X, N, Phi for f to this order, with `constants_at` a point; SingularPoint where a denominator vanishes."""
        ring = SeriesRing(prime, len(self.series.variables), order)
        registers = run(self.series, self.instructions, constants, prime, order)
        return CompiledSystem(ring, self.offset, self.dimension, registers)


@dataclass(frozen=True, slots=True)
class CompiledSystem:
    """As `LocalSystem`, in registers: series of X, N and Phi about the point."""

    ring: SeriesRing
    offset: int
    dimension: int
    registers: Registers

    def equations(self) -> tuple[Equations, ...]:
        """H2 for i <= j, then H3 for i < j, for prolongation to the order of Phi."""
        n, size = self.dimension, self.ring.size
        series = self.registers.coefficients(_series(n, self.offset), self.ring.order - 2)
        return tuple(
            Equations(kind, pairs, TermTable(size, size - n, len(pairs), *series, _terms(kind, n, size)))
            for kind, pairs in ((kind, pairs_of(kind, n)) for kind in KINDS)
        )


def local_program(
    variables: Sequence[Variable], velocities: Sequence[Variable], forces: Sequence[Expression], order: int
) -> LocalProgram:
    """For f to this order or less, in displacements of (t?, q, v); TooLarge where series are better kept sparse."""
    n, m = len(velocities), len(variables)
    offset = m - 2 * n
    series = SeriesProgram(variables, order)
    series.register(m + 3 * n * n + 1)
    half, two = series.number(Fraction(-1, 2)), series.number(Fraction(-2))
    if offset:
        series.write(machine.CONSTANT, 0)
    for register, tree in enumerate([*velocities, *forces], start=offset):
        series.write(machine.ADD, register, series.expand(tree))
    written = np.array(series.instructions, np.int64).ravel()
    return LocalProgram(series, np.concatenate([written, _geometry(n, offset, half, two)]), offset, n)


@lru_cache(maxsize=64)
def _geometry(n: int, offset: int, half: int, two: int) -> Integers:
    """The instructions for df/dv, N and Phi; Phi comes out to order D - 2."""
    size, last = range(n), 2 * n + offset + 3 * n * n
    found: list[tuple[int, int, int, int, int, int]] = []
    for i in size:
        for j in size:
            slope, N = _matrix(n, offset, 0, i, j), _matrix(n, offset, 1, i, j)
            found.append((machine.DERIVATIVE, slope, _force(n, offset, i), offset + n + j, 0, 0))
            found.append((machine.ADD, N, slope, 0, half, 0))
    for i in size:
        for j in size:
            slope, Phi = _matrix(n, offset, 0, i, j), _matrix(n, offset, 2, i, j)
            for a in range(2 * n + offset):
                found.append((machine.DERIVATIVE, last, slope, a, 0, 0))
                found.append((machine.PRODUCT, Phi, a, last, 0, 2))
            found.append((machine.DERIVATIVE, last, _force(n, offset, i), offset + j, 0, 0))
            found.append((machine.ADD, Phi, last, 0, two, 2))
            for k in size:
                product = (_matrix(n, offset, 0, i, k), _matrix(n, offset, 0, k, j))
                found.append((machine.PRODUCT, Phi, *product, half, 2))
    return np.array(found, np.int64).ravel()


def _force(n: int, offset: int, i: int) -> int:
    return offset + n + i


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
    rows = [
        (s.equation, _number(kind, s, n, size), s.negative, pair_number(s.i, s.j, n), s.derivative)
        for s in summands(kind, n, size)
    ]
    return np.array(rows, np.int64).reshape(-1, 5)


def _number(kind: Kind, summand: Summand, n: int, size: int) -> int:
    if summand.derivative != NO_DERIVATIVE:
        return summand.row
    return size + (0 if kind == "H2" else n * n) + summand.row * n + summand.column

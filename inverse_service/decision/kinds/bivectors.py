"""Equations of the constrained card that follow from its own: they settle it at a third of the order.

theta = sum (dl/du^alpha) dr^alpha + lambda_a (ds^a - w^a_alpha dr^alpha) has a differential that Gamma keeps and that
vanishes on pairs of vertical vectors, so on all (L_Gamma)^j (d/du^alpha ^ d/du^beta): with V_i = (ad Gamma)^i applied
to d/du^alpha and V'_i that of beta, sum_i C(j, i) dtheta(V_i, V'_(j - i)) = 0, an equation of order 1 in (l, lambda).
For j = 0 and 1 it is an identity. As it holds j derivatives of Gamma, it is counted as of order j/PACE, rounded up.
(Prince, Mestdag, Martin de Diego, arXiv:2606.05550.)
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from inverse_service.decision.kinds.constrained import Shape
from inverse_service.field import series_kernels as machine
from inverse_service.field.monomials import products
from inverse_service.field.series_program import Registers, SeriesProgram, run_again
from inverse_service.linear_pde.emission import NO_DERIVATIVE, Equations, TermTable
from inverse_service.linear_pde.unknowns import Unknowns

Integers = npt.NDArray[np.int64]
PACE, FIRST = 4, 2
# Of the tables for series to as many degrees as there are brackets.
_MOST_PRODUCTS = 1_000_000


def order_of(j: int) -> int:
    """The order at which the equations of j come in."""
    return -(-j // PACE)


@lru_cache(maxsize=64)
def last_of(shape: Shape) -> int:
    """The last j: no more than there are bivectors, nor than series can be made for; 0 for none."""
    if shape.free < 2:
        return 0
    size = shape.size - shape.with_time
    fitting = [j for j in range(FIRST, math.comb(size, 2) + 1) if products(shape.size, j) <= _MOST_PRODUCTS]
    return max(fitting, default=0)


def degree_for(shape: Shape, order: int) -> int:
    """The degree of the series that it takes to prolong to this order."""
    coming = range(FIRST, min(last_of(shape), PACE * order) + 1)
    return max([order + 1, *(order - order_of(j) + j for j in coming)])


def write_brackets(shape: Shape, series: SeriesProgram) -> int:
    """V_j of each u^alpha, j = 0, 1, …, `last_of`, one after the other; the first register."""
    size, own, minus = shape.size, range(int(shape.with_time), shape.size), series.number(Fraction(-1))
    count = size * shape.free * (last_of(shape) + 1)
    first = series.register(count + 1)
    spare = first + count
    for alpha in range(shape.free):
        series.write(machine.CONSTANT, first + size * alpha + shape.u(alpha))
    for before in range(first, spare - size * shape.free, size):
        j = 1 + (before - first) // (size * shape.free)
        for x in own:
            out = before + size * shape.free + x
            for y in range(size):
                series.write(machine.DERIVATIVE, spare, before + x, y)
                series.instructions.append((machine.PRODUCT, out, y, spare, 0, j))
            for y in own:
                series.write(machine.DERIVATIVE, spare, x, y)
                series.instructions.append((machine.PRODUCT, out, before + y, spare, minus, j))
    return first


@dataclass(frozen=True, slots=True)
class _Program:
    """What is made of the first `kept` registers, `count` in all: instructions, the numbers in them, terms.

    There is a table of terms for each (j, alpha), as for a `TermTable`, its series given by registers.
    """

    kept: int
    count: int
    numbers: tuple[int, ...]
    instructions: Integers
    terms: tuple[tuple[int, int, Integers], ...]


@dataclass(slots=True)
class _Writing:
    """A program in the making: `first` and `slopes` are registers as `equations` has them, `free` the next one."""

    shape: Shape
    first: int
    slopes: int
    last: int
    bends: int = 0
    free: int = 0
    numbers: list[int] = field(default_factory=lambda: [0, -1])
    lines: list[tuple[int, int, int, int, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.free = self.kept + self.shape.free * (self.last + 1) * self.shape.dependent
        self.bends, self.free = self.free, self.free + self.shape.size * self.shape.dependent * self.shape.free

    @property
    def kept(self) -> int:
        return self.first + self.shape.size * self.shape.free * (self.last + 1)

    def weight(self, value: int) -> int:
        self.numbers.append(value)
        return len(self.numbers) - 1

    def vector(self, j: int, alpha: int) -> int:
        return self.first + self.shape.size * (self.shape.free * j + alpha)

    def along(self, j: int, alpha: int, y: int) -> int:
        """The component by dr^y, or by ds^a - w^a_alpha dr^alpha."""
        k, m = self.shape.free, self.shape.dependent
        return self.vector(j, alpha) + self.shape.r(y) if y < k else self.kept + (k * j + alpha) * m + y - k


@lru_cache(maxsize=64)
def _program(shape: Shape, first: int, slopes: int, last: int) -> _Program:
    out = _Writing(shape, first, slopes, last)
    _write_components(out)
    listed = tuple(
        (j, alpha, np.array(list(_terms(out, j, alpha)), np.int64))
        for j in range(FIRST, last + 1)
        for alpha in range(shape.free - 1)
    )
    return _Program(out.kept, out.free, tuple(out.numbers), np.array(out.lines, np.int64).ravel(), listed)


def _write_components(out: _Writing) -> None:
    """Of all V_j by ds^a - w^a_alpha dr^alpha, and the derivatives of the w^a_alpha."""
    k, one = out.shape.free, out.weight(1)
    for j, alpha, a in itertools.product(range(out.last + 1), range(k), range(out.shape.dependent)):
        place = out.along(j, alpha, k + a)
        out.lines.append((machine.ADD, place, out.vector(j, alpha) + out.shape.s(a), 0, one, 0))
        for r in range(k):
            factors = out.slopes + a * k + r, out.vector(j, alpha) + out.shape.r(r)
            out.lines.append((machine.PRODUCT, place, *factors, 1, 0))
    count = out.shape.dependent * k
    for x, each in itertools.product(range(out.shape.size), range(count)):
        out.lines.append((machine.DERIVATIVE, out.bends + x * count + each, out.slopes + each, x, 0, 0))


def _terms(out: _Writing, j: int, alpha: int) -> Iterator[tuple[int, int, int, int, int]]:
    """Of the equations for (j, alpha) and each beta after alpha; their coefficients are written first."""
    shape, k, m = out.shape, out.shape.free, out.shape.dependent
    for equation, beta in enumerate(range(alpha + 1, k)):
        lower = out.free
        out.free += m
        for x, y in itertools.product(range(int(shape.with_time), shape.size), range(k + m)):
            place, out.free = out.free, out.free + 1
            for i in range(j + 1):
                c, left, right = math.comb(j, i), out.vector(i, alpha) + x, out.vector(j - i, beta) + x
                out.lines.append((machine.PRODUCT, place, left, out.along(j - i, beta, y), out.weight(c), 1))
                out.lines.append((machine.PRODUCT, place, right, out.along(i, alpha, y), out.weight(-c), 1))
            yield equation, place, 0, shape.u(y) if y < k else shape.size + y - k, x
            for a in range(m if y < k else 0):
                bend = out.bends + (x * m + a) * k + y
                out.lines.append((machine.PRODUCT, lower + a, place, bend, 1, 1))
        yield from ((equation, lower + a, 0, shape.size + a, NO_DERIVATIVE) for a in range(m))


def equations(
    shape: Shape, unknowns: Unknowns, order: int, registers: Registers, first: int, slopes: int
) -> Iterator[Equations]:
    """Those that come in up to this order, from the registers of `write_brackets` and of the w^a_alpha."""
    last = min(last_of(shape), PACE * order)
    if last < FIRST:
        return
    program = _program(shape, first, slopes, last)
    again = run_again(registers, program.kept, program.count, program.instructions, program.numbers, order)
    for j, alpha, terms in reversed(program.terms):  # which makes the shortest proofs
        used, places = np.unique(terms[:, 1], return_inverse=True)
        own = terms.copy()
        own[:, 1] = places
        count = shape.free - 1 - alpha
        table = TermTable(unknowns, count, again.coefficients(used, order - order_of(j)), own)
        indices = tuple((beta,) for beta in range(alpha + 1, shape.free))
        yield Equations(f"B{j}_{alpha}", indices, order_of(j), table)

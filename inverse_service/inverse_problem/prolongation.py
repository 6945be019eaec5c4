"""The Helmholtz system about a point, prolonged order by order, as rows modulo a prime.

Unknown are the Taylor coefficients c_m of L with v-degree >= 2, so that g_ij = d2L/dv_i dv_j
fulfils (H1). With x = (t?, q, v) and X = (1, v, f) the components of Gamma, the rows are the
coefficients of the displacement monomial alpha in

    H2_ij  sum_a X^a d_a g_ij - sum_k (g_ik N^k_j + g_jk N^k_i)    i <= j, |alpha| <= r - 1
    H3_ij  sum_k (g_ik Phi^k_j - g_jk Phi^k_i)                     i <  j, |alpha| <= r

with N = -1/2 df/dv, Phi = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv)(df/dv) (Helmholtz 1887; Douglas,
Trans. AMS 50 (1941), section 2; signs as in Mestdag, Bloch and Fernandez).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from inverse_service.algebra import series as ps
from inverse_service.algebra.echelon import Echelon
from inverse_service.algebra.monomials import MonomialKeys, exponents_of_degree, keys_of
from inverse_service.algebra.series import Series, SeriesRing
from inverse_service.inverse_problem.emission import (
    NO_DERIVATIVE,
    Exponents,
    Term,
    TermTable,
    Unknowns,
    rows_of_degree,
    term_table,
)

# (kind, i, j, alpha): which Helmholtz equation, which Taylor coefficient of it.
RowName = tuple[str, int, int, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class Equation:
    """One of the equations H2_ij, H3_ij as the sum of its terms."""

    kind: str
    i: int
    j: int
    terms: tuple[Term, ...]
    table: TermTable


def matrix_product(left: list[list[Series]], right: list[list[Series]]) -> list[list[Series]]:
    size = range(len(left))
    return [[_total([ps.multiply(left[i][k], right[k][j]) for k in size]) for j in size] for i in size]


def _total(parts: list[Series]) -> Series:
    total = parts[0]
    for part in parts[1:]:
        total = ps.add(total, part)
    return total


def truncate(series: Series, order: int) -> Series:
    return series[: order + 1]


@dataclass(frozen=True, slots=True)
class LocalSystem:
    """Series of X, N and Phi about the point; `offset` is the index of the first q in x."""

    ring: SeriesRing
    offset: int
    field: tuple[Series, ...]
    connection: tuple[tuple[Series, ...], ...]
    endomorphism: tuple[tuple[Series, ...], ...]

    @property
    def dimension(self) -> int:
        return len(self.connection)


def local_system(ring: SeriesRing, velocities: list[Series], forces: list[Series], with_time: bool) -> LocalSystem:
    """X, N, Phi from the series of v and f of order D; Phi comes out to order D - 2."""
    n = len(forces)
    offset = int(with_time)
    half = ring.invert_number(2)
    field_ = [*([ring.constant(1)] if with_time else []), *velocities, *forces]
    order = ring.order - 1
    by_velocity = [[ps.derivative(f, offset + n + j) for j in range(n)] for f in forces]
    by_position = [[ps.derivative(f, offset + j) for j in range(n)] for f in forces]
    square = matrix_product(by_velocity, by_velocity)
    lower = [truncate(x, order - 1) for x in field_]
    endomorphism = []
    for i in range(n):
        row = []
        for j in range(n):
            entry = _total([ps.multiply(x, ps.derivative(by_velocity[i][j], a)) for a, x in enumerate(lower)])
            entry = ps.subtract(entry, ps.scale(truncate(by_position[i][j], order - 1), 2))
            row.append(ps.subtract(entry, ps.scale(truncate(square[i][j], order - 1), half)))
        endomorphism.append(tuple(row))
    connection = tuple(tuple(ps.scale(entry, ring.prime - half) for entry in row) for row in by_velocity)
    return LocalSystem(ring, offset, tuple(field_), connection, tuple(endomorphism))


def equations(local: LocalSystem) -> list[Equation]:
    """H2 for i <= j, then H3 for i < j."""
    n, found = local.dimension, []
    for i in range(n):
        for j in range(i, n):
            terms = [Term(i, j, a, x) for a, x in enumerate(local.field) if any(x)]
            for k in range(n):
                terms += _zero_order(i, k, local.connection[k][j], negative=True)
                terms += _zero_order(j, k, local.connection[k][i], negative=True)
            found.append(_equation(local, "H2", i, j, terms))
    for i in range(n):
        for j in range(i + 1, n):
            terms = []
            for k in range(n):
                terms += _zero_order(i, k, local.endomorphism[k][j], negative=False)
                terms += _zero_order(j, k, local.endomorphism[k][i], negative=True)
            found.append(_equation(local, "H3", i, j, terms))
    return found


def _equation(local: LocalSystem, kind: str, i: int, j: int, terms: list[Term]) -> Equation:
    table = term_table(terms, local.ring.size, local.offset + local.dimension)
    return Equation(kind, i, j, tuple(terms), table)


def _zero_order(i: int, k: int, series: Series, negative: bool) -> list[Term]:
    if not any(series):
        return []
    return [Term(min(i, k), max(i, k), NO_DERIVATIVE, ps.scale(series, -1) if negative else series)]


@dataclass(slots=True)
class Prolongation:
    """The echelon form of all rows up to `order`, columns in ascending degree of g.

    `blocks[d]` holds the exponents of the unknowns of degree d + 2 in L (degree d in g).
    """

    local: LocalSystem
    echelon: Echelon
    order: int = -1
    equations: list[Equation] = field(default_factory=list)
    blocks: list[Exponents] = field(default_factory=list)
    row_blocks: list[tuple[int, Exponents]] = field(default_factory=list)

    @property
    def size(self) -> int:
        return self.local.ring.size

    @property
    def first_velocity(self) -> int:
        return self.local.offset + self.local.dimension

    def width(self, degree: int) -> int:
        """The number of unknowns of g of degree <= `degree`."""
        return sum(len(block) for block in self.blocks[: degree + 1])

    def dimension(self, degree: int) -> int:
        """D_degree(order): the dimension of the projection of the solutions to degrees <= degree."""
        width = self.width(degree)
        return width - self.echelon.rank_within(width)

    def row_name(self, number: int) -> RowName:
        """The name of an original row."""
        for equation, exponents in self.row_blocks:
            if number < len(exponents):
                found = self.equations[equation]
                return (found.kind, found.i, found.j, tuple(int(e) for e in exponents[number]))
            number -= len(exponents)
        raise IndexError("no such row")


def start(local: LocalSystem) -> Prolongation:
    """No rows yet; `advance` makes order 0, 1, …"""
    return Prolongation(local, Echelon(local.ring.prime), equations=equations(local))


def unknown_block(prolongation: Prolongation, degree: int) -> Exponents:
    """Exponents of the unknowns of degree `degree` in g: total degree + 2, v-degree >= 2."""
    table = exponents_of_degree(prolongation.size, degree + 2)
    kept: Exponents = table[table[:, prolongation.first_velocity :].sum(axis=1) >= 2]
    return kept


def advance(prolongation: Prolongation) -> None:
    """One order more: the rows of H2 of degree r - 1 and of H3 of degree r."""
    prolongation.order += 1
    order = prolongation.order
    prolongation.blocks.append(unknown_block(prolongation, order))
    prolongation.echelon.widen(prolongation.width(order))
    unknowns = _unknowns(prolongation)
    for kind, degree in (("H2", order - 1), ("H3", order)):
        if degree < 0:
            continue
        monomials = exponents_of_degree(prolongation.size, degree)
        keys = keys_of(MonomialKeys(prolongation.size), monomials)
        for number, equation in enumerate(prolongation.equations):
            if equation.kind == kind:
                bits, prime = MonomialKeys(prolongation.size).bits, prolongation.local.ring.prime
                rows = rows_of_degree(unknowns, equation.table, degree, keys, bits, prime)
                prolongation.echelon.insert(rows.starts, rows.columns, rows.values)
                prolongation.row_blocks.append((number, monomials))


def _unknowns(prolongation: Prolongation) -> Unknowns:
    exponents = np.concatenate(prolongation.blocks)
    widths = [0, *(len(block) for block in prolongation.blocks)]
    keys = keys_of(MonomialKeys(prolongation.size), exponents)
    return Unknowns(keys, exponents, np.cumsum(widths).astype(np.int64))

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from inverse_service.algebra import series as ps
from inverse_service.algebra.echelon import Echelon, Flags
from inverse_service.algebra.monomials import exponents_of_degree, raised_places
from inverse_service.algebra.series import Series, SeriesRing
from inverse_service.inverse_problem.decision.emission import NO_DERIVATIVE, Exponents, Term, rows_of_degree, term_table
from inverse_service.inverse_problem.decision.equations import KINDS, Equations, Kind, pairs_of, summands
from inverse_service.inverse_problem.decision.local_program import CompiledSystem
from inverse_service.inverse_problem.decision.monomial_tables import unknown_exponents

# (kind, i, j, alpha): which Helmholtz equation, which Taylor coefficient of it.
RowName = tuple[str, int, int, tuple[int, ...]]


def matrix_product(left: list[list[Series]], right: list[list[Series]]) -> list[list[Series]]:
    size = range(len(left))
    return [[sum_of_products([(left[i][k], right[k][j]) for k in size]) for j in size] for i in size]


def sum_of_products(pairs: Sequence[tuple[Series, Series]]) -> Series:
    """sum_k x_k y_k; most factors of a sparse system are zero, and cost nothing."""
    total: Series | None = None
    for x, y in pairs:
        if any(x) and any(y):
            product = ps.multiply(x, y)
            total = product if total is None else ps.add(total, product)
    return total or ps.scale(pairs[0][1], 0)


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


def along(field_: Sequence[Series], series: Series) -> Series | None:
    """Gamma(y) = sum_a X^a d_a y, one order less than y; None where y is zero."""
    if not any(series):
        return None
    return sum_of_products([(x, ps.derivative(series, a)) for a, x in enumerate(field_)])


def _less(left: Series, right: Series, factor: int) -> Series:
    """left - factor right."""
    return ps.subtract(left, ps.scale(right, factor)) if any(right) else left


def local_system(ring: SeriesRing, velocities: list[Series], forces: list[Series], with_time: bool) -> LocalSystem:
    """X, N, Phi from the series of v and f of order D; Phi comes out to order D - 2."""
    n = len(forces)
    offset = int(with_time)
    half = ring.invert_number(2)
    field_ = [*([ring.constant(1)] if with_time else []), *velocities, *forces]
    order = ring.order - 1
    by_velocity = [[ps.derivative(f, offset + n + j) for j in range(n)] for f in forces]
    by_position = [[ps.derivative(f, offset + j) for j in range(n)] for f in forces]
    lower = [truncate(x, order - 1) for x in field_]
    shorter = [[truncate(entry, order - 1) for entry in row] for row in by_velocity]
    square = matrix_product(shorter, shorter)
    zero = truncate(ring.constant(0), order - 1)
    endomorphism = []
    for i in range(n):
        row = []
        for j in range(n):
            entry = along(lower, by_velocity[i][j]) or zero
            entry = _less(entry, truncate(by_position[i][j], order - 1), 2)
            row.append(_less(entry, square[i][j], half))
        endomorphism.append(tuple(row))
    connection = tuple(
        tuple(ps.scale(entry, ring.prime - half) if any(entry) else entry for entry in row) for row in by_velocity
    )
    return LocalSystem(ring, offset, tuple(field_), connection, tuple(endomorphism))


def equations(local: LocalSystem | CompiledSystem) -> tuple[Equations, ...]:
    """H2 for i <= j, then H3 for i < j, with what prolongation to the order of Phi needs of the series."""
    if isinstance(local, CompiledSystem):
        return local.equations()
    order = local.ring.order - 2
    return tuple(_equations(local, kind, order - 1 if kind == "H2" else order) for kind in KINDS)


def _equations(local: LocalSystem, kind: Kind, degree: int) -> Equations:
    """The rows of this kind are wanted up to this degree."""
    n, size = local.dimension, local.ring.size
    matrix, terms = local.connection if kind == "H2" else local.endomorphism, []
    for s in summands(kind, n, size):
        series = matrix[s.row][s.column] if s.derivative == NO_DERIVATIVE else local.field[s.row]
        if any(series):
            terms.append(Term(s.equation, s.i, s.j, s.derivative, series, s.negative))
    pairs = pairs_of(kind, n)
    return Equations(kind, pairs, term_table(terms, len(pairs), size, size - n, degree))


@dataclass(slots=True)
class Prolongation:
    """The echelon form of all rows up to `order`, columns in ascending degree of g.

    `blocks[d]` holds the exponents of the unknowns of degree d + 2 in L (degree d in g). `dependent` marks,
    for each kind and degree, the rows that depend on those before; `expected` those that did elsewhere.
    """

    local: LocalSystem | CompiledSystem
    echelon: Echelon
    order: int = -1
    equations: tuple[Equations, ...] = ()
    blocks: list[Exponents] = field(default_factory=list)
    row_blocks: list[tuple[Equations, Exponents]] = field(default_factory=list)
    dependent: dict[tuple[str, int], Flags] = field(default_factory=dict)
    expected: Mapping[tuple[str, int], Flags] = field(default_factory=dict)

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
        for block, exponents in self.row_blocks:
            if number < len(block.pairs) * len(exponents):
                pair, monomial = divmod(number, len(exponents))
                i, j = block.pairs[pair]
                return (block.kind, i, j, tuple(int(e) for e in exponents[monomial]))
            number -= len(block.pairs) * len(exponents)
        raise IndexError("no such row")


def start(local: LocalSystem | CompiledSystem, expected: Mapping[tuple[str, int], Flags] | None = None) -> Prolongation:
    """No rows yet; `advance` makes order 0, 1, … `expected` marks rows that depended on others elsewhere."""
    return Prolongation(local, Echelon(local.ring.prime), equations=equations(local), expected=expected or {})


def unknown_block(prolongation: Prolongation, degree: int) -> Exponents:
    """Exponents of the unknowns of degree `degree` in g: total degree + 2, v-degree >= 2."""
    return unknown_exponents(prolongation.size, prolongation.first_velocity, degree)


def advance(prolongation: Prolongation) -> None:
    """One order more: the rows of H2 of degree r - 1 and of H3 of degree r."""
    prolongation.order += 1
    order = prolongation.order
    prolongation.blocks.append(unknown_block(prolongation, order))
    prolongation.echelon.widen(prolongation.width(order))
    for block in prolongation.equations:
        degree = order - 1 if block.kind == "H2" else order
        if degree < 0 or not block.pairs:
            continue
        rows = rows_of_degree(block.table, degree, prolongation.local.ring.prime)
        expected = _expected(prolongation, block, degree)
        found = prolongation.echelon.insert(rows.starts, rows.columns, rows.values, expected, in_order=False)
        prolongation.dependent[block.kind, degree] = found
        prolongation.row_blocks.append((block, exponents_of_degree(prolongation.size, degree)))


def _expected(prolongation: Prolongation, block: Equations, degree: int) -> Flags | None:
    """Which rows will depend on those before them: those that did elsewhere, or by the degree below.

    Near a generic point a dependence holds identically; its derivative d_a makes the row of alpha + e_a
    depend on rows that come before it, since their order is one of shifts. So the dependent alpha
    of one equation go on upwards.
    """
    known = prolongation.expected.get((block.kind, degree))
    below = prolongation.dependent.get((block.kind, degree - 1))
    if known is not None or below is None or not below.any():
        return known
    above = raised_places(prolongation.size, degree - 1)
    flags = np.zeros((len(block.pairs), len(exponents_of_degree(prolongation.size, degree))), np.bool_)
    pairs, monomials = np.nonzero(below.reshape(len(block.pairs), -1))
    flags[pairs[:, None], above[monomials]] = True
    return flags.reshape(-1)

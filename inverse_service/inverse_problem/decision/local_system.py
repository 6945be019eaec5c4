"""X, N and Phi about a point by sparse series, for systems too large for compiled ones, and for other rooms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.algebra import series as ps
from inverse_service.algebra.series import Series, SeriesRing
from inverse_service.inverse_problem.kinds.helmholtz import KINDS, Kind, pairs_of, summands, unknowns_of
from inverse_service.linear_pde.emission import NO_DERIVATIVE, Equations, LocalEquations, Term, term_table

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


def equations(local: LocalSystem) -> LocalEquations:
    """H2 for i <= j, then H3 for i < j, with what prolongation to the order of Phi needs of the series."""
    order = local.ring.order - 2
    blocks = tuple(_equations(local, kind, k, order - k) for kind, k in KINDS)
    return LocalEquations(unknowns_of(local.dimension, local.ring.size), local.ring.prime, blocks)


def _equations(local: LocalSystem, kind: Kind, order: int, degree: int) -> Equations:
    """The rows of this kind are wanted up to this degree."""
    n, size = local.dimension, local.ring.size
    matrix, terms = local.connection if kind == "H2" else local.endomorphism, []
    for s in summands(kind, n, size):
        series = matrix[s.row][s.column] if s.derivative == NO_DERIVATIVE else local.field[s.row]
        if any(series):
            terms.append(Term(s.equation, s.entry, s.derivative, series, s.negative))
    pairs = pairs_of(kind, n)
    return Equations(kind, pairs, order, term_table(unknowns_of(n, size), terms, len(pairs), degree))

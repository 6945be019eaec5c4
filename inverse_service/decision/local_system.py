"""X, N and Phi about a point by sparse series, for systems too large for compiled ones, and for other rooms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.decision.kinds.helmholtz import KINDS, Kind, pairs_of, summands, unknowns_of
from inverse_service.field import truncated_series as ps
from inverse_service.field.truncated_series import Series, SeriesRing
from inverse_service.linear_pde.emission import NO_DERIVATIVE, Equations, LocalEquations, Term, term_table
from inverse_service.mechanics.conditions import Motion, connection, jacobi_endomorphism

# (kind, i, j, alpha): which Helmholtz equation, which Taylor coefficient of it.
RowName = tuple[str, int, int, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class LocalScalar:
    """A truncated series; sums and products are known to the lower of the two orders."""

    ring: SeriesRing
    series: Series

    def _common(self, other: LocalScalar) -> tuple[Series, Series]:
        length = min(len(self.series), len(other.series))
        return self.series[:length], other.series[:length]

    def __add__(self, other: LocalScalar) -> LocalScalar:
        return LocalScalar(self.ring, ps.add(*self._common(other)))

    def __sub__(self, other: LocalScalar) -> LocalScalar:
        return LocalScalar(self.ring, ps.subtract(*self._common(other)))

    def __mul__(self, other: LocalScalar) -> LocalScalar:
        return LocalScalar(self.ring, ps.multiply(*self._common(other)))

    def scaled(self, factor: int | Fraction) -> LocalScalar:
        residue = factor.numerator * self.ring.invert_number(factor.denominator) % self.ring.prime
        return self if self.is_zero else LocalScalar(self.ring, ps.scale(self.series, residue))

    @property
    def is_zero(self) -> bool:
        # Skipped in a sum, a truncated zero would say something of the orders beyond: but in each sum of
        # `mechanics.conditions` stands a derivative along the motion, which is known to the lowest order of all.
        return not any(self.series)

    @property
    def value(self) -> int:
        """The constant term: the value at the point."""
        return ps.value_at_point(self.series)


def field_of(ring: SeriesRing, velocities: list[Series], forces: list[Series]) -> tuple[Series, ...]:
    """X = (1?, v, f)."""
    return (*[ring.constant(1)] * (ring.size - 2 * len(forces)), *velocities, *forces)


def motion_of_series(ring: SeriesRing, velocities: list[Series], forces: list[Series]) -> Motion[LocalScalar]:
    """The motion from the series of v and f in the displacements (t?, q, v); t is the one before q, if any."""
    n = len(forces)
    offset = ring.size - 2 * n
    forward = field_of(ring, velocities, forces)

    def partial(index: int) -> Callable[[LocalScalar], LocalScalar]:
        return lambda scalar: LocalScalar(ring, ps.derivative(scalar.series, index))

    partials = [partial(index) for index in range(ring.size)]
    return Motion(
        tuple(LocalScalar(ring, force) for force in forces),
        tuple(partials[offset : offset + n]),
        tuple(partials[offset + n :]),
        lambda scalar: LocalScalar(ring, ps.along(enumerate(forward), scalar.series)),
        LocalScalar(ring, ring.constant(0)),
    )


@dataclass(frozen=True, slots=True)
class LocalSystem:
    """Series of X, N and Phi about the point."""

    ring: SeriesRing
    field: tuple[Series, ...]
    connection: tuple[tuple[Series, ...], ...]
    endomorphism: tuple[tuple[Series, ...], ...]

    @property
    def dimension(self) -> int:
        return len(self.connection)


def local_system(ring: SeriesRing, velocities: list[Series], forces: list[Series]) -> LocalSystem:
    """X, N, Phi from the series of v and f of order D in (t?, q, v); Phi comes out to order D - 2."""
    motion = motion_of_series(ring, velocities, forces)
    tensors = (connection(motion), jacobi_endomorphism(motion))
    N, Phi = (tuple(tuple(entry.series for entry in row) for row in tensor) for tensor in tensors)
    return LocalSystem(ring, field_of(ring, velocities, forces), N, Phi)


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

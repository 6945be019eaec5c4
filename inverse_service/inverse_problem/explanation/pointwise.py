"""A system's motion in Taylor series about a random point modulo a prime."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.algebra import series as ps
from inverse_service.algebra.point import Expansion, Variable
from inverse_service.algebra.series import Series, SeriesRing, SingularPoint
from inverse_service.algebra.tower import draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.mechanics.conditions import Motion

_POINTS = 8


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
        fraction = Fraction(factor)
        residue = fraction.numerator * self.ring.invert_number(fraction.denominator) % self.ring.prime
        return LocalScalar(self.ring, ps.scale(self.series, residue))

    @property
    def is_zero(self) -> bool:
        # A truncated zero says nothing of the orders beyond, so only a full one may be skipped.
        return len(self.series) == self.ring.order + 1 and not any(self.series)

    @property
    def value(self) -> int:
        """The constant term: the value at the point."""
        return ps.value_at_point(self.series)


@dataclass(frozen=True, slots=True)
class LocalMotion:
    """A motion over truncated series."""

    ring: SeriesRing
    motion: Motion[LocalScalar]


def motion_of_series(ring: SeriesRing, velocities: list[Series], forces: list[Series]) -> LocalMotion:
    """The motion from the series of v and f in the displacements (t?, q, v); t is the one before q, if any."""
    n = len(forces)
    offset = ring.size - 2 * n
    forward = [ring.constant(1)] * offset + velocities + forces

    def partial(index: int) -> Callable[[LocalScalar], LocalScalar]:
        return lambda scalar: LocalScalar(ring, ps.derivative(scalar.series, index))

    def along(scalar: LocalScalar) -> LocalScalar:
        length = len(scalar.series) - 1
        total = ring.constant(0)[:length]
        for index, component in enumerate(forward):
            slope = ps.derivative(scalar.series, index)
            if any(slope):
                total = ps.add(total, ps.multiply(component[:length], slope))
        return LocalScalar(ring, total)

    partials = [partial(index) for index in range(ring.size)]
    motion = Motion(
        tuple(LocalScalar(ring, force) for force in forces),
        tuple(partials[offset : offset + n]),
        tuple(partials[offset + n :]),
        along,
        LocalScalar(ring, ring.constant(0)),
    )
    return LocalMotion(ring, motion)


def local_motion(analysis: Analysis, seed: int, order: int) -> LocalMotion:
    """The motion about the random point of this seed, f known to `order`.

    A point where a denominator vanishes is passed over for the next one. Raises IrreducibleAtoms
    where no point was found.
    """
    system = analysis.system
    coordinates: list[Variable] = [Symbol(name) for name in system.coordinates]
    velocities: list[Variable] = [Velocity(name) for name in system.coordinates]
    variables: list[Variable] = [*([TIME] if system.depends_on_time else []), *coordinates, *velocities]
    for attempt in range(_POINTS):
        point = draw_point(analysis.tower, seed * _POINTS + attempt)
        expansion = Expansion(point, variables, order)
        try:
            forces = [expansion.expand(f) for f in analysis.accelerations]
        except SingularPoint:
            continue
        return motion_of_series(expansion.ring, [expansion.expand(v) for v in velocities], forces)
    raise IrreducibleAtoms("the formulas vanish or have no value at every random point tried")

"""The class L = (I_1 r1'^2 + I_2 r2'^2 + sum I_a s_a'^2)/2 - V, s_a' = -A_a(r1) r2', seen by its structure.

With N = (I_2 + sum I_a A_a^2)^(-1/2) and K = sum I_a A_a A_a' its motion without V is r1'' = 0,
r2'' = -N^2 K r1' r2', and (r2', s_1', ..., s_k') = c u(r1) with u = N (1, -A_1, ..., -A_k) and c constant.
Source: T. Mestdag, A. M. Bloch, O. E. Fernandez, Hamiltonization and geometric integration of
nonholonomic mechanical systems, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from inverse_service.algebra.exact_derivations import sum_of
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.expressions.tree import Expression, power
from inverse_service.mechanics.nonholonomic.geometry import Frame, Geometry, frames
from inverse_service.mechanics.potential import potential


@dataclass(frozen=True, slots=True)
class PaperClass:
    """The roles of the coordinates (places in the system) and the functions of the class.

    `masses` are I_2, I_1', … of the coordinates `moving` = (r2, s_1, …); `slopes` are A_1, …, A_k.
    `has_force` says that V is not constant; `force_fits` that V depends on r2 at most.
    """

    geometry: Geometry
    frame: Frame
    r1: int
    r2: int
    mass_of_r1: Quotient
    masses: tuple[Quotient, ...]
    slopes: tuple[Quotient, ...]
    has_force: bool
    force_fits: bool

    @property
    def moving(self) -> tuple[int, ...]:
        """r2 and s_1, …, s_k."""
        return (self.r2, *self.frame.dependent)

    @property
    def directions(self) -> tuple[Quotient, ...]:
        """u / N = (1, -A_1, …, -A_k)."""
        return (self.geometry.ring.constant(1), *(-slope for slope in self.slopes))

    @property
    def inverse_square_density(self) -> Quotient:
        """1/N^2 = I_2 + sum I_a A_a^2."""
        terms = [mass * entry * entry for mass, entry in zip(self.masses, self.directions, strict=True)]
        return sum_of(self.geometry.zero, terms)

    @property
    def density(self) -> Expression:
        """N up to a constant factor, in its simplest form: 1 where it is constant, cos(phi) for A = tan(phi)."""
        ring, square = self.geometry.ring, self.inverse_square_density
        found = potential(ring, [1 + self.r1], [-(self.slope_of_density / square)])
        return power(self.geometry.tree(square), Fraction(-1, 2)) if found is None else found.exponential(ring)

    @property
    def slope_of_density(self) -> Quotient:
        """K = sum I_a A_a A_a'."""
        terms = [mass * slope * self.by_r1(slope) for mass, slope in zip(self.masses[1:], self.slopes, strict=True)]
        return sum_of(self.geometry.zero, terms)

    @property
    def density_is_constant(self) -> bool:
        return self.slope_of_density.is_zero

    def by_r1(self, element: Quotient) -> Quotient:
        return self.geometry.by_coordinate(self.r1, element)


def recognised(parts: Geometry) -> tuple[PaperClass | None, str]:
    """The system as a member of the class, or the reason why it is none.

    Every choice of dependent coordinates is tried, the most convenient one first; one in which V
    depends on r2 at most is preferred.
    """
    reason = _kinetic_fault(parts)
    if reason:
        return None, reason
    if parts.size - len(parts.rows) != 2:
        count = parts.size - len(parts.rows)
        return None, f"the constraints leave {count} free velocit{'y' if count == 1 else 'ies'}, the class has two"
    found = [member for choice in frames(parts) for member in _members(parts, choice)]
    if not found:
        return None, "the constraints are not of the form s' = -A(r1) r2' with one r1 and one r2 for all of them"
    return next((member for member in found if member.force_fits), found[0]), ""


def _kinetic_fault(parts: Geometry) -> str:
    n = parts.size
    if any(not parts.mass[i][j].is_zero for i in range(n) for j in range(n) if i != j):
        return "the kinetic energy has mixed terms, that of the class is a sum of squares of velocities"
    if any(parts.depends_on_position(parts.mass[i][i]) for i in range(n)):
        return "the kinetic energy depends on the position, that of the class has constant coefficients"
    if any(parts.mass[i][i].is_zero for i in range(n)):
        return "a velocity does not occur in the kinetic energy"
    if any(parts.depends_on_position(entry) for entry in parts.linear):
        return "the Lagrangian has terms linear in the velocities"
    if any(not offset.is_zero for offset in parts.offsets):
        return "a constraint has a velocity-free term"
    return ""


def _members(parts: Geometry, choice: Frame) -> list[PaperClass]:
    """The class with each of the two free coordinates as r1, where that fits."""
    found = []
    for place in (0, 1):
        r1, r2 = choice.free[place], choice.free[1 - place]
        column_r1 = [choice.basis[k][place] for k in choice.dependent]
        slopes = tuple(-choice.basis[k][1 - place] for k in choice.dependent)
        if any(not entry.is_zero for entry in column_r1) or not all(_only(parts, slope, r1) for slope in slopes):
            continue
        masses = tuple(parts.mass[k][k] for k in (r2, *choice.dependent))
        force, fits = parts.depends_on_position(parts.potential), _only(parts, parts.potential, r2)
        found.append(PaperClass(parts, choice, r1, r2, parts.mass[r1][r1], masses, slopes, force, fits))
    return found


def _only(parts: Geometry, element: Quotient, place: int) -> bool:
    """Whether the element depends on this coordinate at most."""
    others = [parts.by_coordinate(k, element) for k in range(parts.size) if k != place]
    return all(slope.is_zero for slope in [*others, parts.by_time(element)])

"""The class L = (I_1 r1'^2 + I_2 r2'^2 + sum I_a s_a'^2)/2 - V, s_a' = -A_a(r1) r2', seen by its structure.

With N = (I_2 + sum I_a A_a^2)^(-1/2) and K = sum I_a A_a A_a' its motion without V is r1'' = 0,
r2'' = -N^2 K r1' r2', and (r2', s_1', ..., s_k') = c u(r1) with u = N (1, -A_1, ..., -A_k) and c constant.
Source: T. Mestdag, A. M. Bloch, O. E. Fernandez, Hamiltonization and geometric integration of
nonholonomic mechanical systems, 2009.

The third associated system: (r2', s')' = r1' M(r1) (r2', s') with M skew for the masses.

On the constraints w = (r2', s_1', ..., s_k') = c u(r1), u = N (1, -A), u^T D u = 1, D = diag(I_2, I_a).
Any symmetric regular S(r1) with S u = constant gives the system w' = r1' M w, M = -S^-1 S', that holds
the motion, and it is variational:

    L = I_1 r1'^2/2 + w^T S w/(2 r1'),  H = (p_r1 + p_w^T S^-1 p_w/2)^2/(2 I_1),  p_w ~ S u on the constraints.

The second system has S = diag(1/u_i). The third has for S a reflection in the metric D, so that M is a
rotation, and constraints with constant coefficients in the momenta. Entries of u that are constant are
left alone; J are the others, rho = sum over J of I_i u_i^2 (a constant), e the first of J:
    two in J     S = ((I_e u_e, I_j u_j), (I_j u_j, -I_j u_e)), rational in u
    more in J    S_ee = I_e u_e, S_ej = I_j u_j sqrt(I_e)/..., see `_matrix`; regular where u_e sqrt(I_e) > -sqrt(rho)
In both cases S u = (rho, 0, ..., 0) up to a constant. With one in J u would be constant too.
Derived here; for one constraint in M. Mestdag's systems see docs/explanation/constrained-systems.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import ZERO, Expression, Symbol, Velocity, add, square_root
from inverse_service.field.exact_field import Quotient, sum_of
from inverse_service.mechanics.nonholonomic.geometry import Frame, Geometry, frames
from inverse_service.mechanics.potential import potential
from inverse_service.mechanics.writing import tidied


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
        return self.geometry.tree(square) ** Fraction(-1, 2) if found is None else found.exponential(ring)

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


def recognized(parts: Geometry) -> tuple[PaperClass | None, str]:
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


Matrix = list[list[Expression]]


@dataclass(frozen=True, slots=True)
class Rotation:
    """M and S over the coordinates `names` = (r2, s_1, …); `turning` are the places J."""

    driver: str
    names: tuple[str, ...]
    turning: tuple[int, ...]
    generator: tuple[tuple[Expression, ...], ...]
    form: tuple[tuple[Expression, ...], ...]
    inverse: tuple[tuple[Expression, ...], ...]
    explanation: str

    def terms(self) -> list[Expression]:
        """r1' M w, one tree for each name."""
        rate = Velocity(self.driver)
        return [
            add(*(tidied(entry * rate * Velocity(name)) for entry, name in zip(row, self.names, strict=True)))
            for row in self.generator
        ]


def rotation(member: PaperClass) -> Rotation:
    """The rotation of a member of the class; the zero matrix where u is constant (integrable constraints)."""
    names = member.geometry.system.coordinates
    r1 = Symbol(names[member.r1])
    masses = [member.geometry.tree(mass) for mass in member.masses]
    constant = _constant_entries(member)
    turning = tuple(place for place in range(len(masses)) if place not in constant)
    size = len(masses)
    generator: Matrix = [[ZERO] * size for _ in range(size)]
    form: Matrix = [[ZERO] * size for _ in range(size)]
    for place in constant:
        form[place][place] = masses[place]
    if turning:
        if len(turning) == 2:
            _fill_plane(generator, form, turning, masses, _unit(member), r1)
        else:
            _fill_space(generator, form, turning, masses, _unit(member), r1)
    text = _explanation([names[member.moving[place]] for place in turning], names[member.r1])
    return Rotation(
        names[member.r1],
        tuple(names[place] for place in member.moving),
        turning,
        tuple(map(tuple, generator)),
        tuple(map(tuple, form)),
        tuple(map(tuple, _inverse(form, turning, masses))),
        text,
    )


def _constant_entries(member: PaperClass) -> list[int]:
    """Places at which u = N (1, -A) is constant: (u_i^2)' = 0."""
    square = member.inverse_square_density
    return [place for place, entry in enumerate(member.directions) if member.by_r1(entry * entry / square).is_zero]


def _unit(member: PaperClass) -> list[Expression]:
    """u up to a constant factor: N (1, -A)."""
    density = member.density
    return [tidied(density * member.geometry.tree(entry)) for entry in member.directions]


def _fill_space(
    generator: Matrix, form: Matrix, turning: Sequence[int], masses: Sequence[Expression], u: Sequence[Expression],
    r1: Symbol,
) -> None:  # fmt: skip
    """M and S on the places J: a reflection that takes u to a multiple of the first unit vector of J."""
    first, others = turning[0], turning[1:]
    rho = tidied(add(*(masses[k] * u[k] ** 2 for k in turning)))
    norm, root = collect(square_root(rho)), collect(square_root(masses[first]))
    height = root * u[first]
    below = norm + height
    for k in others:
        form[first][k] = form[k][first] = tidied(root * masses[k] * u[k])
        for m in others:
            square = masses[k] * masses[m] * u[k] * u[m] / below
            form[k][m] = tidied(square - norm * masses[k] if k == m else square)
    form[first][first] = tidied(root * masses[first] * u[first])
    slopes = [differentiate(entry, r1) for entry in u]
    lifted = {k: u[k] for k in others} | {first: u[first] + norm / root}
    scale = (norm * below) ** -1
    for k in turning:
        for m in turning:
            wedge = slopes[k] * lifted[m] - lifted[k] * slopes[m]
            generator[k][m] = ZERO if k == m else tidied(masses[m] * wedge * scale)


def _fill_plane(
    generator: Matrix, form: Matrix, turning: Sequence[int], masses: Sequence[Expression], u: Sequence[Expression],
    r1: Symbol,
) -> None:  # fmt: skip
    i, j = turning
    rho = masses[i] * u[i] ** 2 + masses[j] * u[j] ** 2
    wedge = differentiate(u[i], r1) * u[j] - differentiate(u[j], r1) * u[i]
    speed = wedge / rho
    generator[i][j] = tidied(masses[j] * speed)
    generator[j][i] = tidied(-(masses[i] * speed))
    form[i][i] = tidied(masses[i] * u[i])
    form[i][j] = form[j][i] = tidied(masses[j] * u[j])
    form[j][j] = tidied(-(masses[j] * u[i]))


def _inverse(form: Matrix, turning: Sequence[int], masses: Sequence[Expression]) -> Matrix:
    """S^-1 = c D^-1 S D^-1 on the places J, as S is a multiple of a reflection; 0 elsewhere."""
    size = len(masses)
    found: Matrix = [[ZERO] * size for _ in range(size)]
    if not turning:
        return found
    first = turning[0]
    # (S D^-1 S)_ee = S_ee / c
    square = add(*(form[first][k] ** 2 / masses[k] for k in turning))
    scale = tidied(masses[first] / square)
    for i in turning:
        for j in turning:
            found[i][j] = tidied(scale * form[i][j] / (masses[i] * masses[j]))
    return found


def _explanation(turning: Sequence[str], driver: str) -> str:
    if not turning:
        return "The direction of the velocities does not change: nothing turns, all accelerations but forces are zero."
    text = (
        f"The velocities of {', '.join(turning)} turn as a vector of constant length (in the masses) with "
        f"angular velocity proportional to {driver}'."
    )
    if len(turning) > 2:
        text += " The rotation is the one that takes the velocity to a fixed axis by a reflection."
    return text

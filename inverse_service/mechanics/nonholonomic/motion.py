"""The equations of motion of a nonholonomic system, the multipliers eliminated exactly.

d'Alembert's principle: d/dt(dL/dv) - dL/dq = lambda_a w^a with w^a(v) + c^a = 0. With v = B u + drift
the free accelerations follow from B^T (g a - F) = 0, a = B u' + (dB/dt) u + d(drift)/dt, so that g
needs to be regular on the distribution of the constraints only.
Source: A. M. Bloch, Nonholonomic Mechanics and Control, 2003, chapter 5.

A motion on a manifold of constraints, however it was given.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, add, holds, substitute
from inverse_service.field.exact_field import Quotient, TooLarge, sum_of
from inverse_service.field.matrices import dot, solve_square
from inverse_service.mechanics.nonholonomic.geometry import (
    Frame,
    Geometry,
    NonholonomicSystem,
    frames,
    geometry,
    too_large,
)
from inverse_service.mechanics.second_order_system import Functions


@dataclass(frozen=True, slots=True)
class ConstrainedMotion:
    """The equations over (t, q, u): s' = w for the `dependent` coordinates, u' = F for the velocities u of the `free`.

    `dependent_velocities[i]` is the velocity of coordinate dependent[i] (first-order equations),
    `free_accelerations[i]` the acceleration of free[i] (second-order equations).
    """

    coordinates: tuple[str, ...]
    free: tuple[str, ...]
    dependent: tuple[str, ...]
    dependent_velocities: tuple[Expression, ...]
    free_accelerations: tuple[Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: Functions = ()

    @property
    def depends_on_time(self) -> bool:
        trees = (*self.dependent_velocities, *self.free_accelerations)
        return any(holds(tree, TIME) for tree in trees)

    @property
    def on_constraints(self) -> dict[Expression, Expression]:
        """The dependent velocities by the free ones."""
        return {Velocity(name): w for name, w in zip(self.dependent, self.dependent_velocities, strict=True)}

    def rate(self, tree: Expression) -> Expression:
        """The derivative along the motion of a function of t, q and the free velocities."""
        rates, forces = self.on_constraints, zip(self.free, self.free_accelerations, strict=True)
        speeds = [differentiate(tree, Symbol(q)) * rates.get(Velocity(q), Velocity(q)) for q in self.coordinates]
        return add(differentiate(tree, TIME), *speeds, *(differentiate(tree, Velocity(u)) * f for u, f in forces))


@dataclass(frozen=True, slots=True, kw_only=True)
class EquationsOfMotion(ConstrainedMotion):
    """The motion of a Lagrangian, with what is known of it.

    `accelerations` are those of all coordinates, in the order of the system, and `multipliers` the lambda_a, one for
    each constraint; both hold free velocities only.
    """

    system: NonholonomicSystem
    accelerations: tuple[Expression, ...]
    multipliers: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class EliminatedMotion:
    """The motion in exact functions: `velocities` v(t, q, u) and `accelerations` a(t, q, u), each n.

    `inertia` is the mass matrix G = B^T g B of the free velocities.
    """

    geometry: Geometry
    frame: Frame
    velocities: tuple[Quotient, ...]
    accelerations: tuple[Quotient, ...]
    inertia: tuple[tuple[Quotient, ...], ...]
    multipliers: tuple[Quotient, ...]

    def rate(self, element: Quotient) -> Quotient:
        """The derivative along the motion of a function of (t, q, u)."""
        parts = self.geometry
        terms = [parts.by_time(element)]
        terms += [self.velocities[k] * parts.by_coordinate(k, element) for k in range(parts.size)]
        terms += [self.accelerations[k] * parts.by_velocity(k, element) for k in self.frame.free]
        return sum_of(parts.zero, terms)


def equations_of_motion(system: NonholonomicSystem) -> EquationsOfMotion:
    """The equations of motion in the most convenient free coordinates.

    InputError where L or a constraint is outside what `geometry` accepts, or where L is singular on
    the distribution of the constraints; LimitError where the equations are too large.
    """
    parts = geometry(system)
    try:
        return written(eliminate_multipliers(parts, frames(parts)[0]))
    except TooLarge as error:
        raise too_large(error) from None


def written(motion: EliminatedMotion) -> EquationsOfMotion:
    """The motion as trees."""
    parts, choice = motion.geometry, motion.frame
    names = parts.system.coordinates
    accelerations = tuple(parts.tree(element) for element in motion.accelerations)
    return EquationsOfMotion(
        names,
        tuple(names[k] for k in choice.free),
        tuple(names[k] for k in choice.dependent),
        tuple(parts.tree(motion.velocities[k]) for k in choice.dependent),
        tuple(accelerations[k] for k in choice.free),
        parts.system.parameters,
        parts.system.functions,
        system=parts.system,
        accelerations=accelerations,
        multipliers=tuple(parts.tree(element) for element in motion.multipliers),
    )


def eliminate_multipliers(parts: Geometry, choice: Frame) -> EliminatedMotion:
    """The motion with a given frame; InputError where B^T g B is singular."""
    n, m = parts.size, len(choice.free)
    speeds = [parts.velocity(k) for k in choice.free]
    velocities = tuple(dot(parts.zero, row, speeds) + drift for row, drift in _rows(choice))
    bias = tuple(
        dot(parts.zero, [_rate(parts, velocities, entry) for entry in row], speeds) + _rate(parts, velocities, drift)
        for row, drift in _rows(choice)
    )
    force = _force(parts, velocities)
    columns = [[row[j] for row in choice.basis] for j in range(m)]
    lowered = [[dot(parts.zero, row, column) for row in parts.mass] for column in columns]
    inertia = tuple(tuple(dot(parts.zero, lowered[i], columns[j]) for j in range(m)) for i in range(m))
    left = [force[i] - dot(parts.zero, parts.mass[i], bias) for i in range(n)]
    solved = solve_square(inertia, [dot(parts.zero, column, left) for column in columns])
    if solved is None:
        raise InputError(
            "the Lagrangian is singular on the constraints, its kinetic energy does not determine the accelerations of "
            f"{', '.join(parts.system.coordinates[k] for k in choice.free)}: give these motions a mass.",
            "/lagrangian",
        )
    accelerations = tuple(dot(parts.zero, row, solved) + extra for row, extra in zip(choice.basis, bias, strict=True))
    multipliers = _multipliers(parts, choice, accelerations, force)
    return EliminatedMotion(parts, choice, velocities, accelerations, inertia, multipliers)


def _rows(choice: Frame) -> list[tuple[tuple[Quotient, ...], Quotient]]:
    return list(zip(choice.basis, choice.drift, strict=True))


def _rate(parts: Geometry, velocities: Sequence[Quotient], element: Quotient) -> Quotient:
    """The derivative in time of a function of (t, q)."""
    terms = [velocities[k] * parts.by_coordinate(k, element) for k in range(parts.size)]
    return sum_of(parts.zero, [parts.by_time(element), *terms])


def _force(parts: Geometry, velocities: Sequence[Quotient]) -> list[Quotient]:
    """F with d/dt(dL/dv) - dL/dq = g a - F, the velocities put in."""
    n = parts.size
    half = Fraction(1, 2)
    found = []
    for i in range(n):
        terms = [-parts.by_coordinate(i, parts.potential), -_rate(parts, velocities, parts.linear[i])]
        for j in range(n):
            terms.append(velocities[j] * parts.by_coordinate(i, parts.linear[j]))
            terms.append(-(velocities[j] * _rate(parts, velocities, parts.mass[i][j])))
            slopes = [parts.by_coordinate(i, parts.mass[j][k]) for k in range(n)]
            terms.append((velocities[j] * dot(parts.zero, slopes, velocities)).scaled(half))
        found.append(sum_of(parts.zero, terms))
    return found


def _multipliers(
    parts: Geometry, choice: Frame, accelerations: Sequence[Quotient], force: Sequence[Quotient]
) -> tuple[Quotient, ...]:
    """lambda_a from the dependent rows of g a - F = lambda_a w^a."""
    matrix = [[row[place] for row in parts.rows] for place in choice.dependent]
    right = [dot(parts.zero, parts.mass[i], accelerations) - force[i] for i in choice.dependent]
    solved = solve_square(matrix, right)
    assert solved is not None, "the minor of the dependent coordinates does not vanish"
    return solved


def motion_on(system: NonholonomicSystem, accelerations: Mapping[str, Expression]) -> ConstrainedMotion:
    """The motion with these accelerations of the free coordinates on the constraints of a system.

    InputError where the constraints do not give the velocities of the others by theirs.
    """
    names = system.coordinates
    parts = geometry(system)
    dependent = tuple(place for place, name in enumerate(names) if name not in accelerations)
    choice = next((found for found in frames(parts) if found.dependent == dependent), None)
    if choice is None:
        listed = ", ".join(names[place] for place in dependent)
        raise InputError(f"the constraints do not determine the velocities of {listed} from the others.", "/motion")
    speeds = [parts.velocity(place) for place in choice.free]
    rates = [dot(parts.zero, choice.basis[place], speeds) + choice.drift[place] for place in dependent]
    velocities = tuple(parts.tree(rate) for rate in rates)
    free, bound = (tuple(names[place] for place in places) for places in (choice.free, dependent))
    forces = tuple(accelerations[name] for name in free)
    found = ConstrainedMotion(names, free, bound, velocities, forces, system.parameters, system.functions)
    return replace(found, free_accelerations=tuple(substitute(force, found.on_constraints) for force in forces))

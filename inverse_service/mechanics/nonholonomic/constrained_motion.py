"""A motion on a manifold of constraints, however it was given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from inverse_service.errors import InputError
from inverse_service.expressions.tree import TIME, Expression, Velocity, substitute, walk
from inverse_service.mechanics.nonholonomic.geometry import frames, geometry
from inverse_service.mechanics.nonholonomic.motion import EquationsOfMotion
from inverse_service.mechanics.nonholonomic.system import NonholonomicSystem
from inverse_service.mechanics.quotient_matrices import dot
from inverse_service.mechanics.second_order_system import FunctionDeclaration


@dataclass(frozen=True, slots=True)
class ConstrainedMotion:
    """s' = w(t, q, u) for the `dependent` coordinates, u' = F(t, q, u) for the velocities u of the `free` ones."""

    coordinates: tuple[str, ...]
    free: tuple[str, ...]
    dependent: tuple[str, ...]
    dependent_velocities: tuple[Expression, ...]
    free_accelerations: tuple[Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: tuple[FunctionDeclaration, ...] = ()

    @property
    def depends_on_time(self) -> bool:
        trees = (*self.dependent_velocities, *self.free_accelerations)
        return any(node == TIME for tree in trees for node in walk(tree))

    @property
    def on_constraints(self) -> dict[Expression, Expression]:
        """The dependent velocities by the free ones."""
        return {Velocity(name): w for name, w in zip(self.dependent, self.dependent_velocities, strict=True)}


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
        raise InputError(f"the constraints do not fix the velocities of {listed} by the others.", "/motion")
    speeds = [parts.velocity(place) for place in choice.free]
    rates = [dot(parts.zero, choice.basis[place], speeds) + choice.drift[place] for place in dependent]
    velocities = tuple(parts.tree(rate) for rate in rates)
    on: dict[Expression, Expression] = {
        Velocity(names[place]): rate for place, rate in zip(dependent, velocities, strict=True)
    }
    free = tuple(names[place] for place in choice.free)
    forces = tuple(substitute(accelerations[name], on) for name in free)
    bound = tuple(names[place] for place in dependent)
    return ConstrainedMotion(names, free, bound, velocities, forces, system.parameters, system.functions)


def constrained_motion(motion: EquationsOfMotion) -> ConstrainedMotion:
    """The motion without the Lagrangian that it came from."""
    system = motion.system
    return ConstrainedMotion(
        system.coordinates, motion.free, motion.dependent, motion.dependent_velocities, motion.free_accelerations,
        system.parameters, system.functions,
    )  # fmt: skip

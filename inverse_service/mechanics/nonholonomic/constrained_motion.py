"""A motion on a manifold of constraints, however it was given."""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.expressions.tree import TIME, Expression, Velocity, walk
from inverse_service.mechanics.nonholonomic.motion import EquationsOfMotion
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


def constrained_motion(motion: EquationsOfMotion) -> ConstrainedMotion:
    """The motion without the Lagrangian that it came from."""
    system = motion.system
    return ConstrainedMotion(
        system.coordinates, motion.free, motion.dependent, motion.dependent_velocities, motion.free_accelerations,
        system.parameters, system.functions,
    )  # fmt: skip

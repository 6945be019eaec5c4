"""What the integrators need to know of a mechanical problem, as trees."""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.expressions.tree import TIME, Expression, walk


@dataclass(frozen=True, slots=True)
class Problem:
    """One motion, described in the ways that the methods ask for; what is not known is None.

    `lagrangian` L of the constrained system with its effects applied, `constraints` omega(q) . v, linear in the
    velocities, `free_lagrangian` the L~ of an associated second-order system or the L of a free one,
    `free_hamiltonian` its H~(q, p) in Symbol("p_x") for each coordinate x, `free_constants` names among the
    parameters that L~ may choose freely (C2, a_x, ...), `accelerations` all n accelerations of the true motion,
    `forces` Q_i(t, q, q') that act beside `lagrangian` or `free_lagrangian`.
    """

    coordinates: tuple[str, ...]
    parameters: tuple[str, ...] = ()
    lagrangian: Expression | None = None
    constraints: tuple[Expression, ...] = ()
    free_lagrangian: Expression | None = None
    free_hamiltonian: Expression | None = None
    free_constants: tuple[str, ...] = ()
    accelerations: tuple[Expression, ...] | None = None
    forces: tuple[Expression, ...] = ()

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in any of the formulas; the motion begins at t = 0."""
        trees = (
            self.lagrangian,
            self.free_lagrangian,
            self.free_hamiltonian,
            *(self.accelerations or ()),
            *self.forces,
        )
        return any(node == TIME for tree in trees if tree is not None for node in walk(tree))

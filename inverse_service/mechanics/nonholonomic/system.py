"""A Lagrangian with constraints on the velocities, as data."""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.expressions.tree import Expression
from inverse_service.mechanics.second_order_system import FunctionDeclaration


@dataclass(frozen=True, slots=True)
class NonholonomicSystem:
    """L(t, q, v) with the constraints w(t, q, v) = 0, one tree each, linear in the velocities.

    Parameters are generic constants; those with values were substituted. That L is quadratic and the
    constraints are linear is seen where the equations of motion are made (`geometry`).
    """

    coordinates: tuple[str, ...]
    lagrangian: Expression
    constraints: tuple[Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: tuple[FunctionDeclaration, ...] = ()
    name: str = ""

"""Which method to take for a scene, and why, seen from its formulas."""

from __future__ import annotations

from typing import Any

import numpy as np

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import TIME, ZERO, Expression, Symbol, Velocity, walk
from inverse_service.mechanics.euler_lagrange import hessian
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.scene import Scene

STIFF = 1e3  # decay times that a run is long, beyond which an explicit method spends its steps on what has decayed
SHARE = 10.0  # real parts beside imaginary ones
ENERGY = "and the energy does not drift; where a single trajectory is to be exact, adaptive costs less."


def advice(scene: Scene, accelerations: tuple[Expression, ...] | None) -> dict[str, Any]:
    """{method, order, alpha, reason}: separable, constrained, conservative, stiff or none of these."""
    if scene.lagrangian is None or scene.forces:
        if accelerations is not None and is_stiff(scene, accelerations):
            return _advice("stiff", None, "what decays fast would hold an explicit method to its shortest time.")
        return _advice("adaptive", None, "nothing is conserved that a geometric method would keep.")
    if scene.constraints:
        return _advice("nonholonomic", 8, f"it keeps the discrete constraints to round-off, {ENERGY}", "1/2")
    if is_separable(scene.lagrangian, scene.coordinates):
        return _advice("stormer-verlet", 8, f"L is separable, so its steps are explicit and symplectic, {ENERGY}")
    return _advice("variational", 8, f"L is not separable; the steps are symplectic, {ENERGY}", "1/2")


def told(taken: dict[str, Any]) -> str:
    """The advice as a sentence."""
    order = f" of order {taken['order']}" if taken["order"] else ""
    return f"For long runs take {taken['method']}{order}: {taken['reason']}"


def _advice(method: str, order: int | None, reason: str, alpha: str | None = None) -> dict[str, Any]:
    return {"method": method, "order": order, "alpha": alpha, "reason": reason}


def is_separable(lagrangian: Expression, coordinates: tuple[str, ...]) -> bool:
    """L = v M v/2 - V(t, q) with a constant M."""
    moving = {*map(Symbol, coordinates), *map(Velocity, coordinates), TIME}
    constant = all(not moving & set(walk(entry)) for row in hessian(lagrangian, coordinates) for entry in row)
    rest = [differentiate(differentiate(lagrangian, Velocity(v)), Symbol(q)) for v in coordinates for q in coordinates]
    return constant and all(collect(slope) == ZERO for slope in rest)


def is_stiff(scene: Scene, accelerations: tuple[Expression, ...]) -> bool:
    """Whether a real eigenvalue of the linearised motion at the start is fast beside the length of the run."""
    n = len(scene.coordinates)
    table = table_of(scene.coordinates, scene.positions[None], scene.velocities[None], scene.values)
    names: list[Expression] = [*map(Symbol, scene.coordinates), *map(Velocity, scene.coordinates)]
    rows = [[float(array_value(differentiate(f, name), table)[0]) for name in names] for f in accelerations]
    matrix = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), np.array(rows).reshape(n, 2 * n)])
    if not np.isfinite(matrix).all():
        return False
    values = np.linalg.eigvals(matrix)
    fastest = values[np.argmax(np.abs(values.real))]
    length = scene.grid.step * scene.grid.steps
    return bool(abs(fastest.real) * length > STIFF and abs(fastest.real) > SHARE * abs(fastest.imag))

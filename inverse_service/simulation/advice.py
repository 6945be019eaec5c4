"""Recommend a method for a scene from its formulas."""

from __future__ import annotations

from typing import Any

import numpy as np

from inverse_service.expressions import derivative, tree as ex
from inverse_service.mechanics import method_advice
from inverse_service.simulation import initial, numeric_formulas, scene_data as data

STIFF = 1e3  # length of a run in decay times beyond which an explicit method spends its steps on decayed components
SHARE = 10.0  # real parts compared with imaginary ones


def advice(
    scene: data.Scene, accelerations: tuple[ex.Expression, ...] | None, free: data.FreeLagrangian | None = None
) -> dict[str, Any] | None:
    """{method, order, alpha, reason}: separable, constrained, conservative, stiff or none of these.

    `free` is a Lagrangian that was found for a system given by its equations. Return None if L is degenerate.
    """
    lagrangian = free.lagrangian if scene.lagrangian is None and free is not None else scene.lagrangian
    decays = scene.lagrangian is None or scene.forces
    if accelerations is not None and decays and is_stiff(scene, accelerations):
        return method_advice.advice("stiff", None, "what decays fast would hold an explicit method to short steps.")
    if lagrangian is None or scene.forces:
        return method_advice.advice("adaptive", None, method_advice.NOTHING_KEPT)
    if scene.lagrangian is not None and initial.is_degenerate(scene):
        return None
    if scene.constraints:
        return method_advice.for_constraints(lagrangian, scene.constraints, scene.coordinates)
    moving: set[ex.Expression] = set(map(ex.Symbol, scene.coordinates))
    ends = () if free is None else (*numeric_formulas.walls(lagrangian, moving), *free.domain)
    return method_advice.for_lagrangian(lagrangian, scene.coordinates, ends)


def is_stiff(scene: data.Scene, accelerations: tuple[ex.Expression, ...]) -> bool:
    """Whether a real eigenvalue of the linearized motion at the start is fast compared with the length of the run."""
    n = len(scene.coordinates)
    table = numeric_formulas.table_of(scene.coordinates, scene.positions[None], scene.velocities[None], scene.values)
    names: list[ex.Expression] = [*map(ex.Symbol, scene.coordinates), *map(ex.Velocity, scene.coordinates)]
    rows = [
        [float(numeric_formulas.array_value(derivative.differentiate(f, name), table)[0]) for name in names]
        for f in accelerations
    ]
    matrix = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), np.array(rows).reshape(n, 2 * n)])
    if not np.isfinite(matrix).all():
        return False
    values = np.linalg.eigvals(matrix)
    fastest = values[np.argmax(np.abs(values.real))]
    length = scene.grid.step * scene.grid.steps
    return bool(abs(fastest.real) * length > STIFF and abs(fastest.real) > SHARE * abs(fastest.imag))

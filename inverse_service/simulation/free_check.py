"""Whether a Lagrangian has the true motion among its solutions, tested at points on the constraints.

The Euler-Lagrange residual L_vv f + L_vq v - L_q is computed with the accelerations f of the true motion. It need
only vanish on the constraints: the free system may differ from the true one elsewhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.expressions.tree import Expression, Sum
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual
from inverse_service.simulation.array_values import Array, array_value, table_of
from inverse_service.simulation.initial import initial_velocities
from inverse_service.simulation.scene import Scene

POINTS = 24
ENOUGH = 4
TOLERANCE = 1e-7


def keeps_motion(
    scene: Scene, lagrangian: Expression, accelerations: tuple[Expression, ...], values: dict[str, float]
) -> bool | None:
    """True or False where enough points have finite values, None where not."""
    positions, velocities = _points(scene)
    times = np.random.default_rng(5).uniform(0, scene.grid.step * scene.grid.steps, len(positions)) + scene.grid.begin
    table = table_of(scene.coordinates, positions, velocities, values, times)
    residuals = euler_lagrange_residual(lagrangian, scene.coordinates, accelerations)
    worst = np.zeros(len(positions))
    for residual in residuals:
        worst = np.maximum(worst, np.abs(array_value(residual, table)) / _size(residual, table))
    finite = worst[np.isfinite(worst)]
    return None if len(finite) < ENOUGH else bool((finite < TOLERANCE).all())


def _size(residual: Expression, table: dict[Expression, NDArray[np.float64] | float]) -> Array:
    """The size of the largest term, which the residual is measured by."""
    terms = residual.terms if isinstance(residual, Sum) else (residual,)
    size = np.ones(len(array_value(residual, table)))
    for term in terms:
        size = np.maximum(size, np.abs(array_value(term, table)))
    return size


def _points(scene: Scene) -> tuple[Array, Array]:
    random = np.random.default_rng(7)
    n = len(scene.coordinates)
    found_q, found_v = [scene.positions], [scene.velocities]
    for _ in range(POINTS):
        q = scene.positions + random.normal(0, 0.3, n)
        v = scene.velocities + 0.2 * (1 + np.abs(scene.velocities)) * random.normal(0, 1, n)
        given = dict(zip(scene.coordinates, map(float, v), strict=True))
        try:
            v = initial_velocities(
                scene.coordinates, scene.constraints, scene.lagrangian, scene.values, q, given, project=True
            )
        except InputError:
            continue
        found_q.append(q)
        found_v.append(v)
    return np.array(found_q), np.array(found_v)

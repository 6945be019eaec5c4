"""Velocities at the points of a trajectory, from the momenta of its method.

variational     v = dH~/dp(q_k, p_k)
nonholonomic    v = g^-1 (p_k - b) with L_v = g v + b, put on the constraints: p_k still holds half a reaction

They are as accurate as the method, where the discrete velocity (q_(k+1) - q_k)/h is of order 2 at best. Methods of
order 2 without them have the mean of the discrete velocities on both sides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, Symbol, Velocity, walk
from inverse_service.integrators.trajectory import Trajectory
from inverse_service.mechanics.euler_lagrange import hessian, momenta
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.choices import Grid
from inverse_service.simulation.problem import Problem
from inverse_service.simulation.scene import Scene

Array = NDArray[np.float64]


def point_velocities(
    scene: Scene, problem: Problem, method: str, trajectory: Trajectory, values: dict[str, float]
) -> Array | None:
    """(m, n), or None where the method has no momenta or their velocities have no formula or no value."""
    if trajectory.momenta is None:
        return None
    try:
        return _velocities(scene, problem, method, trajectory, values)
    except np.linalg.LinAlgError:  # the kinetic energy is degenerate at a point
        return None


def mean_velocities(positions: Array, grid: Grid) -> Array | None:
    """Differences of positions about each point, of order 2, (m, n); None where steps are left out."""
    if grid.record_every > 1 or len(positions) < 3:
        return None
    found: Array = np.gradient(positions, grid.step, axis=0, edge_order=2)
    return found


def _velocities(
    scene: Scene, problem: Problem, method: str, trajectory: Trajectory, values: dict[str, float]
) -> Array | None:
    if method == "variational" and problem.free_hamiltonian is not None:
        return _from_hamiltonian(scene, problem.free_hamiltonian, trajectory, values)
    if method == "nonholonomic" and scene.lagrangian is not None:
        return _from_lagrangian(scene, scene.lagrangian, trajectory, values)
    return None


def _from_hamiltonian(scene: Scene, hamiltonian: Expression, trajectory: Trajectory, values: dict[str, float]) -> Array:
    assert trajectory.momenta is not None
    table = table_of(scene.coordinates, trajectory.positions, None, values, trajectory.times)
    names = [Symbol(f"p_{name}") for name in scene.coordinates]
    table |= {name: trajectory.momenta[:, k] for k, name in enumerate(names)}
    return np.column_stack([array_value(differentiate(hamiltonian, name), table) for name in names])


def _from_lagrangian(
    scene: Scene, lagrangian: Expression, trajectory: Trajectory, values: dict[str, float]
) -> Array | None:
    assert trajectory.momenta is not None
    rates = [Velocity(name) for name in scene.coordinates]
    matrix = hessian(lagrangian, scene.coordinates)
    if any(isinstance(node, Velocity) for row in matrix for entry in row for node in walk(entry)):
        return None
    rest = np.zeros_like(trajectory.positions)
    table = table_of(scene.coordinates, trajectory.positions, rest, values, trajectory.times)
    mass = np.array([[array_value(entry, table) for entry in row] for row in matrix]).transpose(2, 0, 1)
    offsets = np.column_stack([array_value(p, table) for p in momenta(lagrangian, scene.coordinates)])
    free = np.linalg.solve(mass, (trajectory.momenta - offsets)[:, :, None])
    if not scene.constraints:
        return np.asarray(free[:, :, 0])
    rows = np.array([[array_value(differentiate(w, rate), table) for rate in rates] for w in scene.constraints])
    rows = rows.transpose(2, 0, 1)
    drifts = np.column_stack([array_value(w, table) for w in scene.constraints])[:, :, None]
    lifted = np.linalg.solve(mass, rows.transpose(0, 2, 1))
    reactions = np.linalg.solve(rows @ lifted, rows @ free + drifts)
    return np.asarray((free - lifted @ reactions)[:, :, 0])

"""What a scene observes: formulas for the kernel, and numbers made of the recorded points.

energy        E = v L_v - L of the original system; max_energy_error = max |E_k/E_0 - 1|, E_0 that of the initial
              data, at the recorded points with their velocities (those of the momenta), for every method alike;
              max_discrete_energy_error at the point and velocity of the discrete Lagrangian, over all steps
constraints   max_constraint = max |w((1-alpha) q_k + alpha q_(k+1)) (q_(k+1) - q_k)/h| over all steps, and
              max_constraint_at_points = max |w(q_k) v_k| with v_k from the momenta of a variational method
momenta       the momenta that the method's Lagrangian conserves (cyclic coordinates): max |p_k - p_0|
matching_circle   circles of the first and last revolution, distance to the exact circle
phase         angle by which the chords of the path are ahead of those of the true path
error         max |q_k - q(t_k)| against the exact solution or the reference, coordinate by coordinate

Velocities at the points of a trajectory, from the momenta of its method.

variational     v = dH~/dp(q_k, p_k)
nonholonomic    v = g^-1 (p_k - b) with L_v = g v + b, put on the constraints: p_k still holds half a reaction

They are as accurate as the method, where the discrete velocity (q_(k+1) - q_k)/h is of order 2 at best. Methods of
order 2 without them have the mean of the discrete velocities on both sides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, ZERO, Expression, Symbol, Velocity, add, holds, substitute, walk
from inverse_service.integrators.trajectory import Array, Trajectory
from inverse_service.mechanics.euler_lagrange import hessian, momenta
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.callables import walls
from inverse_service.simulation.free_lagrangians import NOTICED, distance_of_motion
from inverse_service.simulation.matching_circle import (
    CircleDrift,
    circle_drift,
    circle_through,
    least_squares_circle,
    phase_error,
    radial_distance,
    recorded_drift,
)
from inverse_service.simulation.scene_data import Grid, Observable, Observation, Problem, Scene, Truth

WITH_TIME = "The Lagrangian contains t, so its energy changes."
FORCED = "Forces do work, so the energy T + V changes: see its balance with the work."
ACTED = "Events change the motion, so the energy is no constant."
MOVING_CONSTRAINTS = (
    "A constraint has a part without velocities and may do work, so the energy is no constant of the motion: there is "
    "no error to tell."
)
ENERGY_START = "energy_of_the_start"
ROUND_OFF = 1e-14


def greatest(values: Array) -> float | None:
    """The greatest absolute value; None where one is not finite, or there is none."""
    largest = float(np.abs(values).max()) if len(values) else np.inf
    return largest if np.isfinite(largest) else None


def energy(lagrangian: Expression, coordinates: tuple[str, ...]) -> Expression:
    """v L_v - L."""
    pairs = zip(coordinates, momenta(lagrangian, coordinates), strict=True)
    return add(*(Velocity(name) * p for name, p in pairs)) - lagrangian


def lagrangian_of_energy(scene: Scene) -> Expression | None:
    """The Lagrangian of the scene; of a system given by its equations the one that was found."""
    return scene.found.lagrangian if scene.lagrangian is None and scene.found is not None else scene.lagrangian


def start_energy(scene: Scene) -> float | None:
    """E_0 of the initial data, 0 where it is round-off; None for a system without a Lagrangian."""
    if lagrangian_of_energy(scene) is None:
        return None
    start = scene, scene.positions[None], scene.velocities[None], np.array([scene.grid.begin])
    return float(without_noise(point_energy(*start), point_kinetic(*start))[0])


def without_noise(energies: Array, kinetic: Array) -> Array:
    """The energies, 0 where they are what the round-off of their parts leaves, as for a parabolic orbit."""
    return np.where(np.abs(energies) <= ROUND_OFF * kinetic, 0.0, energies)


def observables(scene: Scene) -> tuple[Observable, ...]:
    """The formulas that the kernel evaluates at every step: those of the observed quantities, no others."""
    found = []
    if "energy" in scene.observe and scene.lagrangian is not None:
        error = energy(scene.lagrangian, scene.coordinates) - Symbol(ENERGY_START)
        found.append(Observable("energy_error", error))
    if "constraints" in scene.observe:
        found += [Observable(f"constraint_{k}", w) for k, w in enumerate(scene.constraints, 1)]
    return tuple(found)


def observation_of(scene: Scene) -> Observation:
    """What the integrator records for a scene."""
    # Momenta are the state itself: they cost a column, and velocities at the points follow from them.
    return Observation(momenta=True, velocities="velocities" in scene.observe, observables=observables(scene))


def conserved_momenta(scene: Scene, problem: Problem) -> dict[int, str]:
    """Places of the coordinates that do not occur in the method's Lagrangian: their momenta are constants."""
    lagrangian = problem.free_lagrangian or problem.lagrangian
    if lagrangian is None:
        return {}
    constrained = problem.constraints if problem.free_lagrangian is None else ()
    return {
        k: name
        for k, name in enumerate(scene.coordinates)
        if differentiate(lagrangian, Symbol(name)) == ZERO
        and not (scene.forces and scene.forces[k] != ZERO)
        and all(differentiate(w, Velocity(name)) == ZERO for w in constrained)
    }


def why_energy_varies(scene: Scene) -> str | None:
    """A sentence where the energy of the scene is no constant of the motion."""
    lagrangian = lagrangian_of_energy(scene)
    if lagrangian is not None and holds(lagrangian, TIME):
        return WITH_TIME
    rest: dict[Expression, Expression] = {Velocity(name): ZERO for name in scene.coordinates}
    if any(collect(substitute(w, rest)) != ZERO for w in scene.constraints):
        return MOVING_CONSTRAINTS
    if any(event.acts for event in scene.events):
        return ACTED
    return FORCED if scene.forces else None


def point_energy(scene: Scene, positions: Array, velocities: Array, times: Array | None = None) -> Array:
    """E(q_k, v_k) at the recorded points, (m,)."""
    lagrangian = lagrangian_of_energy(scene)
    assert lagrangian is not None
    table = table_of(scene.coordinates, positions, velocities, scene.values, times)
    return array_value(energy(lagrangian, scene.coordinates), table)


def point_kinetic(
    scene: Scene,
    positions: Array,
    velocities: Array,
    times: Array,
    values: Mapping[str, float | Array] | None = None,
) -> Array:
    """|v dL/dv| / 2 at the recorded points, (m,): the kinetic energy where L has masses."""
    lagrangian = lagrangian_of_energy(scene)
    assert lagrangian is not None
    table = table_of(scene.coordinates, positions, velocities, values or scene.values, times)
    powers = [
        v * array_value(p, table) for v, p in zip(velocities.T, momenta(lagrangian, scene.coordinates), strict=True)
    ]
    return np.abs(sum(powers, np.zeros(len(positions)))) / 2


def end_of_energy(scene: Scene, positions: Array, velocities: Array, times: Array) -> str | None:
    """How the Lagrangian that was found stops being one of the motion at the points; None where it does not.

    It is divided by, or takes roots or logarithms of, what passes through 0, its domain ends, or its equations are
    others. The energy of the other side may differ from this one by anything.
    """
    if scene.found is None:
        return None
    table = table_of(scene.coordinates, positions, velocities, scene.values, times)
    own = walls(scene.found.lagrangian, set(map(Symbol, scene.coordinates)))
    for wall in dict.fromkeys((*own, *scene.found.domain)):
        values = array_value(wall, table)
        if not (np.isfinite(values).all() and (values.min() > 0 or values.max() < 0)):
            return f"ends where {to_text(wall)} = 0, and the motion passes there"
    apart = distance_of_motion(scene.found.lagrangian, scene.coordinates, scene.accelerations or (), table)
    return "has another motion than the equations on a part of the way" if (apart > NOTICED).any() else None


def point_constraints(scene: Scene, positions: Array, velocities: Array) -> dict[str, Any]:
    """max |w(q_k) v_k| of all constraints over the recorded points."""
    table = table_of(scene.coordinates, positions, velocities, scene.values)
    defects = [greatest(array_value(w, table)) for w in scene.constraints]
    known = [defect for defect in defects if defect is not None]
    return {"max_constraint_at_points": max(known) if len(known) == len(defects) else None}


def constraint_numbers(scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    """The greatest defect of all constraints over all steps, and each one's."""
    each = {f"constraint_{k}": trajectory.maxima[f"constraint_{k}"] for k in range(1, len(scene.constraints) + 1)}
    return {"max_constraint": max(each.values(), default=None), "max_constraint_each": list(each.values())}


def momentum_numbers(trajectory: Trajectory, conserved: Mapping[int, str]) -> dict[str, Any]:
    """max |p_k - p_0| for each conserved momentum; empty where the method has no momenta."""
    if trajectory.momenta is None:
        return {}
    drifts = np.abs(trajectory.momenta - trajectory.momenta[0]).max(axis=0)
    each = {name: float(drifts[k]) for k, name in conserved.items()}
    return {"max_momentum_drift": max(each.values(), default=None), "momentum_drift": each}


def circle_numbers(points: Array, exact: Array | None, every: int = 1, reach: float = np.inf) -> dict[str, Any]:
    """The `circle` part of a summary; {"circle": None} where the path is not round (a line, too few points).

    `every` says which steps were recorded, `reach` how long the way between two of them is at the start: a revolution
    is seen only where that turns by less than half of one.
    """
    drift = circle_drift(points) if every == 1 else recorded_drift(points, reach)
    if drift is None:
        return {"circle": None}
    numbers: dict[str, Any] = {
        "radius_first": drift.first.radius,
        "radius_last": drift.last.radius,
        "radius_change": drift.last.radius / drift.first.radius - 1,
        "centre_first": list(drift.first.center),
        "centre_last": list(drift.last.center),
        "centre_drift": drift.centre_drift,
        "misfit": drift.first.misfit,
        "shape_misfit": _shape(points),
        "revolutions": None if np.isnan(drift.revolutions) else drift.revolutions,
        "through_three_points": _three(points, drift),
    }
    if np.isnan(drift.revolutions):
        numbers["note"] = (
            "Too few steps are recorded to count revolutions: the circles are those of the first and last 1 % of them."
        )
    elif drift.revolutions < 1:
        numbers["note"] = "The path is less than one revolution, so both circles are that of the whole path."
    reference = None if exact is None else least_squares_circle(exact)
    if reference is not None and reference.misfit <= 1e-6 * reference.radius:
        numbers["exact_radius"] = reference.radius
        numbers["max_radial_distance"] = float(radial_distance(points, reference).max())
    return {"circle": numbers}


def _shape(points: Array) -> float | None:
    """How far the whole path is from one circle of its own, over its radius: center and radius do not enter."""
    whole = least_squares_circle(points)
    return None if whole is None else float(radial_distance(points, whole).max())


def _three(points: Array, drift: CircleDrift) -> dict[str, Any] | None:
    """The paper's matching circle: through three points a third of a revolution apart (or of the path)."""
    last = len(points) - 1
    third = max(1, int(last / max(1.0, drift.revolutions) / 3)) if np.isfinite(drift.revolutions) else 1
    circle = circle_through(points[[0, third, 2 * third]])
    return None if circle is None else {"radius": circle.radius, "center": list(circle.center)}


def phase_numbers(points: Array, exact: Array) -> tuple[dict[str, Any], Array]:
    """Greatest and final phase error in radians, and the error at each point."""
    error = phase_error(points, exact)
    return {"max_phase_error": greatest(error), "final_phase_error": float(error[-1])}, error


def error_numbers(scene: Scene, positions: Array, true: Array, truth: Truth) -> tuple[dict[str, Any], dict[str, Array]]:
    """The greatest and the last distance from the true positions, with a bound of how far these are off themselves.

    Where the truth is lost before the run ends there is no greatest error of the run, and `error_until` holds that of
    the part before.
    """
    differences = np.abs(positions - true)
    distances: Array = differences.max(axis=1)
    known = int(np.isfinite(distances).sum())
    bound = float(truth.bounds[max(known - 1, 0)])
    numbers = {
        "max_error": greatest(distances),
        "final_error": float(distances[-1]),
        "error_each": {name: greatest(differences[:, k]) for k, name in enumerate(scene.coordinates)},
        "error_against": truth.against,
        "error_uncertainty": bound,
    }
    if known and (greatest(distances[:known]) or 0.0) <= bound:
        numbers["error_note"] = f"Within the uncertainty of the true motion: at most {bound:.2g}."
    if known < len(distances):
        until = {"time": float(truth.times[known - 1]), "max_error": greatest(distances[:known])}
        numbers |= {"error_note": truth.reason, "error_until": until, "error_uncertainty": None}
    return numbers, {"error": distances}


def point_velocities(
    scene: Scene, problem: Problem, method: str, trajectory: Trajectory, values: dict[str, float]
) -> Array | None:
    """(m, n), or None where the method has no momenta or their velocities have no formula or no value."""
    if trajectory.momenta is None:
        return None
    try:
        return _velocities_of_method(scene, problem, method, trajectory, values)
    except np.linalg.LinAlgError:  # the kinetic energy is degenerate at a point
        return None


def mean_velocities(positions: Array, grid: Grid) -> Array | None:
    """Differences of positions about each point, of order 2, (m, n); None where steps are left out."""
    if grid.record_every > 1 or len(positions) < 3:
        return None
    found: Array = np.gradient(positions, grid.step, axis=0, edge_order=2)
    return found


def _velocities_of_method(
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
    free = _solved(mass, (trajectory.momenta - offsets)[:, :, None])
    if not scene.constraints:
        return np.asarray(free[:, :, 0])
    rows = np.array([[array_value(differentiate(w, rate), table) for rate in rates] for w in scene.constraints])
    rows = rows.transpose(2, 0, 1)
    drifts = np.column_stack([array_value(w, table) for w in scene.constraints])[:, :, None]
    lifted = _solved(mass, rows.transpose(0, 2, 1))
    reactions = np.linalg.solve(rows @ lifted, rows @ free + drifts)
    return np.asarray((free - lifted @ reactions)[:, :, 0])


def _solved(matrices: Array, right: Array) -> Array:
    """matrices^-1 right for each point, (m, n, k); one that is the same everywhere is taken apart once."""
    if not (matrices == matrices[:1]).all():
        return np.asarray(np.linalg.solve(matrices, right))
    columns = right.transpose(1, 0, 2).reshape(right.shape[1], -1)
    found = np.linalg.solve(matrices[0], columns).reshape(right.shape[1], len(right), -1)
    return np.asarray(found.transpose(1, 0, 2))

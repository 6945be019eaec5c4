"""The observed quantities of a run: formulas for the kernel, and numbers and columns from the recorded points.

energy        E = v L_v - L of the original system; max_energy_error = max |E_k/E_0 - 1|, E_0 that of the initial
              data, at the recorded points with their velocities (those of the momenta), for every method alike;
              max_discrete_energy_error at the point and velocity of the discrete Lagrangian, over all steps
constraints   max_constraint = max |w((1-alpha) q_k + alpha q_(k+1)) (q_(k+1) - q_k)/h| over all steps, and
              max_constraint_at_points = max |w(q_k) v_k| with v_k from the momenta of a variational method
momenta       the momenta that the method's Lagrangian conserves (cyclic coordinates): max |p_k - p_0|
phase         angle by which the chords of the path are ahead of those of the true path (`circles`)
error         max |q_k - q(t_k)| against the exact solution or the reference, coordinate by coordinate

Velocities at the points come from the momenta of the method and are as accurate as it is: v = dH~/dp(q_k, p_k) of the
variational method; of the nonholonomic one v = g^-1 (p_k - b) with L_v = g v + b, put on the constraints, as p_k still
holds half a reaction. Methods of order 2 without momenta have differences of the positions about each point.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inverse_service.expressions import collecting, derivative, printing, tree as ex
from inverse_service.integrators.trajectory import Array, Trajectory
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import (
    accelerations as accelerating,
    circles,
    derivation,
    numeric_formulas as nf,
    scene_data as data,
)

WITH_TIME = "The Lagrangian contains t, so its energy changes."
FORCED = "Forces do work, so the energy T + V changes: see its balance with the work."
ACTED = "Events change the motion, so the energy is not constant."
MOVING_CONSTRAINTS = (
    "A constraint has a part without velocities and may do work, so the energy is not a constant of the motion, "
    "and no error is reported."
)
ENERGY_START = "energy_of_the_start"
ROUND_OFF = 1e-14
KEPT = "See `conserved`: {} is constant."
_NO_VELOCITIES = "The method has no velocities at the recorded points: record every step."
_NO_ENERGY = "The system is given by its equations and no Lagrangian was found, so no energy is defined."
_NO_VALUE = "The formula has no value at {} of the {} recorded points, the first at t = {:.7g}."
_WALL = "The energy is that of a Lagrangian that was found, which {}."


def greatest(values: Array) -> float | None:
    """The greatest absolute value; None where one is not finite, or there is none."""
    largest = float(np.abs(values).max()) if len(values) else np.inf
    return largest if np.isfinite(largest) else None


def energy(lagrangian: ex.Expression, coordinates: tuple[str, ...]) -> ex.Expression:
    """v L_v - L."""
    pairs = zip(coordinates, euler_lagrange.momenta(lagrangian, coordinates), strict=True)
    return ex.add(*(ex.Velocity(name) * p for name, p in pairs)) - lagrangian


def lagrangian_of_energy(scene: data.Scene) -> ex.Expression | None:
    """The Lagrangian of the scene; of a system given by its equations the one that was found."""
    return scene.found.lagrangian if scene.lagrangian is None and scene.found is not None else scene.lagrangian


def start_energy(scene: data.Scene) -> float | None:
    """E_0 of the initial data, 0 if it is round-off; None for a system without a Lagrangian."""
    if lagrangian_of_energy(scene) is None:
        return None
    start = scene, scene.positions[None], scene.velocities[None], np.array([scene.grid.begin])
    return float(without_noise(point_energy(*start), point_kinetic(*start))[0])


def without_noise(energies: Array, kinetic: Array) -> Array:
    """The energies, 0 where they are what the round-off of their parts leaves, as for a parabolic orbit."""
    return np.where(np.abs(energies) <= ROUND_OFF * kinetic, 0.0, energies)


def observables(scene: data.Scene) -> data.Observation:
    """The formulas that the kernel evaluates at every step: only those of the observed quantities."""
    found = []
    if "energy" in scene.observe and scene.lagrangian is not None:
        error = energy(scene.lagrangian, scene.coordinates) - ex.Symbol(ENERGY_START)
        found.append(data.Observable("energy_error", error))
    if "constraints" in scene.observe:
        found += [data.Observable(f"constraint_{k}", w) for k, w in enumerate(scene.constraints, 1)]
    return tuple(found)


def observed_problem(scene: data.Scene, problem: data.Problem) -> tuple[data.Problem, data.Observation]:
    """The problem with the parameters that the observed formulas need, and the recorded formulas."""
    observation = observables(scene)
    if observation and "energy" in scene.observe:
        problem = replace(problem, parameters=(*problem.parameters, ENERGY_START))
    return problem.with_used_parameters([one.expression for one in observation]), observation


def beginning(
    scene: data.Scene, requested: data.Requested, free: data.FreeLagrangian | None
) -> tuple[dict[str, float], data.Start]:
    """Numbers of all parameters, the free constants of the method and the energy to compare with among them, and the
    start: momenta where L~ gives them itself (they may be 0/0 in the velocities)."""
    values = dict(scene.values) | (dict(free.constants) if free else {}) | dict(requested.constants)
    if "energy" in scene.observe and scene.lagrangian is not None:
        values[ENERGY_START] = start_energy(scene) or 0.0
    momenta = None
    if free is not None and free.start_momenta is not None and requested.convention == "momenta":
        found = free.start_momenta(scene.positions, scene.velocities, values)
        momenta = tuple(map(float, found)) if np.isfinite(found).all() else None
    positions, velocities = tuple(map(float, scene.positions)), tuple(map(float, scene.velocities))
    return values, data.Start(positions, velocities, momenta, requested.convention)


def conserved_momenta(scene: data.Scene, problem: data.Problem) -> list[int]:
    """Indices of the cyclic coordinates of the method's Lagrangian, whose momenta are constant."""
    lagrangian = problem.free_lagrangian or problem.lagrangian
    if lagrangian is None:
        return []
    constrained = problem.constraints if problem.free_lagrangian is None else ()
    return [
        k
        for k, name in enumerate(scene.coordinates)
        if derivative.differentiate(lagrangian, ex.Symbol(name)) == ex.ZERO
        and not (scene.forces and scene.forces[k] != ex.ZERO)
        and all(derivative.differentiate(w, ex.Velocity(name)) == ex.ZERO for w in constrained)
    ]


def why_energy_varies(scene: data.Scene) -> str | None:
    """A sentence if the energy of the scene is not a constant of the motion."""
    lagrangian = lagrangian_of_energy(scene)
    if lagrangian is not None and ex.holds(lagrangian, ex.TIME):
        return WITH_TIME
    rest: dict[ex.Expression, ex.Expression] = {ex.Velocity(name): ex.ZERO for name in scene.coordinates}
    if any(collecting.collect(ex.substitute(w, rest)) != ex.ZERO for w in scene.constraints):
        return MOVING_CONSTRAINTS
    if any(event.acts for event in scene.events):
        return ACTED
    return FORCED if scene.forces else None


def factor_of_time(scene: data.Scene, times: Array) -> Array | None:
    """f(t)/f(t_0), (m,), of an L = f(t) L_0(q, q'), whose energy is f times T + V; None for any other L."""
    lagrangian = lagrangian_of_energy(scene)
    factors = lagrangian.factors if isinstance(lagrangian, ex.Product) else ()
    timed = [factor for factor in factors if ex.holds(factor, ex.TIME)]
    moving: list[ex.Expression] = [*map(ex.Symbol, scene.coordinates), *map(ex.Velocity, scene.coordinates)]
    if not timed or any(ex.holds(factor, name) for factor in timed for name in moving):
        return None
    table: dict[ex.Expression, Any] = {ex.Symbol(name): value for name, value in scene.values.items()}
    table[ex.TIME] = np.concatenate([[scene.grid.begin], times])
    found = np.prod([nf.array_value(factor, table) for factor in timed], axis=0)
    return np.asarray(found[1:] / found[0])


def point_energy(scene: data.Scene, positions: Array, velocities: Array, times: Array | None = None) -> Array:
    """E(q_k, v_k) at the recorded points, (m,)."""
    lagrangian = lagrangian_of_energy(scene)
    assert lagrangian is not None
    table = nf.table_of(scene.coordinates, positions, velocities, scene.values, times)
    return nf.array_value(energy(lagrangian, scene.coordinates), table)


def point_kinetic(
    scene: data.Scene,
    positions: Array,
    velocities: Array,
    times: Array,
    values: Mapping[str, float | Array] | None = None,
) -> Array:
    """|v dL/dv| / 2 at the recorded points, (m,): the kinetic energy where L has masses."""
    lagrangian = lagrangian_of_energy(scene)
    assert lagrangian is not None
    table = nf.table_of(scene.coordinates, positions, velocities, values or scene.values, times)
    powers = [
        v * nf.array_value(p, table)
        for v, p in zip(velocities.T, euler_lagrange.momenta(lagrangian, scene.coordinates), strict=True)
    ]
    return np.abs(sum(powers, np.zeros(len(positions)))) / 2


def end_of_energy(scene: data.Scene, positions: Array, velocities: Array, times: Array) -> str | None:
    """How the Lagrangian that was found stops being one of the motion at the points; None where it does not.

    It is divided by, or takes roots or logarithms of, what passes through 0, its domain ends, or its equations are
    others. The energy of the other side may differ from this one by anything.
    """
    if scene.found is None:
        return None
    table = nf.table_of(scene.coordinates, positions, velocities, scene.values, times)
    own = nf.walls(scene.found.lagrangian, set(map(ex.Symbol, scene.coordinates)))
    for wall in dict.fromkeys((*own, *scene.found.domain)):
        values = nf.array_value(wall, table)
        if not (np.isfinite(values).all() and (values.min() > 0 or values.max() < 0)):
            return f"ends where {printing.to_text(wall)} = 0, and the motion passes there"
    apart = accelerating.distance_of_motion(scene.found.lagrangian, scene.coordinates, scene.accelerations or (), table)
    return "does not give the motion of the equations everywhere" if (apart > accelerating.NOTICED).any() else None


def point_constraints(scene: data.Scene, positions: Array, velocities: Array) -> dict[str, Any]:
    """max |w(q_k) v_k| of all constraints over the recorded points."""
    table = nf.table_of(scene.coordinates, positions, velocities, scene.values)
    defects = [greatest(nf.array_value(w, table)) for w in scene.constraints]
    known = [defect for defect in defects if defect is not None]
    return {"max_constraint_at_points": max(known) if len(known) == len(defects) else None}


def error_numbers(
    scene: data.Scene, positions: Array, true: Array, truth: data.Truth
) -> tuple[dict[str, Any], dict[str, Array]]:
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
    scene: data.Scene, problem: data.Problem, method: str, trajectory: Trajectory, values: dict[str, float]
) -> Array | None:
    """(m, n), or None where the method has no momenta or their velocities have no formula or no value."""
    if trajectory.momenta is None:
        return None
    try:
        return _velocities_of_method(scene, problem, method, trajectory, values)
    except np.linalg.LinAlgError:  # the kinetic energy is degenerate at a point
        return None


def mean_velocities(positions: Array, grid: data.Grid) -> Array | None:
    """Differences of positions about each point, of order 2, (m, n); None where steps are left out."""
    if grid.record_every > 1 or len(positions) < 3:
        return None
    found: Array = np.gradient(positions, grid.step, axis=0, edge_order=2)
    return found


def _velocities_of_method(
    scene: data.Scene, problem: data.Problem, method: str, trajectory: Trajectory, values: dict[str, float]
) -> Array | None:
    if method == "variational" and problem.free_hamiltonian is not None:
        return _from_hamiltonian(scene, problem.free_hamiltonian, trajectory, values)
    if method == "nonholonomic" and scene.lagrangian is not None:
        return _from_lagrangian(scene, scene.lagrangian, trajectory, values)
    return None


def _from_hamiltonian(
    scene: data.Scene, hamiltonian: ex.Expression, trajectory: Trajectory, values: dict[str, float]
) -> Array:
    assert trajectory.momenta is not None
    table = nf.table_of(scene.coordinates, trajectory.positions, None, values, trajectory.times)
    names = [ex.Symbol(f"p_{name}") for name in scene.coordinates]
    table |= {name: trajectory.momenta[:, k] for k, name in enumerate(names)}
    return np.column_stack([nf.array_value(derivative.differentiate(hamiltonian, name), table) for name in names])


def _from_lagrangian(
    scene: data.Scene, lagrangian: ex.Expression, trajectory: Trajectory, values: dict[str, float]
) -> Array | None:
    assert trajectory.momenta is not None
    rates = [ex.Velocity(name) for name in scene.coordinates]
    matrix = euler_lagrange.hessian(lagrangian, scene.coordinates)
    if any(isinstance(node, ex.Velocity) for row in matrix for entry in row for node in ex.walk(entry)):
        return None
    rest = np.zeros_like(trajectory.positions)
    table = nf.table_of(scene.coordinates, trajectory.positions, rest, values, trajectory.times)
    mass = np.array([[nf.array_value(entry, table) for entry in row] for row in matrix]).transpose(2, 0, 1)
    offsets = np.column_stack([nf.array_value(p, table) for p in euler_lagrange.momenta(lagrangian, scene.coordinates)])
    free = _solved(mass, (trajectory.momenta - offsets)[:, :, None])
    if not scene.constraints:
        return np.asarray(free[:, :, 0])
    rows = np.array(
        [[nf.array_value(derivative.differentiate(w, rate), table) for rate in rates] for w in scene.constraints]
    )
    rows = rows.transpose(2, 0, 1)
    drifts = np.column_stack([nf.array_value(w, table) for w in scene.constraints])[:, :, None]
    lifted = _solved(mass, rows.transpose(0, 2, 1))
    reactions = np.linalg.solve(rows @ lifted, rows @ free + drifts)
    return np.asarray((free - lifted @ reactions)[:, :, 0])


def _solved(matrices: Array, right: Array) -> Array:
    """matrices^-1 right for each point, (m, n, k); a constant matrix is factored once."""
    if not (matrices == matrices[:1]).all():
        return np.asarray(np.linalg.solve(matrices, right))
    columns = right.transpose(1, 0, 2).reshape(right.shape[1], -1)
    found = np.linalg.solve(matrices[0], columns).reshape(right.shape[1], len(right), -1)
    return np.asarray(found.transpose(1, 0, 2))


@dataclass(frozen=True, slots=True)
class Observed:
    """An observed run: `problem` is None for the exact solution, `values` hold the free constants too. A run
    `in_pieces` has the velocities of its points, and no momenta."""

    scene: data.Scene
    requested: data.Requested
    trajectory: Trajectory
    problem: data.Problem | None
    values: Mapping[str, float]
    truth: data.Truth | data.Unavailable | None
    in_pieces: bool = False


def observed_quantities(run: Observed, seconds: dict[str, float]) -> tuple[dict[str, Any], dict[str, Array]]:
    """Numbers and columns of every observed quantity, none of any other; `seconds` gets what each took."""
    numbers: dict[str, Any] = {}
    series: dict[str, Array] = {}
    scene, truth = run.scene, run.truth
    true = truth.positions[data.places_of(truth, run.trajectory.times)] if isinstance(truth, data.Truth) else None
    for name in scene.observe:
        with derivation.timed(seconds, name):
            found, columns = _quantity(name, run, true)
            numbers |= found
            series |= columns
    if scene.own:
        with derivation.timed(seconds, "own observables"):
            found, columns = _own(run)
            numbers |= found
            series |= columns
    return numbers, series


def _own(run: Observed) -> tuple[dict[str, Any], dict[str, Array]]:
    """The observables given by formula, at the recorded points: first, last, least and greatest values."""
    velocities = velocities_at_points(run)
    numbers: dict[str, Any] = {}
    series: dict[str, Array] = {}
    at = run.trajectory
    values = dict(run.scene.values)
    table = nf.table_of(run.scene.coordinates, at.positions, velocities, values, at.times)
    for one in run.scene.own:
        try:
            column = nf.array_value(one.expression, table)
        except nf.NoValue:
            numbers[one.name] = {"note": _NO_VELOCITIES}
            continue
        series[one.name] = column
        ends = {"first": float(column[0]), "last": float(column[-1])}
        lost = ~np.isfinite(column)
        if lost.any():
            note = _NO_VALUE.format(lost.sum(), len(column), at.times[lost.argmax()])
            numbers[one.name] = {**ends, "note": note}
        else:
            numbers[one.name] = {**ends, "least": float(column.min()), "greatest": float(column.max())}
    return {"observables": numbers}, series


def _balance(run: Observed, velocities: Array, points: Array, start: float) -> tuple[dict[str, Any], dict[str, Array]]:
    """Power Q v and its work at the recorded points, and how far E - E_0 is from the work."""
    scene, times = run.scene, run.trajectory.times
    table = nf.table_of(scene.coordinates, run.trajectory.positions, velocities, dict(scene.values), times)
    # What is at rest takes no power, whatever static friction is there: sign(0) has no value.
    parts = [
        np.where(v == 0, 0.0, nf.array_value(force, table) * v)
        for force, v in zip(scene.forces, velocities.T, strict=True)
    ]
    power = np.asarray(sum(parts))
    work = _integral(power, times)
    difference = np.abs(points - start - work)
    numbers = {"work": float(work[-1]), "max_balance_error": greatest(difference)}
    return numbers, {"power": power, "work": work}


def _integral(values: Array, times: Array) -> Array:
    """The integral from the start, (m,), by the cubic through each point and its neighbors: order 4 in the spacing."""
    if len(values) < 3:
        return np.concatenate([[0.0], np.cumsum(np.diff(times) * (values[1:] + values[:-1]) / 2)])
    steps, slopes = np.diff(times), np.gradient(values, times, edge_order=2)
    parts = steps * (values[1:] + values[:-1]) / 2 - steps**2 * (slopes[1:] - slopes[:-1]) / 12
    return np.concatenate([[0.0], np.cumsum(parts)])


def _quantity(name: str, run: Observed, true: Array | None) -> tuple[dict[str, Any], dict[str, Array]]:
    scene, trajectory, problem, truth = run.scene, run.trajectory, run.problem, run.truth
    positions = trajectory.positions
    if name == "energy":
        return _energy(run)
    if name == "constraints":
        columns = {key: column for key, column in trajectory.series.items() if key.startswith("constraint_")}
        sizes = [size for key, size in trajectory.maxima.items() if key.startswith("constraint_")]
        numbers: dict[str, Any] = {"max_constraint": max(sizes, default=None)}
        if run.requested.method == "variational" and scene.constraints:
            velocities = velocities_at_points(run)
            numbers |= {} if velocities is None else point_constraints(scene, positions, velocities)
        return numbers, columns
    if name == "momenta" and problem is not None:
        if trajectory.momenta is None:
            return {}, {}
        drifts = np.abs(trajectory.momenta - trajectory.momenta[0]).max(axis=0)
        kept = [float(drifts[k]) for k in conserved_momenta(scene, problem)]
        return {"max_momentum_drift": max(kept, default=None)}, columns_of(scene, trajectory.momenta, "p_")
    if name == "velocities":
        points = velocities_at_points(run)
        return ({"velocities_note": _NO_VELOCITIES}, {}) if points is None else ({}, columns_of(scene, points, "v_"))
    if name == "matching_circle":
        if scene.circle is None:
            return {"circle": None}, {}
        pair = list(scene.circle)
        every = scene.grid.record_every
        reach = float(np.hypot(*scene.velocities[pair])) * abs(scene.grid.step) * every
        return circles.circle_numbers(positions[:, pair], None if true is None else true[:, pair], every, reach), {}
    if name == "constraint_forces":
        return _constraint_forces(run)
    if name in ("phase", "error"):
        return _compared(name, scene, positions, true, truth)
    return {}, {}


def _constraint_forces(run: Observed) -> tuple[dict[str, Any], dict[str, Array]]:
    """The multipliers lambda_a of the constraints and the forces w^T lambda that they exert, at the recorded points."""
    scene, velocities = run.scene, velocities_at_points(run)
    if velocities is None or scene.lagrangian is None or not scene.constraints:
        note = _NO_VELOCITIES if velocities is None else "There are no constraints."
        return {"constraint_forces": None, "constraint_forces_note": note}, {}
    found = accelerating.accelerations_and_multipliers(
        scene.coordinates, scene.lagrangian, scene.constraints, scene.forces
    )
    if found is None:
        return {"constraint_forces": None, "constraint_forces_note": "The constraints are too many for a formula."}, {}
    table = nf.table_of(scene.coordinates, run.trajectory.positions, velocities, dict(run.values), run.trajectory.times)
    columns = {f"lambda_{a}": nf.array_value(one, table) for a, one in enumerate(found[1], 1)}
    for name in scene.coordinates:
        pairs = zip(scene.constraints, columns.copy().items(), strict=False)
        forces = [
            nf.array_value(derivative.differentiate(w, ex.Velocity(name)), table) * column for w, (key, column) in pairs
        ]
        columns[f"force_{name}"] = sum(forces, np.zeros(len(run.trajectory.times)))
    formulas = {f"lambda_{a}": printing.to_text(one) for a, one in enumerate(found[1], 1)}
    largest = {name: greatest(column) for name, column in columns.items()}
    return {"constraint_forces": {"formulas": formulas, "greatest": largest}}, columns


def _energy(run: Observed) -> tuple[dict[str, Any], dict[str, Array]]:
    """The energy at the recorded points for every method; that of the discrete Lagrangian, where there is one, under a
    separate name."""
    start = start_energy(run.scene)
    if start is None:
        return {"max_energy_error": None, "energy_note": _NO_ENERGY}, {}
    numbers, series = _discrete_energy(run, start)
    velocities = velocities_at_points(run)
    if velocities is None:
        note = why_energy_varies(run.scene) or _NO_VELOCITIES
        return {"energy_start": start, "max_energy_error": None, "energy_note": note} | numbers, series
    points = point_energy(run.scene, run.trajectory.positions, velocities, run.trajectory.times)
    series = {"energy": points} | series
    wall = end_of_energy(run.scene, run.trajectory.positions, velocities, run.trajectory.times)
    varies = why_energy_varies(run.scene) or (wall and _WALL.format(wall))
    if varies:
        kept, drifts = _conserved(run, velocities)
        factor = factor_of_time(run.scene, run.trajectory.times)
        series |= {} if factor is None else {"mechanical_energy": points / factor}
        note = f"{varies} {KEPT.format(run.scene.conserved[0].name)}" if kept else varies
        numbers = {"energy_start": start, "max_energy_error": None, "energy_note": note} | kept
        if not run.scene.forces:
            return numbers, series | drifts
        further, columns = _balance(run, velocities, points, start)
        return numbers | further, series | columns | drifts
    errors = np.abs(points - start) / (abs(start) or 1.0)
    found: dict[str, Any] = {"energy_start": start, "max_energy_error": greatest(errors)}
    found |= {} if start else {"energy_error_is": "absolute, because the energy of the start is 0"}
    return found | numbers, series


def _conserved(run: Observed, velocities: Array) -> tuple[dict[str, Any], dict[str, Array]]:
    """The drift of each constant of the motion that was found, from the start of each part of the way on which its
    formula is one: where it passes a pole, as an arctangent of x'/x at x = 0, it begins again."""
    found: dict[str, Any] = {}
    series: dict[str, Array] = {}
    at, scene = run.trajectory, run.scene
    table = nf.table_of(scene.coordinates, at.positions, velocities, dict(run.values), at.times)
    for k, one in enumerate(scene.conserved, 1):
        values = nf.array_value(one.expression, table)
        ends = nf.walls(one.expression, set(map(ex.Symbol, scene.coordinates)))
        turned = [np.diff(np.sign(nf.array_value(wall, table))) != 0 for wall in ends]
        cuts = np.flatnonzero(np.any([*turned, np.zeros(len(values) - 1, dtype=bool)], axis=0)) + 1
        pieces = np.split(values, cuts)
        drift = np.concatenate([piece - piece[0] for piece in pieces])
        size = float(np.nanmax(_terms_size(one.expression, table), initial=0.0)) or 1.0
        found[one.name] = {
            "text": printing.to_text(one.expression), "max_error": greatest(drift / size), "parts": len(pieces),
        }  # fmt: skip
        series[f"conserved_{k}"] = drift / size
    return ({"conserved": found} if found else {}), series


def _terms_size(tree: ex.Expression, table: Mapping[ex.Expression, Any]) -> Array:
    """The sum of the sizes of its terms, against which round-off is measured: a momentum may be 0 all the time."""
    match tree:
        case ex.Sum(terms):
            return np.asarray(sum(_terms_size(term, table) for term in terms))
        case ex.Product(factors):
            return np.asarray(math.prod(_terms_size(factor, table) for factor in factors))
    return np.abs(nf.array_value(tree, table))


def _discrete_energy(run: Observed, start: float) -> tuple[dict[str, Any], dict[str, Array]]:
    """E at the point and velocity of the discrete Lagrangian, the paper's: of methods of order 2 that have one."""
    choice = run.requested.choice
    if choice is None or run.requested.alpha is None or choice.order > 2 or run.scene.found is not None:
        return {}, {}
    series = {"discrete_energy": run.trajectory.series["energy_error"] + start}
    if why_energy_varies(run.scene):
        return {}, series
    return {"max_discrete_energy_error": run.trajectory.maxima["energy_error"] / (abs(start) or 1.0)}, series


def velocities_at_points(run: Observed) -> Array | None:
    """(m, n) at the recorded points, from the momenta where the method has them; None where it has neither."""
    if run.problem is None or run.requested.alpha is None or run.in_pieces:
        return run.trajectory.velocities
    method, values = run.requested.method, dict(run.values)
    found = point_velocities(run.scene, run.problem, method, run.trajectory, values)
    return mean_velocities(run.trajectory.positions, run.scene.grid) if found is None else found


def _compared(
    name: str, scene: data.Scene, positions: Array, true: Array | None, truth: data.Truth | data.Unavailable | None
) -> tuple[dict[str, Any], dict[str, Array]]:
    if true is None or not isinstance(truth, data.Truth):
        reason = truth.reason if isinstance(truth, data.Unavailable) else "nothing to compare with"
        return {f"max_{name}" if name == "error" else "max_phase_error": None, f"{name}_note": reason}, {}
    if name == "error":
        return error_numbers(scene, positions, true, truth)
    if scene.circle is None:
        return {"max_phase_error": None}, {}
    pair = list(scene.circle)
    angles = circles.phase_error(positions[:, pair], true[:, pair])
    return {"max_phase_error": greatest(angles), "final_phase_error": float(angles[-1])}, {"phase_error": angles}


def last_point(run: Observed) -> tuple[float, Array, Array | None]:
    """(t, q, v) at the end of the run, from which another can continue; v is None if the method has none."""
    at = run.trajectory
    velocities = velocities_at_points(replace(run, trajectory=at.part(slice(-3, None))))
    return float(at.times[-1]), at.positions[-1], None if velocities is None else velocities[-1]


def columns_of(scene: data.Scene, table: Array, prefix: str = "") -> dict[str, Any]:
    """The entries of a table (m, n), or of one row, by coordinate."""
    return {f"{prefix}{name}": table[..., k] for k, name in enumerate(scene.coordinates)}

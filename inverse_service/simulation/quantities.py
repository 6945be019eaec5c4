"""The observed quantities of one run: which numbers belong to which name, and what each cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Symbol, Velocity
from inverse_service.integrators.trajectory import Array, Trajectory
from inverse_service.simulation.array_values import NoValue, array_value, table_of
from inverse_service.simulation.callables import walls
from inverse_service.simulation.derivation import timed
from inverse_service.simulation.observing import (
    circle_numbers,
    conserved_momenta,
    constraint_numbers,
    end_of_energy,
    error_numbers,
    greatest,
    mean_velocities,
    momentum_numbers,
    phase_numbers,
    point_constraints,
    point_energy,
    point_velocities,
    start_energy,
    why_energy_varies,
)
from inverse_service.simulation.regular_motion import accelerations_and_multipliers
from inverse_service.simulation.scene_data import Problem, Requested, Scene, Truth, Unavailable, places_of

KEPT = "See `conserved`: {} is constant."
_NO_VELOCITIES = "The method has no velocities at the recorded points: record every step."
_NO_ENERGY = "The system is given by its equations, and no Lagrangian of it was found, so there is no energy."
_NO_VALUE = "The formula has no value at {} of the {} recorded points, the first at t = {:.7g}."
_WALL = "The energy is that of a Lagrangian that was found, which {}."


@dataclass(frozen=True, slots=True)
class Observed:
    """One run as it is observed: `problem` is None for the exact solution, `values` hold the free constants too. A run
    `in_pieces` has the velocities of its points, and no momenta."""

    scene: Scene
    requested: Requested
    trajectory: Trajectory
    problem: Problem | None
    values: Mapping[str, float]
    truth: Truth | Unavailable | None
    in_pieces: bool = False


def observed_quantities(run: Observed, seconds: dict[str, float]) -> tuple[dict[str, Any], dict[str, Array]]:
    """Numbers and columns of every observed quantity, none of any other; `seconds` gets what each took."""
    numbers: dict[str, Any] = {}
    series: dict[str, Array] = {}
    scene, truth = run.scene, run.truth
    true = truth.positions[places_of(truth, run.trajectory.times)] if isinstance(truth, Truth) else None
    for name in scene.observe:
        with timed(seconds, name):
            found, columns = _quantity(name, run, true)
            numbers |= found
            series |= columns
    if scene.own:
        with timed(seconds, "own observables"):
            found, columns = _own(run)
            numbers |= found
            series |= columns
    return numbers, series


def _own(run: Observed) -> tuple[dict[str, Any], dict[str, Array]]:
    """The observables that the scene gives by formula, at the recorded points: first, last, least and greatest."""
    velocities = velocities_at_points(run)
    numbers: dict[str, Any] = {}
    series: dict[str, Array] = {}
    at = run.trajectory
    values = dict(run.scene.values)
    table = table_of(run.scene.coordinates, at.positions, velocities, values, at.times)
    for one in run.scene.own:
        try:
            column = array_value(one.expression, table)
        except NoValue:
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
    table = table_of(scene.coordinates, run.trajectory.positions, velocities, dict(scene.values), times)
    power = sum(
        (array_value(force, table) * velocities[:, k] for k, force in enumerate(scene.forces)), np.zeros(len(times))
    )
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
        return constraint_numbers(scene, trajectory) | _point_constraints(run), columns
    if name == "momenta" and problem is not None:
        columns = {} if trajectory.momenta is None else columns_of(scene, trajectory.momenta, "p_")
        return momentum_numbers(trajectory, conserved_momenta(scene, problem)), columns
    if name == "velocities" and (points := velocities_at_points(run)) is not None:
        return {}, columns_of(scene, points, "v_")
    if name == "velocities" and trajectory.velocities is not None:
        return {}, columns_of(scene, trajectory.velocities, "discrete_v_")
    if name == "matching_circle":
        if scene.circle is None:
            return {"circle": None}, {}
        pair = list(scene.circle)
        every = scene.grid.record_every
        reach = float(np.hypot(*scene.velocities[pair])) * abs(scene.grid.step) * every
        return circle_numbers(positions[:, pair], None if true is None else true[:, pair], every, reach), {}
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
    found = accelerations_and_multipliers(scene.coordinates, scene.lagrangian, scene.constraints, scene.forces)
    if found is None:
        return {"constraint_forces": None, "constraint_forces_note": "The constraints are too many for a formula."}, {}
    table = table_of(scene.coordinates, run.trajectory.positions, velocities, dict(run.values), run.trajectory.times)
    columns = {f"lambda_{a}": array_value(one, table) for a, one in enumerate(found[1], 1)}
    for name in scene.coordinates:
        pairs = zip(scene.constraints, columns.copy().items(), strict=False)
        forces = [array_value(differentiate(w, Velocity(name)), table) * column for w, (key, column) in pairs]
        columns[f"force_{name}"] = sum(forces, np.zeros(len(run.trajectory.times)))
    formulas = {f"lambda_{a}": to_text(one) for a, one in enumerate(found[1], 1)}
    largest = {name: greatest(column) for name, column in columns.items()}
    return {"constraint_forces": {"formulas": formulas, "greatest": largest}}, columns


def _energy(run: Observed) -> tuple[dict[str, Any], dict[str, Array]]:
    """The energy at the recorded points for every method; that of the discrete Lagrangian, where there is one, under a
    name of its own."""
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
        note = f"{varies} {KEPT.format(run.scene.conserved[0].name)}" if kept else varies
        numbers = {"energy_start": start, "max_energy_error": None, "energy_note": note} | kept
        if not run.scene.forces:
            return numbers, series | drifts
        further, columns = _balance(run, velocities, points, start)
        return numbers | further, series | columns | drifts
    errors = np.abs(points - start) / (abs(start) or 1.0)
    found: dict[str, Any] = {
        "energy_start": start,
        "max_energy_error": greatest(errors),
        "final_energy_error": float(errors[-1]),
    }
    found |= {} if start else {"energy_error_is": "absolute, because the energy of the start is 0"}
    return found | numbers, series


def _conserved(run: Observed, velocities: Array) -> tuple[dict[str, Any], dict[str, Array]]:
    """The drift of each constant of the motion that was found, from the start of each part of the way on which its
    formula is one: where it passes a pole, as an arctangent of x'/x at x = 0, it begins again."""
    found: dict[str, Any] = {}
    series: dict[str, Array] = {}
    at, scene = run.trajectory, run.scene
    table = table_of(scene.coordinates, at.positions, velocities, dict(run.values), at.times)
    for k, one in enumerate(scene.conserved, 1):
        values = array_value(one.expression, table)
        ends = walls(one.expression, set(map(Symbol, scene.coordinates)))
        turned = [np.diff(np.sign(array_value(wall, table))) != 0 for wall in ends]
        cuts = np.flatnonzero(np.any([*turned, np.zeros(len(values) - 1, dtype=bool)], axis=0)) + 1
        pieces = np.split(values, cuts)
        drift = np.concatenate([piece - piece[0] for piece in pieces])
        size = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
        found[one.name] = {
            "text": to_text(one.expression), "max_error": greatest(drift / size), "parts": len(pieces),
        }  # fmt: skip
        series[f"conserved_{k}"] = drift / size
    return ({"conserved": found} if found else {}), series


def _discrete_energy(run: Observed, start: float) -> tuple[dict[str, Any], dict[str, Array]]:
    """E at the point and velocity of the discrete Lagrangian, the paper's: of methods of order 2 that have one."""
    choice = run.requested.choice
    if choice is None or run.requested.alpha is None or choice.order > 2 or run.scene.found is not None:
        return {}, {}
    series = {"discrete_energy": run.trajectory.series["energy_error"] + start}
    if why_energy_varies(run.scene):
        return {}, series
    return {"max_discrete_energy_error": run.trajectory.maxima["energy_error"] / (abs(start) or 1.0)}, series


def _point_constraints(run: Observed) -> dict[str, Any]:
    if run.requested.method != "variational" or not run.scene.constraints:
        return {}
    velocities = velocities_at_points(run)
    return {} if velocities is None else point_constraints(run.scene, run.trajectory.positions, velocities)


def velocities_at_points(run: Observed) -> Array | None:
    """(m, n) at the recorded points, from the momenta where the method has them; None where it has neither."""
    if run.problem is None or run.requested.alpha is None or run.in_pieces:
        return run.trajectory.velocities
    method, values = run.requested.method, dict(run.values)
    found = point_velocities(run.scene, run.problem, method, run.trajectory, values)
    return mean_velocities(run.trajectory.positions, run.scene.grid) if found is None else found


def _compared(
    name: str, scene: Scene, positions: Array, true: Array | None, truth: Truth | Unavailable | None
) -> tuple[dict[str, Any], dict[str, Array]]:
    if true is None or not isinstance(truth, Truth):
        reason = truth.reason if isinstance(truth, Unavailable) else "nothing to compare with"
        return {f"max_{name}" if name == "error" else "max_phase_error": None, f"{name}_note": reason}, {}
    if name == "error":
        return error_numbers(scene, positions, true, truth)
    if scene.circle is None:
        return {"max_phase_error": None}, {}
    pair = list(scene.circle)
    found, angles = phase_numbers(positions[:, pair], true[:, pair])
    return found, {"phase_error": angles}


def last_point(run: Observed) -> tuple[float, Array, Array | None]:
    """(t, q, v) where the run ended, with which another can go on; v is None where the method has none."""
    at = run.trajectory
    velocities = velocities_at_points(replace(run, trajectory=at.part(slice(-3, None))))
    return float(at.times[-1]), at.positions[-1], None if velocities is None else velocities[-1]


def columns_of(scene: Scene, table: Array, prefix: str = "") -> dict[str, Any]:
    """What a table (m, n), or one row of it, holds of each coordinate."""
    return {f"{prefix}{name}": table[..., k] for k, name in enumerate(scene.coordinates)}

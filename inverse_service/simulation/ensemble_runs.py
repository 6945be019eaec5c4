"""A scene's ensemble: every method for all members at once, and what is observed of each."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.simulation.array_values import NoValue, array_value, table_of
from inverse_service.simulation.derivation import USES_FREE, Derived, problem_of
from inverse_service.simulation.ensembles import ALL_METHODS, Many, run_ensemble
from inverse_service.simulation.observing import energy, why_energy_varies
from inverse_service.simulation.point_velocities import point_velocities
from inverse_service.simulation.problem import Problem
from inverse_service.simulation.scene import EXACT, FreeLagrangian, Members, Requested, Scene, Unavailable

Array = NDArray[np.float64]
Stop = Callable[[], bool]


@dataclass(frozen=True, slots=True)
class EnsembleRun:
    """One method for all members. `series` are columns (N, m) of what is observed, `numbers` (N,) of each member."""

    requested: Requested
    outcome: Outcome
    many: Many | None
    velocities: Array | None = None
    series: Mapping[str, Array] = field(default_factory=dict)
    numbers: Mapping[str, Array] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)


def run_members(scene: Scene, derived: Derived, requested: Requested, stop: Stop | None) -> EnsembleRun:
    """All members by one method."""
    assert scene.ensemble is not None
    if requested.method in (EXACT, "heyoka", "modified") or requested.choice is None:
        return EnsembleRun(requested, Outcome("unavailable", remedy=ALL_METHODS), None)
    problem = problem_of(scene, requested, derived)
    if isinstance(problem, Unavailable):
        return EnsembleRun(requested, Outcome("unavailable", remedy=problem.reason), None)
    free = derived.free.get(requested.free) if requested.method in USES_FREE else None
    known = free if isinstance(free, FreeLagrangian) else None
    members = scene.ensemble
    values: dict[str, float | Array] = {**scene.values, **(known.constants if known else {})}
    values |= dict(requested.constants) | dict(members.values)
    begun = time.perf_counter()
    momenta = _momenta(known, members, values)
    try:
        many = run_ensemble(
            problem, requested.choice, members.positions, members.velocities, scene.grid, values, momenta, stop=stop
        )
    except InputError as error:
        return EnsembleRun(requested, Outcome("unavailable", remedy=error.detail), None)
    ran = time.perf_counter()
    velocities = _velocities(scene, problem, requested, many, values)
    series, numbers = _observed(scene, many, velocities, values)
    seconds = {"run": ran - begun, "observed": time.perf_counter() - ran}
    kind = "cancelled" if many.cancelled else "completed" if many.completed.all() else "partly"
    return EnsembleRun(requested, Outcome(kind, scene.grid.steps), many, velocities, series, numbers, seconds)


def _momenta(free: FreeLagrangian | None, members: Members, values: Mapping[str, float | Array]) -> Array | None:
    """Those that L~ gives itself, one member after the other: they may be 0/0 in the velocities."""
    if free is None or free.start_momenta is None:
        return None
    rows = []
    for k, (q, v) in enumerate(zip(members.positions, members.velocities, strict=True)):
        own = {name: float(value[k]) if isinstance(value, np.ndarray) else value for name, value in values.items()}
        rows.append(free.start_momenta(q, v, own))
    return np.array(rows)


def _flat(values: Mapping[str, float | Array], points: int) -> Any:
    """Values of the parameters at all points of all members."""
    return {name: np.repeat(x, points) if isinstance(x, np.ndarray) else x for name, x in values.items()}


def _velocities(
    scene: Scene, problem: Problem, requested: Requested, many: Many, values: Mapping[str, float | Array]
) -> Array | None:
    """(N, m, n) at the recorded points."""
    if many.carried == "v":
        return many.rates
    shape = many.positions.shape
    flat = Trajectory(
        np.tile(many.times, shape[0]), many.positions.reshape(-1, shape[2]), many.rates.reshape(-1, shape[2]), None,
        Outcome("completed"), 0, 0, 0.0, 0.0,
    )  # fmt: skip
    found = point_velocities(scene, problem, requested.method, flat, _flat(values, shape[1]))
    return None if found is None else found.reshape(shape)


def _observed(
    scene: Scene, many: Many, velocities: Array | None, values: Mapping[str, float | Array]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Energy, where the scene observes it, and its own observables: columns (N, m), and numbers (N,)."""
    shape = many.positions.shape
    speeds = None if velocities is None else velocities.reshape(-1, shape[2])
    table = table_of(
        scene.coordinates, many.positions.reshape(-1, shape[2]), speeds, _flat(values, shape[1]),
        np.tile(many.times, shape[0]),
    )  # fmt: skip
    formulas = {one.name: one.expression for one in scene.own}
    if "energy" in scene.observe and scene.lagrangian is not None:
        formulas["energy"] = energy(scene.lagrangian, scene.coordinates)
    series: dict[str, Array] = {}
    for name, tree in formulas.items():
        try:
            series[name] = array_value(tree, table).reshape(shape[:2])
        except NoValue:
            continue
    numbers: dict[str, Array] = {}
    if "energy" in series and why_energy_varies(scene) is None:
        start = series["energy"][:, :1]
        with np.errstate(all="ignore"):
            errors = np.abs(series["energy"] - start) / np.where(start == 0, 1.0, np.abs(start))
        numbers["max_energy_error"] = np.where(many.completed, errors.max(axis=1), np.nan)
    return series, numbers

"""A scene run: every method, with the observed quantities, each with what it cost.

The largest Lyapunov exponent of a motion is found from its variational equations

    w_i'' = sum_j (df_i/dq_j) w_j + (df_i/dq_j') w_j'

integrated with q'' = f by DOP853; w is brought back to length 1 after each of PARTS parts of the run. The mean
of log |w| over time is the exponent. G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, Symbol, Velocity, add
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation.advice import COST, Means, effects_of, part_costs
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.derivation import (
    COMPARED,
    USES_EXACT,
    Derived,
    Find,
    derived_for_truth,
    problem_of,
    timed,
    with_accelerations,
    with_energy,
)
from inverse_service.simulation.ensembles import EnsembleRun, run_members
from inverse_service.simulation.estimates import (
    apart_from,
    estimated,
    has_functions_of_time,
    jump_of_energy,
    other_motion,
)
from inverse_service.simulation.events import Found, period_of, with_events
from inverse_service.simulation.exact_motion import ExactMotion
from inverse_service.simulation.hybrid import Pieces, has_pieces, run_pieces
from inverse_service.simulation.initial import ended_at_start
from inverse_service.simulation.methods import run
from inverse_service.simulation.observing import (
    ENERGY_START,
    Observed,
    observables,
    observation_of,
    observed_quantities,
    start_energy,
)
from inverse_service.simulation.scene_data import (
    EXACT,
    FreeLagrangian,
    Grid,
    MethodChoice,
    Observation,
    Problem,
    Progress,
    Requested,
    Scene,
    Start,
    Stop,
    Truth,
    Unavailable,
)
from inverse_service.simulation.truth import exact_trajectory, true_motion

OTHER = Requested("adaptive", "adaptive", None, MethodChoice("adaptive", tolerance=1e-10))
LATE = "The time was over before its turn; take fewer methods or steps, or a longer time limit."
FAULT = "This method failed by a fault of the program ({}): please report the scene."


@dataclass(frozen=True, slots=True)
class MethodRun:
    """One method of a scene. `numbers` are the observed quantities, `series` those at each recorded point.

    `seconds` says what compiling, running and each observed quantity cost; `trajectory` is None where the
    method could not start, and `outcome` says why. `events` are those found, `observed` is the run with what
    velocities at its points need.
    """

    requested: Requested
    outcome: Outcome
    trajectory: Trajectory | None
    numbers: Mapping[str, Any] = field(default_factory=dict)
    series: Mapping[str, Array] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    free: FreeLagrangian | None = None
    events: tuple[Found, ...] = ()
    observed: Observed | None = None
    pieces: Pieces | None = None


@dataclass(frozen=True, slots=True)
class SceneRun:
    """All runs of a scene, with the true motion where something observed needed it."""

    scene: Scene
    derived: Derived
    truth: Truth | Unavailable | None
    runs: tuple[MethodRun, ...]
    members: tuple[EnsembleRun, ...] = ()
    lyapunov: Mapping[str, Any] | None = None
    effects: Mapping[str, Any] = field(default_factory=dict)


def run_scene(
    scene: Scene, derived: Derived, progress: Progress | None = None, stop: Stop | None = None,
    find: Find | None = None, compared_until: Stop | None = None,
) -> SceneRun:  # fmt: skip
    """Run every method; what ends a method is its outcome and does not touch the others.

    `find` looks for free Lagrangians where the cost of parts is observed. The true motion is given up where
    `compared_until` says so, that the methods have time left.
    """
    tell = progress or (lambda message: None)
    scene = with_energy(scene, derived)
    truth = None
    if USES_EXACT & set(scene.observe) and scene.ensemble is None:
        tell("true motion")
        truth = _truth(scene, derived, compared_until or stop)
    runs: list[MethodRun] = []
    members: list[EnsembleRun] = []
    for place, requested in enumerate(scene.methods, 1):
        tell(f"{requested.label} ({place} of {len(scene.methods)})")
        if stop is not None and stop() and scene.ensemble is None:
            # To compile it and take no step would cost the time in which the others are written.
            runs.append(MethodRun(requested, Outcome("cancelled", remedy=LATE), None))
            continue
        try:
            if scene.ensemble is not None:
                members.append(run_members(scene, derived, requested, stop))
                continue
            runs.append(run_method(scene, requested, derived, truth, stop, find))
        except (ArithmeticError, ValueError, LookupError, TypeError, RuntimeError) as error:
            logging.getLogger(__name__).exception("the method %s failed", requested.method)
            runs.append(MethodRun(requested, Outcome("failed", remedy=FAULT.format(type(error).__name__)), None))
    exponent = None
    begins = not isinstance(with_accelerations(scene, derived), Unavailable)
    if "lyapunov" in scene.observe and isinstance(derived.accelerations, tuple) and begins:
        tell("Lyapunov exponent")
        exponent = largest_exponent(scene, derived.accelerations, stop)
    means = Means(_no_run, observed_problem, find or _no_free, stop or (lambda: False))
    return SceneRun(scene, derived, truth, tuple(runs), tuple(members), exponent, effects_of(scene, derived, means))


def run_method(
    scene: Scene,
    requested: Requested,
    derived: Derived,
    truth: Truth | Unavailable | None,
    stop: Stop | None = None,
    find: Find | None = None,
) -> MethodRun:
    """One method and its observed quantities, with an estimate of its error, and what its parts cost."""
    run_ = observed_run(scene, requested, derived, truth, stop)
    problem = None if run_.observed is None else run_.observed.problem
    if run_.observed is None or problem is None:
        return run_
    outcome, numbers, seconds = run_.outcome, dict(run_.numbers), dict(run_.seconds)
    if outcome.completed:
        with timed(seconds, "half the step"):
            numbers |= estimated(run_.observed, partial(_again, problem, run_.free, stop, derived))
        doubt = numbers.pop("doubt")
        if not doubt and has_functions_of_time(run_.observed):
            with timed(seconds, "adaptive"):
                other = observed_run(replace(scene, observe=()), OTHER, derived_for_truth(scene, derived), None, stop)
            doubt = "" if other.trajectory is None else apart_from(run_.observed, other.trajectory)
        outcome = replace(outcome, doubt=doubt)
    if COST in scene.observe:
        with timed(seconds, COST):
            numbers[COST] = _costs(scene, requested, derived, run_.free, stop, find)
    return replace(run_, outcome=outcome, numbers=numbers, seconds=seconds)


def observed_run(
    scene: Scene,
    requested: Requested,
    derived: Derived,
    truth: Truth | Unavailable | None,
    stop: Stop | None = None,
) -> MethodRun:
    """One method and its observed quantities, as far as it came and its steps saw what they moved through."""
    free = derived.free.get(requested.free) if requested.method in ("variational", "modified") else None
    known = free if isinstance(free, FreeLagrangian) else None
    if (lost := ended_at_start(scene)) is not None:
        return MethodRun(requested, lost.outcome, lost, free=known)
    problem, ran = _motion(scene, requested, derived, known, stop)
    if isinstance(ran, Unavailable):
        return MethodRun(requested, Outcome("unavailable", remedy=ran.reason), None)
    pieces = ran if isinstance(ran, Pieces) else None
    found = ran.trajectory if isinstance(ran, Pieces) else ran
    seconds = {"compile": found.compile_seconds, "run": found.run_seconds}
    values = values_of(scene, requested, known)
    observed = Observed(scene, requested, found, problem, values, truth, pieces is not None)
    events: tuple[Found, ...] = () if pieces is None else pieces.events
    if pieces is None:
        if found.outcome.completed and (unseen := other_motion(observed) or jump_of_energy(observed)) is not None:
            found = found.ended(found.times <= (unseen.time or 0.0), unseen)
            observed = replace(observed, trajectory=found)
        if scene.events and len(found.times) > 1:
            with timed(seconds, "events"):
                found, events = with_events(observed, with_accelerations(scene, derived))
                observed = replace(observed, trajectory=found)
    if not found.outcome.completed and len(found.times) < 2:  # it did not make a step: nothing to observe
        return MethodRun(requested, found.outcome, found, seconds=seconds, free=known)
    numbers, series = observed_quantities(observed, seconds)
    if "period" in scene.observe:
        with timed(seconds, "period"):
            numbers |= period_of(observed, with_accelerations(scene, derived))
    return MethodRun(requested, found.outcome, found, numbers, series, seconds, known, events, observed, pieces)


def _motion(
    scene: Scene, requested: Requested, derived: Derived, free: FreeLagrangian | None, stop: Stop | None
) -> tuple[Problem | None, Trajectory | Pieces | Unavailable]:
    """The problem that a method has, None of the exact solution, and its trajectory, or its pieces."""
    if requested.method == EXACT:
        exact = exact_trajectory(scene, derived)
        return None, with_series(scene, exact) if isinstance(exact, Trajectory) else exact
    problem = problem_of(scene, requested, derived)
    if isinstance(problem, Unavailable):
        return None, problem
    return problem, _integrated(scene, requested, problem, free, stop, derived)


def _integrated(
    scene: Scene, requested: Requested, problem: Problem, free: FreeLagrangian | None, stop: Stop | None,
    derived: Derived | None = None,
) -> Trajectory | Pieces | Unavailable:  # fmt: skip
    assert requested.choice is not None
    values = values_of(scene, requested, free)
    if "energy" in scene.observe and scene.lagrangian is not None:
        values[ENERGY_START] = start_energy(scene) or 0.0
        if not np.isfinite(values[ENERGY_START]):
            return Unavailable("The energy has no finite value at the start: start somewhere else.")

    def piece(what: Problem, choice: MethodChoice, start: Start, grid: Grid) -> Trajectory:
        own, observation = observed_problem(scene, what)
        return run(own, choice, start, grid, values, observation, stop, in_pieces)

    in_pieces = derived is not None and has_pieces(scene, problem)
    try:
        start = start_of(scene, requested, free, values)
        if not in_pieces or derived is None:
            return piece(problem, requested.choice, start, scene.grid)
        every, whole = scene.grid.record_every, replace(scene, grid=replace(scene.grid, record_every=1))
        found = run_pieces(whole, requested, problem, with_accelerations(scene, derived), start, values, piece, stop)
        return found if every == 1 or isinstance(found, Unavailable) else found.thinned(scene.grid)
    except InputError as error:
        return Unavailable(error.detail)


def _again(
    problem: Problem, free: FreeLagrangian | None, stop: Stop | None, derived: Derived, scene: Scene,
    requested: Requested,
) -> Trajectory | Unavailable:  # fmt: skip
    """The method once more."""
    found = _integrated(scene, requested, problem, free, stop, derived)
    return found.trajectory if isinstance(found, Pieces) else found


def observed_problem(scene: Scene, problem: Problem) -> tuple[Problem, Observation]:
    """The problem with the parameters that the observed formulas need, and what is recorded."""
    observation = observation_of(scene)
    if observation.observables and "energy" in scene.observe:
        problem = replace(problem, parameters=(*problem.parameters, ENERGY_START))
    return problem.with_used_parameters([one.expression for one in observation.observables]), observation


def _costs(
    scene: Scene, requested: Requested, derived: Derived, free: FreeLagrangian | None, stop: Stop | None,
    find: Find | None,
) -> dict[str, Any]:  # fmt: skip
    def step(variant: Scene, problem: Problem) -> Trajectory | Unavailable:
        known = None
        if problem.free_lagrangian is not None:
            known = free or FreeLagrangian(problem.free_lagrangian, problem.free_hamiltonian, {}, "")
        found = _integrated(variant, requested, problem, known, stop)
        return found.trajectory if isinstance(found, Pieces) else found

    means = Means(step, observed_problem, find or _no_free, stop or (lambda: False))
    return part_costs(scene, requested, derived, means)


def _no_run(*_: object) -> Unavailable:
    return Unavailable("no run is made.")


def _no_free(*_: object) -> Unavailable:
    return Unavailable("no free Lagrangian was looked for.")


def values_of(scene: Scene, requested: Requested, free: FreeLagrangian | None) -> dict[str, float]:
    """Numbers of all parameters, the free constants of the method too."""
    return dict(scene.values) | (dict(free.constants) if free else {}) | dict(requested.constants)


def start_of(scene: Scene, requested: Requested, free: FreeLagrangian | None, values: Mapping[str, float]) -> Start:
    """The start of a method: momenta where L~ gives them itself (they may be 0/0 in the velocities)."""
    positions, velocities = tuple(map(float, scene.positions)), tuple(map(float, scene.velocities))
    momenta = None
    if free is not None and free.start_momenta is not None and requested.convention == "momenta":
        found = free.start_momenta(scene.positions, scene.velocities, values)
        momenta = tuple(map(float, found)) if np.isfinite(found).all() else None
    return Start(positions, velocities=velocities, momenta=momenta, convention=requested.convention)


def with_series(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """The exact trajectory with the formulas of the observed quantities at its points."""
    values = dict(scene.values) | {ENERGY_START: start_energy(scene) or 0.0}
    table = table_of(scene.coordinates, trajectory.positions, trajectory.velocities, values, trajectory.times)
    series = {one.name: array_value(one.expression, table) for one in observables(scene)}
    maxima = {name: float(np.abs(column).max()) for name, column in series.items()}
    return replace(trajectory, series=series, maxima=maxima)


def _truth(scene: Scene, derived: Derived, stop: Stop | None) -> Truth | Unavailable:
    """The true motion; circles are compared with the exact solution only, so they cost no reference run."""
    if COMPARED & set(scene.observe) or isinstance(derived.exact, ExactMotion):
        return true_motion(scene, derived, stop)
    return Unavailable("No exact solution is known here.")


PARTS = 200
CHOICE = MethodChoice("adaptive", tolerance=1e-10)
BARE = Observation(momenta=False)
OVER = "The time was over before the exponent was found; take fewer methods or steps, or a longer time limit."
ENDED = "The motion ends at t = {:.6g}, before the exponent has settled."


def largest_exponent(
    scene: Scene, accelerations: tuple[Expression, ...], stop: Callable[[], bool] | None = None
) -> dict[str, Any]:
    """{largest, half, time}: the exponent over the whole run and over its first half, which tells how settled it is."""
    problem = with_tangent(scene, accelerations)
    n, length = len(scene.coordinates), scene.grid.step * scene.grid.steps
    positions, velocities = scene.positions, scene.velocities
    names: list[Expression] = [*map(Symbol, scene.coordinates), *map(Velocity, scene.coordinates)]
    slopes = [[differentiate(one, name) for name in names] for one in scene.constraints]
    tangent = _on_constraints(np.ones(2 * n), scene, slopes, positions, velocities)
    tangent /= np.linalg.norm(tangent)
    total, halves = 0.0, []
    for part in range(PARTS):
        begin = scene.grid.begin + part * length / PARTS
        start = Start((*positions, *tangent[:n]), velocities=(*velocities, *tangent[n:]))
        found = run(problem, CHOICE, start, Grid(length / PARTS, 1, 1, begin), dict(scene.values), BARE, stop)
        if stop is not None and stop():
            return {"largest": None, "note": OVER}
        if not found.outcome.completed or found.velocities is None:
            return {"largest": None, "note": ENDED.format(begin)}
        positions, velocities = found.positions[-1, :n], found.velocities[-1, :n]
        tangent = np.concatenate([found.positions[-1, n:], found.velocities[-1, n:]])
        tangent = _on_constraints(tangent, scene, slopes, positions, velocities)
        size = float(np.linalg.norm(tangent))
        total, tangent = total + float(np.log(size)), tangent / size
        halves.append(total)
    return {"largest": total / length, "half": halves[PARTS // 2 - 1] / (length / 2), "time": length}


def _on_constraints(
    tangent: Array, scene: Scene, slopes: list[list[Expression]], positions: Array, velocities: Array
) -> Array:
    """The tangent to motions that keep the constraints, (2 n,): others, which the accelerations have too, may part."""
    if not slopes:
        return tangent
    table = table_of(scene.coordinates, positions[None], velocities[None], scene.values)
    rows = np.array([[float(array_value(one, table).ravel()[0]) for one in row] for row in slopes])
    found: Array = tangent - np.linalg.pinv(rows) @ (rows @ tangent)
    return found


def with_tangent(scene: Scene, accelerations: tuple[Expression, ...]) -> Problem:
    """The motion with its variational equations; the tangent of x has a name that no formula uses."""
    names = scene.coordinates
    tangents = tuple(f"tangent_of_{name}" for name in names)
    rows = []
    for force in accelerations:
        terms = [differentiate(force, Symbol(x)) * Symbol(w) for x, w in zip(names, tangents, strict=True)]
        terms += [differentiate(force, Velocity(x)) * Velocity(w) for x, w in zip(names, tangents, strict=True)]
        rows.append(collect(add(*terms)))
    return Problem((*names, *tangents), tuple(scene.values), accelerations=(*accelerations, *rows))

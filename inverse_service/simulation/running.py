"""Run a scene: every method with its observed quantities, and the cost of each.

The largest Lyapunov exponent of a motion is found from its variational equations

    w_i'' = sum_j (df_i/dq_j) w_j + (df_i/dq_j') w_j'

integrated with q'' = f by `adaptive`; w is brought back to length 1 after each of PARTS parts of the run. The mean
of log |w| over time is the exponent. G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9.
"""

import logging
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, Symbol, Velocity, add
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.kernels.codegen import compiled
from inverse_service.simulation import (
    derivation,
    ensemble_runs,
    estimates,
    execution,
    initial,
    motions,
    numeric_formulas,
    observing,
    scene_data,
    schemes,
    truth as truths,
)
from inverse_service.simulation.events import Found, Pieces, period_of, run_motion, until, with_events

LATE = "The time limit was reached before this method could run. Take fewer methods or steps, or a longer time limit."
FAULT = "This method failed because of a fault of the program ({}): please report the scene."
COST = "cost"
IN_KERNEL = ("energy", "constraints")
TIMED_STEPS, MORE_STEPS = 20_000, 8  # steps that are timed at most, and how many times as many where they are too few
REPEATS, LEAST_REPEATS, LONG_ENOUGH = 15, 3, 0.03  # runs for one measurement, and their seconds
LARGE = 8  # coordinates beyond which the operations of effects are counted where the cost is observed only
NOT_IN_STEPS = "The cost of parts is measured only for methods that step with a kernel."
TOO_SHORT = "The run is too short to time its steps: take more steps."
TOGETHER = "The free Lagrangian belongs to all effects together, so single effects cannot be removed from it."
_OPERATION = re.compile(r"= (?:fadd|fsub|fmul|fdiv|fneg|fcmp|(?:tail )?call)\b")
PARTS = 200
CHOICE = scene_data.MethodChoice("adaptive", tolerance=1e-10)
OVER = "The time limit was reached before the exponent was found. Take fewer methods or steps, or a longer time limit."
ENDED = "The motion ends at t = {:.6g}, before the exponent has converged."


@dataclass(frozen=True, slots=True)
class MethodRun:
    """One method of a scene. `numbers` are the observed quantities, `series` those at each recorded point.

    `seconds` says what compiling, running and each observed quantity cost; `trajectory` is None where the
    method could not start, and `outcome` says why. `events` are those found, `observed` is the run with what
    velocities at its points need.
    """

    requested: scene_data.Requested
    outcome: Outcome
    trajectory: Trajectory | None
    numbers: Mapping[str, Any] = field(default_factory=dict)
    series: Mapping[str, Array] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    free: scene_data.FreeLagrangian | None = None
    events: tuple[Found, ...] = ()
    observed: observing.Observed | None = None
    pieces: Pieces | None = None


@dataclass(frozen=True, slots=True)
class SceneRun:
    """All runs of a scene, with the true motion where something observed needed it."""

    scene: scene_data.Scene
    derived: derivation.Derived
    truth: scene_data.Truth | scene_data.Unavailable | None
    runs: tuple[MethodRun, ...]
    members: tuple[ensemble_runs.EnsembleRun, ...] = ()
    lyapunov: Mapping[str, Any] | None = None
    effects: Mapping[str, Any] = field(default_factory=dict)


def run_scene(
    scene: scene_data.Scene, derived: derivation.Derived, progress: scene_data.Progress | None = None,
    stop: scene_data.Stop | None = None, find: derivation.Find | None = None,
    compared_until: scene_data.Stop | None = None,
) -> SceneRun:  # fmt: skip
    """Run every method; the failure of one method is its outcome and does not affect the others.

    `find` looks for free Lagrangians where the cost of parts is observed. The true motion is abandoned when
    `compared_until` says so, so that the methods have time left.
    """
    tell = progress or (lambda message: None)
    scene = derivation.with_energy(scene, derived)
    truth = None
    if derivation.USES_EXACT & set(scene.observe) and scene.ensemble is None:
        tell("true motion")
        truth = _truth(scene, derived, compared_until or stop)
    runs: list[MethodRun] = []
    members: list[ensemble_runs.EnsembleRun] = []
    for place, requested in enumerate(scene.methods, 1):
        tell(f"{requested.label} ({place} of {len(scene.methods)})")
        if stop is not None and stop() and scene.ensemble is None:
            # Compiling it without taking a step would use the time needed to write the other methods.
            runs.append(MethodRun(requested, Outcome("cancelled", remedy=LATE), None))
            continue
        try:
            if scene.ensemble is not None:
                members.append(ensemble_runs.run_members(scene, derived, requested, stop))
                continue
            runs.append(run_method(scene, requested, derived, truth, stop, find))
        except (ArithmeticError, ValueError, LookupError, TypeError, RuntimeError) as error:
            logging.getLogger(__name__).exception("the method %s failed", requested.method)
            runs.append(MethodRun(requested, Outcome("failed", remedy=FAULT.format(type(error).__name__)), None))
    exponent = None
    begins = not isinstance(derivation.with_accelerations(scene, derived), scene_data.Unavailable)
    if "lyapunov" in scene.observe and isinstance(derived.accelerations, tuple) and begins:
        tell("Lyapunov exponent")
        exponent = largest_exponent(scene, derived.accelerations, stop)
    effects = effects_of(scene, derived, find or _no_free)
    return SceneRun(scene, derived, truth, tuple(runs), tuple(members), exponent, effects)


def run_method(
    scene: scene_data.Scene,
    requested: scene_data.Requested,
    derived: derivation.Derived,
    truth: scene_data.Truth | scene_data.Unavailable | None,
    stop: scene_data.Stop | None = None,
    find: derivation.Find | None = None,
) -> MethodRun:
    """One method and its observed quantities, with an estimate of its error, and the cost of its parts."""
    run_ = observed_run(scene, requested, derived, truth, stop)
    problem = None if run_.observed is None else run_.observed.problem
    if run_.observed is None or problem is None:
        return run_
    outcome, numbers, seconds = run_.outcome, dict(run_.numbers), dict(run_.seconds)
    if outcome.completed:
        with derivation.timed(seconds, "half the step"):
            numbers |= estimates.estimated(run_.observed, partial(_again, problem, run_.free, stop, derived))
            lost = numbers.pop("lost")
            if lost is None and not numbers["doubt"]:
                numbers = truths.with_missed_force(run_.observed, numbers, derived, stop)
        if lost is not None:
            return _cut(run_, run_.observed, lost)
        outcome = replace(outcome, doubt=numbers.pop("doubt"))
    if COST in scene.observe:
        with derivation.timed(seconds, COST):
            numbers[COST] = part_costs(scene, requested, problem, run_.free, stop, find or _no_free)
    return replace(run_, outcome=outcome, numbers=numbers, seconds=seconds)


def _cut(run: MethodRun, observed: observing.Observed, outcome: Outcome) -> MethodRun:
    """The run up to its outcome, with the quantities observed so far."""
    seconds = dict(run.seconds)
    ran = observed.trajectory.ended(observed.trajectory.times <= (outcome.time or 0.0), outcome)
    shorter = replace(observed, trajectory=ran)
    numbers, series = observing.observed_quantities(shorter, seconds)
    events = tuple(until(one, outcome.time or 0.0) for one in run.events)
    return replace(
        run, outcome=outcome, trajectory=ran, numbers=numbers, series=series, seconds=seconds, events=events,
        observed=shorter,
    )  # fmt: skip


def observed_run(
    scene: scene_data.Scene,
    requested: scene_data.Requested,
    derived: derivation.Derived,
    truth: scene_data.Truth | scene_data.Unavailable | None,
    stop: scene_data.Stop | None = None,
) -> MethodRun:
    """One method and its observed quantities, up to the point that it reached within the domain of its formulas."""
    free = derived.free.get(requested.free) if requested.method in ("variational", "modified") else None
    known = free if isinstance(free, scene_data.FreeLagrangian) else None
    if (lost := initial.ended_at_start(scene)) is not None:
        return MethodRun(requested, lost.outcome, lost, free=known)
    problem, ran = _motion(scene, requested, derived, known, stop)
    if isinstance(ran, scene_data.Unavailable):
        return MethodRun(requested, Outcome("unavailable", remedy=ran.reason), None)
    pieces = ran if isinstance(ran, Pieces) else None
    found = ran.trajectory if isinstance(ran, Pieces) else ran
    seconds = {"compile": found.compile_seconds, "run": found.run_seconds}
    values = values_of(scene, requested, known)
    observed = observing.Observed(scene, requested, found, problem, values, truth, pieces is not None)
    events: tuple[Found, ...] = () if pieces is None else pieces.events
    if pieces is None:
        if found.outcome.completed and (other := estimates.other_motion(observed)) is not None:
            found = found.ended(found.times <= (other.time or 0.0), other)
            observed = replace(observed, trajectory=found)
        if scene.events and len(found.times) > 1:
            with derivation.timed(seconds, "events"):
                found, events = with_events(observed, derivation.with_accelerations(scene, derived))
                observed = replace(observed, trajectory=found)
    if not found.outcome.completed and len(found.times) < 2:  # it did not make a step: nothing to observe
        return MethodRun(requested, found.outcome, found, seconds=seconds, free=known)
    numbers, series = observing.observed_quantities(observed, seconds)
    if "period" in scene.observe:
        with derivation.timed(seconds, "period"):
            numbers |= period_of(observed, derivation.with_accelerations(scene, derived))
    return MethodRun(requested, found.outcome, found, numbers, series, seconds, known, events, observed, pieces)


def _motion(
    scene: scene_data.Scene,
    requested: scene_data.Requested,
    derived: derivation.Derived,
    free: scene_data.FreeLagrangian | None,
    stop: scene_data.Stop | None,
) -> tuple[scene_data.Problem | None, Trajectory | Pieces | scene_data.Unavailable]:
    """The problem of a method (None for the exact solution), and its trajectory or its pieces."""
    if requested.method == scene_data.EXACT:
        exact = truths.exact_trajectory(scene, derived)
        return None, with_series(scene, exact) if isinstance(exact, Trajectory) else exact
    problem = derivation.problem_of(scene, requested, derived)
    if isinstance(problem, scene_data.Unavailable):
        return None, problem
    return problem, _integrated(scene, requested, problem, free, stop, derived)


def _integrated(
    scene: scene_data.Scene, requested: scene_data.Requested, problem: scene_data.Problem,
    free: scene_data.FreeLagrangian | None, stop: scene_data.Stop | None, derived: derivation.Derived,
) -> Trajectory | Pieces | scene_data.Unavailable:  # fmt: skip
    assert requested.choice is not None
    values = start_values(scene, requested, free)
    if not np.isfinite(values.get(observing.ENERGY_START, 0.0)):
        return scene_data.Unavailable("The energy has no finite value at the start: start somewhere else.")

    def piece(
        what: scene_data.Problem, choice: scene_data.MethodChoice, start: scene_data.Start, grid: scene_data.Grid
    ) -> Trajectory:
        own, observation = observed_problem(scene, what)
        return execution.run(own, choice, start, grid, values, observation, stop)

    try:
        start, motion = start_of(scene, requested, free, values), derivation.with_accelerations(scene, derived)
        return run_motion(scene, requested, problem, motion, start, values, piece, stop)
    except InputError as error:
        return scene_data.Unavailable(error.detail)


def _again(
    problem: scene_data.Problem, free: scene_data.FreeLagrangian | None, stop: scene_data.Stop | None,
    derived: derivation.Derived, scene: scene_data.Scene, requested: scene_data.Requested,
) -> Trajectory | scene_data.Unavailable:  # fmt: skip
    """The method once more."""
    found = _integrated(scene, requested, problem, free, stop, derived)
    return found.trajectory if isinstance(found, Pieces) else found


def observed_problem(
    scene: scene_data.Scene, problem: scene_data.Problem
) -> tuple[scene_data.Problem, scene_data.Observation]:
    """The problem with the parameters that the observed formulas need, and the recorded formulas."""
    observation = observing.observables(scene)
    if observation and "energy" in scene.observe:
        problem = replace(problem, parameters=(*problem.parameters, observing.ENERGY_START))
    return problem.with_used_parameters([one.expression for one in observation]), observation


def part_costs(
    scene: scene_data.Scene, requested: scene_data.Requested, problem: scene_data.Problem,
    free: scene_data.FreeLagrangian | None, stop: scene_data.Stop | None,
    find: derivation.Find,
) -> dict[str, Any]:  # fmt: skip
    """The key `cost` of a method: the whole step, and each part of it as the difference to the scene without it; no
    time where that is below the noise. A step is timed as a run of many less that of one, each the best of several: to
    call a kernel takes longer than many steps."""
    if not method_table.METHODS[requested.method].has_kernel:
        return {"note": NOT_IN_STEPS}

    def price(variant: scene_data.Scene, what: scene_data.Problem) -> tuple[float, int, int] | scene_data.Unavailable:
        """(ns of a step or nan, operations, steps that were timed)."""
        known = free
        if what.free_lagrangian is not None and known is None:
            known = scene_data.FreeLagrangian(what.free_lagrangian, what.free_hamiltonian, {}, "")
        values, (own, observation) = start_values(variant, requested, known), observed_problem(variant, what)
        assert requested.choice is not None
        try:
            execution.check(own, requested.choice)
            start = start_of(variant, requested, known, values)
            ready = execution.prepared(own, requested.choice, start, variant.grid, values, observation)
        except InputError as error:
            return scene_data.Unavailable(error.detail)
        if isinstance(ready, Trajectory):
            return scene_data.Unavailable("no step is made.")
        begun, steps = _fastest(ready, variant, 1, stop), min(scene.grid.steps, TIMED_STEPS)
        whole = _fastest(ready, variant, steps, stop)
        while not whole[0] > 2 * begun[0] and whole[1] == steps < TIMED_STEPS:
            steps = min(MORE_STEPS * steps, TIMED_STEPS)
            whole = _fastest(ready, variant, steps, stop)
        is_long = whole[0] > 2 * begun[0] and whole[1] > 1
        step = 1e9 * (whole[0] - begun[0]) / (whole[1] - 1) if is_long else np.nan
        return step, operations(own, observation, requested), whole[1]

    whole = price(scene, problem)
    if isinstance(whole, scene_data.Unavailable):
        return {"note": whole.reason}
    together = _belongs_together(scene, requested)
    variants = [] if together else [(part.name, "effect", turned(scene, part)) for part in scene.parts if part.acts]
    for name in (name for name in scene.observe if name in IN_KERNEL):
        others = tuple(one for one in scene.observe if one != name)
        variants.append((name, "observed", replace(scene, observe=others)))
    parts = []
    for name, kind, variant in variants:
        without = derivation.problem_of(variant, requested, derivation.derive(_alone(variant, requested), find))
        found = without if isinstance(without, scene_data.Unavailable) else price(variant, without)
        part: dict[str, Any] = {"name": name, "kind": kind, "step_ns": None, "operations": None}
        if isinstance(found, scene_data.Unavailable):
            part["note"] = f"Without it: {found.reason}"
        else:
            part["operations"] = whole[1] - found[1]
            part |= {"step_ns": whole[0] - found[0]} if whole[0] > found[0] else {"note": "Its time is below noise."}
        parts.append(part)
    note = TOO_SHORT if np.isnan(whole[0]) else TOGETHER if together and scene.parts else ""
    numbers = dict(zip(("step_ns", "operations", "steps"), whole, strict=True))
    return numbers | ({"note": note} if note else {}) | {"parts": parts}


def _fastest(
    ready: execution.Prepared, scene: scene_data.Scene, steps: int, stop: scene_data.Stop | None
) -> tuple[float, int]:
    """(seconds of the fastest run with so many steps, steps that it makes)."""
    least, spent, done = float("inf"), 0.0, 0
    for turn in range(REPEATS):
        if (turn >= LEAST_REPEATS and spent > LONG_ENOUGH) or (turn and stop is not None and stop()):
            break
        ran = ready.go(replace(scene.grid, steps=steps))
        least, spent, done = min(least, ran.seconds), spent + ran.seconds, ran.done
    return least, done


def _belongs_together(scene: scene_data.Scene, requested: scene_data.Requested) -> bool:
    """Whether the effects of a method are in one free Lagrangian, from which none can be removed."""
    return bool(scene.constraints) and requested.method in method_table.USES_FREE


def turned(scene: scene_data.Scene, part: scene_data.Effect) -> scene_data.Scene:
    """The scene without the effect, where it acts, or with it."""
    names = (name for name in scene.effects if name != part.name)
    effects = tuple(names) if part.acts else (*scene.effects, part.name)
    return replace(scene, lagrangian=part.lagrangian, constraints=part.constraints, forces=part.forces, effects=effects)


def _alone(scene: scene_data.Scene, requested: scene_data.Requested) -> scene_data.Scene:
    """The scene with one method and what its kernel observes."""
    return replace(scene, methods=(requested,), observe=tuple(name for name in scene.observe if name in IN_KERNEL))


def effects_of(scene: scene_data.Scene, derived: derivation.Derived, find: derivation.Find) -> dict[str, Any]:
    """{acting, left_out, method}: each effect with the operations of a step that it adds, or would add, to the first
    method that steps with a kernel; None if that cannot be determined."""
    method = next((one for one in scene.methods if method_table.METHODS[one.method].has_kernel
                   and not _belongs_together(scene, one)), None)  # fmt: skip

    def count(variant: scene_data.Scene, known: derivation.Derived | None) -> int | None:
        if method is None or len(scene.coordinates) > LARGE:
            return None
        alone = _alone(variant, method)
        problem = derivation.problem_of(variant, method, known or derivation.derive(alone, find))
        try:
            return (
                None
                if isinstance(problem, scene_data.Unavailable)
                else operations(*observed_problem(alone, problem), method)
            )
        except InputError:  # the method is not for such a scene
            return None

    whole = count(scene, derived)
    found: dict[bool, list[dict[str, Any]]] = {True: [], False: []}
    for part in scene.parts:
        other = None if whole is None else count(turned(scene, part), None)
        more = None if whole is None or other is None else (whole - other if part.acts else other - whole)
        found[part.acts].append({"name": part.name, "operations": more})
    label = None if whole is None or method is None else method.label
    return {"acting": found[True], "left_out": found[False], "method": label, "operations": whole}


def operations(
    problem: scene_data.Problem, observation: scene_data.Observation, requested: scene_data.Requested
) -> int:
    """Floating-point instructions and calls in the kernel of a method, each counted once: no load changes them."""
    assert requested.choice is not None
    text = compiled.kernel_text(schemes.program_of(numeric_formulas.Formulas(problem), requested.choice, observation))
    return len(_OPERATION.findall(text.partition("next_step:")[2]))


def _no_free(*_: object) -> scene_data.Unavailable:
    return scene_data.Unavailable("no free Lagrangian was looked for.")


def values_of(
    scene: scene_data.Scene, requested: scene_data.Requested, free: scene_data.FreeLagrangian | None
) -> dict[str, float]:
    """Numbers of all parameters, the free constants of the method too."""
    return dict(scene.values) | (dict(free.constants) if free else {}) | dict(requested.constants)


def start_values(
    scene: scene_data.Scene, requested: scene_data.Requested, free: scene_data.FreeLagrangian | None
) -> dict[str, float]:
    """The numbers of `values_of`, with the energy of the start where the kernel compares with it."""
    found = values_of(scene, requested, free)
    if "energy" in scene.observe and scene.lagrangian is not None:
        found[observing.ENERGY_START] = observing.start_energy(scene) or 0.0
    return found


def start_of(
    scene: scene_data.Scene,
    requested: scene_data.Requested,
    free: scene_data.FreeLagrangian | None,
    values: Mapping[str, float],
) -> scene_data.Start:
    """The start of a method: momenta where L~ gives them itself (they may be 0/0 in the velocities)."""
    positions, velocities = tuple(map(float, scene.positions)), tuple(map(float, scene.velocities))
    momenta = None
    if free is not None and free.start_momenta is not None and requested.convention == "momenta":
        found = free.start_momenta(scene.positions, scene.velocities, values)
        momenta = tuple(map(float, found)) if np.isfinite(found).all() else None
    return scene_data.Start(positions, velocities=velocities, momenta=momenta, convention=requested.convention)


def with_series(scene: scene_data.Scene, trajectory: Trajectory) -> Trajectory:
    """The exact trajectory with the formulas of the observed quantities at its points."""
    values = dict(scene.values) | {observing.ENERGY_START: observing.start_energy(scene) or 0.0}
    table = numeric_formulas.table_of(
        scene.coordinates, trajectory.positions, trajectory.velocities, values, trajectory.times
    )
    series = {one.name: numeric_formulas.array_value(one.expression, table) for one in observing.observables(scene)}
    maxima = {name: float(np.abs(column).max()) for name, column in series.items()}
    return replace(trajectory, series=series, maxima=maxima)


def _truth(
    scene: scene_data.Scene, derived: derivation.Derived, stop: scene_data.Stop | None
) -> scene_data.Truth | scene_data.Unavailable:
    """The true motion; circles are compared with the exact solution only, so they cost no reference run."""
    if derivation.COMPARED & set(scene.observe) or isinstance(derived.exact, motions.ExactMotion):
        return truths.true_motion(scene, derived, stop)
    return scene_data.Unavailable("No exact solution is known here.")


def largest_exponent(
    scene: scene_data.Scene, accelerations: tuple[Expression, ...], stop: Callable[[], bool] | None = None
) -> dict[str, Any]:
    """{largest, half, time}: the exponent over the whole run and over its first half, which shows its convergence."""
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
        start = scene_data.Start((*positions, *tangent[:n]), velocities=(*velocities, *tangent[n:]))
        found = execution.run(
            problem, CHOICE, start, scene_data.Grid(length / PARTS, 1, 1, begin), dict(scene.values), (), stop
        )
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
    tangent: Array, scene: scene_data.Scene, slopes: list[list[Expression]], positions: Array, velocities: Array
) -> Array:
    """The tangent to motions that keep the constraints, (2 n,): others, which the accelerations have too, may part."""
    if not slopes:
        return tangent
    table = numeric_formulas.table_of(scene.coordinates, positions[None], velocities[None], scene.values)
    rows = np.array([[float(numeric_formulas.array_value(one, table).ravel()[0]) for one in row] for row in slopes])
    found: Array = tangent - np.linalg.pinv(rows) @ (rows @ tangent)
    return found


def with_tangent(scene: scene_data.Scene, accelerations: tuple[Expression, ...]) -> scene_data.Problem:
    """The motion with its variational equations; the tangent of x has a name that no formula uses."""
    names = scene.coordinates
    tangents = tuple(f"tangent_of_{name}" for name in names)
    rows = []
    for force in accelerations:
        terms = [differentiate(force, Symbol(x)) * Symbol(w) for x, w in zip(names, tangents, strict=True)]
        terms += [differentiate(force, Velocity(x)) * Velocity(w) for x, w in zip(names, tangents, strict=True)]
        rows.append(collect(add(*terms)))
    return scene_data.Problem((*names, *tangents), tuple(scene.values), accelerations=(*accelerations, *rows))

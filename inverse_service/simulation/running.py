"""Run a scene: every method with its observed quantities, an estimate of its error, and the cost of its parts."""

import logging
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation import (
    costs,
    derivation,
    ensembles,
    estimates,
    events as happening,
    initial,
    lyapunov,
    numeric_formulas,
    observing,
    scene_data as data,
    switching,
    truth as truths,
)

LATE = "The time limit was reached before this method could run. Take fewer methods or steps, or a longer time limit."
FAULT = "This method failed because of a fault of the program ({}): please report the scene."


@dataclass(frozen=True, slots=True)
class MethodRun:
    """One method of a scene. `numbers` are the observed quantities, `series` those at each recorded point.

    `seconds` says what compiling, running and each observed quantity cost; `trajectory` is None where the
    method could not start, and `outcome` says why. `events` are those found, `observed` is the run with what
    velocities at its points need.
    """

    requested: data.Requested
    outcome: Outcome
    trajectory: Trajectory | None
    numbers: Mapping[str, Any] = field(default_factory=dict)
    series: Mapping[str, Array] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    free: data.FreeLagrangian | None = None
    events: tuple[happening.Found, ...] = ()
    observed: observing.Observed | None = None
    ran: switching.Run | None = None


@dataclass(frozen=True, slots=True)
class SceneRun:
    """All runs of a scene, with the true motion where something observed needed it, or why it is not known."""

    scene: data.Scene
    derived: derivation.Derived
    truth: data.Truth | str | None
    runs: tuple[MethodRun, ...]
    members: tuple[ensembles.EnsembleRun, ...] = ()
    lyapunov: Mapping[str, Any] | None = None
    effects: Mapping[str, Any] = field(default_factory=dict)


def run_scene(
    derived: derivation.Derived, progress: data.Progress | None = None, stop: data.Stop | None = None,
    compared_until: data.Stop | None = None,
) -> SceneRun:  # fmt: skip
    """Run every method; the failure of one method is its outcome and does not affect the others.

    The true motion is abandoned when `compared_until` says so, so that the methods have time left.
    """
    tell = progress or (lambda message: None)
    derived = derivation.with_energy(derived)
    scene = derived.scene
    truth: data.Truth | str | None = None
    if derivation.USES_EXACT & set(scene.observe) and scene.ensemble is None:
        tell("true motion")
        truth = _truth(scene, derived, compared_until or stop)
    runs: list[MethodRun] = []
    members: list[ensembles.EnsembleRun] = []
    for place, requested in enumerate(scene.methods, 1):
        tell(f"{requested.label} ({place} of {len(scene.methods)})")
        if stop is not None and stop() and scene.ensemble is None:
            # Compiling it without taking a step would use the time needed to write the other methods.
            runs.append(MethodRun(requested, Outcome("cancelled", remedy=LATE), None))
            continue
        try:
            if scene.ensemble is not None:
                members.append(ensembles.run_members(derived, requested, stop))
                continue
            runs.append(run_method(scene, requested, derived, truth, stop))
        except (ArithmeticError, ValueError, LookupError, TypeError, RuntimeError) as error:
            logging.getLogger(__name__).exception("the method %s failed", requested.method)
            runs.append(MethodRun(requested, Outcome("failed", remedy=FAULT.format(type(error).__name__)), None))
    exponent = None
    if "lyapunov" in scene.observe:
        tell("Lyapunov exponent")
        with suppress(data.Unavailable):
            exponent = lyapunov.largest_exponent(scene, derived.motion(), stop)
    return SceneRun(scene, derived, truth, tuple(runs), tuple(members), exponent, costs.effects_of(scene, derived))


def run_method(
    scene: data.Scene, requested: data.Requested, derived: derivation.Derived, truth: data.Truth | str | None,
    stop: data.Stop | None,
) -> MethodRun:  # fmt: skip
    """One method and its observed quantities, with an estimate of its error, and the cost of its parts."""
    run = observed_run(scene, requested, derived, truth, stop)
    if run.observed is None or run.observed.problem is None:
        return run
    outcome, numbers, seconds = run.outcome, dict(run.numbers), dict(run.seconds)
    problem = run.observed.problem

    def again(scene: data.Scene, requested: data.Requested) -> Trajectory:
        return _integrated(scene, requested, problem, derived, stop).trajectory

    if outcome.completed:
        with derivation.timed(seconds, "half the step"):
            numbers |= estimates.estimated(run.observed, again)
            lost = numbers.pop("lost")
            if lost is None and not numbers["doubt"]:
                numbers = truths.with_missed_force(run.observed, numbers, derived, stop)
        if lost is not None:
            return _cut(run, run.observed, lost)
        outcome = replace(outcome, doubt=numbers.pop("doubt"))
    if "cost" in scene.observe:
        with derivation.timed(seconds, "cost"):
            numbers["cost"] = costs.part_costs(scene, requested, derived, stop)
    return replace(run, outcome=outcome, numbers=numbers, seconds=seconds)


def _cut(run: MethodRun, observed: observing.Observed, outcome: Outcome) -> MethodRun:
    """The run up to its outcome, with the quantities observed so far."""
    seconds = dict(run.seconds)
    ran = observed.trajectory.ended(observed.trajectory.times <= (outcome.time or 0.0), outcome)
    shorter = replace(observed, trajectory=ran)
    numbers, series = observing.observed_quantities(shorter, seconds)
    events = tuple(happening.until(one, outcome.time or 0.0) for one in run.events)
    return replace(
        run, outcome=outcome, trajectory=ran, numbers=numbers, series=series, seconds=seconds, events=events,
        observed=shorter,
    )  # fmt: skip


def observed_run(
    scene: data.Scene, requested: data.Requested, derived: derivation.Derived, truth: data.Truth | str | None = None,
    stop: data.Stop | None = None,
) -> MethodRun:  # fmt: skip
    """One method and its observed quantities, up to the point that it reached within the domain of its formulas."""
    free = derivation.free_of(requested, derived)
    if (lost := initial.ended_at_start(scene)) is not None:
        return MethodRun(requested, lost.outcome, lost, free=free)
    section = happening.section_of(scene, derived.motion) if "period" in scene.observe else None
    watched = scene if section is None else replace(scene, events=(*scene.events, section))
    try:
        problem = None if requested.method == data.EXACT else derivation.problem_of(requested, derived)
        if problem is None:
            ran = switching.Run(_with_series(scene, truths.exact_trajectory(scene, derived)))
        else:
            ran = _integrated(watched, requested, problem, derived, stop)
    except InputError as error:
        return MethodRun(requested, Outcome("unavailable", remedy=error.detail), None)
    found = ran.trajectory
    seconds = {"compile": found.compile_seconds, "run": found.run_seconds}
    values, _ = observing.beginning(scene, requested, free)
    observed = observing.Observed(scene, requested, found, problem, values, truth, ran.in_pieces)
    events = ran.events
    if not ran.in_pieces:
        if found.outcome.completed and (other := estimates.other_motion(observed)) is not None:
            found = found.ended(found.times <= (other.time or 0.0), other)
            observed = replace(observed, trajectory=found)
        if watched.events and len(found.times) > 1:
            with derivation.timed(seconds, "events"):
                found, events = happening.with_events(replace(observed, scene=watched), derived.motion)
                observed = replace(observed, trajectory=found)
    if not found.outcome.completed and len(found.times) < 2:  # it did not make a step: nothing to observe
        return MethodRun(requested, found.outcome, found, seconds=seconds, free=free)
    numbers, series = observing.observed_quantities(observed, seconds)
    if section is None and "period" in scene.observe:
        numbers |= {"period": None, "period_note": happening.NO_PERIOD}
    elif section is not None and events:
        *others, returns = events
        numbers, events = numbers | happening.period_of(observed, returns, others), tuple(others)
    return MethodRun(requested, found.outcome, found, numbers, series, seconds, free, events, observed, ran)


def _integrated(
    scene: data.Scene, requested: data.Requested, problem: data.Problem, derived: derivation.Derived,
    stop: data.Stop | None,
) -> switching.Run:  # fmt: skip
    """The run of a method, in pieces where the scene has some."""
    values, start = observing.beginning(scene, requested, derivation.free_of(requested, derived))
    if not np.isfinite(values.get(observing.ENERGY_START, 0.0)):
        raise data.Unavailable("The energy has no finite value at the start: start somewhere else.")
    return switching.run_motion(scene, requested, problem, derived.motion, start, values, stop)


def _with_series(scene: data.Scene, exact: Trajectory) -> Trajectory:
    """The exact trajectory with the formulas of the observed quantities at its points."""
    values = dict(scene.values) | {observing.ENERGY_START: observing.start_energy(scene) or 0.0}
    table = numeric_formulas.table_of(scene.coordinates, exact.positions, exact.velocities, values, exact.times)
    series = {one.name: numeric_formulas.array_value(one.expression, table) for one in observing.observables(scene)}
    maxima = {name: float(np.abs(column).max()) for name, column in series.items()}
    return replace(exact, series=series, maxima=maxima)


def _truth(scene: data.Scene, derived: derivation.Derived, stop: data.Stop | None) -> data.Truth | str:
    """The true motion; circles are compared with the exact solution only, so they cost no reference run."""
    if not derivation.COMPARED & set(scene.observe) and derived.exact_or_none() is None:
        return "No exact solution is known here."
    try:
        return truths.true_motion(scene, derived, stop)
    except data.Unavailable as error:
        return error.detail

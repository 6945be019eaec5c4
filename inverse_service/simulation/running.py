"""Run a scene: every method with its observed quantities, an estimate of its error, and the cost of
its parts; one motion, or the members of an ensemble, which are started, run and checked together.
"""

import logging
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions import arrays
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation import (
    accuracy,
    costs,
    derivation,
    events as happening,
    execution,
    initial,
    lyapunov,
    observing,
    peaks,
    piecewise,
    scene_data as data,
)
from inverse_service.simulation.sentences import say

MOST_SHARPER, LOOKED_AT = (
    2**22,
    16,
)  # steps of all members together; members in which a missed force is looked for


@dataclass(frozen=True, slots=True)
class MethodRun:
    """One method of a scene. `numbers` are the observed quantities, `series` those at each recorded
    point.

    `seconds` says what compiling, running and each observed quantity cost; `trajectory` is None
    where the method could not start, and `outcome` says why. `events` are those found, `observed`
    is the run with what velocities at its points need, `final` where an event ended it or its last
    piece.
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
    switches: tuple[piecewise.Switch, ...] = ()
    final: data.Point | None = None
    contacts: tuple[piecewise.Touched, ...] = ()


@dataclass(frozen=True, slots=True)
class EnsembleRun:
    """One method for all members. `series` are columns (N, m) of what is observed, `numbers` (N,)
    of each member.
    """

    requested: data.Requested
    outcome: Outcome
    many: execution.Run
    velocities: Array | None = None
    series: Mapping[str, Array] = field(default_factory=dict)
    numbers: Mapping[str, Array] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SceneRun:
    """All runs of a scene, with the true motion where something observed needed it, or why it is
    not known.
    """

    scene: data.Scene
    derived: derivation.Derived
    truth: data.Truth | str | None
    runs: tuple[MethodRun | EnsembleRun, ...]
    lyapunov: Mapping[str, Any] | None = None
    effects: Mapping[str, Any] = field(default_factory=dict)


def run_scene(
    derived: derivation.Derived,
    progress: data.Progress | None = None,
    compared_until: data.Stop | None = None,
) -> SceneRun:
    """Run every method; the failure of one method is its outcome and does not affect the others.

    The true motion is abandoned when `compared_until` says so, so that the methods have time left.
    """
    tell = progress or (lambda message: None)
    derived = derivation.with_energy(derived)
    scene = derived.scene
    truth: data.Truth | str | None = None
    if (exact := derivation.USES_EXACT & set(scene.observe)) and scene.ensemble is None:
        tell("true motion")
        truth = "No exact solution is known here."
        # Circles are compared with the exact solution only, so they cost no reference run.
        if derivation.COMPARED & exact or derived.exact_or_none() is not None:
            try:
                truth = accuracy.true_motion(replace(derived, stop=compared_until or derived.stop))
            except data.Unavailable as error:
                truth = error.detail
    runs: list[MethodRun | EnsembleRun] = []
    for place, requested in enumerate(scene.methods, 1):
        tell(f"{requested.label} ({place} of {len(scene.methods)})")
        if derived.is_over and scene.ensemble is None:
            # Compiling it without taking a step would use the time needed to write the other
            # methods.
            runs.append(MethodRun(requested, Outcome("cancelled", remedy=say("late")), None))
            continue
        try:
            members = scene.ensemble
            run = (
                run_method(derived, requested, truth)
                if members is None
                else run_members(derived, members, requested)
            )
            runs.append(run)
        except InputError as error:
            if scene.ensemble is None:
                raise
            runs.append(MethodRun(requested, Outcome("unavailable", remedy=error.detail), None))
        except (ArithmeticError, ValueError, LookupError, TypeError, RuntimeError) as error:
            logging.getLogger(__name__).exception("the method %s failed", requested.method)
            runs.append(
                MethodRun(
                    requested, Outcome("failed", remedy=say("fault", type(error).__name__)), None
                )
            )
    exponent = None
    if "lyapunov" in scene.observe:
        tell("Lyapunov exponent")
        with suppress(data.Unavailable):
            exponent = lyapunov.largest_exponent(derived)
    return SceneRun(scene, derived, truth, tuple(runs), exponent, costs.effects_of(derived))


def run_method(
    derived: derivation.Derived, requested: data.Requested, truth: data.Truth | str | None = None
) -> MethodRun:
    """One method and its observed quantities, with an estimate of its error, and the cost of its
    parts.
    """
    run = observed_run(derived, requested, truth)
    if run.observed is None or run.observed.problem is None:
        return run
    outcome, numbers, seconds = run.outcome, dict(run.numbers), dict(run.seconds)
    if outcome.completed:
        with derivation.timed(seconds, "half the step"):
            estimate = accuracy.estimated(run.observed, derived)
        if (
            lost := estimate.lost
        ) is not None:  # the run up to there, with the quantities observed so far
            end, at = lost.time or 0.0, run.observed.trajectory
            shorter = replace(run.observed, trajectory=at.ended(at.times <= end, lost))
            numbers, series = observing.observed_quantities(shorter, seconds)
            return replace(
                run, outcome=lost, trajectory=shorter.trajectory, numbers=numbers, series=series, seconds=seconds,
                events=tuple(one.part(one.times <= end) for one in run.events), observed=shorter, final=None,
            )  # fmt: skip
        numbers |= estimate.numbers
        outcome = replace(outcome, doubt=" ".join(filter(None, (outcome.doubt, estimate.doubt))))
    if "cost" in derived.scene.observe:
        with derivation.timed(seconds, "cost"):
            numbers["cost"] = costs.part_costs(derived, requested)
    return replace(run, outcome=outcome, numbers=numbers, seconds=seconds)


def observed_run(
    derived: derivation.Derived, requested: data.Requested, truth: data.Truth | str | None = None
) -> MethodRun:
    """One method and its observed quantities, up to the point that it reached within the domain of
    its formulas.
    """
    scene = derived.scene
    free = derivation.free_of(requested, derived)
    if (lost := initial.ended_at_start(scene)) is not None:
        return MethodRun(requested, lost.outcome, lost, free=free)
    section = happening.section_of(scene, derived.motion) if "period" in scene.observe else None
    watched = derived if section is None else derived.but(events=(*scene.events, section))
    try:
        values, _ = observing.beginning(scene, requested, free)
        if requested.method == data.EXACT:
            problem, ran = None, piecewise.Run(accuracy.exact_trajectory(derived, values))
        else:
            problem = derivation.problem_of(requested, derived)
            ran = accuracy.integrated(watched, requested, problem)
    except InputError as error:
        return MethodRun(requested, Outcome("unavailable", remedy=error.detail), None)
    found = ran.trajectory
    seconds = {"compile": found.compile_seconds, "run": found.run_seconds}
    observed = observing.Observed(scene, requested, found, problem, values, truth, ran.in_pieces)
    events, final = ran.events, ran.final
    if not ran.in_pieces:
        if found.outcome.completed and (other := accuracy.other_motion(observed)) is not None:
            found = found.ended(found.times <= (other.time or 0.0), other)
            observed = replace(observed, trajectory=found)
        if watched.scene.events and len(found.times) > 1:
            with derivation.timed(seconds, "events"):
                found, events, final = happening.with_events(
                    replace(observed, scene=watched.scene), derived.motion
                )
                observed = replace(observed, trajectory=found)
    if (
        not found.outcome.completed and len(found.times) < 2
    ):  # it did not make a step: nothing to observe
        return MethodRun(requested, found.outcome, found, seconds=seconds, free=free)
    numbers, series = observing.observed_quantities(observed, seconds)
    if "period" in scene.observe:
        with derivation.timed(seconds, "period"):
            if section is None:
                numbers |= {"period": None, "period_note": say("no_period")}
            elif events:
                *others, returns = events
                numbers, events = (
                    numbers | happening.period_of(observed, returns, others),
                    tuple(others),
                )
    run = MethodRun(
        requested, found.outcome, found, numbers, series, seconds, free, events, observed
    )
    return replace(run, switches=ran.switches, final=final, contacts=ran.contacts)


def run_members(
    derived: derivation.Derived, members: data.Members, requested: data.Requested
) -> EnsembleRun:
    """All members by one method; InputError where it cannot run them."""
    scene = derived.scene
    if requested.method == data.EXACT:
        raise data.Unavailable(say("ensemble_methods"))
    known, problem = (
        derivation.free_of(requested, derived),
        derivation.problem_of(requested, derived),
    )
    problem = problem.with_used_parameters()
    values: dict[str, Any] = {
        **scene.values,
        **(known.constants if known else {}),
        **dict(requested.constants),
    }
    values |= members.values
    # The momenta that L~ gives directly: they may be 0/0 in the velocities.
    known_momenta = None if known is None else known.start_momenta
    momenta = (
        None
        if known_momenta is None
        else known_momenta(members.positions, members.velocities, values)
    )
    begun = time.perf_counter()
    steps = np.where(
        initial.without_value(scene), np.nan, scene.grid.step
    )  # without one, a member does not start
    start = members.positions, members.velocities
    many = execution.run_ensemble(
        problem, requested.choice, *start, scene.grid, values, momenta, steps, derived.stop
    )
    ran = time.perf_counter()
    if piecewise.has_pieces(scene, problem):
        many = replace(many, remedy=say("alone"))
    velocities, series, numbers = _observed(scene, problem, requested, many, values)
    seconds = {"run": ran - begun, "observed": time.perf_counter() - ran}
    run = EnsembleRun(
        requested,
        Outcome("cancelled", scene.grid.steps),
        many,
        velocities,
        series,
        numbers,
        seconds,
    )
    if many.cancelled:
        return run
    # With half the step, or a smaller tolerance: as many members as MOST_SHARPER allows, nan for
    # others.
    again, count = accuracy.finer(requested, scene.grid), len(many.positions)
    most = max(1, MOST_SHARPER // max(again.grid.steps, 1))
    rows = np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
    own = {
        name: value[rows] if isinstance(value, np.ndarray) else value
        for name, value in values.items()
    }
    found = execution.run_ensemble(
        problem, again.requested.choice, start[0][rows], start[1][rows], again.grid, own,
        None if momenta is None else momenta[rows],
    )  # fmt: skip
    points = many.positions[rows, : found.positions.shape[1]]
    errors, shares = accuracy.errors_of(points, found.positions, initial.angles(scene), again.part)
    numbers["estimated_error"] = estimates = np.full(count, np.nan)
    estimates[rows] = np.where(many.completed[rows], errors.max(axis=(1, 2)), np.nan)
    far = (shares > accuracy.TOO_LARGE_SHARE).any(axis=(1, 2)) & many.completed[rows]
    looked = f"{len(rows):,}" if len(rows) == count else f"{len(rows):,} examined (of {count:,})"
    doubt = (
        say("members_differ", f"{far.sum():,}", looked, again.how, rows[far.argmax()])
        if far.any()
        else ""
    )
    doubt = doubt or _missed(derived, members, problem, run, values)
    kind = "completed" if many.completed.all() else "partly"
    if not many.completed.any():  # the most frequent outcome
        kinds = Counter(many.outcome(member).kind for member in range(len(many.positions)))
        kind = kinds.most_common(1)[0][0]
    return replace(run, outcome=Outcome(kind, scene.grid.steps, doubt=doubt))


def _missed(
    derived: derivation.Derived,
    members: data.Members,
    problem: data.Problem,
    run: EnsembleRun,
    values: dict[str, Any],
) -> str:
    """The doubt of the first of LOOKED_AT members that misses a force acting within a step, with
    its error.
    """
    many, estimates = run.many, run.numbers["estimated_error"]
    for row in np.flatnonzero(many.completed)[:: max(1, len(many.positions) // LOOKED_AT)]:
        if run.velocities is None or derived.is_over:
            break
        own = {
            name: float(value[row]) if isinstance(value, np.ndarray) else value
            for name, value in values.items()
        }
        start = members.positions[row], members.velocities[row]
        alone = replace(
            derived.scene, positions=start[0], velocities=start[1], values=own, ensemble=None
        )
        ran = Trajectory(
            many.grid.times, many.positions[row], None, run.velocities[row], many.outcome(row)
        )
        seen = observing.Observed(alone, run.requested, ran, problem, own, None, in_pieces=True)
        if not len(peaks.moments_between(seen)):
            continue
        estimate = accuracy.estimated(seen, derived)
        if estimate.doubt:
            estimates[row] = np.nan if estimate.error is None else estimate.error
            return say("member", row, estimate.doubt)
    return ""


class ObservedTogether(NamedTuple):
    """What is observed of several runs at once."""

    velocities: Array | None
    series: dict[str, Array]
    numbers: dict[str, Array]


def _observed(
    scene: data.Scene,
    problem: data.Problem,
    requested: data.Requested,
    many: execution.Run,
    values: dict[str, Any],
) -> ObservedTogether:
    """Velocities (N, m, n), columns (N, m) of the energy and own observables, as of one run, and
    numbers (N,).
    """
    count, points, n = many.positions.shape
    rates, times = many.rates.reshape(-1, n), np.tile(many.grid.times, count)
    own = {
        name: np.repeat(x, points) if isinstance(x, np.ndarray) else x for name, x in values.items()
    }
    flat = Trajectory(times, many.positions.reshape(-1, n), rates, rates, Outcome("completed"))
    if many.letter == "p":
        flat = replace(
            flat, velocities=observing.point_velocities(scene, problem, requested.method, flat, own)
        )
    seen = observing.Observed(scene, requested, flat, problem, own, None, in_pieces=True)
    series: dict[str, Array] = {}
    numbers: dict[str, Array] = {}
    for one in scene.own:
        with suppress(arrays.NoValue):
            series[one.name] = seen.values_of(one.expression)[0].reshape(count, points)
    if flat.velocities is None:
        return ObservedTogether(None, series, numbers)
    if "energy" in scene.observe and scene.lagrangian is not None:
        energies, kinetic = (
            part.reshape(count, points) for part in observing.energies(scene, seen.table)
        )
        series["energy"] = energies
        if observing.why_energy_varies(scene) is None:
            start = observing.without_noise(energies[:, 0], kinetic[:, 0])[:, None]
            errors = np.abs(energies - start) / np.where(start == 0, 1.0, np.abs(start))
            numbers["max_energy_error"] = np.where(many.completed, errors.max(axis=1), np.nan)
    return ObservedTogether(flat.velocities.reshape(many.positions.shape), series, numbers)

"""The true motion of a scene: exact where that is known, else a reference that a second one confirms.

heyoka's Taylor series, where that is installed, is checked by `adaptive`; without it, that is checked by Gauss-Legendre
of order 12. Four times the distance of the two bounds the error. Runs are also compared with `adaptive` where a force
acts within one of their steps.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation import (
    derivation,
    estimates,
    exact_motion,
    initial,
    observing,
    scene_data,
    schemes,
)
from inverse_service.simulation.switching import run_motion

ENOUGH = 1e-12  # two solutions agree if their distance over the size of the motion is less
USELESS = 1e-3  # if they differ by more than this share of the motion, the true motion is unknown
SAFETY = 4.0  # times the distance of the two: a bound of the error of the better one
ROUND_OFF = 1e-15
MOST_STEPS = 1_000_000
TAYLOR, EXPLICIT, IMPLICIT = (
    scene_data.MethodChoice("heyoka", tolerance=1e-15), scene_data.MethodChoice("adaptive", tolerance=1e-13),
    scene_data.MethodChoice("reference"),
)  # fmt: skip
NONE_FOUND = "No reference solution was found: the reference integrators did not complete the run."
PARTED = "The true motion is known until t = {:.6g} only: {}."
MISSED, NEGLIGIBLE, NARROW = 10.0, 1e-6, 1e-4  # times the estimated error, and of the size of the motion
ENDS_ELSEWHERE = (
    "`adaptive`, stopping at the peaks of the forces, ends {:.3g} away: one acts within a step. Take a smaller step."
)
TOO_NARROW = "A force acts within a step at t = {:.6g}, and `adaptive` cannot resolve it. Give it more width."


def true_motion(
    scene: scene_data.Scene, derived: derivation.Derived, stop: scene_data.Stop | None = None
) -> scene_data.Truth:
    """The true motion at the recorded times of the scene; Unavailable where it is not known."""
    if derived.exact_or_none() is None:
        return _references(scene, derived.motion(), stop)
    found = exact_trajectory(scene, derived)
    assert found.velocities is not None
    bounds = ROUND_OFF * (1 + np.maximum.accumulate(np.abs(found.positions).max(axis=1)))
    return scene_data.Truth(found.times, found.positions, found.velocities, "exact", bounds, found.run_seconds)


def exact_trajectory(scene: scene_data.Scene, derived: derivation.Derived) -> Trajectory:
    """The exact solution as a trajectory, at the recorded times."""
    try:
        exact = derived.exact()
    except scene_data.Unavailable as error:
        raise scene_data.Unavailable(f"No exact solution is known for this scene. {error.detail}") from None
    if initial.ended_at_start(scene) is not None:
        raise scene_data.Unavailable(initial.NO_VALUE)
    begun = time.perf_counter()
    times = scene.grid.times
    try:
        rows = exact_motion.positions_of(exact, scene.positions, scene.velocities, times - scene.grid.begin)
    except ValueError as error:
        raise scene_data.Unavailable(f"The exact solution ends: {error}.") from None
    seconds = time.perf_counter() - begun
    return Trajectory(times, rows[0], None, np.array(rows[1]), Outcome("completed"), run_seconds=seconds)


def _references(scene: scene_data.Scene, problem: scene_data.Problem, stop: scene_data.Stop | None) -> scene_data.Truth:
    begun, times = time.perf_counter(), scene.grid.times

    def rows(choice: scene_data.MethodChoice, refinement: int = 1) -> Array:
        """Positions and velocities at the recorded times, (m, 2 n); nan where the reference did not arrive."""
        grid, start = scene.grid, scene_data.Start(tuple(scene.positions), velocities=tuple(scene.velocities))
        steps, every = refinement * grid.steps, refinement * grid.record_every
        finer = replace(grid, step=grid.step / refinement, steps=steps, record_every=every)
        found = np.full((len(times), 2 * len(scene.coordinates)), np.nan)
        ran = _part(scene, problem, choice, start, finer, stop)
        if ran.velocities is not None:
            found[: len(ran.times)] = np.column_stack([ran.positions, ran.velocities])
        return found

    try:
        first, second, by = rows(TAYLOR), rows(EXPLICIT), "heyoka, checked by adaptive"
    except InputError:  # heyoka is not installed, or does not know a function
        first, by = rows(EXPLICIT), "adaptive, checked by Gauss-Legendre of order 12"
        second = _collocation(rows, first, scene.grid.steps, stop)
    return _judged(times, first, second, by, begun)


def _collocation(rows: Callable[..., Array], other: Array, steps: int, stop: scene_data.Stop | None) -> Array:
    """Gauss-Legendre of order 12, refined until it agrees with the other or no longer comes nearer."""
    nearest, refinement, best = np.inf, 1, np.full_like(other, np.nan)
    while refinement * steps <= MOST_STEPS and not (stop and stop()):
        found = rows(IMPLICIT, refinement)
        apart = float(np.nan_to_num(_distances(found, other), nan=np.inf)[-1])
        if apart < nearest or refinement == 1:
            best = found
        if apart <= ENOUGH * _size(other) or (np.isfinite(nearest) and apart > 0.5 * nearest):
            break
        nearest, refinement = min(apart, nearest), 2 * refinement
    return best


def _part(
    scene: scene_data.Scene,
    problem: scene_data.Problem,
    choice: scene_data.MethodChoice,
    start: scene_data.Start,
    grid: scene_data.Grid,
    stop: scene_data.Stop | None,
) -> Trajectory:
    """A part of the run, with the events that act and the switches in it."""
    acting = tuple(event for event in scene.events if event.acts)
    requested, own = scene_data.Requested("", choice.method, None, choice), replace(
        scene, grid=grid, events=acting, observe=())  # fmt: skip
    return run_motion(own, requested, problem, lambda: problem, start, scene.values, stop).trajectory


def _size(rows: Array) -> float:
    """The size of the motion: the greatest change of a coordinate."""
    half = rows[:, : rows.shape[1] // 2]
    change = np.abs(half - half[0])
    return float(change[np.isfinite(change)].max(initial=0.0)) or 1.0


def _distances(first: Array, second: Array) -> Array:
    """The greatest distance of a coordinate up to each time, (m,); nan where one has ended."""
    n = first.shape[1] // 2
    found: Array = np.maximum.accumulate(np.abs(first[:, :n] - second[:, :n]).max(axis=1))
    return found


def _judged(times: Array, first: Array, second: Array, by: str, begun: float) -> scene_data.Truth:
    """The reference, the bound of its error, and the time until which it is known."""
    distances = _distances(first, second)
    good = np.isfinite(distances) & (SAFETY * distances <= USELESS * _size(first))
    until = len(good) if good.all() else int(np.argmin(good))
    if until < 2:
        raise scene_data.Unavailable(NONE_FOUND)
    rows, reason = first.copy(), ""
    rows[until:] = np.nan
    if until < len(times):
        ended = bool(np.isnan(first[until]).any() or np.isnan(second[until]).any())
        why = "the reference solutions end there" if ended else "from there on, the reference solutions differ"
        reason = PARTED.format(times[until - 1], why)
    n = rows.shape[1] // 2
    bounds = SAFETY * np.where(good, distances, np.nan)
    bounds = bounds + ROUND_OFF * np.maximum.accumulate(np.abs(rows[:, :n]).max(axis=1))
    seconds = time.perf_counter() - begun
    return scene_data.Truth(times, rows[:, :n], rows[:, n:], "reference", bounds, seconds, reason, by)


def with_missed_force(
    run: observing.Observed, numbers: dict[str, Any], derived: derivation.Derived, stop: scene_data.Stop | None
) -> dict[str, Any]:
    """The estimate of a completed run. Where a force acts within a step, `adaptive` runs too, its steps ending on the
    peaks of the forces: with a doubt and the true size of the error if that leads elsewhere, or cannot pass a peak."""
    scene, grid, moments = run.scene, run.scene.grid, estimates.moments_between(run)
    if not len(moments):
        return numbers
    try:
        problem = derived.motion()
    except scene_data.Unavailable:
        return numbers
    start = scene_data.Start(tuple(scene.positions), velocities=tuple(scene.velocities))
    found = [scene.positions]
    begin, end = grid.begin, grid.begin + grid.step * grid.steps
    for moment in [*moments[(moments > begin) & (moments < end)], end]:
        part = scene_data.Grid(grid.step, max(1, round((moment - begin) / grid.step)), 1, begin)
        part = replace(part, step=(moment - begin) / part.steps)
        ran = _part(scene, problem, EXPLICIT, start, part, stop)
        if stop is not None and stop():
            return numbers
        if not ran.outcome.completed or ran.velocities is None:
            unknown = {"estimated_error": None, "estimated_error_share": None}
            return numbers | unknown | {"doubt": TOO_NARROW.format(float(moment))}
        found += list(ran.positions[1:])
        start, begin = scene_data.Start(tuple(ran.positions[-1]), velocities=tuple(ran.velocities[-1])), float(moment)
    apart = float(np.abs(found[-1] - run.trajectory.positions[-1]).max())
    size, expected = float(np.ptp(found, axis=0).max()), numbers.get("estimated_error") or 0.0
    if not apart > NEGLIGIBLE * size:
        return numbers
    share = apart / max(size, schemes.SMALLEST)
    limit = NARROW if run.requested.method in method_table.OWN_STEPS else estimates.TOO_LARGE
    is_far = apart > MISSED * expected or share > limit
    known = {
        "estimated_error": max(apart, expected),
        "estimated_error_share": max(share, numbers.get("estimated_error_share") or 0.0),
    }
    return numbers | known | {"doubt": ENDS_ELSEWHERE.format(apart) if is_far else numbers["doubt"]}

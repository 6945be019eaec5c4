"""The true motion that methods are compared with: exact where it is known, else a reference and its check.

The reference is heyoka's Taylor series where it is installed, checked by DOP853; else DOP853, checked by Gauss-Legendre
of order 12. Four times the distance of the two bounds the error of the reference.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation.derivation import Derived, with_accelerations
from inverse_service.simulation.exact_motion import ExactMotion, positions_of
from inverse_service.simulation.hybrid import has_pieces, run_pieces
from inverse_service.simulation.initial import NO_VALUE, ended_at_start
from inverse_service.simulation.methods import run
from inverse_service.simulation.scene_data import (
    Grid,
    MethodChoice,
    Observation,
    Problem,
    Requested,
    Scene,
    Start,
    Stop,
    Truth,
    Unavailable,
)

ENOUGH = 1e-12  # two solutions that are this near, over the size of the motion, agree
USELESS = 1e-3  # where they part by more than this share of the motion, there is no truth any more
SAFETY = 4.0  # times the distance of the two: a bound of the error of the better one
ROUND_OFF = 1e-15
MOST_STEPS = 1_000_000
TAYLOR, EXPLICIT, IMPLICIT = (
    MethodChoice("heyoka", tolerance=1e-15), MethodChoice("adaptive", tolerance=1e-13), MethodChoice("reference"),
)  # fmt: skip
NONE_FOUND = "No reference solution was found: the reference integrators did not get through."
PARTED = "The true motion is known until t = {:.6g} only: {}."


def true_motion(scene: Scene, derived: Derived, stop: Stop | None = None) -> Truth | Unavailable:
    """The true motion at the recorded times of the scene, or why it is not known."""
    if not isinstance(derived.exact, ExactMotion):
        return _references(scene, derived, stop)
    found = exact_trajectory(scene, derived)
    if isinstance(found, Unavailable) or found.velocities is None:
        return found if isinstance(found, Unavailable) else Unavailable(NONE_FOUND)
    bounds = ROUND_OFF * (1 + np.maximum.accumulate(np.abs(found.positions).max(axis=1)))
    return Truth(found.times, found.positions, found.velocities, "exact", bounds, found.run_seconds)


def exact_trajectory(scene: Scene, derived: Derived) -> Trajectory | Unavailable:
    """The exact solution as a trajectory, at the recorded times."""
    if not isinstance(derived.exact, ExactMotion):
        reason = derived.exact.reason if derived.exact is not None else "It was not asked for."
        return Unavailable(f"No exact solution is known for this scene. {reason}")
    if ended_at_start(scene) is not None:
        return Unavailable(NO_VALUE)
    begun = time.perf_counter()
    times = scene.grid.times
    try:
        rows = positions_of(derived.exact, scene.positions, scene.velocities, times - scene.grid.begin)
    except ValueError as error:
        return Unavailable(f"The exact solution ends: {error}.")
    seconds = time.perf_counter() - begun
    return Trajectory(times, rows[0], None, np.array(rows[1]), Outcome("completed"), 0, 0, 0.0, seconds)


def _references(scene: Scene, derived: Derived, stop: Stop | None) -> Truth | Unavailable:
    begun, times = time.perf_counter(), scene.grid.times
    problem = with_accelerations(scene, derived)
    if isinstance(problem, Unavailable):
        return problem

    def rows(choice: MethodChoice, refinement: int = 1) -> Array:
        return _rows(scene, problem, choice, refinement, times, stop)

    try:
        first, second, by = rows(TAYLOR), rows(EXPLICIT), "heyoka, checked by DOP853"
    except InputError:  # heyoka is not installed, or does not know a function
        first, by = rows(EXPLICIT), "DOP853, checked by Gauss-Legendre of order 12"
        second = _collocation(rows, first, scene.grid.steps, stop)
    return _judged(times, first, second, by, begun)


def _collocation(rows: Callable[..., Array], other: Array, steps: int, stop: Stop | None) -> Array:
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


def _rows(
    scene: Scene, problem: Problem, choice: MethodChoice, refinement: int, times: Array, stop: Stop | None
) -> Array:
    """Positions and velocities of a reference at the recorded times, (m, 2 n); nan where it did not arrive."""
    grid = scene.grid
    start = Start(tuple(scene.positions), velocities=tuple(scene.velocities))
    rows = np.full((len(times), 2 * len(scene.coordinates)), np.nan)
    rows[0] = [*scene.positions, *scene.velocities]
    whole, rest = divmod(grid.steps, grid.record_every)
    pieces = [(grid.record_every, whole)] + ([(rest, 1)] if rest else [])
    done = 0
    for every, count in pieces:
        begin = float(times[done])
        if choice.method == "reference":
            part = Grid(grid.step / refinement, every * count * refinement, every * refinement, begin)
        else:
            part = Grid(grid.step * every, count, 1, begin)
        ran = _part(scene, problem, choice, start, part, stop)
        if ran.velocities is None:
            break
        table = np.column_stack([ran.positions, ran.velocities])[1:]
        rows[done + 1 : done + 1 + len(table)] = table
        done += len(table)
        if not ran.outcome.completed:
            break
        start = Start(tuple(ran.positions[-1]), velocities=tuple(ran.velocities[-1]))
    return rows


def _part(
    scene: Scene, problem: Problem, choice: MethodChoice, start: Start, grid: Grid, stop: Stop | None
) -> Trajectory:
    """A part of the run, with the events that act and the switches in it."""

    def piece(what: Problem, by: MethodChoice, begin: Start, over: Grid) -> Trajectory:
        return run(what, by, begin, over, dict(scene.values), Observation(momenta=False), stop, in_pieces)

    acting = tuple(event for event in scene.events if event.acts)
    own = replace(scene, grid=replace(grid, record_every=1), events=acting)
    in_pieces = has_pieces(own, problem)
    if not in_pieces:
        return piece(problem, choice, start, grid)
    found = run_pieces(
        own, Requested("", choice.method, None, choice), problem, problem, start, scene.values, piece, stop
    )
    if isinstance(found, Unavailable):
        raise InputError(found.reason)
    return found.thinned(grid).trajectory


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


def _judged(times: Array, first: Array, second: Array, by: str, begun: float) -> Truth | Unavailable:
    """The reference, what bounds its error, and until when it is known."""
    distances = _distances(first, second)
    good = np.isfinite(distances) & (SAFETY * distances <= USELESS * _size(first))
    until = len(good) if good.all() else int(np.argmin(good))
    if until < 2:
        return Unavailable(NONE_FOUND)
    rows, reason = first.copy(), ""
    rows[until:] = np.nan
    if until < len(times):
        ended = bool(np.isnan(first[until]).any() or np.isnan(second[until]).any())
        why = "the reference solutions end there" if ended else "from there on reference solutions part"
        reason = PARTED.format(times[until - 1], why)
    n = rows.shape[1] // 2
    bounds = SAFETY * np.where(good, distances, np.nan)
    bounds = bounds + ROUND_OFF * np.maximum.accumulate(np.abs(rows[:, :n]).max(axis=1))
    seconds = time.perf_counter() - begun
    return Truth(times, rows[:, :n], rows[:, n:], "reference", bounds, seconds, reason, by)

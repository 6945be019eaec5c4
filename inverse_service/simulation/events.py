"""Events: zeros of formulas along a run, located to round-off by shorter steps of the method itself.

Between two recorded points a method is continued by its own step of length theta h, theta from 0 to 1, which ends where
the whole step does. Of all crossings at once theta is found by regula falsi (Illinois; M. Dowell, P. Jarratt, BIT 11
(1971) 168), in SIMD lanes. Methods that have no such step are continued by DOP853 from the point before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation.array_values import NoValue, array_value, table_of
from inverse_service.simulation.ensembles import run_ensemble
from inverse_service.simulation.observing import mean_velocities, point_velocities
from inverse_service.simulation.scene import (
    POINT_METHODS,
    Event,
    Grid,
    MethodChoice,
    Problem,
    Requested,
    Scene,
    Unavailable,
)

State = tuple[Array, Array, Array]  # times (m,), positions and velocities (m, n)
CONTINUED = MethodChoice("adaptive", tolerance=1e-14)
ITERATIONS = 60
ROUND_OFF = 4e-16
ENDED = "The run was ended by an event at t = {:.12g}."
NO_VELOCITIES = "The method has no velocities at its points, which the event needs."


@dataclass(frozen=True, slots=True)
class Found:
    """The points of one event: times (m,), positions and velocities (m, n); `note` says why there is none."""

    event: Event
    times: Array
    positions: Array
    velocities: Array
    note: str = ""


def with_events(
    scene: Scene, requested: Requested, problem: Problem | None, ran: Trajectory, motion: Problem | Unavailable,
    values: Mapping[str, float],
) -> tuple[Trajectory, tuple[Found, ...]]:  # fmt: skip
    """The run, ended by the first event that stops it, and every event found before."""
    velocities = _velocities(scene, requested, problem, ran, values)
    follow = _follower(scene, requested, problem, ran, velocities, motion, values)
    found = tuple(_located(scene, event, ran, velocities, follow, values) for event in scene.events)
    ends = [float(one.times[0]) for one in found if one.event.stops and len(one.times)]
    if not ends:
        return ran, found
    end = min(ends)
    kept = ran.times < end
    cut = replace(
        ran, times=ran.times[kept], positions=ran.positions[kept],
        momenta=None if ran.momenta is None else ran.momenta[kept],
        velocities=None if ran.velocities is None else ran.velocities[kept],
        series={name: column[kept] for name, column in ran.series.items()},
        outcome=Outcome("completed", int(kept.sum()) - 1, end, note=ENDED.format(end)),
    )  # fmt: skip
    return cut, tuple(_until(one, end) for one in found)


def where_ended(found: tuple[Found, ...], outcome: Outcome) -> tuple[float, Array, Array] | None:
    """(t, q, v) of the event that ended the run, None where none did."""
    stops = (one for one in found if one.event.stops and len(one.times) and one.times[0] == outcome.time)
    return next(((float(one.times[0]), one.positions[0], one.velocities[0]) for one in stops), None)


def _until(found: Found, end: float) -> Found:
    kept = found.times <= end
    return Found(found.event, found.times[kept], found.positions[kept], found.velocities[kept], found.note)


def _velocities(
    scene: Scene, requested: Requested, problem: Problem | None, ran: Trajectory, values: Mapping[str, float]
) -> Array | None:
    if problem is None or requested.alpha is None:
        return ran.velocities
    found = point_velocities(scene, problem, requested.method, ran, dict(values))
    return mean_velocities(ran.positions, scene.grid) if found is None else found


Follow = Callable[[NDArray[np.int64], Array], State]


def _follower(
    scene: Scene, requested: Requested, problem: Problem | None, ran: Trajectory, velocities: Array | None,
    motion: Problem | Unavailable, values: Mapping[str, float],
) -> Follow | None:  # fmt: skip
    """A function of places k and lengths: the motion so long after point k."""
    choice, what = requested.choice, problem
    stepped = choice is not None and requested.method not in ("heyoka", "modified")
    if not stepped or (ran.momenta is None and requested.method not in POINT_METHODS):
        choice, what = CONTINUED, None if isinstance(motion, Unavailable) else motion
    if velocities is None or what is None or choice is None:
        return None
    speeds, run_by, of = velocities, choice, what

    def follow(places: NDArray[np.int64], lengths: Array) -> State:
        carried = None if run_by.method in POINT_METHODS or ran.momenta is None else ran.momenta[places]
        begins = ran.times[places]
        many = run_ensemble(
            of, run_by, ran.positions[places], speeds[places], Grid(1.0, 1), values, carried, lengths, begins=begins
        )  # fmt: skip
        positions, rates = many.positions[:, -1], many.rates[:, -1]
        if many.carried == "v":
            return begins + lengths, positions, rates
        bare = replace(ran, times=begins + lengths, positions=positions, momenta=rates, velocities=None)
        found = point_velocities(scene, of, requested.method, bare, dict(values))
        return begins + lengths, positions, np.full_like(positions, np.nan) if found is None else found

    return follow


def _located(
    scene: Scene, event: Event, ran: Trajectory, velocities: Array | None, follow: Follow | None,
    values: Mapping[str, float],
) -> Found:  # fmt: skip
    nothing = np.empty((0, len(scene.coordinates)))

    def value(state: tuple[Array, Array, Array | None]) -> Array:
        times, positions, speeds = state
        return array_value(event.formula, table_of(scene.coordinates, positions, speeds, dict(scene.values), times))

    try:
        along = value((ran.times, ran.positions, velocities))
    except NoValue:
        return Found(event, nothing[:, 0], nothing, nothing, NO_VELOCITIES)
    rising = (along[:-1] < 0) & (along[1:] >= 0)
    falling = (along[:-1] > 0) & (along[1:] <= 0)
    places = np.nonzero({1: rising, -1: falling, 0: rising | falling}[event.direction])[0]
    if not len(places):
        return Found(event, nothing[:, 0], nothing, nothing)
    if follow is None:
        return Found(event, nothing[:, 0], nothing, nothing, NO_VELOCITIES)
    try:
        state = _zeros(places, ran.times, along, follow, value)
    except InputError as error:
        return Found(event, nothing[:, 0], nothing, nothing, error.detail)
    # At a pole the sign changes too, and the value is beyond those on both sides.
    zero = np.abs(value(state)) <= np.maximum(np.abs(along[places]), np.abs(along[places + 1]))
    times, positions, speeds = (part[zero] for part in state)
    return Found(event, times, positions, speeds)


def _zeros(
    places: NDArray[np.int64], times: Array, along: Array, follow: Follow, value: Callable[[State], Array]
) -> State:
    """The states at the zeros, one between points k and k + 1 for each place k."""
    whole = times[places + 1] - times[places]
    low, high = np.zeros(len(places)), np.ones(len(places))
    below, above = along[places].copy(), along[places + 1].copy()
    state: State | None = None
    for _ in range(ITERATIONS):
        with np.errstate(all="ignore"):
            share = np.where(above == below, high, low - below * (high - low) / (above - below))
        share = np.where(
            np.isfinite(share), np.clip(share, np.minimum(low, high), np.maximum(low, high)), (low + high) / 2
        )
        state = follow(places, share * whole)
        new = value(state)
        with np.errstate(invalid="ignore"):
            same = np.sign(new) == np.sign(above)
        # The end that stays counts half, so that both ends move (Illinois).
        below = np.where(same, below / 2, above)
        low = np.where(same, low, high)
        high, above = share, new
        if ((np.abs(high - low) * whole <= ROUND_OFF * (1 + np.abs(times[places]))) | (new == 0)).all():
            break
    assert state is not None
    return state

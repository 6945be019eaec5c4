"""Events: zeros of formulas along a run, located to round-off by shorter steps of the method
itself.

Between two recorded points a method is continued by its own step of length theta h, theta from 0 to
1, which for theta = 1 is the whole step. The sign is examined at PIECES such points of each step,
and where the formula turns towards 0 between them at its turning point, so that two zeros within a
step are found. Between these points `enclosures` bounds all but linear formulas: what is narrower
is found too, or a note says so. Of all crossings at once theta is found by regula falsi (Illinois;
M. Dowell, P. Jarratt, BIT 11 (1971) 168), in SIMD lanes. Methods that have no such step are
continued by `adaptive` from the point before. The period of an orbit is the time between its
returns to a section.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inverse_service import errors
from inverse_service.expressions import arrays, tree as ex
from inverse_service.integrators import method_table, trajectory
from inverse_service.integrators.trajectory import Trajectory
from inverse_service.simulation import (
    enclosures,
    execution,
    initial,
    numeric_formulas as nf,
    observing,
    scene_data as data,
    scene_graph,
)
from inverse_service.simulation.scene_data import Point
from inverse_service.simulation.sentences import say

State = tuple[
    trajectory.Array, trajectory.Array, trajectory.Array
]  # times (m,), positions and velocities (m, n)
CONTINUED = data.MethodChoice("adaptive", tolerance=1e-14)
ITERATIONS = 60
JUST = 1e-9  # of the way to a zero
ROUND_OFF, NOISE = 4e-16, 1e-14
PIECES, LEAST_PIECES, MOST_PLACES = 16, 2, 2**18  # of a step, and of a run
AT_ONCE = 2**17
NEAR = 4.0  # differences between places: beyond them the formula does not reach 0 before the next
FLAT = 1e-3
SECTIONS, CLOSEST = (
    16,
    1e-9,
)  # points that are looked at together, and the last interval in distances of places
CLOSE = 0.1  # of the size of a motion: a return to its start
TOUCH, TOUCH_FROM = 1e-13, 1e-6  # of its greatest value, and of a step from the ends of the run
Motion = Callable[[], data.Problem]  # the motion as q'' = f; Unavailable where that is not known
Follow = Callable[[NDArray[np.int64], trajectory.Array], State]
Inner = Callable[[], list[State]]  # states inside the steps of a run


@dataclass(frozen=True, slots=True)
class Found:
    """The points of one event: times (m,), positions and velocities (m, n); `note` says what else
    was seen.
    """

    event: data.Event
    times: trajectory.Array
    positions: trajectory.Array
    velocities: trajectory.Array
    note: str = ""

    def part(self, rows: NDArray[np.bool_]) -> Found:
        """Some of the points."""
        return Found(
            self.event, self.times[rows], self.positions[rows], self.velocities[rows], self.note
        )


def nowhere(event: data.Event, size: int) -> Found:
    """No points, of `size` coordinates."""
    return Found(event, np.empty(0), np.empty((0, size)), np.empty((0, size)))


def event_of_parts(parts: Sequence[Found], note: str) -> Found:
    """The points of an event in several parts of a run."""
    columns = zip(*((one.times, one.positions, one.velocities) for one in parts), strict=True)
    times, positions, velocities = map(np.concatenate, columns)
    return Found(parts[0].event, times, positions, velocities, note)


def located(
    run: observing.Observed, events: Sequence[data.Event], motion: Motion
) -> tuple[Found, ...]:
    """All points of these events along a run."""
    follow = _follower(run, motion)
    inner = follow and lru_cache(maxsize=1)(partial(_inner, run.trajectory.times, follow))
    rough: list[bool] = []
    return tuple(_located(run, event, follow, inner, rough) for event in events)


def first_of(found: Sequence[Found]) -> Point | None:
    """The first point of all of them."""
    firsts = (
        (float(one.times[0]), one.positions[0], one.velocities[0])
        for one in found
        if len(one.times)
    )
    return min(firsts, key=lambda point: point[0], default=None)


class RunWithEvents(NamedTuple):
    """A run up to the event that ends it, the events, and the state at its end."""

    run: Trajectory
    found: tuple[Found, ...]
    end: Point | None


def with_events(run: observing.Observed, motion: Motion) -> RunWithEvents:
    """The run, which ends at the first event that stops it, all events found up to there, and its
    end if one did.
    """
    ran, found = run.trajectory, located(run, run.scene.events, motion)
    if (final := first_of([one for one in found if one.event.stops])) is None:
        return RunWithEvents(ran, found, None)
    end, kept = final[0], ran.times < final[0]
    outcome = trajectory.Outcome(
        "completed", int(kept.sum()) - 1, end, note=say("ended_by_event", end)
    )
    return RunWithEvents(
        ran.ended(kept, outcome), tuple(one.part(one.times <= end) for one in found), final
    )


def _follower(run: observing.Observed, motion: Motion) -> Follow | None:
    """A function of indices k and lengths: the motion at this length of time after point k."""
    ran, values, method = run.trajectory, run.values, run.requested.method
    run_by, what, speeds = run.requested.choice, run.problem, run.velocities
    stepped = method_table.METHODS[method].has_kernel and method != "modified"
    if not stepped or (ran.momenta is None and method not in method_table.POINT_METHODS):
        run_by, what = CONTINUED, None
        with suppress(data.Unavailable):
            what = motion()
    if speeds is None or what is None:
        return None
    of = what

    def follow(places: NDArray[np.int64], lengths: trajectory.Array) -> State:
        carried = (
            None
            if run_by.method in method_table.POINT_METHODS or ran.momenta is None
            else ran.momenta[places]
        )
        begins = ran.times[places]
        many = execution.run_ensemble(
            of, run_by, ran.positions[places], speeds[places], data.Grid(1.0, 1), values, carried, lengths,
            begins=begins,
        )  # fmt: skip
        positions, rates = many.positions[:, -1], many.rates[:, -1]
        if many.letter == "v":
            return begins + lengths, positions, rates
        bare = replace(
            ran, times=begins + lengths, positions=positions, momenta=rates, velocities=None
        )
        found = observing.point_velocities(run.scene, of, method, bare, dict(values))
        return (
            begins + lengths,
            positions,
            np.full_like(positions, np.nan) if found is None else found,
        )

    return follow


def _located(
    run: observing.Observed, event: data.Event, follow: Follow | None, inner: Inner | None,
    rough: list[bool],
) -> Found:  # fmt: skip
    """The points of one event. What all events share: states inside the steps, and in `rough`
    whether the motion is, once that is known.
    """
    scene, ran = run.scene, run.trajectory
    nothing = nowhere(event, len(scene.coordinates))

    def value(state: State) -> trajectory.Array:
        times, positions, speeds = state
        if event.measure is not None:
            return event.measure(times, positions, speeds)
        return arrays.array_value(
            event.formula,
            nf.arrays_by_name(scene.coordinates, positions, speeds, scene.values, times),
        )

    try:
        assert run.velocities is not None or event.measure is None
        if event.measure is not None and run.velocities is not None:
            along, parts = event.measure(ran.times, ran.positions, run.velocities), []
        else:
            along, *parts = run.values_of(event.formula, *ex.summands(event.formula))
        if not along.any() or (
            len(parts) > 1 and (np.abs(along) <= NOISE * np.abs(parts).sum(axis=0)).all()
        ):
            return replace(nothing, note=say("event_always_zero"))
        if follow is None or inner is None:
            turns = (np.sign(along[1:]) != np.sign(along[:-1])).any()
            return replace(nothing, note=say("event_without_velocities") if turns else "")
        assert run.velocities is not None
        way = Way(ran.times, along, follow, value)
        points = ran.times, ran.positions, run.velocities
        fine, states, pieces = _examined(way, points, inner())
        curve = enclosures.Curve(scene.coordinates, *states, scene.values)
        if not rough:
            rough.append(
                enclosures.is_rough(curve, lambda k, shares: way.between(k, shares, pieces)[1:])
            )
        between, unseen = np.empty(0), rough[0]
        if not unseen and not enclosures.is_plain(event.formula, scene.coordinates):
            between, unseen = enclosures.hidden(event.formula, curve, fine)
        brackets, touched = _brackets(way, event.direction, fine, between / pieces)
        lost = int(np.isnan(along).sum())
        note = (
            say("events_unseen")
            if unseen
            else say("zero_touched", touched[0])
            if len(touched)
            else ""
        )
        note = say("event_without_value", lost, len(along)) if lost else note
        if not len(brackets.places):
            return replace(nothing, note=note)
        state = _zeros(brackets, way)
    except arrays.NoValue:
        return replace(nothing, note=say("event_without_velocities"))
    except errors.InputError as error:
        return replace(nothing, note=error.detail)
    about = value(state)
    if (
        lost_there := np.isnan(about)
    ).any():  # just before the zero where it has no value there, as sign(x) at x = 0
        begin = way.times[brackets.places]
        share = (state[0] - begin) / (way.times[brackets.places + 1] - begin)
        before = value(way.at(brackets.places, share - JUST * (share - brackets.low)))
        about = np.where(lost_there, before, about)
    # At a pole the sign also changes, but the value there exceeds those on both sides.
    zero = np.abs(about) <= np.maximum(np.abs(brackets.below), np.abs(brackets.above))
    order = np.argsort(state[0][zero], kind="stable")
    times, positions, speeds = (part[zero][order] for part in state)
    return Found(event, times, positions, speeds, note)


@dataclass(frozen=True, slots=True)
class Way:
    """A run with the values of a formula at its points, (m,), and its continuation from each
    point.
    """

    times: trajectory.Array
    along: trajectory.Array
    follow: Follow
    value: Callable[[State], trajectory.Array]

    def at(self, places: NDArray[np.int64], shares: trajectory.Array) -> State:
        """The states a share of the step behind the points at these places."""
        return self.follow(places, shares * (self.times[places + 1] - self.times[places]))

    def between(self, places: NDArray[np.int64], shares: trajectory.Array, pieces: int) -> State:
        """The states a share of the intervals behind these points, `pieces` to a step."""
        steps, inner = np.divmod(places, pieces)
        return self.at(steps, (inner + shares) / pieces)

    def values(self, shares: trajectory.Array) -> trajectory.Array:
        """The formula at `shares`, in steps from the first point."""
        places = np.minimum(shares.astype(np.int64), len(self.times) - 2)
        return self.value(self.at(places, shares - places))


@dataclass(frozen=True, slots=True)
class Brackets:
    """Changes of sign: between the shares `low` and `high` of the step behind a point, from `below`
    to `above`.
    """

    places: NDArray[np.int64]
    low: trajectory.Array
    high: trajectory.Array
    below: trajectory.Array
    above: trajectory.Array


def _inner(times: trajectory.Array, follow: Follow) -> list[State]:
    """The states at PIECES places of each step but its ends, or less in a long run, in chunks."""
    steps, pieces = len(times) - 1, _pieces_of(times)
    places, shares = (
        np.repeat(np.arange(steps), pieces - 1),
        np.tile(np.arange(1, pieces) / pieces, steps),
    )
    lengths = shares * (times[places + 1] - times[places])
    return [
        follow(places[k : k + AT_ONCE], lengths[k : k + AT_ONCE])
        for k in range(0, len(places), AT_ONCE)
    ]


def _pieces_of(times: trajectory.Array) -> int:
    """Into which each step of a run is divided."""
    return int(np.clip(MOST_PLACES // (len(times) - 1), LEAST_PIECES, PIECES))


class Examined(NamedTuple):
    """A formula and the states at points of a run and inside its steps."""

    formula: trajectory.Array
    states: State
    pieces: int


def _examined(way: Way, points: State, chunks: Sequence[State]) -> Examined:
    """The formula and the states, (m,) and (m, n), at the points of the run and inside its steps,
    and into how many pieces each is divided.
    """
    steps, pieces = len(way.times) - 1, _pieces_of(way.times)
    inner = tuple(map(np.concatenate, zip(*chunks, strict=True)))
    fine, between = np.empty(steps * pieces + 1), np.arange(steps * pieces + 1) % pieces != 0
    fine[::pieces], fine[between] = (
        way.along,
        np.concatenate([way.value(chunk) for chunk in chunks]),
    )
    states = []
    for known, more in zip(points, inner, strict=True):
        whole = np.empty((len(fine), *known.shape[1:]))
        whole[::pieces], whole[between] = known, more
        states.append(whole)
    return Examined(fine, (states[0], states[1], states[2]), pieces)


def _brackets(
    way: Way, direction: int, fine: trajectory.Array, between: trajectory.Array
) -> tuple[Brackets, trajectory.Array]:
    """The changes of sign along a run, rising (direction 1), falling (-1) or both (0), and the
    times at which the formula is 0 and does not change it.

    Each step is examined at its `fine` points, at places `between` them, in steps from the first
    point, and where the formula turns towards 0, at its turning point.
    """
    steps = len(way.times) - 1
    pieces = (len(fine) - 1) // steps
    turned, least = _turning_points(way, fine, pieces)
    size = np.abs(fine).max(initial=0.0, where=np.isfinite(fine))
    touching = (
        (np.abs(least) <= TOUCH * size) & (turned > TOUCH_FROM) & (turned < steps - TOUCH_FROM)
    )
    shares = np.concatenate([np.arange(len(fine)) / pieces, turned[~touching], between])
    values = np.concatenate(
        [fine, least[~touching], way.values(between) if len(between) else between]
    )
    order = np.argsort(shares, kind="stable")
    shares, values = shares[order], values[order]
    k = np.minimum(((shares[:-1] + shares[1:]) / 2).astype(np.int64), steps - 1)
    below, above = values[:-1], _signed(values)[1:]
    sense = np.where(above > 0, 1, -1) * (np.sign(below) * np.sign(above) < 0)
    sense = np.where((above == 0) & (below != 0), -np.sign(below), sense)
    kept = np.isin(sense, (direction,) if direction else (1, -1))
    low, high, below, above = (
        column[kept] for column in (shares[:-1] - k, shares[1:] - k, below, above)
    )
    moments = np.interp(turned[touching], np.arange(steps + 1), way.times)
    return Brackets(k[kept], low, high, below, above), moments


def _signed(values: trajectory.Array) -> trajectory.Array:
    """The values, where a 0 within the run gets the sign that follows it: touching 0 is not a
    change of sign.
    """
    found = values.copy()
    for place in np.flatnonzero(values[:-1] == 0)[::-1]:
        found[place] = (
            np.copysign(np.finfo(float).tiny, found[place + 1]) if found[place + 1] else 0.0
        )
    return found


def _turning_points(
    way: Way, fine: trajectory.Array, pieces: int
) -> tuple[trajectory.Array, trajectory.Array]:
    """The places where the formula is nearest to 0 between points at which it has the same sign,
    and its values.

    Search by SECTIONS points of each interval, in SIMD lanes; the start and the end of the run are
    always examined.
    """
    size, last = np.abs(fine), len(fine) - 1
    middle = np.arange(1, last)
    alike = (
        (np.sign(fine[:-2]) == np.sign(fine[1:-1]))
        & (np.sign(fine[2:]) == np.sign(fine[1:-1]))
        & (fine[1:-1] != 0)
    )
    step = np.maximum(np.abs(size[:-2] - size[1:-1]), np.abs(size[2:] - size[1:-1]))
    near = (
        alike & (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]) & (size[1:-1] <= NEAR * step)
    )
    low = np.concatenate([middle[near] - 1, [0, last - 1]]) / pieces
    high = np.concatenate([middle[near] + 1, [1, last]]) / pieces
    sign = np.sign(np.concatenate([fine[1:-1][near], [fine[1], fine[last - 1]]]))
    between = np.linspace(0, 1, int(np.clip(AT_ONCE // len(low), 2, SECTIONS)) + 2)[:, None]
    lanes = np.arange(len(low))
    while True:
        shares = low + (high - low) * between
        values = way.values(shares[1:-1].ravel()).reshape(-1, len(low)) * sign
        best = np.where(np.isnan(values), np.inf, values).argmin(axis=0)
        found, least, rest = shares[best + 1, lanes], values[best, lanes], np.ptp(values, axis=0)
        low, high = shares[best, lanes], shares[best + 2, lanes]
        # A value below zero means two zeros; values that hardly decrease any more stay above zero.
        done = (least <= 0) | (rest < FLAT * least) | ~np.isfinite(least)
        if (done | (high - low < CLOSEST / pieces)).all():
            return found, least * sign


def _zeros(brackets: Brackets, way: Way) -> State:
    """The states at the zeros, one in each bracket."""
    places, times = brackets.places, way.times
    whole = times[places + 1] - times[places]
    low, high = brackets.low, brackets.high
    below, above = brackets.below.copy(), brackets.above.copy()
    state: State | None = None
    for _ in range(ITERATIONS):
        share = np.where(above == below, high, low - below * (high - low) / (above - below))
        inside = np.clip(share, np.minimum(low, high), np.maximum(low, high))
        share = np.where(np.isfinite(share), inside, (low + high) / 2)
        state = way.at(places, share)
        new = way.value(state)
        same = np.sign(new) == np.sign(above)
        # The end that stays counts half, so that both ends move (Illinois).
        below = np.where(same, below / 2, above)
        low = np.where(same, low, high)
        high, above = share, new
        if (
            (np.abs(high - low) * whole <= ROUND_OFF * (1 + np.abs(times[places]))) | (new == 0)
        ).all():
            break
    assert state is not None
    return state


def section_of(scene: data.Scene, motion: Motion) -> data.Event | None:
    """The returns to the section through the start, across its velocity, or across its acceleration
    among the velocities where it begins at rest; None where every step is not recorded, or neither
    is known.
    """
    way, turns = scene.velocities, initial.angles(scene)
    parts = [
        ex.Symbol(x) - ex.number(Fraction(q))
        for x, q in zip(scene.coordinates, scene.positions, strict=True)
    ]
    terms = [
        ex.Apply("sin", part) if turn else part for part, turn in zip(parts, turns, strict=True)
    ]
    if not way.any():
        with suppress(data.Unavailable):
            graph = scene_graph.graph_of(motion())
            begin = graph.inputs(scene.positions[None], way[None], scene.values, scene.grid.begin)
            way = graph.solution(begin, 1)[0, : len(way)]
            terms = [ex.Velocity(name) for name in scene.coordinates]
    if scene.grid.record_every > 1 or not (way.any() and np.isfinite(way).all()):
        return None
    return data.Event(ex.dot([ex.number(Fraction(v)) for v in way], terms), 1, False)


def period_of(run: observing.Observed, returns: Found, others: Sequence[Found]) -> dict[str, Any]:
    """{"period": {mean, least, greatest, returns, apart}}: the times between returns to the section
    that come as near to the start as CLOSE of the motion's size; `apart` is how far the first one
    is from it, as such a share.
    """
    scene, at = run.scene, run.trajectory
    turns, span = initial.angles(scene), np.ptp(at.positions, axis=0)
    size = float(np.where(turns, np.minimum(span, 2 * np.pi), span).max()) or 1.0

    def distance(found: Found) -> trajectory.Array:
        """From the start, of the points behind it."""
        moved = (
            found.positions[found.times > at.times[0] + TOUCH_FROM * scene.grid.step]
            - scene.positions
        )
        apart = np.where(turns, np.abs((moved + np.pi) % (2 * np.pi) - np.pi), np.abs(moved))
        return np.asarray(apart.max(axis=1, initial=0.0) / size)

    if any((distance(one) <= TOUCH_FROM).any() for one in others if one.event.acts):
        return {"period": None, "period_note": say("acts_at_start")}
    apart = distance(returns)
    times = np.concatenate(
        [at.times[:1], returns.times[len(returns.times) - len(apart) :][apart <= CLOSE]]
    )
    if len(times) < 2:
        return {
            "period": None,
            "period_note": returns.note or "The motion does not return to its start.",
        }
    gaps = np.diff(times)
    numbers = {
        "mean": gaps.mean(),
        "least": gaps.min(),
        "greatest": gaps.max(),
        "apart": apart[apart <= CLOSE][0],
    }
    return {
        "period": {name: float(value) for name, value in numbers.items()} | {"returns": len(gaps)}
    }

"""Peaks within a step: times at which a function of a scene rises higher than the points of a run
show.

A function is extreme where its argument turns or passes 0; this time is located on the cubic of
Hermite through the positions and velocities of the points. A sine or cosine of u changes in half a
step by at most that times |u'|, so most turns of angles are ruled out at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inverse_service.expressions import tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.kernels.codegen.graph import Graph, NotInGraph
from inverse_service.simulation import numeric_formulas as nf, observing
from inverse_service.simulation.scene_graph import MOMENT, PLACE, SPEED, SceneGraph, on_table

MOST_MOMENTS, MOST_VALUES = 64, 2**21
GOLDEN, GOLDEN_STEPS, SECANTS, HALVINGS = 0.618033988749895, 75, 20, 50  # to the last bit of a step
FIRST_LOOK, SHOWS = (
    8,
    0.25,
)  # sections after which a turn has to show this share of what a peak would
BENDS = 1.5  # times the mean slope of a cubic between two points: its greatest one, if those at its ends are smaller
WAVES = ("sin", "cos")
AT_ONCE = 32  # functions that are followed together


class PlaceInStep(NamedTuple):
    """The point after a moment, the length of its step, and the share that has passed."""

    after: NDArray[np.int64]
    length: Array
    share: Array


@dataclass(frozen=True)
class _Between(Mapping[int, Any]):
    """The inputs of a graph at moments (k,) between points, each made when it is first asked
    for.
    """

    times: Array
    positions: Array
    velocities: Array
    given: Mapping[int, Any]  # parameters
    moments: Array

    @cached_property
    def _place(self) -> PlaceInStep:
        """The point after each moment, the length of the step, and the share of it that has
        passed.
        """
        after = np.clip(np.searchsorted(self.times, self.moments), 1, len(self.times) - 1)
        length = self.times[after] - self.times[after - 1]
        return PlaceInStep(after, length, (self.moments - self.times[after - 1]) / length)

    def __getitem__(self, place: int) -> Any:
        if place == 0:
            return self.moments
        k = place - 1
        n = self.positions.shape[1]
        if k >= 2 * n:
            return self.given[place]
        after, length, s = self._place
        first, last = self.velocities[after - 1, k % n], self.velocities[after, k % n]
        begin = self.positions[after - 1, k % n]
        mean = (self.positions[after, k % n] - begin) / length
        bend, curve = first + last - 2 * mean, 3 * mean - 2 * first - last
        if k < n:
            return begin + length * s * (first + s * (curve + s * bend))
        return first + s * (2 * curve + 3 * s * bend)

    def __iter__(self) -> Iterator[int]:
        return iter(range(2 * self.positions.shape[1] + 1))

    def __len__(self) -> int:
        return 2 * int(self.positions.shape[1]) + 1


class Places(NamedTuple):
    """The points before which an argument turns, and passes 0."""

    turns: NDArray[np.int64]
    zeros: NDArray[np.int64]


class Heights(NamedTuple):
    """Values at peaks and half a step before them, and how far they are apart."""

    begin: Array
    before: Array
    heights: Array
    above: Array
    apart: Array


def moments_between(run: observing.Observed) -> Array:
    """Times, at most MOST_MOMENTS, at which a function or power in the scene rises to a value that
    half a step before and after do not show: a force that acts within a step and is missed by a
    method that steps over it.

    A sine or cosine whose argument moves by more than a half turn in a step counts as well. In a
    long run only the first MOST_VALUES values are examined.
    """
    at, scene, velocities = run.trajectory, run.scene, run.velocities
    if run.problem is None or not run.requested.choice.guard or velocities is None:
        return np.empty(0)
    moving = [ex.TIME, *nf.state_names(scene.coordinates)]
    trees = [
        (tree, tree.argument if isinstance(tree, ex.Apply) else tree.base)
        for tree in ex.distinct_nodes(scene.formulas)
        if isinstance(tree, ex.Apply | ex.Power)
        and ex.holds(tree, *moving)
        and not _is_square_or_cube(tree)
    ]
    count = min(len(at.times), MOST_VALUES // max(1, len(trees)))
    if count < 3 or not trees:
        return np.empty(0)
    times, places, speeds = at.times[:count], at.positions[:count], velocities[:count]
    scene_graph, inputs, _ = on_table(
        scene.coordinates,
        scene.lagrangian,
        (),
        nf.arrays_by_name(scene.coordinates, places, speeds, run.values, times),
    )
    graph, pairs = scene_graph.graph, list[tuple[int, int, str]]()
    for tree, argument in trees:
        try:
            name = tree.function if isinstance(tree, ex.Apply) else ""
            pairs.append((graph.node(tree), graph.node(argument), name))
        except NotInGraph:  # no function of numbers
            continue
    given = {place: value for place, value in inputs.items() if place > 2 * len(scene.coordinates)}
    between = _Moments(graph, partial(_Between, times, places, speeds, given))
    rates = _rates(scene_graph, [inner for _, inner, name in pairs if name in WAVES])
    wanted = [*(node for pair in pairs for node in pair[:2]), *rates.values()]
    values = (np.broadcast_to(one, count) for one in graph.values(wanted, inputs))
    known = dict(zip(wanted, values, strict=True))
    step, found = abs(scene.grid.step), [np.empty(0)]
    for begin in range(0, len(pairs), AT_ONCE):
        some = pairs[begin : begin + AT_ONCE]
        found.append(_peaks_of([pair[:2] for pair in some], known, rates, between, step))
    for _, inner, name in pairs:
        if name in WAVES:
            far = np.flatnonzero(np.abs(np.diff(known[inner])) > np.pi * scene.grid.record_every)[
                :1
            ]
            found.append((times[far] + times[far + 1]) / 2)
    moments = np.concatenate(found)
    return np.unique(moments)[:MOST_MOMENTS] if len(moments) else moments


@dataclass(frozen=True)
class _Moments:
    """The formulas of a graph at moments between points."""

    graph: Graph
    at: Callable[[Array], _Between]

    @property
    def times(self) -> Array:
        """Those of the points."""
        return self.at(np.empty(0)).times

    def values(self, nodes: Sequence[int], own: NDArray[np.int64], moments: Array) -> Array:
        """At each moment (k,) the value of its own node, whose place among the nodes is given."""
        used, places = np.unique(own, return_inverse=True)
        found = self.graph.values([nodes[k] for k in used.tolist()], self.at(moments))
        table = np.array([np.broadcast_to(one, moments.shape) for one in found])
        return table[places, np.arange(len(moments))] if len(moments) else moments

    def heights(
        self, nodes: Sequence[int], own: NDArray[np.int64], peaks: Array, half: float
    ) -> Heights:
        """Half a step before the peaks, the values there and at the peaks, how far these are above
        those half a step before and after, and how far those are apart.
        """
        times = self.times
        begin, end = np.maximum(peaks - half, times[0]), np.minimum(peaks + half, times[-1])
        before, heights, after = (self.values(nodes, own, one) for one in (begin, peaks, end))
        above = np.minimum(np.abs(heights - before), np.abs(heights - after))
        return Heights(begin, before, heights, above, np.abs(after - before))


def _peaks_of(
    pairs: Sequence[tuple[int, int]], known: Mapping[int, Array], rates: Mapping[int, int],
    between: _Moments, step: float,
) -> Array:  # fmt: skip
    """The moments at which formulas rise, each given with its argument; all are followed together,
    because to evaluate a few moments takes as long as to evaluate one.
    """
    times, half = between.times, step / 2
    nodes, arguments = zip(*pairs, strict=True)
    largest = np.array([np.nanmax(np.abs(known[node]), initial=0.0) for node in nodes])
    turns, zeros = list[NDArray[np.int64]](), list[NDArray[np.int64]]()
    for inner, most in zip(arguments, largest.tolist(), strict=True):
        where = _turns_and_zeros(known, inner, rates, times, step, most)
        turns.append(where.turns)
        zeros.append(where.zeros)
    own, roots_of = (np.repeat(np.arange(len(pairs)), [*map(len, one)]) for one in (turns, zeros))
    places = np.concatenate(turns)
    lines = np.array([known[inner] for inner in arguments])
    rises = np.sign(lines[own, places + 1] - lines[own, places])
    low, high = times[places], times[places + 2]
    for section in range(GOLDEN_STEPS):
        if section == FIRST_LOOK and len(low):
            above = between.heights(nodes, own, (low + high) / 2, half).above
            stays = ~(above < SHOWS * largest[own] / 2)
            low, high, rises, own = low[stays], high[stays], rises[stays], own[stays]
        if not len(low):
            break
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left, right = (rises * between.values(arguments, own, one) for one in (a, b))
        low, high = np.where(left > right, low, a), np.where(left > right, b, high)
    peaks, places = (low + high) / 2, np.concatenate(zeros)
    if len(places):
        ends = (
            times[places],
            times[places + 1],
            lines[roots_of, places],
            lines[roots_of, places + 1],
        )
        moments = _zero(*ends, partial(between.values, arguments, roots_of))
        peaks, own = np.concatenate([peaks, moments]), np.concatenate([own, roots_of])
    if not len(peaks):
        return peaks
    begin, before, heights, above, apart = between.heights(nodes, own, peaks, half)
    np.fmax.at(largest, own, np.abs(heights))
    seen = (above > largest[own] / 2) & (apart < above / 2)
    low, high, before, above, own = begin[seen], peaks[seen], before[seen], above[seen], own[seen]
    # To half of its height, where a force that is its slope is strong.
    for _ in range(HALVINGS if len(low) else 0):
        middle = (low + high) / 2
        rise = np.abs(between.values(nodes, own, middle) - before)
        low, high = np.where(rise < above / 2, (middle, high), (low, middle))
    return high


def _turns_and_zeros(
    known: Mapping[int, Array], inner: int, rates: Mapping[int, int], times: Array, step: float,
    largest: float,
) -> Places:  # fmt: skip
    """Those of an argument; of waves only where it is fast."""
    along = known[inner]
    turns, zeros = (np.flatnonzero(np.diff(np.sign(one)) != 0) for one in (np.diff(along), along))
    if inner in rates:
        most = np.abs(known[rates[inner]])
        most[:-1] = np.maximum(most[:-1], BENDS * np.abs(np.diff(along)) / np.diff(times))
        fast = ~(most * step < largest / 2)
        turns = turns[fast[turns] | fast[turns + 1] | fast[turns + 2]]
        zeros = zeros[fast[zeros] | fast[zeros + 1]]
    return Places(turns, zeros)


def _zero(
    low: Array, high: Array, below: Array, above: Array, value: Callable[[Array], Array]
) -> Array:
    """Where a formula is 0 between moments at which it has the values `below` and `above`, by
    regula falsi.
    """
    moments = low
    for _ in range(SECANTS):
        share = np.where(above == below, 0.5, -below / np.where(above == below, 1.0, above - below))
        moments = low + np.where(np.isfinite(share), np.clip(share, 0.0, 1.0), 0.5) * (high - low)
        new = value(moments)
        same = np.sign(new) == np.sign(above)
        below, low = np.where(same, below / 2, above), np.where(same, low, high)
        high, above = moments, new
    return moments


def _rates(scene: SceneGraph, arguments: list[int]) -> dict[int, int]:
    """The rates of those arguments that hold no velocity, {argument: rate}."""
    fixed = [node for node in dict.fromkeys(arguments) if not scene.graph.masks[node] & SPEED]
    along = {1 + k: speed for k, speed in enumerate(scene.speeds)} | {0: scene.graph.constant(1.0)}
    moved = [node for node in fixed if scene.graph.masks[node] & (MOMENT | PLACE)]
    return dict(zip(moved, scene.graph.rate(moved, along), strict=True))


def _is_square_or_cube(node: ex.Expression) -> bool:
    """Whether it is one of sums, products, and waves, whose peaks are as wide as those of what it
    holds.

    The square of tanh(u/0.001) is 1 but for a narrow dip, where tanh itself has no peak.
    """
    is_low = isinstance(node, ex.Power) and node.exponent in (ex.TWO, ex.number(3))
    inside = list(ex.walk(node))[1:] if is_low else []
    return is_low and not any(
        isinstance(part, ex.Power) or (isinstance(part, ex.Apply) and part.function not in WAVES)
        for part in inside
    )

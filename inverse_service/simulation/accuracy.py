"""How far a run is from the true motion: an estimate of its error, warnings where it is large, and
the true motion.

The method is run again with half the step h. If the error is C h^p, both differ by (1 - 2^-p) of
the error of the run; a method that chooses its steps also gets a tenth of its tolerance, or ten
times it where a tenth is round-off. Errors common to both runs are not detected in this way, so the
energy, a constant, and the true motion, if known, are compared too. A run with a Lagrangian that
has another motion there than the given equations is `off_domain`.

The true motion is exact where that is known, else a reference that a second one confirms: heyoka's
Taylor series, where that is installed, checked by `adaptive`; without it, that is checked by
Gauss-Legendre of order 12. Four times the distance of the two bounds the error.

A force that acts within a step, unnoticed by both runs, is searched for in the formulas between the
points; where there is one, the run is compared with `adaptive`, whose steps end there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum, StrEnum, auto
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.expressions import arrays, tree as ex
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation import (
    accelerations as accelerating,
    derivation,
    exact_motion,
    execution,
    initial,
    numeric_formulas as nf,
    observing,
    scene_data as data,
    schemes,
)
from inverse_service.simulation.peaks import moments_between
from inverse_service.simulation.piecewise import Run, has_pieces, run_motion
from inverse_service.simulation.sentences import say

MOST_STEPS = 1_000_000
CHANGED, TIGHTER, TIGHTEST, LEAST_RANGE, ROUND_OFF = 0.1, 0.1, 1e-14, 0.01, 1e-15
AGAIN, TRUE = "With {}, the trajectory", "The true motion"
GOES_ON = ("completed", "cancelled")
# An error above this share of the range of a coordinate is too large.
TOO_LARGE_SHARE = 0.1
# So is, of a method that chooses its steps for an error, one above so many times its tolerance and
# above this share of the range.
TIMES_TOLERANCE, LEAST_SHARE = 100.0, 0.01
MOST_VALUES = 2**21
NO_CHANGE = 1e-13  # of the energy
CREATED = 0.75  # of the kinetic energy: more from nothing in one step is no motion
LOST, SUDDEN = (
    "one step differs from two of half its length by {:.3g} of the range of a coordinate",
    0.05,
)
ENOUGH = 1e-12  # two solutions agree if their distance over the size of the motion is less
USELESS = 1e-3  # if they differ by more than this share of the motion, the true motion is unknown
SAFETY = 4.0  # times the distance of the two: a bound of the error of the better one
TAYLOR, EXPLICIT, IMPLICIT = (
    data.MethodChoice("heyoka", tolerance=1e-15), data.MethodChoice("adaptive", tolerance=1e-13),
    data.MethodChoice("reference"),
)  # fmt: skip
MISSED = 0.01  # of the usual limits
BEYOND = 10.0  # times what half the step shows
ADAPTIVE = data.Requested("", EXPLICIT)


class How(StrEnum):
    """In which way a second solution is finer, in the words of a sentence."""

    HALF = "half the step"
    STRICTER = "half the step and a tenth of the tolerance"
    LOOSER = "half the step and ten times the tolerance"
    PEAKS = "`adaptive`, stopping at the peaks of the forces"


@dataclass(frozen=True, slots=True)
class Finer:
    """The same method on a finer `grid`, `how` a person says it, and the part of the error by which
    both are apart; `problem` where it is another than that of the run, `stops` where its steps end
    too.
    """

    requested: data.Requested
    grid: data.Grid
    how: How
    part: float
    problem: data.Problem | None = None
    stops: tuple[float, ...] = ()


def finer(requested: data.Requested, grid: data.Grid) -> Finer:
    """Half the step, over the first MOST_STEPS, at the same recorded times; if the method chooses
    its own steps within those, another tolerance too.
    """
    choice, every = requested.choice, grid.record_every
    steps = min(grid.steps, max(1, MOST_STEPS // every) * every)
    half = replace(grid, step=grid.step / 2, steps=2 * steps, record_every=2 * every)
    if choice.method not in method_table.OWN_STEPS:
        return Finer(requested, half, How.HALF, 1 - 0.5 ** (order_of(requested) or 1))
    factor, how = (
        (TIGHTER, How.STRICTER)
        if TIGHTER * choice.tolerance >= TIGHTEST
        else (1 / TIGHTER, How.LOOSER)
    )
    return Finer(
        replace(requested, choice=replace(choice, tolerance=factor * choice.tolerance)),
        half,
        how,
        1.0,
    )


def order_of(requested: data.Requested) -> int | None:
    """The order in h of the positions of a run, or of the steps that a method chooses itself; None
    where it varies.
    """
    choice = requested.choice
    if not method_table.METHODS[choice.method].orders:
        return method_table.METHODS[choice.method].order
    is_symmetric = choice.method == "runge_kutta" or choice.alpha == 0.5 or choice.symmetrised
    return choice.order if is_symmetric and requested.convention == "momenta" else 1


def errors_of(
    positions: Array, nearer: Array, turns: NDArray[np.bool_], part: float = 1.0, whole: Array | None = None
) -> tuple[Array, Array]:  # fmt: skip
    """Both (..., m, n): by how much positions are off, by round-off at least, and which share of
    the range of the coordinate that is, of at least LEAST_RANGE of the widest one, and of one of
    the angles `turns` at most a turn.

    The range is that of the `whole` way, where more of it is known: points recorded once a period
    have none.
    """
    whole = nearer if whole is None else whole
    ranges = np.nanmax(whole, axis=-2, keepdims=True) - np.nanmin(whole, axis=-2, keepdims=True)
    ranges = np.where(turns, np.minimum(ranges, 2 * np.pi), ranges)
    noise = ROUND_OFF * np.abs(positions)
    least = np.maximum(LEAST_RANGE * ranges.max(axis=-1, keepdims=True), 100 * noise)
    errors = np.maximum(np.abs(positions - nearer) / part, noise)
    return errors, errors / np.maximum(np.maximum(ranges, least), schemes.SMALLEST)


def integrated(
    derived: derivation.Derived, requested: data.Requested, problem: data.Problem
) -> Run:
    """The run of a method from the start of the scene, in pieces where it has some."""
    scene = derived.scene
    values, start = observing.beginning(scene, requested, derivation.free_of(requested, derived))
    if not np.isfinite(values.get(observing.ENERGY_START, 0.0)):
        raise data.Unavailable("The energy has no finite value at the start: start somewhere else.")
    return run_motion(derived, requested, problem, start, values)


def _again(
    derived: derivation.Derived, requested: data.Requested, problem: data.Problem
) -> Trajectory | None:
    """Another run of the scene, without the guard if that ends it early."""
    try:
        found = integrated(derived, requested, problem).trajectory
    except InputError:
        return None
    if found.outcome.kind in GOES_ON:
        return found
    unguarded = replace(requested, choice=replace(requested.choice, guard=False))
    return integrated(derived, unguarded, problem).trajectory


class Comparison(Enum):
    """What a run was compared with."""

    ENERGY = auto()
    HALF_STEP = auto()
    PEAKS = auto()
    TRUE_MOTION = auto()


@dataclass(frozen=True, slots=True)
class Doubt:
    """A comparison in which a run is far off, and the sentence that says so."""

    by: Comparison
    sentence: str


@dataclass(frozen=True, slots=True)
class Estimate:
    """How far a run is from the true motion: the greatest error of a position, and the greatest
    share of the range of a coordinate, up to the time `until` if the comparison ended there (None:
    the end). `lost`: the outcome of a run that one step leads elsewhere. `is_known`: whether
    another run was compared; its numbers may still not be finite.
    """

    is_known: bool = False
    error: float | None = None
    share: float | None = None
    until: float | None = None
    lost: Outcome | None = None
    doubts: tuple[Doubt, ...] = ()

    def has_doubts(self, *but: Comparison) -> bool:
        """Whether there are any, but for those by these comparisons."""
        return any(doubt.by not in but for doubt in self.doubts)

    def with_doubt(self, by: Comparison, sentence: str) -> Estimate:
        """The estimate with a doubt more, if the sentence says anything."""
        return replace(self, doubts=(*self.doubts, Doubt(by, sentence))) if sentence else self

    @property
    def doubt(self) -> str:
        """All of them."""
        return " ".join(doubt.sentence for doubt in self.doubts)

    @property
    def numbers(self) -> dict[str, float | None]:
        """Those that a result shows."""
        known = (
            {"estimated_error": self.error, "estimated_error_share": self.share}
            if self.is_known
            else {}
        )
        return known | ({} if self.until is None else {"estimated_until": self.until})


def estimated(run: observing.Observed, derived: derivation.Derived) -> Estimate:
    """The error of a run by its energy, a run with half the step, one that stops at peaks of
    forces, and the true motion, as far as each is known.
    """
    found = _by_energy(run, derived)
    if found.lost is not None:
        return found
    found, whole = _by_another_run(
        run, derived, finer(run.requested, run.scene.grid), found, run.trajectory.positions
    )
    if found.lost is None and not found.has_doubts():
        for again in _at_peaks(run, derived):
            found, whole = _by_another_run(run, derived, again, found, whole)
    if run.true is not None and not found.has_doubts(Comparison.ENERGY):
        errors = errors_of(
            run.trajectory.positions, run.true, initial.angles(run.scene), whole=whole
        )
        found = found.with_doubt(Comparison.TRUE_MOTION, _elsewhere(run, *errors, TRUE))
    return found


def _by_energy(run: observing.Observed, derived: derivation.Derived) -> Estimate:
    """The estimate by an energy that should be constant: one step may lead elsewhere, and the whole
    change be large.

    The mean kinetic energy is changed by no constant in L; a tenth of CHANGED of it suffices where
    the change is CHANGED of E_0, which is what `max_energy_error` shows.
    """
    scene = run.scene
    varies = observing.lagrangian_of_energy(scene) is None or observing.why_energy_varies(scene)
    if varies or run.velocities is None or observing.end_of_energy(run):
        return Estimate()
    energies, kinetic = observing.energies(scene, run.table)
    if (lost := _with_made_energy(run, energies, kinetic)) is not None:
        return Estimate(lost=lost)
    change, start = float(np.abs(energies - energies[0]).max()), abs(float(energies[0]))
    mean = max(float(kinetic.mean()), schemes.SMALLEST)
    if (
        every := scene.grid.record_every
    ) > 1 and change > CHANGED * mean:  # at rest wherever it is recorded
        short = replace(
            scene, grid=replace(scene.grid, steps=min(every, scene.grid.steps), record_every=1)
        )
        ran = (
            _again(replace(derived, scene=short), run.requested, run.problem)
            if run.problem
            else None
        )
        seen = run if ran is None else replace(run, scene=short, trajectory=ran)
        if seen.velocities is not None:
            mean = max(mean, float(observing.energies(scene, seen.table)[1].mean()))
    is_large = change > max(CHANGED * min(mean, max(start, CHANGED * mean)), NO_CHANGE * start)
    sentence = say("energy_changes", change, change / mean, start) if is_large else ""
    return Estimate().with_doubt(Comparison.ENERGY, sentence)


def _by_another_run(
    run: observing.Observed, derived: derivation.Derived, again: Finer, before: Estimate, whole: Array
) -> tuple[Estimate, Array]:  # fmt: skip
    """The estimate with a finer run too, and the positions of that; what was known where it does
    not begin.
    """
    at, turns, scene, what = (
        run.trajectory,
        initial.angles(run.scene),
        run.scene,
        again.problem or run.problem,
    )
    assert what is not None
    is_sparse = scene.grid.record_every > 1 and again.grid.steps * len(turns) <= MOST_VALUES
    every = 1 if is_sparse else again.grid.record_every
    own = replace(derived, scene=replace(scene, grid=replace(again.grid, record_every=every)))
    ran = _stopping(own, what, again.stops) if again.stops else _again(own, again.requested, what)
    if ran is None:
        return before, whole
    whole, found = ran.positions, ran.thinned(again.grid.steps, again.grid.record_every // every)
    count, end, kind = (
        min(len(found.times), len(at.times)),
        float(found.times[-1]),
        found.outcome.kind,
    )
    early = count < len(at.times) and kind not in GOES_ON
    if early and again.how is How.HALF:
        quantity = say("end_with_half", kind.replace("_", " "))
        return replace(before, lost=_unresolved(run, count - 1, quantity)), whole
    errors, shares = errors_of(
        at.positions[:count], found.positions[:count], turns, again.part, whole
    )
    is_at_peaks, error = again.how is How.PEAKS, observing.greatest(errors)
    is_own = run.requested.method in method_table.OWN_STEPS
    missed = is_at_peaks and (is_own or (error or 0.0) > BEYOND * (before.error or 0.0))
    estimate = replace(
        before, is_known=True, error=error, share=observing.greatest(shares),
        until=float(at.times[count - 1]) if count < len(at.times) else before.until,
        lost=_lost(run, shares.max(axis=1)) if again.how is How.HALF else None,
    )  # fmt: skip
    sentence = _elsewhere(run, errors, shares, AGAIN.format(again.how), MISSED if missed else 1.0)
    if early and not sentence:
        sentence = say("ends_early", again.how, end, kind.replace("_", " "))
    return estimate.with_doubt(
        Comparison.PEAKS if is_at_peaks else Comparison.HALF_STEP, sentence
    ), whole


def _at_peaks(run: observing.Observed, derived: derivation.Derived) -> Iterator[Finer]:
    """`adaptive` with an event at each peak of a force that acts within a step; nothing where there
    is none.
    """
    if len(peaks := moments_between(run)):
        with suppress(data.Unavailable):
            grid, stops = finer(run.requested, run.scene.grid).grid, tuple(peaks.tolist())
            yield Finer(ADAPTIVE, grid, How.PEAKS, 1.0, derived.motion(), stops)


def _stopping(
    derived: derivation.Derived, problem: data.Problem, stops: Sequence[float]
) -> Trajectory | None:
    """`adaptive` with steps that end at these times too: at events that change nothing where it
    runs in pieces anyway, else as one run after the other with the kernel of all.
    """
    scene, grid = derived.scene, derived.scene.grid
    if has_pieces(scene, problem):
        stays = ex.Symbol(scene.coordinates[0])
        formulas = (ex.TIME - ex.number(Fraction(moment)) for moment in stops)
        events = tuple(data.Event(one, 1, False, ((stays, stays),), 2) for one in formulas)
        return _again(derived.but(events=(*scene.events, *events)), ADAPTIVE, problem)
    pieces, done = list[tuple[data.Grid, bool]](), 0  # and whether each ends at a point of the grid
    for place in sorted(
        {*(int((moment - grid.begin) / grid.step) for moment in stops), grid.steps}
    ):
        if place > done:
            pieces.append(
                (data.Grid(grid.step, place - done, 1, grid.begin + done * grid.step), True)
            )
        if place < grid.steps:
            begin, end = (grid.begin + k * grid.step for k in (place, place + 1))
            ends = [begin, *sorted(moment for moment in stops if begin < moment < end), end]
            pieces += [(data.Grid(b - a, 1, 1, a), b == end) for a, b in pairwise(ends)]
        done = place + 1
    values, start = observing.beginning(scene, ADAPTIVE, None)
    observed = observing.observed_problem(scene, problem, ADAPTIVE.choice)
    choice = execution.with_order(observed[0], ADAPTIVE.choice, start, grid, values, observed[1])
    by = replace(ADAPTIVE, choice=choice)
    state, outcome = (scene.positions, scene.velocities), Outcome("completed")
    points = [(grid.begin, *state)]
    for piece, is_on_grid in pieces:
        own = derived.but(grid=piece, positions=state[0], velocities=state[1])
        if (ran := _again(own, by, problem)) is None or ran.velocities is None:
            return None
        state = ran.positions[-1], ran.velocities[-1]
        if is_on_grid:
            points += zip(ran.times[1:], ran.positions[1:], ran.velocities[1:], strict=True)
        if not (outcome := ran.outcome).completed:
            break
    times, positions, velocities = map(np.array, zip(*points, strict=True))
    return Trajectory(times, positions, None, velocities, outcome).thinned(
        grid.steps, grid.record_every
    )


def _unresolved(run: observing.Observed, row: int, quantity: str) -> Outcome:
    """The outcome of a run whose steps are too long from a recorded point on."""
    step, time = int(run.scene.grid.recorded[row]), float(run.trajectory.times[row])
    return Outcome("unresolved", step, time, quantity, None, say("shorter_or_adaptive"))


def _is_guarded(run: observing.Observed) -> bool:
    """Whether a guarded run is recorded at every step of its grid, and not made of pieces."""
    return run.requested.choice.guard and run.scene.grid.record_every == 1 and not run.in_pieces


def _lost(run: observing.Observed, shares: Array) -> Outcome | None:
    """The outcome of a run that one step takes from SUDDEN of TOO_LARGE_SHARE of the range to all
    of it: no chaos parts motions so fast, and the step is too long there.
    """
    before = np.maximum.accumulate(shares[:-1])
    places = np.flatnonzero((shares[1:] > TOO_LARGE_SHARE) & (before < SUDDEN * TOO_LARGE_SHARE))
    if not len(places) or not _is_guarded(run):
        return None
    k = int(places[0])
    return _unresolved(run, k, LOST.format(shares[k + 1]))


def _with_made_energy(run: observing.Observed, energies: Array, kinetic: Array) -> Outcome | None:
    """The outcome of a run in which one step changes a constant energy by CREATED of the kinetic
    energy, the mean one and that at its ends, without what the step itself has made: it is too long
    there, and what follows is another motion. Round-off of a great energy is no change.
    """
    if not _is_guarded(run):
        return None
    changes = np.abs(made := np.diff(energies))
    about = np.maximum(kinetic[1:] - np.maximum(made, 0.0), kinetic[:-1])
    sudden = (changes > CREATED * about) & (changes > NO_CHANGE * np.abs(energies).max())
    end = None
    while len(
        places := np.flatnonzero(sudden[:end] & (changes[:end] > CREATED * kinetic[:end].mean()))
    ):
        end = int(places[0])  # the mean of what is left shows smaller changes, down to the first
        if end == 0:
            break
    if end is None:
        return None
    part = changes[end] / max(about[end], float(kinetic[: end + 2].mean()))
    return _unresolved(run, end, say("energy_in_a_step", part))


def _elsewhere(
    run: observing.Observed, errors: Array, shares: Array, which: str, part: float = 1.0
) -> str:
    """A warning if the error of a coordinate exceeds TOO_LARGE_SHARE of its range; of a method that
    chooses its steps for an error, TIMES_TOLERANCE times its tolerance, and at least LEAST_SHARE,
    is enough: it has missed something. Of these limits, a `part` is enough.
    """
    choice, limit = run.requested.choice, TOO_LARGE_SHARE
    if choice.method in method_table.OWN_STEPS:
        limit = min(limit, max(LEAST_SHARE, TIMES_TOLERANCE * choice.tolerance))
    far = shares > part * limit
    if not far.any():
        return ""
    first = int(far.any(axis=1).argmax())
    k = int(far[first].argmax())
    worst = float(np.nanmax(errors[:, k]))
    return say(
        "other_trajectory", which, run.trajectory.times[first], run.scene.coordinates[k], worst
    )


def other_motion(run: observing.Observed) -> Outcome | None:
    """The outcome if the Lagrangian of the method has a motion at a point of the run that differs
    from the equations.

    The known conditions of its domain are watched at every step; a given Lagrangian has none.
    """
    scene, problem, at = run.scene, run.problem, run.trajectory
    free = None if problem is None or run.velocities is None else problem.free_lagrangian
    if scene.accelerations is None or free is None:
        return None
    apart = accelerating.distance_of_motion(free, scene.coordinates, scene.accelerations, run.table)
    apart += 0 * np.sum(run.values_of(*scene.accelerations), axis=0)  # no number where one has none
    apart[0] = 0.0  # where the start was looked at, which may be a pole that the motion leaves
    places = np.flatnonzero(~(apart <= accelerating.NOTICED))
    if not len(places):
        return None
    k = int(places[0])
    step, time = int(scene.grid.recorded[k]), float(at.times[k])
    return Outcome(
        "off_domain", step, time, say("other_equations"), float(apart[k]), say("other_motion")
    )


def true_motion(derived: derivation.Derived) -> data.Truth:
    """The true motion at the recorded times of the scene; Unavailable where it is not known."""
    if derived.exact_or_none() is None:
        return _references(derived)
    found = exact_trajectory(derived.but(observe=()), derived.scene.values)
    assert found.velocities is not None
    bounds = ROUND_OFF * (1 + np.maximum.accumulate(np.abs(found.positions).max(axis=1)))
    return data.Truth(
        found.times, found.positions, found.velocities, "exact", bounds, found.run_seconds
    )


def exact_trajectory(derived: derivation.Derived, values: Mapping[str, float]) -> Trajectory:
    """The exact solution as a trajectory, with what is observed, at the recorded times."""
    scene, times = derived.scene, derived.scene.grid.times
    try:
        exact = derived.exact()
    except data.Unavailable as error:
        raise data.Unavailable(
            f"No exact solution is known for this scene. {error.detail}"
        ) from None
    if initial.ended_at_start(scene) is not None:
        raise data.Unavailable(say("no_lagrangian_at_start"))
    begun = time.perf_counter()
    q, v = exact_motion.positions_of(
        exact, scene.positions, scene.velocities, times - scene.grid.begin
    )
    seconds, table = (
        time.perf_counter() - begun,
        nf.arrays_by_name(scene.coordinates, q, v, values, times),
    )
    observation = observing.observables(scene, data.MethodChoice(data.EXACT))
    series = {one.name: arrays.array_value(one.expression, table) for one in observation}
    maxima = {name: float(np.abs(column).max()) for name, column in series.items()}
    done = Outcome("completed")
    return Trajectory(
        times, q, None, np.array(v), done, run_seconds=seconds, series=series, maxima=maxima
    )


def _references(derived: derivation.Derived) -> data.Truth:
    """The better of two reference solutions, the bound of its error, and the time until which it is
    known.
    """
    begun, scene, problem = time.perf_counter(), derived.scene, derived.motion()
    times = scene.grid.times

    def states(choice: data.MethodChoice, refinement: int = 1) -> Array:
        """Positions and velocities at the recorded times, (2, m, n); nan where the reference did
        not arrive.
        """
        grid, start = scene.grid, data.Start(scene.positions, scene.velocities)
        steps, every = refinement * grid.steps, refinement * grid.record_every
        finer = replace(grid, step=grid.step / refinement, steps=steps, record_every=every)
        found = np.full((2, len(times), len(scene.coordinates)), np.nan)
        acting = tuple(event for event in scene.events if event.acts)
        own = derived.but(grid=finer, events=acting, observe=())
        ran = run_motion(own, data.Requested("", choice), problem, start, scene.values).trajectory
        if ran.velocities is not None:
            found[:, : len(ran.times)] = ran.positions, ran.velocities
        return found

    try:
        first, second, by = states(TAYLOR), states(EXPLICIT), "heyoka, checked by adaptive"
    except InputError:  # heyoka is not installed, or does not know a function
        first, by = states(EXPLICIT), "adaptive, checked by Gauss-Legendre of order 12"
        second = _collocation(states, first, derived)
    distances = _distances(first, second)
    good = np.isfinite(distances) & (SAFETY * distances <= USELESS * _size(first))
    until = len(good) if good.all() else int(np.argmin(good))
    if until < 2:
        raise data.Unavailable(say("no_reference"))
    found, reason = first.copy(), ""
    found[:, until:] = np.nan
    if until < len(times):
        ended = bool(np.isnan([first[0, until], second[0, until]]).any())
        why = (
            "the reference solutions end there"
            if ended
            else "from there on, the reference solutions differ"
        )
        reason = say("reference_until", times[until - 1], why)
    bounds = SAFETY * np.where(good, distances, np.nan)
    bounds = bounds + ROUND_OFF * np.maximum.accumulate(np.abs(found[0]).max(axis=1))
    return data.Truth(
        times, found[0], found[1], "reference", bounds, time.perf_counter() - begun, reason, by
    )


def _collocation(states: Callable[..., Array], other: Array, derived: derivation.Derived) -> Array:
    """Gauss-Legendre of order 12, refined until it agrees with the other or no longer comes
    nearer.
    """
    nearest, refinement, best = np.inf, 1, np.full_like(other, np.nan)
    while refinement * derived.scene.grid.steps <= MOST_STEPS and not derived.is_over:
        found = states(IMPLICIT, refinement)
        apart = float(np.nan_to_num(_distances(found, other), nan=np.inf)[-1])
        if apart < nearest or refinement == 1:
            best = found
        if apart <= ENOUGH * _size(other) or (np.isfinite(nearest) and apart > 0.5 * nearest):
            break
        nearest, refinement = min(apart, nearest), 2 * refinement
    return best


def _size(states: Array) -> float:
    """The size of the motion: the greatest change of a coordinate."""
    change = np.abs(states[0] - states[0, 0])
    return float(change[np.isfinite(change)].max(initial=0.0)) or 1.0


def _distances(first: Array, second: Array) -> Array:
    """The greatest distance of a coordinate up to each time, (m,); nan where one has ended."""
    found: Array = np.maximum.accumulate(np.abs(first[0] - second[0]).max(axis=1))
    return found

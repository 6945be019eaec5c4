"""Error against work for every method of a scene, measured by rules that favor no method.

Every method is run over the same time, from a coarse setting to finer ones: half the step, or a
tenth of the tolerance, until its error is round-off or it takes too long. Errors are taken at
CHECKS common times against the exact solution, or a reference that a second one confirms.
Compiling, the first call and steady runs are separate; steady runs of all settings alternate, best
and median of several. A curve ends at its least error: what lies beyond is the round-off floor. A
setting that failed is kept with its reason and has no error.
"""

import itertools
import math
import statistics
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inverse_service.integrators import method_table
from inverse_service.simulation import accuracy, derivation, observing, running, scene_data as data
from inverse_service.simulation.sentences import say

CHECKS = 8
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
COARSEST, FINEST = 1e-2, 1e-13  # shares of the motion: from where to where a curve is wanted
LOOSEST, TIGHTEST = 1e-3, 1e-15  # tolerances
MOST_STEPS = 4_000_000
ROUND_OFF, NOISE = (
    1e-12,
    4.0,
)  # errors below this share of the motion are round-off, whose noise is about this factor
STALLED = 0.5  # of the error before: less gain than this, twice, is the round-off floor
SECONDS, LATER_SECONDS = (
    0.2,
    0.06,
)  # for each of the repeats: of the first runs of all methods, and of later ones
SHARE_OF_FIRST, SHARE_OF_REPEATS, SHARE_OF_ONE = (
    0.6,
    0.2,
    0.05,
)  # of the time limit, the last for a single one
LONG = 100  # times the time of the scene
PARTS = 20  # of a long run: the first and the last are compared
LATE, CUT = say("limit_almost_reached"), "it takes too long"


@dataclass(frozen=True, slots=True)
class Setting:
    """One method at one step, measured; `reason` is empty where `error` is a number.

    `first_seconds` are those of the first call with compiling, `compile_seconds` the part of it
    before the run; the best and the median are of `repeats` later runs. `at_floor`: a smaller step
    than that of the least error. Where `tolerance` is not None the method took steps of its own,
    and `step` is only the distance of the times at which it is seen.
    """

    requested: data.Requested
    step: float
    steps: int
    error: float | None = None
    reason: str = ""
    compile_seconds: float = 0.0
    first_seconds: float = 0.0
    best_seconds: float | None = None
    median_seconds: float | None = None
    repeats: int = 0
    force_evaluations: int = 0
    newton_iterations: int = 0
    at_floor: bool = False
    tolerance: float | None = None

    @property
    def grid(self) -> data.Grid:
        return _grid(self.step, self.steps)


@dataclass(frozen=True, slots=True)
class LongRun:
    """A method over LONG times the time: greatest errors of the energy (relative) and the
    constraints, the change of the orbit's shape from the first part to the last, as a share of its
    size, and the seconds that it takes.
    """

    setting: Setting
    seconds: float | None = None
    energy_error: float | None = None
    energy_drift: float | None = None
    constraint_error: float | None = None
    shape_change: float | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Precision:
    """All settings, in the order of methods and from coarse to fine; `scale` is the size of the
    motion.
    """

    scene: data.Scene
    truth: data.Truth
    scale: float
    settings: tuple[Setting, ...]
    long: tuple[LongRun, ...] = ()


@dataclass(frozen=True, slots=True)
class Price:
    """The cost of an error by one method, interpolated on its curve. `at_most`: its coarsest
    setting is better.
    """

    seconds: float
    step: float | None
    tolerance: float | None
    evaluations: float
    at_most: bool


def measure(
    derived: derivation.Derived, steps: Sequence[float], repeats: int, time_limit: float,
    progress: data.Progress | None = None, long: bool = False,
) -> Precision:  # fmt: skip
    """Measure every method of the scene but the exact one, at `steps` or from coarse to fine;
    Unavailable where nothing is true.
    """
    begun, scene, derived = time.process_time(), derived.scene, derived.but(observe=())
    length = scene.grid.step * scene.grid.steps
    finest = min(max(_counts(length, steps or [scene.grid.step / 8])), 65_536)
    truth = accuracy.true_motion(derived.but(grid=_grid(length / finest, finest)))
    if not np.isfinite(truth.positions).all():
        raise data.Unavailable(truth.reason)
    scale = float(np.abs(truth.positions - truth.positions[0]).max()) or 1.0
    methods = [requested for requested in scene.methods if requested.method != data.EXACT]

    def run(blank: Setting) -> Setting:
        if progress is not None:
            at = (
                f"{blank.steps} steps"
                if blank.tolerance is None
                else f"tolerance {blank.tolerance:g}"
            )
            progress(f"{blank.requested.label}, {at}")
        if time.process_time() - begun > SHARE_OF_FIRST * time_limit:
            return replace(blank, reason=LATE)
        end, first = time.process_time() + SHARE_OF_ONE * time_limit, time.perf_counter()
        limited = replace(derived.but(grid=blank.grid), stop=lambda: time.process_time() > end)
        ran = running.observed_run(limited, blank.requested)
        blank, found = replace(blank, first_seconds=time.perf_counter() - first), ran.trajectory
        if found is None or not ran.outcome.completed:
            return replace(blank, reason=reason_of(ran))
        error = float(np.abs(found.positions - truth.positions).max())
        if not np.isfinite(error):
            return replace(blank, reason="the result is not finite")
        return replace(
            blank, error=error, compile_seconds=found.compile_seconds, best_seconds=found.run_seconds,
            force_evaluations=found.force_evaluations, newton_iterations=found.newton_iterations,
        )  # fmt: skip

    def refined(blanks: Iterable[Setting]) -> list[Setting]:
        """From coarse to fine until the error is round-off, no longer falls, or a run takes
        long.
        """
        found: list[Setting] = []
        for blank in blanks:
            # The next setting takes as long as all previous ones together.
            if sum(one.best_seconds or 0.0 for one in found) > SECONDS * repeats / len(methods) / 2:
                return [*found, replace(blank, reason=CUT)]
            found.append(run(blank))
            errors = [one.error for one in found if one.error is not None]
            if found[-1].reason in (LATE, CUT) or (
                errors and errors[-1] <= max(FINEST * scale, truth.uncertainty)
            ):
                break
            if (
                len(errors) > 2
                and errors[-3] < COARSEST * scale
                and min(errors[-2:]) > STALLED * errors[-3]
            ):
                break
        return found

    settings: list[Setting] = []
    for requested in methods:
        if method_table.METHODS[requested.method].own_steps:
            settings += refined(_tolerances(requested, length))
        elif steps:
            settings += [run(_blank(requested, length, count)) for count in _counts(length, steps)]
        else:  # steps halved from four times that of the scene, or from longer ones if that is already accurate
            parts = max(1, round(length / (4 * CHECKS * scene.grid.step)))
            halves = (CHECKS * parts * 2**k for k in range(MOST_STEPS.bit_length()))
            own = refined(
                [_blank(requested, length, count) for count in halves if count <= MOST_STEPS]
            )
            while parts > 1 and own[0].error is not None and own[0].error <= COARSEST * scale:
                parts //= 2
                own.insert(0, run(_blank(requested, length, CHECKS * parts)))
            settings += own
    budget = min(SHARE_OF_REPEATS * time_limit, LATER_SECONDS * repeats)
    settings = _repeated(derived, settings, repeats, budget)
    settings = with_floor(settings, scale, truth.uncertainty)
    found = Precision(scene, truth, scale, tuple(settings))
    if long:
        left = begun + time_limit - time.process_time()
        found = replace(found, long=tuple(_long_runs(found, derived, min(left, repeats))))
    return found


def _counts(length: float, steps: Sequence[float]) -> list[int]:
    """Numbers of steps, rising, each a multiple of CHECKS so that all methods are seen at the same
    times.
    """
    counts = {CHECKS * max(1, round(length / (CHECKS * step))) for step in steps}
    return sorted(count for count in counts if count <= MOST_STEPS) or [min(counts)]


def _tolerances(requested: data.Requested, length: float) -> Iterator[Setting]:
    factor = 100.0 if method_table.METHODS[requested.method].scipy else 10.0
    tolerance = LOOSEST
    while tolerance > 0.9 * TIGHTEST:
        yield _blank(requested, length, CHECKS, tolerance)
        tolerance /= factor


def _blank(
    requested: data.Requested, length: float, count: int, tolerance: float | None = None
) -> Setting:
    """A setting before it is measured; a tolerance is part of what is requested."""
    if tolerance is not None:
        requested = replace(requested, choice=replace(requested.choice, tolerance=tolerance))
    return Setting(requested, length / count, count, tolerance=tolerance)


def _grid(step: float, steps: int) -> data.Grid:
    return data.Grid(step, steps, steps // CHECKS)


def reason_of(run: running.MethodRun) -> str:
    """The reason why a setting has no error."""
    if run.outcome.kind == "cancelled":
        return CUT
    return (
        run.outcome.sentence
        if run.trajectory is not None
        else run.outcome.remedy or run.outcome.kind
    )


def _repeated(
    derived: derivation.Derived, settings: list[Setting], repeats: int, budget: float
) -> list[Setting]:
    """Steady times: rounds over the settings that worked, in alternating order, until the budget is
    used up; a run that takes a twentieth of it is not repeated.
    """
    begun = time.process_time()
    times = {
        k: [one.best_seconds]
        for k, one in enumerate(settings)
        if one.error is not None and one.best_seconds
    }
    short = [k for k, (first,) in times.items() if first < SHARE_OF_ONE * budget]
    for k in itertools.chain.from_iterable(
        (short[::-1], short)[turn % 2] for turn in range(repeats - 1)
    ):
        if time.process_time() - begun > budget:
            break
        run = running.observed_run(derived.but(grid=settings[k].grid), settings[k].requested)
        if run.trajectory is not None and run.outcome.completed:
            times[k].append(run.trajectory.run_seconds)
    for k, found in times.items():
        best, median = min(found), statistics.median(found)
        settings[k] = replace(
            settings[k], best_seconds=best, median_seconds=median, repeats=len(found)
        )
    return settings


def by_method(settings: Iterable[Setting]) -> dict[str, list[Setting]]:
    """The settings of each method, from coarse to fine."""
    found: dict[str, list[Setting]] = {}
    for setting in settings:
        found.setdefault(setting.requested.label, []).append(setting)
    return found


def with_floor(settings: Sequence[Setting], scale: float, unknown: float = 0.0) -> list[Setting]:
    """Mark the settings beyond the least error of their method, or beyond the first error that is
    only round-off or less than the `unknown` part of the true motion.
    """
    found: list[Setting] = []
    for own in by_method(settings).values():
        least = min((s.error for s in own if s.error is not None), default=0.0)
        is_noise = least <= ROUND_OFF * scale
        limit = max(NOISE * least + 1e-16 * scale if is_noise else least, unknown)
        last = next(
            (k for k, s in enumerate(own) if s.error is not None and s.error <= limit), len(own)
        )
        found += [replace(s, at_floor=s.error is not None and k > last) for k, s in enumerate(own)]
    return found


def curves(measured: Precision) -> dict[str, list[Setting]]:
    """The curve of each method: its settings with an error and a time, from coarse to fine, up to
    the floor.
    """
    return {
        label: [s for s in own if s.error and s.best_seconds is not None and not s.at_floor]
        for label, own in by_method(measured.settings).items()
    }


def measured_order(curve: Sequence[Setting], scale: float) -> float | None:
    """The median slope of log error over log step where errors are below 1 % of the motion and
    above round-off.

    None for a method that chooses its steps itself.
    """
    if any(setting.tolerance is not None for setting in curve):
        return None
    slopes = [
        math.log(a.error / b.error) / math.log(a.step / b.step)
        for a, b in itertools.pairwise(curve)
        if a.error and b.error and a.error < COARSEST * scale and b.error > ROUND_OFF * scale
    ]
    return sorted(slopes)[len(slopes) // 2] if slopes else None


def price_of(curve: Sequence[Setting], coarsest: Setting, error: float) -> Price | None:
    """What it costs by a method to get below an error, interpolated between the points of its
    curve; None if it never reaches it. `coarsest` is its first setting: where that failed a longer
    step is not faster.
    """
    pairs = [
        *itertools.pairwise(curve),
        *((one, one) for one in curve[:1] if (one.error or math.inf) <= error),
    ]
    a, b = next(
        ((a, b) for a, b in pairs if a is b or (a.error or 0) > error >= (b.error or 0)),
        (None, None),
    )
    if a is None or b is None:
        return None
    share = (
        0.0
        if a is b or not (a.error and b.error)
        else math.log(a.error / error) / math.log(a.error / b.error)
    )

    def between(x: float | None, y: float | None) -> float:
        return float(x * (y / x) ** share) if x and y else 0.0

    seconds, evaluations = (
        between(a.best_seconds, b.best_seconds),
        between(a.force_evaluations, b.force_evaluations),
    )
    step = between(a.step, b.step) if a.tolerance is None else None
    tolerance = None if a.tolerance is None else between(a.tolerance, b.tolerance)
    return Price(seconds, step, tolerance, evaluations, a is b is coarsest)


def prices(measured: Precision) -> dict[float, dict[str, Price]]:
    """For each target the methods that reach it, cheapest first."""
    drawn, first = (
        curves(measured),
        {label: own[0] for label, own in by_method(measured.settings).items()},
    )
    found: dict[float, dict[str, Price]] = {}
    finer: dict[str, Price] = {}
    for target in reversed(TARGETS):
        known = {
            label: price_of(curve, first[label], target * measured.scale)
            for label, curve in drawn.items()
        }
        reached = {label: price for label, price in known.items() if price is not None}
        for (
            label,
            price,
        ) in finer.items():  # a price for a smaller error is also valid for a larger one
            if label in reached and price.seconds < reached[label].seconds:
                reached[label] = price
        finer = reached
        found[target] = dict(sorted(finer.items(), key=lambda item: item[1].seconds))
    return {target: found[target] for target in TARGETS}


def _long_runs(
    measured: Precision, derived: derivation.Derived, budget: float
) -> Iterator[LongRun]:
    """Each method over LONG times the time, with the coarsest setting that has an error of a
    thousandth.
    """
    begun = time.process_time()
    wanted = [next((s for s in curve if (s.error or 1.0) <= TARGETS[0] * measured.scale), curve[-1])
              for curve in curves(measured).values() if curve]  # fmt: skip
    for one in sorted(wanted, key=lambda setting: setting.best_seconds or 0.0):
        expected, count = LONG * (one.best_seconds or 0.0), LONG * one.steps
        if time.process_time() - begun + expected > budget or count > 10 * MOST_STEPS:
            yield LongRun(one, reason=f"not measured: it takes about {expected:.1g} s")
        else:
            yield _long_run(
                derived.but(grid=data.Grid(one.step, count, max(1, count // (PARTS * 200)))), one
            )


def _long_run(derived: derivation.Derived, one: Setting) -> LongRun:
    scene, requested = derived.scene, one.requested
    unguarded = replace(requested.choice, guard=False)  # a long run is not checked a second time
    run = running.observed_run(derived, replace(requested, choice=unguarded))
    if run.trajectory is None or not run.outcome.completed or run.observed is None:
        return LongRun(one, reason=reason_of(run))
    at = run.trajectory
    part = max(2, len(at.times) // PARTS)
    extents = [np.ptp(at.positions[rows], axis=0) for rows in (slice(0, part), slice(-part, None))]
    shape = float(np.max(np.abs(extents[1] - extents[0]) / max(float(extents[0].max()), 1e-300)))
    energy = drift = constraint = None
    if run.observed.velocities is not None:
        if scene.lagrangian is not None and observing.why_energy_varies(scene) is None:
            start = observing.start_energy(scene) or 0.0
            errors = (observing.energies(scene, run.observed.table)[0] - start) / (
                abs(start) or 1.0
            )
            energy, drift = (
                observing.greatest(errors),
                float(abs(errors[-part:].mean() - errors[:part].mean())),
            )
        if scene.constraints:
            constraint = observing.constraint_at_points(run.observed)
    return LongRun(one, at.run_seconds, energy, drift, constraint, shape)

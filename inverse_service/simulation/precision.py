"""Error against work for every method of a scene, measured by rules that favor none.

Every method gets the same step sizes over the same length of time; heyoka, which chooses its steps itself, gets
tolerances. Errors are taken at CHECKS common times against
the exact solution, or two references that agree. Compiling, the first call and steady runs are separate; steady
runs of all settings alternate, best and median of several. A curve ends at its least error: what lies beyond is
the round-off floor. A setting that failed is kept with its reason and has no error.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inverse_service.integrators.methods import OWN_STEPS, SCIPY
from inverse_service.integrators.trajectory import Trajectory
from inverse_service.simulation.derivation import Derived
from inverse_service.simulation.observing import (
    greatest,
    point_constraints,
    point_energy,
    start_energy,
    why_energy_varies,
)
from inverse_service.simulation.quantities import velocities_at_points
from inverse_service.simulation.running import MethodRun, observed_run
from inverse_service.simulation.scene_data import EXACT, Grid, Progress, Requested, Scene, Unavailable
from inverse_service.simulation.truth import Truth, true_motion

CHECKS = 8
TOLERANCES = tuple(10.0**-k for k in range(3, 16))
MOST_STEPS = 4_000_000
# Errors below this share of the motion are round-off, whose noise is about this factor.
ROUND_OFF = 1e-12
NOISE = 4.0
SLOW = 1.0  # seconds; a peer that takes longer is not made finer: its very first call also loads what it needs
COARSE = 1e-2  # of the motion
# Shares of the time limit: for first calls, and for all repetitions.
SHARE_OF_FIRST = 0.5
SHARE_OF_REPEATS = 0.35


@dataclass(frozen=True, slots=True)
class Setting:
    """One method at one step, measured. Times in seconds; `reason` is empty where `error` is a number.

    `first` is the first call with compiling; `compile` is the part of it before the run; `best` and `median` are of
    `repeats` later runs. `further` are errors of velocity, energy (relative) and constraints at the same times.
    `at_floor`: a smaller step than that of the least error. Where `tolerance` is not None the method took steps of its
    own, and `step` is only the distance of the times at which it is seen.
    """

    requested: Requested
    step: float
    steps: int
    error: float | None
    reason: str
    compile: float
    first: float
    best: float | None
    median: float | None
    repeats: int
    force_evaluations: int
    newton_iterations: int
    at_floor: bool = False
    tolerance: float | None = None
    further: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def fineness(self) -> tuple[int, float]:
        """Rises from coarse settings of a method to fine ones."""
        return self.steps, -(self.tolerance or 0.0)


@dataclass(frozen=True, slots=True)
class Precision:
    """All settings, in the order of methods and of falling steps; `scale` is the size of the motion."""

    scene: Scene
    truth: Truth
    scale: float
    settings: tuple[Setting, ...]


def default_steps(step: float) -> tuple[float, ...]:
    """Ten steps, from four times the scene's one down to a 128th."""
    return tuple(step * 2.0 ** (2 - k) for k in range(10))


def measure(
    scene: Scene,
    derived: Derived,
    steps: Sequence[float],
    repeats: int,
    time_limit: float,
    progress: Progress | None = None,
    coarser: bool = False,
) -> Precision | Unavailable:
    """Measure every method of the scene but the exact one at every step, and at `coarser` ones where it is good at all
    of these; Unavailable where nothing is true."""
    begun = time.monotonic()
    length = scene.grid.step * scene.grid.steps
    plain = replace(scene, observe=())
    counts = _counts(length, steps)
    truth = _truth(plain, derived, length, max(counts))
    if isinstance(truth, Unavailable):
        return truth
    if not np.isfinite(truth.positions).all():
        return Unavailable(truth.reason)
    scale = float(np.abs(truth.positions - truth.positions[0]).max()) or 1.0
    late = begun + SHARE_OF_FIRST * time_limit

    def first(blank: Setting) -> Setting:
        if progress is not None:
            at = f"{blank.steps} steps" if blank.tolerance is None else f"tolerance {blank.tolerance:g}"
            progress(f"{blank.requested.label}, {at}")
        if time.monotonic() > late:
            return replace(blank, reason="not measured: the time limit was near")
        return _first(plain, blank, derived, truth, length)

    settings: list[Setting] = []
    for requested in scene.methods:
        if requested.method == EXACT:
            continue
        own: list[Setting] = []
        for count, tolerance in _fineness(requested, counts):
            blank = _blank(requested, length, count, tolerance)
            slow = requested.method in SCIPY and any(one.first > SLOW for one in own[1:])
            reason = f"not measured: the coarser one took more than {SLOW:g} s"
            own.append(replace(blank, reason=reason) if slow else first(blank))
        while coarser and _is_good(own[0], scale):
            count = CHECKS * (own[0].steps // CHECKS // 2)
            own.insert(0, first(_blank(requested, length, count, None)))
        settings += own
    settings = _repeated(plain, derived, settings, length, repeats, SHARE_OF_REPEATS * time_limit)
    return Precision(scene, truth, scale, tuple(_with_floor(settings, scale, truth.uncertainty)))


def _is_good(setting: Setting, scale: float) -> bool:
    """Whether a method with a given step is so good there that longer ones say more."""
    plain = setting.tolerance is None and setting.steps >= 2 * CHECKS
    return plain and setting.error is not None and setting.error <= COARSE * scale


def _counts(length: float, steps: Sequence[float]) -> list[int]:
    """Numbers of steps, rising, each a multiple of CHECKS so that all methods are seen at the same times."""
    counts = {CHECKS * max(1, round(length / (CHECKS * step))) for step in steps}
    return sorted(count for count in counts if count <= MOST_STEPS) or [min(counts)]


def _fineness(requested: Requested, counts: Sequence[int]) -> list[tuple[int, float | None]]:
    """(steps, None) of each setting; (CHECKS, tolerance) for methods that choose their steps."""
    if requested.method in SCIPY:
        return [(CHECKS, tolerance) for tolerance in TOLERANCES[1:10:2]]
    if requested.method in OWN_STEPS:
        return [(CHECKS, tolerance) for tolerance in TOLERANCES]
    return [(count, None) for count in counts]


def _blank(requested: Requested, length: float, count: int, tolerance: float | None) -> Setting:
    """A setting before it is measured; a tolerance is part of what is requested."""
    if tolerance is not None and requested.choice is not None:
        requested = replace(requested, choice=replace(requested.choice, tolerance=tolerance))
    step = _grid(length, count).step
    return Setting(requested, step, count, None, "", 0.0, 0.0, None, None, 0, 0, 0, tolerance=tolerance)


def _grid(length: float, count: int) -> Grid:
    return Grid(length / count, count, count // CHECKS)


def _truth(scene: Scene, derived: Derived, length: float, finest: int) -> Truth | Unavailable:
    return true_motion(replace(scene, grid=_grid(length, min(finest, 65_536))), derived)


def _first(scene: Scene, blank: Setting, derived: Derived, truth: Truth, length: float) -> Setting:
    begun = time.perf_counter()
    run = observed_run(replace(scene, grid=_grid(length, blank.steps)), blank.requested, derived, None)
    first = time.perf_counter() - begun
    trajectory = run.trajectory
    if trajectory is None or not run.outcome.completed:
        return replace(blank, reason=reason_of(run), first=first)
    error = float(np.abs(trajectory.positions - truth.positions).max())
    if not np.isfinite(error):
        return replace(blank, reason="the result is not finite", first=first)
    return replace(
        blank,
        error=error,
        compile=trajectory.compile_seconds,
        first=first,
        force_evaluations=trajectory.force_evaluations,
        newton_iterations=trajectory.newton_iterations,
        further=_further(scene, run, truth),
    )


def _further(scene: Scene, run: MethodRun, truth: Truth) -> dict[str, float | None]:
    """Greatest errors at the CHECKS common times, of what has values there."""
    assert run.trajectory is not None
    velocities = None if run.observed is None else velocities_at_points(run.observed)
    if velocities is None:
        return {}
    positions, times = run.trajectory.positions, run.trajectory.times
    found = {"velocity_error": greatest(velocities - truth.velocities)}
    if scene.lagrangian is not None and why_energy_varies(scene) is None:
        start = start_energy(scene) or 0.0
        found["energy_error"] = greatest(
            (point_energy(scene, positions, velocities, times) - start) / (abs(start) or 1.0)
        )
    if scene.constraints:
        found["constraint_error"] = point_constraints(scene, positions, velocities)["max_constraint_at_points"]
    return found


def reason_of(run: MethodRun) -> str:
    """Why a setting has no error, in a line."""
    outcome = run.outcome
    if run.trajectory is None:
        return outcome.remedy or outcome.kind
    what = f"{outcome.quantity} = {outcome.value:.3g}" if outcome.value is not None else outcome.quantity or ""
    where = f"at step {outcome.step}" if outcome.step is not None else ""
    return " ".join(part for part in (outcome.kind.replace("_", " "), where, what) if part)


def _repeated(
    scene: Scene, derived: Derived, settings: list[Setting], length: float, repeats: int, budget: float
) -> list[Setting]:
    """Steady times: rounds over all settings that worked, in alternating order, until the budget is used up."""
    begun = time.monotonic()
    times: dict[int, list[float]] = {k: [] for k, setting in enumerate(settings) if setting.error is not None}
    for turn in range(repeats):
        for k in list(times) if turn % 2 == 0 else list(times)[::-1]:
            if time.monotonic() - begun > budget and times[k]:
                continue
            found = _steady(scene, derived, settings[k], length)
            if found is not None:
                times[k].append(found)
    return [
        replace(s, best=min(times[k]), median=statistics.median(times[k]), repeats=len(times[k])) if times.get(k) else s
        for k, s in enumerate(settings)
    ]


def _steady(scene: Scene, derived: Derived, setting: Setting, length: float) -> float | None:
    run = observed_run(replace(scene, grid=_grid(length, setting.steps)), setting.requested, derived, None)
    found: Trajectory | None = run.trajectory
    return None if found is None or not run.outcome.completed else found.run_seconds


def _with_floor(settings: Sequence[Setting], scale: float, unknown: float = 0.0) -> list[Setting]:
    """Mark what lies beyond the least error of its method, or beyond the first error that is round-off only or less
    than what is `unknown` of the true motion."""
    found = []
    for setting in settings:
        own = [s for s in settings if s.requested.label == setting.requested.label and s.error is not None]
        beyond = (
            bool(own) and setting.error is not None and setting.fineness > _last_useful(own, scale, unknown).fineness
        )
        found.append(replace(setting, at_floor=beyond))
    return found


def _last_useful(own: Sequence[Setting], scale: float, unknown: float) -> Setting:
    least = min(own, key=lambda s: s.error or 0.0)
    if (least.error or 0.0) > max(ROUND_OFF * scale, unknown):
        return least
    round_off = NOISE * (least.error or 0.0) + 1e-16 * scale if (least.error or 0.0) <= ROUND_OFF * scale else 0.0
    return next(s for s in own if (s.error or 0.0) <= max(round_off, unknown))

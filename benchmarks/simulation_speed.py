"""Measure steps per second next to other routes, latency by stage, ensembles, and long runs."""

from __future__ import annotations

import os
import resource
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.hard_cases import disk_start
from benchmarks.problems import DISK, DISK_CONSTRAINTS, DISK_ENERGY, problem
from benchmarks.simulation_cases import BARE, CASES, SpeedCase
from benchmarks.simulation_routes import lambdify_and_fsolve, ours, with_numba
from inverse_service.expressions.collecting import forget_expansions
from inverse_service.mechanics.legendre import legendre
from inverse_service.simulation.execution import kernel_of, run, run_ensemble
from inverse_service.simulation.numeric_formulas import Formulas
from inverse_service.simulation.scene_data import Grid, MethodChoice, Start

Report = Callable[[str], None]
# Many short rounds: even if other programs use the machine, the best of them is undisturbed.
ROUNDS = 41
_STEPS = {"ours": 10_000, "generated C": 10_000, "numba": 10_000, "lambdify + fsolve": 10}


@dataclass(frozen=True, slots=True)
class RouteRow:
    """Nanoseconds per step of each route: (best, median) of alternating rounds."""

    case: str
    routes: Mapping[str, tuple[float, float]]

    def ratio(self, route: str) -> float | None:
        """Our time divided by that of the route, by the best rounds."""
        return self.routes["ours"][0] / self.routes[route][0] if route in self.routes else None


def route_rows(report: Report, rounds: int = ROUNDS) -> list[RouteRow]:
    with tempfile.TemporaryDirectory() as folder:
        return [_route_row(case, Path(folder), report, rounds) for case in CASES]


def _route_row(case: SpeedCase, folder: Path, report: Report, rounds: int) -> RouteRow:
    report(case.label)
    found = {
        "ours": ours(case), "numba": with_numba(case, folder),
        "lambdify + fsolve": lambdify_and_fsolve(case),
    }  # fmt: skip
    times: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(rounds):
        for name, runner in found.items():
            times[name].append(1e9 * runner(_STEPS[name]) / _STEPS[name])
    return RouteRow(
        case.label,
        {name: (min(values), statistics.median(values)) for name, values in times.items()},
    )


@dataclass(frozen=True, slots=True)
class LatencyRow:
    """Milliseconds by stage (best of each) from a Lagrangian never seen before to its first 1,000
    steps.

    `best` and `median` totals by the clock; `processor` the best total of processor time, which
    other work on the machine affects less.
    """

    case: str
    stages: Mapping[str, float]
    best: float
    median: float
    processor: float


_DISK_TEXT = "{0}/2*(phi'^2 + theta'^2 + c*x'^2/(cos(phi)*phi') + c*y'^2/(sin(phi)*phi'))"
_PARTICLE_TEXT = "{0}/2*x'^2 + {0}*c*sqrt(1 + x^2)/2*(y'^2/x' + z'^2/(x*x'))"
_NEW = {
    "disk": ("phi theta x y", _DISK_TEXT, disk_start()),
    "particle": ("x y z", _PARTICLE_TEXT, Start((-0.7, 0.0, 0.0), (1.0, 0.5, 0.35))),
}


def latency_rows(report: Report, rounds: int = 15) -> list[LatencyRow]:
    """Each round has a new factor in L and clears the expansions, so that no cache contains it."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        before = os.environ.get("INVERSE_SERVICE_CACHE")
        os.environ["INVERSE_SERVICE_CACHE"] = folder
        try:
            for name in _NEW:
                for alpha in (0.0, 0.5):
                    report(f"latency, {name}, alpha = {alpha:g}")
                    rows.append(_latency_row(name, alpha, rounds))
        finally:
            if before is None:
                del os.environ["INVERSE_SERVICE_CACHE"]
            else:
                os.environ["INVERSE_SERVICE_CACHE"] = before
    return rows


def _latency_row(name: str, alpha: float, rounds: int) -> LatencyRow:
    found, processor = [], []
    for factor in range(2, rounds + 3):
        begin = time.thread_time()
        found.append(_latency(name, alpha, factor))
        processor.append(1e3 * (time.thread_time() - begin))
    found, processor = found[1:], processor[1:]
    totals = [sum(stages.values()) for stages in found]
    best = {stage: min(stages[stage] for stages in found) for stage in found[0]}
    label = f"{name}, alpha = {alpha:g}"
    return LatencyRow(label, best, min(totals), statistics.median(totals), min(processor))


def _latency(name: str, alpha: float, factor: int) -> dict[str, float]:
    coordinates, text, start = _NEW[name]
    forget_expansions()
    clock = [time.perf_counter()]
    made = problem(coordinates, free=text.format(factor), parameters="c")
    clock.append(time.perf_counter())
    assert made.free_lagrangian is not None
    made = replace(
        made, free_hamiltonian=legendre(made.free_lagrangian, made.coordinates).hamiltonian
    )
    clock.append(time.perf_counter())
    choice = MethodChoice("variational", alpha)
    kernel = kernel_of(Formulas(made), choice, BARE)
    clock.append(time.perf_counter())
    found = run(made, choice, start, Grid(0.01, 1000), {"c": 1e-2}, BARE)
    clock.append(time.perf_counter())
    assert found.outcome.completed
    stages = {"read": clock[1] - clock[0], "Legendre": clock[2] - clock[1], **kernel.seconds}
    stages["start and 1,000 steps"] = clock[4] - clock[3]
    stages["rest"] = clock[3] - clock[2] - sum(kernel.seconds.values())
    return {stage: 1e3 * seconds for stage, seconds in stages.items()}


@dataclass(frozen=True, slots=True)
class EnsembleRow:
    """Nanoseconds per trajectory-step: processor time (best, median), and by the clock on all
    cores.

    Two idle cores that share the work evenly need half of the processor time by the clock.
    """

    case: str
    members: int
    core: tuple[float, float]
    wall: float


def ensemble_rows(
    report: Report, rounds: int = 9, members: int = 100_000, steps: int = 100
) -> list[EnsembleRow]:
    rows = []
    for case in CASES:
        report(f"ensemble, {case.label}")
        factors = np.linspace(0.9, 1.1, members)[:, None]
        positions, velocities = (
            np.tile(case.start.positions, (members, 1)),
            factors * np.array(case.start.velocities),
        )
        used, walls = [], []
        for _ in range(rounds + 1):
            begin, busy = time.perf_counter(), time.process_time()
            found = run_ensemble(
                case.problem,
                case.choice,
                positions,
                velocities,
                Grid(0.01, steps, steps),
                {"c": 1e-2},
            )
            walls.append(1e9 * (time.perf_counter() - begin) / members / steps)
            used.append(1e9 * (time.process_time() - busy) / members / steps)
            assert found.completed.all()
        rows.append(
            EnsembleRow(
                case.label, members, (min(used[1:]), statistics.median(used[1:])), min(walls[1:])
            )
        )
    return rows


@dataclass(frozen=True, slots=True)
class LongRow:
    """A long run with energy and both constraints recorded at every step, 1,000 rows kept."""

    case: str
    steps: int
    seconds: float
    growth: float  # MB of resident memory added by the run
    worst: tuple[float, float]  # relative energy error, discrete constraint


def long_rows(report: Report, steps: int = 10**7) -> list[LongRow]:
    rows = []
    for method in ("variational", "nonholonomic"):
        report(f"{steps:,} steps, {method}")
        observed = (DISK_ENERGY, *DISK_CONSTRAINTS)
        choice = MethodChoice(method, 0.5)
        run(DISK, choice, disk_start(), Grid(0.05, 1000, 10), {"c": 1e-2}, observed)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        found = run(
            DISK,
            choice,
            disk_start(),
            Grid(0.05, steps, max(1, steps // 1000)),
            {"c": 1e-2},
            observed,
        )
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        assert found.outcome.completed
        energy = found.series["energy"]
        worst = max(found.maxima["constraint 0"], found.maxima["constraint 1"])
        drift = float(abs(energy / energy[0] - 1).max())
        rows.append(
            LongRow(method, steps, found.run_seconds, (after - before) / 1024, (drift, worst))
        )
    return rows


@dataclass(frozen=True, slots=True)
class EffectRow:
    """The nanoseconds that each observed quantity or potential adds to a step (best of alternating
    rounds).
    """

    case: str
    nanoseconds: float


def effect_rows(report: Report, rounds: int = ROUNDS, steps: int = 10_000) -> list[EffectRow]:
    from benchmarks.problems import ROBOT

    level = problem(
        "theta psi x y", lagrangian="1/2*(x'^2 + y'^2 + theta'^2 + psi'^2)",
        constraints=("x' - cos(theta)*psi'", "y' - sin(theta)*psi'"),
    )  # fmt: skip
    start = Start((0.3, 0.5, 0.0, 0.0), (1.0, 0.3, 0.2866, 0.08866))
    all_three = (DISK_ENERGY, *DISK_CONSTRAINTS)
    variants = {
        "disk, nonholonomic, nothing observed": (DISK, disk_start(), {"c": 1.0}, BARE),
        "… energy": (DISK, disk_start(), {"c": 1.0}, (DISK_ENERGY,)),
        "… energy and both constraints": (DISK, disk_start(), {"c": 1.0}, all_three),
        "robot, nonholonomic, without potential": (level, start, {}, BARE),
        "robot, nonholonomic, with potential": (ROBOT, start, {"k": 1.0}, BARE),
    }
    report("effects")
    best = dict.fromkeys(variants, float("inf"))
    for _ in range(rounds):
        for name, (what, begin, values, observation) in variants.items():
            found = run(
                what,
                MethodChoice("nonholonomic", 0.5),
                begin,
                Grid(0.01, steps, steps),
                values,
                observation,
            )
            assert found.outcome.completed
            best[name] = min(best[name], 1e9 * found.run_seconds / steps)
    return [EffectRow(name, value) for name, value in best.items()]

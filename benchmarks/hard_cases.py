"""Cases in which integrators fail silently: each must end in a right result or in a named
outcome.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.problems import (
    CONTACT,
    CONTACT_ENERGY,
    DISK,
    DISK_CONSTRAINTS,
    DISK_ENERGY,
    DISK_THIRD,
    KNIFE,
    PARTICLE,
    PARTICLE_THIRD,
    PENDULUM,
    ROBOT,
)
from inverse_service.integrators.trajectory import Trajectory
from inverse_service.simulation.execution import run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observation, Problem, Start

TYPED = ("singular", "guard", "no_convergence", "off_domain", "not_finite")
ALPHAS = (0.0, 1 / 5, 1 / 3, 1 / 2, 4 / 5, 1.0)
STEPS = (0.2, 0.1, 0.03)


@dataclass(frozen=True, slots=True)
class HardCase:
    """`allowed` are the correct outcomes; a completed run must be closer than `bound` to the true
    motion.
    """

    group: str
    name: str
    problem: Problem
    choice: MethodChoice
    start: Start
    grid: Grid
    values: dict[str, float]
    bound: float
    allowed: tuple[str, ...] = ("completed",)
    long: bool = False
    observation: Observation = ()


@dataclass(frozen=True, slots=True)
class Judged:
    """A case with its outcome; `error` is `greatest_error` if it completed."""

    case: HardCase
    trajectory: Trajectory
    error: float | None

    @property
    def right(self) -> bool:
        outcome = self.trajectory.outcome
        if outcome.kind not in self.case.allowed:
            return False
        if outcome.kind == "completed":
            return self.error is not None and self.error <= self.case.bound
        return bool(
            outcome.step is not None
            and outcome.time is not None
            and outcome.quantity
            and outcome.remedy
        )


def disk_start(phi: float = 0.3, rate: float = 1.0, roll: float = 0.5) -> Start:
    return Start((phi, 0.0, 0.0, 0.0), (rate, roll, roll * math.cos(phi), roll * math.sin(phi)))


def knife_start(phi: float = 0.3) -> Start:
    return Start((phi, 0.0, 0.0), (1.0, 0.5 * math.cos(phi), 0.5 * math.sin(phi)))


def particle_start(x: float = -0.7) -> Start:
    return Start((x, 0.0, 0.0), (1.0, 0.5, -0.5 * x))


def error_bound(choice: MethodChoice, step: float, span: float) -> float:
    """h^p (1 + T) with p = 2 at alpha = 1/2 and 1 else: far below the size of the motion for small
    steps.
    """
    order = choice.order if choice.alpha == 0.5 else 1
    return abs(step) ** order * (1.0 + span)


def _case(
    group: str,
    name: str,
    problem: Problem,
    choice: MethodChoice,
    start: Start,
    grid: Grid,
    **more: object,
) -> HardCase:
    settings = {
        "values": {"c": 1e-3},
        "bound": error_bound(choice, grid.step, grid.step * grid.steps),
    } | more
    return HardCase(group, name, problem, choice, start, grid, **settings)  # type: ignore[arg-type]


def crossings() -> Iterator[HardCase]:
    """36 runs of disk and knife edge over cos phi = 0 and sin phi = 0, 18 of the particle over x =
    0.
    """
    systems = (
        ("disk", DISK, disk_start()),
        ("knife edge", KNIFE, knife_start()),
        ("particle", PARTICLE, particle_start()),
    )
    for name, problem, start in systems:
        for step in STEPS:
            for alpha in ALPHAS:
                grid = Grid(step, math.ceil(10.0 / step))
                where = "x = 0" if name == "particle" else "cos phi = 0 and sin phi = 0"
                label = f"{name}, h = {step:g}, alpha = {alpha:.3g}"
                choice = MethodChoice("variational", alpha)
                yield _case(f"crossing {where}", label, problem, choice, start, grid)
                raw = MethodChoice("variational", alpha, form="raw")
                yield _case(
                    f"crossing {where}, raw form",
                    label,
                    problem,
                    raw,
                    start,
                    grid,
                    allowed=("singular",),
                )


def crossings_of_others() -> Iterator[HardCase]:
    """The third system and the nonholonomic method pass; the modified method fails where factors do
    not cancel.
    """
    for step in STEPS:
        grid = Grid(step, math.ceil(10.0 / step))
        for alpha in ALPHAS:
            choice, label = MethodChoice("variational", alpha), f"h = {step:g}, alpha = {alpha:.3g}"
            yield _case(
                "crossing, third type", f"disk, {label}", DISK_THIRD, choice, disk_start(), grid
            )
            yield _case(
                "crossing, third type",
                f"particle, {label}",
                PARTICLE_THIRD,
                choice,
                particle_start(),
                grid,
            )
        for name, problem, start in (
            ("disk", DISK, disk_start()),
            ("particle", PARTICLE, particle_start()),
        ):
            for method in ("nonholonomic", "modified"):
                choice, label = (
                    MethodChoice(method, 0.5),
                    f"{name}, {method}, h = {step:g}, alpha = 0.5",
                )
                # The modified method is implicit in L~ itself: its error is that of C = 1 for every
                # C.
                yield _case("crossing, other methods", label, problem, choice, start, grid)
    for alpha in (0.0, 1 / 3, 0.5, 1.0):
        for phi in (0.0, 0.3):
            label = f"knife edge from phi = {phi:g}, alpha = {alpha:.3g}"
            choice, grid = MethodChoice("modified", alpha), Grid(0.05, 200)
            yield _case(
                "crossing, other methods",
                f"{label}, modified",
                KNIFE,
                choice,
                knife_start(phi),
                grid,
            )
            # The mean over alpha and 1 - alpha divides by cos phi at two places, which are on both
            # sides of its zero.
            choice = replace(choice, method="variational", symmetrised=True)
            allowed = ("completed",) if alpha == 0.5 else ("singular",)
            yield _case("crossing, other methods", f"{label}, variational, symmetrised", KNIFE, choice,
                        knife_start(phi), grid, allowed=allowed)  # fmt: skip


def starts() -> Iterator[HardCase]:
    """Runs that start exactly where A vanishes."""
    grid = Grid(0.02, 300)
    places = [("disk, sin phi = 0", DISK, disk_start(0.0)), ("disk, cos phi = 0", DISK, disk_start(math.pi / 2)),
              ("knife edge, sin phi = 0", KNIFE, knife_start(0.0)), ("particle, x = 0", PARTICLE, particle_start(0.0)),
              ("disk of the third type, sin phi = 0", DISK_THIRD, disk_start(0.0)),
              ("particle of the third type, x = 0", PARTICLE_THIRD, particle_start(0.0))]  # fmt: skip
    for name, problem, start in places:
        for method in ("variational", "nonholonomic"):
            if method == "nonholonomic" and "third" in name:
                continue
            for alpha in (0.0, 0.5, 1.0):
                label = f"{name}, {method}, alpha = {alpha:g}"
                yield _case(
                    "start on A = 0", label, problem, MethodChoice(method, alpha), start, grid
                )
    raw = MethodChoice("variational", 0.0, form="raw")
    yield _case("start on A = 0", "disk, sin phi = 0, raw form, alpha = 0", DISK, raw, disk_start(0.0), grid,
                allowed=("singular", "off_domain"))  # fmt: skip


def slow_rates() -> Iterator[HardCase]:
    """r1' from 1 to 1e-3 and 0, with C = 1 and with C ~ mu^-2."""
    for rate in (1.0, 0.1, 0.01, 0.001):
        grid, choice = Grid(0.05, 400), MethodChoice("variational", 0.5)
        start = disk_start(0.3, rate)
        allowed = ("completed", "guard") if rate > 0.05 else ("guard",)
        yield _case("small phi'", f"phi' = {rate:g}, C = 1", DISK, choice, start, grid, values={"c": 1.0},
                    allowed=allowed, bound=0.05)  # fmt: skip
        small = 1e-3 * min(1.0, (rate / 0.5) ** 2)
        yield _case(
            "small phi'",
            f"phi' = {rate:g}, C = {small:.3g}",
            DISK,
            choice,
            start,
            grid,
            values={"c": small},
        )
    for method, form, allowed in (
        ("variational", "hamiltonian", ("off_domain",)), ("variational", "raw", ("off_domain",)),
        ("modified", "hamiltonian", ("off_domain",)), ("nonholonomic", "hamiltonian", ("completed",)),
    ):  # fmt: skip
        choice = MethodChoice(method, 0.5, form=form)
        yield _case("small phi'", f"phi' = 0, {method}, {form} form", DISK, choice, disk_start(0.3, 0.0),
                    Grid(0.05, 400), allowed=allowed)  # fmt: skip


def large_steps() -> Iterator[HardCase]:
    """h far too large: the run must be rejected, or bounded as the scheme itself for methods that
    are explicit here.
    """
    for step in (8.0, 20.0, 100.0):
        for alpha in (0.0, 1 / 3, 0.5, 1.0):
            label = f"disk, C = 1, h = {step:g}, alpha = {alpha:.3g}"
            choice = MethodChoice("variational", alpha)
            yield _case("h far too large", label, DISK, choice, disk_start(), Grid(step, 200), values={"c": 1.0},
                        allowed=("guard", "singular", "no_convergence"))  # fmt: skip
    for step in (2.0, 20.0):
        yield _case("h far too large", f"contact oscillator, nonholonomic, h = {step:g}", CONTACT,
                    MethodChoice("nonholonomic", 0.5), contact_start(), Grid(step, 200), values={"k": 0.3},
                    allowed=("guard",))  # fmt: skip


def contact_start() -> Start:
    return Start((0.3, 0.4, 0.5), (-0.28, 0.2, 0.7))


def stiff() -> Iterator[HardCase]:
    """Potentials k from soft to far beyond what the step resolves."""
    for k, step in ((1.0, 0.01), (1e4, 1e-4), (1e4, 0.1), (1e6, 0.1)):
        resolved = k * step * step < 1
        allowed = ("completed",) if resolved else ("singular", "guard", "no_convergence")
        bound = 20 * k * step * step
        pendulum = Start((0.5,), (0.3,))
        yield _case("stiff potential", f"pendulum, k = {k:g}, h = {step:g}", PENDULUM, MethodChoice("variational", 0.5),
                    pendulum, Grid(step, 400), values={"k": k}, allowed=allowed, bound=bound)  # fmt: skip
        raw = MethodChoice("variational", 0.5, form="raw")
        yield _case("stiff potential", f"pendulum, raw form, k = {k:g}, h = {step:g}", PENDULUM, raw,
                    pendulum, Grid(step, 400), values={"k": k}, allowed=allowed, bound=bound)  # fmt: skip
        start = Start((0.3, 0.5, 0.0, 0.0), (1.0, 0.3, 0.3 * math.cos(0.3), 0.3 * math.sin(0.3)))
        yield _case("stiff potential", f"robot, k = {k:g}, h = {step:g}", ROBOT, MethodChoice("nonholonomic", 0.5),
                    start, Grid(step, 400), values={"k": k}, allowed=allowed, bound=bound)  # fmt: skip


def near_singular() -> Iterator[HardCase]:
    """The modified method at alpha = 0 reaches 1 + (theta'^2/phi'^3)(cos phi + sin phi) = 0 by
    itself.
    """
    start = disk_start()
    discrete = Start(start.positions, start.velocities, convention="discrete_constraint")
    yield _case("near-singular Newton", "disk, modified, alpha = 0, h = 0.2", DISK, MethodChoice("modified", 0.0),
                discrete, Grid(0.2, 500), values={"c": 1.0}, allowed=("singular",))  # fmt: skip
    for roll, step in ((1.0, 0.05), (1.5, 0.02), (3.0, 0.01)):
        yield _case("near-singular Newton", f"disk, modified, alpha = 0, theta' = {roll:g}", DISK,
                    MethodChoice("modified", 0.0), disk_start(0.3, 1.0, roll), Grid(step, 2000), values={"c": 1.0},
                    allowed=("singular",))  # fmt: skip
    yield _contract_scene()


def _contract_scene() -> HardCase:
    """phi' = theta' = 1 and C = 1: 1 + cos phi + sin phi vanishes at phi = pi."""
    start = disk_start(0.1, 1.0, 1.0)
    return _case("near-singular Newton", "disk, modified, alpha = 0, phi' = theta' = 1, h = 0.05", DISK,
                 MethodChoice("modified", 0.0), start, Grid(0.05, 2000), values={"c": 1.0},
                 allowed=("singular",))  # fmt: skip


def non_reversible() -> Iterator[HardCase]:
    """A contact oscillator with a magnetic term and an asymmetric driver: no reflection reverses
    time.
    """
    for order, bound in ((2, 0.06), (4, 1e-3), (8, 1e-7)):
        yield _case("not reversible", f"contact oscillator, nonholonomic, order {order}", CONTACT,
                    MethodChoice("nonholonomic", 0.5, order=order), contact_start(), Grid(0.05, 2000, 10),
                    values={"k": 0.3}, bound=bound, observation=(CONTACT_ENERGY,))  # fmt: skip


def long_runs() -> Iterator[HardCase]:
    """10^6 and 10^7 steps, with energy and constraint recorded along the run."""
    observed = (DISK_ENERGY, *DISK_CONSTRAINTS)
    for count in (10**6, 10**7):
        for method in ("variational", "nonholonomic"):
            # The phase of the variational disk drifts at a rate of order C h^2.
            yield _case("long", f"disk, {method}, alpha = 0.5, {count:,} steps", DISK, MethodChoice(method, 0.5),
                        disk_start(), Grid(0.05, count, count // 1000), values={"c": 1e-8}, bound=2e-3,
                        observation=observed, long=count > 10**6)  # fmt: skip


def all_cases() -> list[HardCase]:
    """Every case; `long` ones take seconds."""
    groups = (
        crossings,
        crossings_of_others,
        starts,
        slow_rates,
        large_steps,
        stiff,
        near_singular,
        non_reversible,
    )
    return [case for group in (*groups, long_runs) for case in group()]


def judge(case: HardCase) -> Judged:
    """Run the case and measure it against the true motion."""
    found = run(case.problem, case.choice, case.start, case.grid, case.values, case.observation)
    return Judged(case, found, greatest_error(case, found) if found.outcome.completed else None)


def greatest_error(case: HardCase, found: Trajectory) -> float:
    """The greatest difference of a coordinate from the true motion, relative where the coordinate
    exceeds 1.
    """
    true = true_positions(case, found)
    return float((np.abs(found.positions - true) / np.maximum(1.0, np.abs(true).max(axis=0))).max())


def true_positions(case: HardCase, found: Trajectory) -> NDArray[np.float64]:
    assert case.start.velocities is not None
    q, v, t = np.array(case.start.positions), np.array(case.start.velocities), found.times
    if case.problem in (DISK, DISK_THIRD):
        return _disk_motion(q, v, t)
    # The reference takes substeps until its own series of stages is resolved.
    parts = max(
        1, math.ceil(abs(case.grid.step) * math.sqrt(1.0 + abs(case.values.get("k", 0.0))) / 0.05)
    )
    grid = Grid(case.grid.step / parts, case.grid.steps * parts, parts * case.grid.record_every)
    return run(case.problem, MethodChoice("reference"), case.start, grid, case.values).positions


def _disk_motion(
    q: NDArray[np.float64], v: NDArray[np.float64], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Circles of radius theta'/phi'; straight lines where phi' = 0."""
    phi, theta = q[0] + v[0] * t, q[1] + v[1] * t
    if v[0] == 0:
        return np.stack([phi, theta, q[2] + v[2] * t, q[3] + v[3] * t], axis=1)
    # sin a - sin b = 2 cos((a + b)/2) sin((a - b)/2) loses no digits where phi' t is small.
    half, middle = v[0] * t / 2, q[0] + v[0] * t / 2
    chord = 2 * v[1] / v[0] * np.sin(half)
    return np.stack(
        [phi, theta, q[2] + chord * np.cos(middle), q[3] + chord * np.sin(middle)], axis=1
    )

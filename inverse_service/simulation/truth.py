"""The true motion that methods are compared with: exact where it is known, else two references that agree."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.simulation.choices import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.derivation import Derived, with_accelerations
from inverse_service.simulation.exact_motion import ExactMotion, positions_of
from inverse_service.simulation.methods import run
from inverse_service.simulation.scene import Scene, Unavailable

Array = NDArray[np.float64]
AGREEMENT = 1e-11
MOST_STEPS = 4_000_000
SECOND_REFINEMENT = 4


@dataclass(frozen=True, slots=True)
class Truth:
    """Positions (m, n) at the recorded times; `uncertainty` is how far the two references are apart (0: exact)."""

    positions: Array
    against: str
    uncertainty: float
    seconds: float


def recorded_times(grid: Grid) -> Array:
    """t = k h at the recorded steps, the start first; the last step is always recorded."""
    steps = list(range(0, grid.steps + 1, grid.record_every))
    if steps[-1] != grid.steps:
        steps.append(grid.steps)
    found: Array = grid.step * np.array(steps, dtype=float)
    return found


def true_rows(truth: Truth, grid: Grid, times: Array) -> Array:
    """The true positions at the times of a trajectory, (len(times), n); nan at a time that is none of the grid's."""
    known = recorded_times(grid)
    places = np.clip(np.searchsorted(known, times - 0.5 * grid.step), 0, len(known) - 1)
    found = truth.positions[places].copy()
    found[np.abs(known[places] - times) > 1e-6 * grid.step] = np.nan
    return found


def true_motion(scene: Scene, derived: Derived) -> Truth | Unavailable:
    """The true positions at the recorded times of the scene, or why they are not known."""
    begun = time.perf_counter()
    if isinstance(derived.exact, ExactMotion):
        try:
            positions, _ = positions_of(derived.exact, scene.positions, scene.velocities, recorded_times(scene.grid))
        except ValueError as error:
            return Unavailable(f"The exact solution ends: {error}.")
        return Truth(positions, "exact", 0.0, time.perf_counter() - begun)
    return _references(scene, derived, begun)


def exact_trajectory(scene: Scene, derived: Derived) -> Trajectory | Unavailable:
    """The exact solution as a trajectory, at the recorded times."""
    if not isinstance(derived.exact, ExactMotion):
        reason = derived.exact.reason if derived.exact is not None else "It was not asked for."
        return Unavailable(f"No exact solution is known for this scene. {reason}")
    begun = time.perf_counter()
    times = recorded_times(scene.grid)
    try:
        positions, velocities = positions_of(derived.exact, scene.positions, scene.velocities, times)
    except ValueError as error:
        return Unavailable(f"The exact solution ends: {error}.")
    return Trajectory(
        times=times,
        positions=positions,
        momenta=None,
        velocities=np.array(velocities),
        outcome=Outcome("completed"),
        force_evaluations=0,
        newton_iterations=0,
        compile_seconds=0.0,
        run_seconds=time.perf_counter() - begun,
    )


def _references(scene: Scene, derived: Derived, begun: float) -> Truth | Unavailable:
    """Gauss-Legendre of order 12 and explicit Runge-Kutta of order 8, both refined until they agree."""
    refinement, nearest = 1, np.inf
    found: Array | None = None
    while refinement * SECOND_REFINEMENT * scene.grid.steps <= MOST_STEPS:
        first = reference_run(scene, derived, MethodChoice("reference"), refinement)
        second = reference_run(scene, derived, MethodChoice("runge_kutta", order=8), SECOND_REFINEMENT * refinement)
        for one in (first, second):
            if isinstance(one, Unavailable):
                return one
        assert isinstance(first, Trajectory)
        assert isinstance(second, Trajectory)
        if first.outcome.completed and second.outcome.completed:
            apart = float((np.abs(first.positions - second.positions) / (1 + np.abs(first.positions))).max())
            gained = apart < 0.5 * nearest
            if apart < nearest:
                nearest, found = apart, first.positions
            if apart <= AGREEMENT or not gained:
                break
        refinement *= 2
    if found is None:
        return Unavailable("No reference solution was found: the two reference integrators did not get through.")
    return Truth(found, "reference", nearest, time.perf_counter() - begun)


def reference_run(
    scene: Scene, derived: Derived, choice: MethodChoice, refinement: int, observation: Observation | None = None
) -> Trajectory | Unavailable:
    """One reference with steps `refinement` times smaller, recorded at the times of the scene."""
    problem = with_accelerations(scene, derived)
    if isinstance(problem, Unavailable):
        return problem
    grid = scene.grid
    finer = replace(
        grid, step=grid.step / refinement, steps=grid.steps * refinement, record_every=grid.record_every * refinement
    )
    start = Start(tuple(scene.positions), velocities=tuple(scene.velocities))
    plain = observation or Observation(momenta=False, velocities=False)
    return run(problem, choice, start, finer, dict(scene.values), plain)

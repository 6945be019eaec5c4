"""Runs of a problem by a method: the one door to the integrators."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from inverse_service.integrators.trajectory import Trajectory
from inverse_service.simulation.choices import Grid, MethodChoice, Observable, Observation, Start
from inverse_service.simulation.problem import Problem

__all__ = [
    "Grid", "MethodChoice", "Observable", "Observation", "Problem", "Start", "available", "run", "run_ensemble",
]  # fmt: skip

Stop = Callable[[], bool]


def available(problem: Problem) -> tuple[str, ...]:
    """The methods that have what they need: "variational" wants L~ or H~, "nonholonomic" L, "modified" all."""
    known = {
        "variational": problem.free_hamiltonian is not None or problem.free_lagrangian is not None,
        "nonholonomic": problem.lagrangian is not None,
        "modified": bool(problem.free_lagrangian and problem.constraints),
        "runge_kutta": problem.accelerations is not None,
        "reference": problem.accelerations is not None,
        "heyoka": problem.accelerations is not None,
    }
    return tuple(name for name, has in known.items() if has)


def run(
    problem: Problem,
    choice: MethodChoice,
    start: Start,
    grid: Grid,
    values: Mapping[str, float],
    observation: Observation | None = None,
    stop: Stop | None = None,
) -> Trajectory:
    """One trajectory; `values` gives every parameter (free constants too) a number.

    Where the method cannot go on, the outcome says so and the rows up to there are kept. InputError for a choice
    that the problem does not allow. `stop` is asked about ten times a second; True ends the run as "cancelled".
    """
    raise NotImplementedError


def run_ensemble(
    problem: Problem,
    choice: MethodChoice,
    starts: Sequence[Start],
    grids: Sequence[Grid],
    values: Sequence[Mapping[str, float]],
    alphas: Sequence[float] | None = None,
    observation: Observation | None = None,
) -> list[Trajectory]:
    """Many trajectories in one call, side by side in SIMD lanes and on all cores.

    Sequences of length one are used for all. All grids have the same steps and record_every; h, alpha, parameters
    and starts may differ.
    """
    raise NotImplementedError

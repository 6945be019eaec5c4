"""Runs of a problem by a method: the one door to the integrators."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.simulation.choices import OWN_STEPS, SCIPY, Grid, MethodChoice, Observable, Observation, Start
from inverse_service.simulation.execution import execute, memory_of
from inverse_service.simulation.formulas import MOMENT, Formulas
from inverse_service.simulation.guard import refusal
from inverse_service.simulation.heyoka_reference import run_heyoka
from inverse_service.simulation.monotone import has_unique_roots
from inverse_service.simulation.outcomes import failed_start, trajectory_of
from inverse_service.simulation.preparation import check, kernel_of, lane_of, parameter_values, weights_of
from inverse_service.simulation.problem import Problem
from inverse_service.simulation.schemes import program_of
from inverse_service.simulation.scipy_peers import run_scipy
from inverse_service.simulation.starting import Initial, initial
from inverse_service.simulation.watches import RESOLVE

__all__ = [
    "Grid", "MethodChoice", "Observable", "Observation", "Problem", "Start", "available", "run",
]  # fmt: skip

MONOTONE = "The step is far beyond what the guard allows, but its equation is monotone: the root found is the only one."
NO_GUARD = "The guard was off: that each step took the root that belongs to small steps was not checked."
FEW, MANY, HALF = 4, 4096, 0.5
Stop = Callable[[], bool]


def available(problem: Problem) -> tuple[str, ...]:
    """The methods that have what they need: "variational" wants L~ or H~, "nonholonomic" L, "modified" all."""
    known = {
        "variational": problem.free_hamiltonian is not None or problem.free_lagrangian is not None,
        "nonholonomic": problem.lagrangian is not None,
        "modified": bool(problem.free_lagrangian and problem.constraints),
        "runge_kutta": problem.accelerations is not None,
    }
    known |= dict.fromkeys(("reference", "adaptive", "stiff", "heyoka"), problem.accelerations is not None)
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
    check(problem, choice, [grid])
    observation = observation or Observation()
    if choice.method == "heyoka":
        return run_heyoka(problem, start, grid, values, observation, choice.tolerance, stop)
    if choice.method in SCIPY:
        return run_scipy(problem, choice, start, grid, values)
    formulas = Formulas(problem)
    parameters = parameter_values(problem, values)
    begin = initial(formulas, choice, start, grid.step, parameters | {str(MOMENT): grid.begin})
    refused = begin.missing or refusal(formulas, choice, begin, grid, parameters)
    if refused:
        return failed_start(start, refused, grid.begin)
    if choice.guard and choice.method not in OWN_STEPS and grid.steps >= FEW:
        unresolved = _first_steps(formulas, choice, begin, grid, parameters)
        if unresolved is not None:
            return failed_start(start, unresolved, grid.begin)
    found = _run(formulas, choice, begin, grid, parameters, observation, stop)
    if found.outcome.kind == "guard" and _is_monotone(formulas, choice, grid, parameters):
        found = _run(formulas, replace(choice, guard=False), begin, grid, parameters, observation, stop)
        return replace(found, outcome=replace(found.outcome, note=MONOTONE))
    return found if choice.guard else replace(found, outcome=replace(found.outcome, note=NO_GUARD))


def _run(
    formulas: Formulas, choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float],
    observation: Observation, stop: Stop | None,
) -> Trajectory:  # fmt: skip
    kernel = kernel_of(formulas, choice, observation)
    memory = memory_of(kernel.card, [lane_of(choice, begin, grid, parameters)])
    done = execute(kernel, memory, weights_of(choice), grid, stop)
    return trajectory_of(formulas, choice, kernel, done, 0, begin, grid, observation)


def _first_steps(
    formulas: Formulas, choice: MethodChoice, begin: Initial, grid: Grid, parameters: Mapping[str, float]
) -> Outcome | None:
    """The outcome where FEW steps lead elsewhere than MANY over the same time: what is watched later sees only what
    steps have met. None where both agree, or where one of them fails, which the run will say itself."""
    bare = Observation(momenta=False, velocities=False)
    ends = []
    for count in (FEW, MANY):
        short = replace(grid, step=FEW * grid.step / count, steps=count, record_every=count)
        found = _run(formulas, choice, begin, short, parameters, bare, None)
        if not found.outcome.completed:
            return None
        ends.append(found.positions[-1] - found.positions[0])
    apart, moved = (float(np.linalg.norm(difference)) for difference in (ends[0] - ends[1], ends[1]))
    if not apart > HALF * moved:
        return None
    return Outcome("unresolved", 0, grid.begin, f"the first {FEW} steps beside {MANY} shorter ones", apart, RESOLVE)


def _is_monotone(formulas: Formulas, choice: MethodChoice, grid: Grid, parameters: Mapping[str, float]) -> bool:
    """Whether each substep has one root only, whatever the guard says."""
    if formulas.depends_on_time:
        return False
    program = program_of(formulas, choice, Observation(momenta=False, velocities=False))
    known = {"a": choice.alpha, **parameters}
    substeps = {weight * grid.step for weight in weights_of(choice)}
    return all(has_unique_roots(program, known | {"h": step}) for step in substeps)

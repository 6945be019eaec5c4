"""Ensembles: trajectories side by side in SIMD lanes, groups of lanes on all cores."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TypeVar

from inverse_service.codegen.digests import processor_features
from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Trajectory
from inverse_service.simulation.choices import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.execution import execute, memory_of
from inverse_service.simulation.formulas import Formulas
from inverse_service.simulation.guard import refusal
from inverse_service.simulation.outcomes import failed_start, trajectory_of
from inverse_service.simulation.problem import Problem
from inverse_service.simulation.starting import Initial, initial

Item = TypeVar("Item")


def lanes_here() -> int:
    """Doubles that a core takes at once."""
    return 8 if "+avx512f" in processor_features() else 4


def cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_lanes(
    problem: Problem,
    choice: MethodChoice,
    starts: Sequence[Start],
    grids: Sequence[Grid],
    values: Sequence[Mapping[str, float]],
    alphas: Sequence[float] | None,
    observation: Observation,
) -> list[Trajectory]:
    """See `methods.run_ensemble`."""
    from inverse_service.simulation import methods

    size = max(len(starts), len(grids), len(values), len(alphas or ()))
    starts, grids, values = _spread(starts, size), _spread(grids, size), _spread(values, size)
    choices = [replace(choice, alpha=alpha) for alpha in _spread(alphas or [choice.alpha], size)]
    if len({(grid.steps, grid.record_every) for grid in grids}) > 1:
        raise InputError("The grids of an ensemble must have the same steps and record_every.")
    for item in choices:
        methods.check(problem, item, [])
    formulas = Formulas(problem)
    parameters = [methods.parameter_values(problem, item) for item in values]
    begins = [
        initial(formulas, item, start, grid.step, given)
        for item, start, grid, given in zip(choices, starts, grids, parameters, strict=True)
    ]
    lanes = lanes_here()
    results: dict[int, Trajectory] = {}
    for k, begin in enumerate(begins):
        refused = begin.missing or refusal(formulas, choices[k], begin, grids[k], parameters[k])
        if refused:
            results[k] = failed_start(starts[k], refused)
    groups = _groups(choices, [k for k in range(size) if k not in results], lanes)

    def work(group: list[int]) -> list[tuple[int, Trajectory]]:
        kernel = methods.kernel_of(formulas, choices[group[0]], observation, lanes)
        padded = group + [group[-1]] * (lanes - len(group))
        memory = memory_of(
            kernel.card, [methods.lane_of(choices[k], begins[k], grids[k], parameters[k]) for k in padded]
        )
        done = execute(kernel, memory, methods.weights_of(choice), grids[group[0]])
        return [
            (k, trajectory_of(formulas, choices[k], kernel, done, lane, begins[k], grids[k], observation))
            for lane, k in enumerate(group)
        ]

    with ThreadPoolExecutor(cores()) as pool:
        for part in pool.map(work, groups):
            results.update(part)
    return [results[k] for k in range(size)]


def _spread(items: Sequence[Item], size: int) -> list[Item]:
    if len(items) not in (1, size):
        raise InputError(f"An ensemble of {size} needs 1 or {size} of each of its settings.")
    return list(items) * size if len(items) == 1 else list(items)


def _groups(choices: Sequence[MethodChoice], members: Sequence[int], lanes: int) -> list[list[int]]:
    """Members of the same kernel, `lanes` at a time; alpha = 0 and 1 have kernels of their own."""
    kinds: dict[float, list[int]] = {}
    for k in members:
        alpha = choices[k].alpha
        kinds.setdefault(alpha if alpha in (0.0, 0.5, 1.0) else -1.0, []).append(k)
    return [same[first : first + lanes] for same in kinds.values() for first in range(0, len(same), lanes)]


__all__ = ["Initial", "cores", "lanes_here", "run_lanes"]

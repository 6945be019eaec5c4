"""Ensembles: trajectories side by side in SIMD lanes, groups of lanes on all cores."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.machine_code.processor import processor_features
from inverse_service.simulation.choices import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.execution import execute, memory_of
from inverse_service.simulation.formulas import MOMENT, Formulas
from inverse_service.simulation.guard import refusal
from inverse_service.simulation.outcomes import failed_start, trajectory_of
from inverse_service.simulation.preparation import check, kernel_of, lane_of, parameter_values, weights_of
from inverse_service.simulation.problem import Problem
from inverse_service.simulation.starting import Initial, initial

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Member:
    """One trajectory of an ensemble, ready to run; `parameters` by kernel name."""

    choice: MethodChoice
    start: Start
    grid: Grid
    parameters: Mapping[str, float]
    begin: Initial


def lanes_here() -> int:
    """Doubles that a core takes at once."""
    return 8 if "+avx512f" in processor_features() else 4


def cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
    check(problem, choice, grids)
    if choice.method == "heyoka":
        raise InputError("heyoka runs one trajectory at a time here: use another method for an ensemble.")
    size = max(len(starts), len(grids), len(values), len(alphas or ()))
    choices = [replace(choice, alpha=alpha) for alpha in _spread(alphas or [choice.alpha], size)]
    grids = _spread(grids, size)
    if len({(grid.steps, grid.record_every) for grid in grids}) > 1:
        raise InputError("The grids of an ensemble must have the same steps and record_every.")
    formulas = Formulas(problem)
    members = _members(formulas, choices, _spread(starts, size), grids, _spread(values, size))
    results = {k: failed_start(item.start, why) for k, item in enumerate(members) if (why := _refusal(formulas, item))}
    groups = _groups(choices, [k for k in range(size) if k not in results], lanes_here())
    observed = observation or Observation()
    with ThreadPoolExecutor(cores()) as pool:
        runs = pool.map(lambda group: _run_group(formulas, [members[k] for k in group], observed), groups)
        for group, trajectories in zip(groups, runs, strict=True):
            results.update(zip(group, trajectories, strict=True))
    return [results[k] for k in range(size)]


def _members(
    formulas: Formulas, choices: Sequence[MethodChoice], starts: Sequence[Start], grids: Sequence[Grid],
    values: Sequence[Mapping[str, float]],
) -> list[Member]:  # fmt: skip
    members = []
    for choice, start, grid, given in zip(choices, starts, grids, values, strict=True):
        check(formulas.problem, choice, [])
        numbers = parameter_values(formulas.problem, given)
        members.append(
            Member(
                choice,
                start,
                grid,
                numbers,
                initial(formulas, choice, start, grid.step, numbers | {str(MOMENT): grid.begin}),
            )
        )
    return members


def _refusal(formulas: Formulas, member: Member) -> Outcome | None:
    return member.begin.missing or refusal(formulas, member.choice, member.begin, member.grid, member.parameters)


def _run_group(formulas: Formulas, group: Sequence[Member], observation: Observation) -> list[Trajectory]:
    """One kernel call; lanes that are left over repeat the last member."""
    lanes = lanes_here()
    first = group[0]
    kernel = kernel_of(formulas, first.choice, observation, lanes)
    padded = [*group, *[group[-1]] * (lanes - len(group))]
    memory = memory_of(kernel.card, [lane_of(m.choice, m.begin, m.grid, m.parameters) for m in padded])
    done = execute(kernel, memory, weights_of(first.choice), first.grid)
    return [
        trajectory_of(formulas, m.choice, kernel, done, lane, m.begin, m.grid, observation)
        for lane, m in enumerate(group)
    ]


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

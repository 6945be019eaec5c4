"""Two independent references: our Gauss-Legendre collocation and heyoka's Taylor series."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inverse_service.integrators.trajectory import Trajectory
from inverse_service.simulation.choices import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.methods import run
from inverse_service.simulation.problem import Problem

TOLERANCE = 1e-13


@dataclass(frozen=True, slots=True)
class Agreement:
    """`difference` is the greatest difference of positions over the size of the motion; inf where one stopped."""

    agree: bool
    difference: float
    ours: Trajectory
    theirs: Trajectory


def references_agree(
    problem: Problem, start: Start, grid: Grid, values: Mapping[str, float], tolerance: float = TOLERANCE
) -> Agreement:
    """Run both references on the grid; InputError where heyoka is not installed.

    `tolerance` grows with the square root of the number of steps, as round-off does.
    """
    bare = Observation(velocities=False)
    ours, theirs = (run(problem, MethodChoice(name), start, grid, values, bare) for name in ("reference", "heyoka"))
    if not (ours.outcome.completed and theirs.outcome.completed):
        return Agreement(False, float("inf"), ours, theirs)
    size = max(1.0, float(np.abs(ours.positions).max()))
    difference = float(np.abs(ours.positions - theirs.positions).max()) / size
    return Agreement(difference <= tolerance * max(1.0, grid.steps) ** 0.5, difference, ours, theirs)

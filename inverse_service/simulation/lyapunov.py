"""The largest Lyapunov exponent of a motion, from its variational equations.

    w_i'' = sum_j (df_i/dq_j) w_j + (df_i/dq_j') w_j'

are integrated beside q'' = f by DOP853; w is brought back to length 1 after each of PARTS parts of the run. The mean
of log |w| over time is the exponent. G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import Expression, Symbol, Velocity, add, multiply
from inverse_service.simulation.choices import Grid, MethodChoice, Observation, Start
from inverse_service.simulation.methods import run
from inverse_service.simulation.problem import Problem
from inverse_service.simulation.scene import Scene

PARTS = 200
CHOICE = MethodChoice("adaptive", tolerance=1e-10)
BARE = Observation(momenta=False)
ENDED = "The motion ends at t = {:.6g}, before the exponent has settled."


def largest_exponent(
    scene: Scene, accelerations: tuple[Expression, ...], stop: Callable[[], bool] | None = None
) -> dict[str, Any]:
    """{largest, half, time}: the exponent over the whole run and over its first half, which tells how settled it is."""
    problem = with_tangent(scene, accelerations)
    n, length = len(scene.coordinates), scene.grid.step * scene.grid.steps
    tangent = np.ones(2 * n) / np.sqrt(2 * n)
    positions, velocities = scene.positions, scene.velocities
    total, halves = 0.0, []
    for part in range(PARTS):
        begin = scene.grid.begin + part * length / PARTS
        start = Start((*positions, *tangent[:n]), velocities=(*velocities, *tangent[n:]))
        found = run(problem, CHOICE, start, Grid(length / PARTS, 1, 1, begin), dict(scene.values), BARE, stop)
        if not found.outcome.completed or found.velocities is None:
            return {"largest": None, "note": ENDED.format(begin)}
        positions, velocities = found.positions[-1, :n], found.velocities[-1, :n]
        tangent = np.concatenate([found.positions[-1, n:], found.velocities[-1, n:]])
        size = float(np.linalg.norm(tangent))
        total, tangent = total + float(np.log(size)), tangent / size
        halves.append(total)
    return {"largest": total / length, "half": halves[PARTS // 2 - 1] / (length / 2), "time": length}


def with_tangent(scene: Scene, accelerations: tuple[Expression, ...]) -> Problem:
    """The motion with its variational equations; the tangent of x has a name that no formula uses."""
    names = scene.coordinates
    tangents = tuple(f"tangent_of_{name}" for name in names)
    rows = []
    for force in accelerations:
        terms = [multiply(differentiate(force, Symbol(x)), Symbol(w)) for x, w in zip(names, tangents, strict=True)]
        terms += [
            multiply(differentiate(force, Velocity(x)), Velocity(w)) for x, w in zip(names, tangents, strict=True)
        ]
        rows.append(collect(add(*terms)))
    return Problem((*names, *tangents), tuple(scene.values), accelerations=(*accelerations, *rows))

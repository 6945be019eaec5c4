"""Which coordinates stay at rest, although round-off in the solution of the linear equations would
move them.

The coordinates K with v_K = 0 stay at rest if their accelerations vanish wherever the others are: a
disk that falls over keeps its heading. In doubles the terms of such an acceleration leave
round-off, which grows where the masses of these coordinates nearly vanish. That it is round-off is
seen at several places and velocities of the others, on the constraints, from states that differ in
their last bits. A force on what moves later, or next to an unstable equilibrium, is none at one
place only.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.integrators.trajectory import Array
from inverse_service.kernels.codegen.looped import HELD
from inverse_service.simulation import scene_data as data, scene_graph
from inverse_service.simulation.scene_graph import PARAMETER, SceneGraph, graph_of

PLACES, SAMPLES = 4, 6  # of the others, and states with other last bits at each
LAST_BITS = 5 * 2.0**-52  # of a number: by how much such states differ
TIMES = 4.0  # the greatest difference: what may be round-off
FAR = 0.3  # of their size: how far the others are moved
MOST_ROUNDS = 12  # in which coordinates turn out to move
Mask = NDArray[np.bool_]


def held(problem: data.Problem, columns: Mapping[str, Any]) -> dict[str, Any]:
    """{name in a kernel: 1 or 0}, numbers or (N,), from the numbers of a kernel by name; empty
    where nothing stays.
    """
    scene, n = graph_of(problem), len(problem.coordinates)
    if problem.lagrangian is None or not _has_changing_masses(problem):
        return {}
    names = [*(f"{letter}{k}" for letter in "qv" for k in range(n)), "t",
             *(f"c{k}" for k in range(len(problem.parameters)))]  # fmt: skip
    rows = np.stack(np.broadcast_arrays(*(np.atleast_1d(columns.get(x, 0.0)) for x in names)), -1)
    still: Mask = np.equal(rows[:, n : 2 * n], 0.0)
    if not still.any():
        return {}
    found = np.zeros(still.shape)
    for row in np.flatnonzero(still.any(axis=1)):
        found[row] = _staying(scene, rows[row], still[row])
    if not found.any():
        return {}
    single = not any(np.ndim(columns.get(name, 0.0)) for name in names)
    return {f"{HELD}{k}": found[0, k] if single else found[:, k] for k in range(n)}


@lru_cache(maxsize=64)
def _has_changing_masses(problem: data.Problem) -> bool:
    """Whether round-off can grow by masses that nearly vanish."""
    scene = graph_of(problem)
    return any(scene.graph.masks[node] & ~PARAMETER for node in scene.linear[1].values())


def _staying(scene: SceneGraph, numbers: Array, still: Mask) -> Mask:
    """Which of the coordinates that are still at these numbers (2 n + 1 + parameters,) stay, (n,)."""
    n, random = scene.size, np.random.default_rng(11)
    sizes = np.abs(numbers[: 2 * n])
    greatest = np.repeat([sizes[:n].max(), sizes[n:].max()], n)
    sizes += FAR * np.where(greatest, greatest, greatest.max() or 1.0)
    for _ in range(MOST_ROUNDS):
        if not still.any():
            break
        places = np.tile(numbers, (PLACES, 1))
        moved = ~np.tile(still, 2)
        away = FAR * random.normal(size=(PLACES - 1, 2 * n)) * sizes
        places[1:, : 2 * n] += np.where(moved, away, 0.0)
        places[1:, 2 * n] += FAR * random.normal(size=PLACES - 1) * (1 + abs(numbers[2 * n]))
        places[1:, n : 2 * n] -= _off_constraints(scene, places[1:], still)
        worst = _ratios(scene, places, random)
        if worst is None:
            return np.zeros(n, dtype=bool)
        stays = still & (worst <= TIMES)
        if (stays == still).all():
            break
        still = stays
    else:
        return np.zeros(n, dtype=bool)
    return still


def _off_constraints(scene: SceneGraph, places: Array, still: Mask) -> Array:
    """What velocities of the others have to lose to be on the constraints, (places, n)."""
    count, n, m = len(places), scene.size, len(scene.constraints)
    lost = np.zeros((count, n))
    if not m:
        return lost
    inputs = _inputs(scene, places)
    rows = np.zeros((count, m, n))
    for (a, k), value in zip(
        scene.forms, scene.values([*scene.forms.values()], inputs, count), strict=True
    ):
        rows[:, a, k] = value
    rows[:, :, still] = 0.0
    defects = scene.values(scene.constraints, inputs, count).T
    for place in range(count):
        if np.isfinite(rows[place]).all() and np.isfinite(defects[place]).all():
            lost[place] = np.linalg.lstsq(rows[place], defects[place], rcond=1e-10)[0]
    return lost


def _ratios(scene: SceneGraph, places: Array, random: np.random.Generator) -> Array | None:
    """The greatest ratio of each acceleration to its round-off among the places, (n,); None where
    fewer than two of them have accelerations.
    """
    shares = random.integers(-5, 6, size=(len(places), SAMPLES, places.shape[1])) / 5
    shares[:, 0] = 0.0
    states = (places[:, None] * (1 + LAST_BITS * shares)).reshape(-1, places.shape[1])
    found = _accelerations(scene, states, random).reshape(len(places), SAMPLES, scene.size)
    own, spread = np.abs(found[:, 0]), np.abs(found - found[:, :1]).max(axis=1)
    good: Mask = np.asarray(np.isfinite(found).all(axis=(1, 2)))
    if good.sum() < 2 or not good[0]:
        return None
    with np.errstate(all="ignore"):
        ratios = np.where(own == 0.0, 0.0, own / spread)
    return np.asarray(ratios[good].max(axis=0))


def _accelerations(scene: SceneGraph, states: Array, random: np.random.Generator) -> Array:
    """Those of the linear equations, (states, n), nan where they are singular."""
    count, n = len(states), scene.size
    right, entries = scene.linear
    inputs = _inputs(scene, states)
    values = scene.values([*right, *entries.values()], inputs, count)
    values = values * (1 + 2.0**-52 * random.uniform(-1, 1, size=values.shape))
    matrix = scene_graph.filled_matrices(entries, values[len(right) :], len(right))
    return scene_graph.solved_rows(matrix, values[: len(right)].T)[:, :n]


def _inputs(scene: SceneGraph, states: Array) -> dict[int, Any]:
    n = scene.size
    values = dict(zip(scene.problem.parameters, states[:, 2 * n + 1 :].T, strict=True))
    return scene.inputs(states[:, :n], states[:, n : 2 * n], values, states[:, 2 * n])

"""The largest Lyapunov exponent of a motion, from its variational equations

    w_i'' = sum_j (df_i/dq_j) w_j + (df_i/dq_j') w_j'

integrated with q'' = f by `adaptive`. Those of a Lagrangian are the Lagrange equations of its
complete lift L_q w + L_v w' in (q, w), with the constraints and their lifts, and the forces (Q_q w
+ Q_v w', Q): K. Yano, S. Ishihara, Tangent and Cotangent Bundles, 1973. w is brought back to length
1 after each of PARTS parts of the run. The mean of log |w| over time is the exponent. G. Benettin,
L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9.
"""

from typing import Any

import numpy as np

from inverse_service.expressions import arrays, calculus, collecting, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import (
    derivation,
    execution,
    numeric_formulas as nf,
    scene_data as data,
)
from inverse_service.simulation.sentences import say

PARTS = 200
CHOICE = data.MethodChoice("adaptive", tolerance=1e-10)


def with_tangent(motion: data.Problem) -> data.Problem:
    """The motion with its variational equations, in (q, w); the w of x has a name that no formula
    uses.
    """
    names = motion.coordinates
    tangents = tuple(f"tangent_of_{name}" for name in names)
    pairs = list(zip(nf.state_names(names), nf.state_names(tangents), strict=True))

    def lifted(tree: ex.Expression) -> ex.Expression:
        found = ex.add(*(calculus.differentiate(tree, x) * w for x, w in pairs))
        return collecting.collect(found) if motion.accelerations is not None else found

    moving, given = (*names, *tangents), motion.accelerations
    if given is not None:
        whole = (*given, *map(lifted, given))
        return data.Problem(moving, motion.parameters, accelerations=whole)
    assert motion.lagrangian is not None
    still = (ex.ZERO,) * len(names)
    rows = [euler_lagrange.momenta(w, names) for w in motion.constraints]
    pulls = [(*map(lifted, row), *row) for row in rows] + [(*row, *still) for row in rows]
    return data.Problem(
        moving, motion.parameters, lifted(motion.lagrangian),
        (*motion.constraints, *map(lifted, motion.constraints)),
        forces=(*map(lifted, motion.forces), *motion.forces), pulls=tuple(pulls),
    )  # fmt: skip


def largest_exponent(derived: derivation.Derived) -> dict[str, Any]:
    """{largest, half, time}: the exponent over the whole run and over its first half, which shows
    its convergence.
    """
    scene, problem = derived.scene, with_tangent(derived.motion())
    if scene.contacts or any(event.acts for event in scene.events):
        return {"largest": None, "note": say("exponent_with_events")}
    n, length = len(scene.coordinates), scene.grid.step * scene.grid.steps
    positions, velocities = scene.positions, scene.velocities
    names = nf.state_names(scene.coordinates)
    slopes = [calculus.differentiate(one, name) for one in scene.constraints for name in names]

    def kept(tangent: Array) -> Array:
        """Tangent to motions that keep the constraints, (2 n,): others, which the accelerations
        have too, may part.
        """
        table = nf.arrays_by_name(
            scene.coordinates, positions[None], velocities[None], scene.values
        )
        rows = np.array(arrays.array_values(slopes, table)).reshape(-1, 2 * n)
        found: Array = tangent - np.linalg.pinv(rows) @ (rows @ tangent) if slopes else tangent
        return found

    tangent = kept(np.ones(2 * n))
    tangent /= np.linalg.norm(tangent)
    total, halves = 0.0, []
    for part in range(PARTS):
        begin = scene.grid.begin + part * length / PARTS
        start = data.Start((*positions, *tangent[:n]), velocities=(*velocities, *tangent[n:]))
        grid = data.Grid(length / PARTS, 1, 1, begin)
        found = execution.run(problem, CHOICE, start, grid, dict(scene.values), (), derived.stop)
        if derived.is_over:
            return {"largest": None, "note": say("exponent_late")}
        if not found.outcome.completed or found.velocities is None:
            return {"largest": None, "note": say("exponent_ended", begin)}
        positions, velocities = found.positions[-1, :n], found.velocities[-1, :n]
        tangent = np.concatenate([found.positions[-1, n:], found.velocities[-1, n:]])
        tangent = kept(tangent)
        size = float(np.linalg.norm(tangent))
        total, tangent = total + float(np.log(size)), tangent / size
        halves.append(total)
    return {
        "largest": total / length,
        "half": halves[PARTS // 2 - 1] / (length / 2),
        "time": length,
    }

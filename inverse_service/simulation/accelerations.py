"""The accelerations of a motion with constraints and its multipliers; whether a Lagrangian has that
motion.

In a form that is regular wherever the constraints w v = 0 are independent, unlike equations in
independent velocities, which have singular points such as cos(phi) = 0. With g = L_vv, F = L_q -
L_vq v - L_vt + Q

    a = g^-1 (F + w^T lambda),   lambda = -(w g^-1 w^T)^-1 (w' v + w g^-1 F)

Source: A. M. Bloch, Nonholonomic Mechanics and Control, 2003, chapter 5; adjugates by Laplace
expansion.
"""

from collections.abc import Sequence

import numpy as np

from inverse_service import errors
from inverse_service.expressions import arrays, calculus, collecting, graphs, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import initial, numeric_formulas, scene_data
from inverse_service.simulation.sentences import say

POINTS = 24
ENOUGH = 4
SAME_MOTION = 1e-7
NOTICED = 1e-3  # of the motion of a run, whose velocities come from momenta
MOST_FULL_ROWS = 5  # beyond this size the expansion of a full determinant would fill pages


def accelerations_and_multipliers(
    what: initial.System,
) -> tuple[tuple[ex.Expression, ...], tuple[ex.Expression, ...]] | None:
    """All n accelerations over (q, v), with the forces Q, and lambda, the constraints exerting w^T
    lambda; None if the matrices are too large to invert.
    """
    names = what.coordinates
    assert what.lagrangian is not None
    inertia = inverse(euler_lagrange.hessian(what.lagrangian, names))
    if inertia is None:
        return None
    own = tuple(
        -e
        for e in euler_lagrange.euler_lagrange_sums(what.lagrangian, names, [ex.ZERO] * len(names))
    )
    free = _applied(inertia, tuple(map(ex.add, own, what.forces)) if what.forces else own)
    if not what.constraints:
        return free, ()
    rows = initial.forms_of(what)
    lifted = tuple(_applied(inertia, row) for row in rows)
    gram = inverse(tuple(tuple(ex.dot(row, lift) for lift in lifted) for row in rows))
    if gram is None:
        return None
    drifts = [collecting.collect(rate(w, names, [ex.ZERO] * len(names))) for w in what.constraints]
    defects = [drift + ex.dot(row, free) for drift, row in zip(drifts, rows, strict=True)]
    multipliers = tuple(-ex.dot(line, defects) for line in gram)
    moved = (free[i] + ex.dot([lift[i] for lift in lifted], multipliers) for i in range(len(names)))
    return tuple(moved), multipliers


def rate(
    tree: ex.Expression, names: Sequence[str], accelerations: Sequence[ex.Expression]
) -> ex.Expression:
    """The derivative in time along q'' = accelerations."""
    moving = [calculus.differentiate(tree, ex.Symbol(name)) * ex.Velocity(name) for name in names]
    pushed = [calculus.differentiate(tree, ex.Velocity(name)) for name in names]
    return ex.add(calculus.differentiate(tree, ex.TIME), *moving, ex.dot(pushed, accelerations))


def inverse(matrix: euler_lagrange.Matrix) -> euler_lagrange.Matrix | None:
    """The inverse of a symmetric matrix, block by block; None where a block is larger than
    MOST_FULL_ROWS.

    InputError where it is singular everywhere.
    """
    span = range(len(matrix))
    found: list[list[ex.Expression]] = [[ex.ZERO for _ in span] for _ in span]
    for block in graphs.components({i: [j for j in span if matrix[i][j] != ex.ZERO] for i in span}):
        if len(block) > MOST_FULL_ROWS:
            return None
        inner = tuple(tuple(matrix[i][j] for j in block) for i in block)
        whole = collecting.determinant(inner)
        if whole == ex.ZERO:
            raise errors.InputError(say("degenerate"))
        for a, i in enumerate(block):
            for b, j in enumerate(block):
                minor = [[*row[:a], *row[a + 1 :]] for row in (*inner[:b], *inner[b + 1 :])]
                found[i][j] = (-1) ** (a + b) * collecting.determinant(minor) / whole
    return tuple(map(tuple, found))


def _applied(
    matrix: euler_lagrange.Matrix, vector: Sequence[ex.Expression]
) -> tuple[ex.Expression, ...]:
    return tuple(ex.dot(row, vector) for row in matrix)


def keeps_motion(
    scene: scene_data.Scene, lagrangian: ex.Expression, accelerations: tuple[ex.Expression, ...],
    values: dict[str, float], domain: tuple[ex.Expression, ...] = (),
) -> bool | None:  # fmt: skip
    """Whether the Lagrangian has the motion among its solutions, tested at points on the
    constraints, off which the free system may differ; None where too few points of the domain,
    whose formulas are positive, have values.
    """
    positions, velocities = _points(scene)
    times = (
        np.random.default_rng(5).uniform(0, scene.grid.step * scene.grid.steps, len(positions))
        + scene.grid.begin
    )
    table = numeric_formulas.table_of(scene.coordinates, positions, velocities, values, times)
    worst = distance_of_motion(lagrangian, scene.coordinates, accelerations, table)
    inside = np.all([arrays.array_value(end, table) > 0 for end in domain], axis=0)
    finite = worst[np.isfinite(worst) & inside]
    return None if len(finite) < ENOUGH else bool((finite < SAME_MOTION).all())


def distance_of_motion(
    lagrangian: ex.Expression, coordinates: tuple[str, ...], accelerations: tuple[ex.Expression, ...],
    table: dict[ex.Expression, Array | float],
) -> Array:  # fmt: skip
    """The greatest residual L_vv f + L_vq v - L_q at each of m points (m,), measured by its largest
    term.
    """
    residuals = euler_lagrange.euler_lagrange_residual(lagrangian, coordinates, accelerations)
    sizes = []
    for residual in residuals:
        found, *parts = np.abs(arrays.array_values([residual, *ex.summands(residual)], table))
        sizes.append(found / np.max([np.ones(len(found)), *parts], axis=0))
    worst: Array = np.max(sizes, axis=0)
    return worst


def _points(scene: scene_data.Scene) -> tuple[Array, Array]:
    random = np.random.default_rng(7)
    n = len(scene.coordinates)
    found_q, found_v = [scene.positions], [scene.velocities]
    for _ in range(POINTS):
        q = scene.positions + random.normal(0, 0.3, n)
        v = scene.velocities + 0.2 * (1 + np.abs(scene.velocities)) * random.normal(0, 1, n)
        given = dict(zip(scene.coordinates, map(float, v), strict=True))
        try:
            v = initial.initial_velocities(scene, scene.values, q, given, project=True)
        except errors.InputError:
            continue
        found_q.append(q)
        found_v.append(v)
    return np.array(found_q), np.array(found_v)

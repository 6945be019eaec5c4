"""The accelerations of a motion with constraints and its multipliers as formulas; whether a
Lagrangian has that motion.

    L_vv a - w^T lambda = L_q - L_vq v - L_vt + Q,   w a = -w' v - c'

solved by exact elimination, for people, for the solver and for tests at points. Methods have these
equations as they are, and solve them with numbers: `scene_graph`.

Source: A. M. Bloch, Nonholonomic Mechanics and Control, 2003, chapter 5.
"""

from collections.abc import Sequence

import numpy as np

from inverse_service import errors
from inverse_service.expressions import arrays, calculus, collecting, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import initial, numeric_formulas, scene_data

POINTS = 24
ENOUGH = 4
SAME_MOTION = 1e-7
NOTICED = 1e-3  # of the motion of a run, whose velocities come from momenta


def formulas_of(
    what: initial.System,
) -> tuple[tuple[ex.Expression, ...], tuple[ex.Expression, ...]]:
    """All n accelerations over (q, v), with the forces Q, and lambda, the constraints exerting w^T
    lambda. InputError where the matrix is singular, LimitError where the formulas are too long.
    """
    names, still = what.coordinates, [ex.ZERO] * len(what.coordinates)
    assert what.lagrangian is not None
    masses = euler_lagrange.hessian(what.lagrangian, names)
    sums = euler_lagrange.euler_lagrange_sums(what.lagrangian, names, still)
    if what.forces:
        sums = tuple(own - force for own, force in zip(sums, what.forces, strict=True))
    rows = initial.forms_of(what)
    multipliers = [f"multiplier {a}" for a in range(len(rows))]
    equations = []
    for k, rest in enumerate(sums):
        pulls = {one: -row[k] for one, row in zip(multipliers, rows, strict=True)}
        own = dict(zip(names, masses[k], strict=True)) | pulls
        equations.append((_without_zeros(own), rest))
    for constraint, row in zip(what.constraints, rows, strict=True):
        drift = collecting.collect(rate(constraint, names, still))
        equations.append((_without_zeros(dict(zip(names, row, strict=True))), drift))
    from inverse_service.mechanics import linear_equations  # the exact field takes long to load

    found = linear_equations.solve_accelerations(
        [linear_equations.LinearEquation(own, rest) for own, rest in equations],
        (*names, *multipliers),
    )
    return found[: len(names)], found[len(names) :]


def _without_zeros(coefficients: dict[str, ex.Expression]) -> dict[str, ex.Expression]:
    return {name: tree for name, tree in coefficients.items() if tree != ex.ZERO}


def rate(
    tree: ex.Expression, names: Sequence[str], accelerations: Sequence[ex.Expression]
) -> ex.Expression:
    """The derivative in time along q'' = accelerations."""
    moving = [calculus.differentiate(tree, ex.Symbol(name)) * ex.Velocity(name) for name in names]
    pushed = [calculus.differentiate(tree, ex.Velocity(name)) for name in names]
    return ex.add(calculus.differentiate(tree, ex.TIME), *moving, ex.dot(pushed, accelerations))


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
    table = numeric_formulas.arrays_by_name(scene.coordinates, positions, velocities, values, times)
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

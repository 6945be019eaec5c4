"""The free Lagrangian L~ and Hamiltonian H~ of the second associated system, for motions with known directions.

Where the exact motion is q_i' = c d_i(r)/n(r), n = sqrt(d M d), r'' = 0 (`exact_motion`), the second
associated system r'' = 0, q_i'' = (d_i/n)' (n/d_i) r' q_i' is variational for every d:

    L~ = r'^2/2 + (n/2r') sum C_i q_i'^2/d_i,        H~ = (p_r + (1/2n) sum d_i p_i^2/C_i)^2/2

and where n is constant, coordinates with constant d_i may have q_i'^2/2 instead (the paper's L~2).
Constant factors and signs of d_i are left to the free constants C_i; H~ is smooth through d_i = 0.
Source: Mestdag, Bloch, Fernandez (2009), proposition 1.2, for d = (1, -A_a); the general d by own computation.

Whether a Lagrangian has the true motion among its solutions, tested at points on the constraints.

The Euler-Lagrange residual L_vv f + L_vq v - L_q is computed with the accelerations f of the true motion. It need
only vanish on the constraints: the free system may differ from the true one elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import (
    HALF,
    ONE,
    ZERO,
    Expression,
    Number,
    Sum,
    Symbol,
    Velocity,
    add,
    factors_of,
    holds,
    multiply,
    number,
    square_root,
)
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.derivation import determinant
from inverse_service.simulation.exact_motion import ExactMotion, turning_table
from inverse_service.simulation.initial import initial_velocities
from inverse_service.simulation.scene_data import Scene

SAMPLES = 32
CONSTANT = 1e-13


@dataclass(frozen=True, slots=True)
class ClassLagrangian:
    """L~, H~ in Symbol("p_x"), and their free constants, one for each coupled coordinate; `directions` d_i without
    constant factors.

    `kind` is "L~2" where n is constant and "L~1" elsewhere; `decoupled` are the places with q'^2/2.
    """

    lagrangian: Expression
    hamiltonian: Expression
    constants: tuple[str | None, ...]
    kind: str
    turning: int
    decoupled: tuple[int, ...]
    directions: tuple[Expression, ...]
    norm: Expression


def class_lagrangian(motion: ExactMotion, taken: Sequence[str] = ()) -> ClassLagrangian | None:
    """L~ of the second associated system; None where the motion is straight or a direction vanishes.

    `taken` are names that the free constants C_x (one for each coordinate x) must not have.
    """
    if motion.turning is None:
        return None
    k, names = motion.turning, motion.coordinates
    raw = _directions(motion)
    steady = _is_constant(_square(motion, raw), motion)
    decoupled = tuple(i for i in raw if raw[i] == ZERO or (steady and not holds(raw[i], Symbol(names[k]))))
    if len(decoupled) == len(raw):
        return None
    norm = ONE if steady else square_root(_square(motion, raw))
    coupled = [i for i in raw if i not in decoupled]
    directions = tuple(_stripped(raw[i], names[k]) if i in coupled else ONE for i in range(len(names)))
    constants = {i: _name(names[i], [*taken, *names]) for i in coupled}
    speed, momentum = Velocity(names[k]), Symbol(f"p_{names[k]}")
    quadratic = add(*(
        Symbol(constants[i]) * Velocity(names[i])**2 / directions[i] for i in coupled
    ))  # fmt: skip
    image = add(*(
        directions[i] * Symbol(f"p_{names[i]}")**2 / Symbol(constants[i]) for i in coupled
    ))  # fmt: skip
    free = [i for i in range(len(names)) if i == k or i in decoupled]
    kinetic = [HALF * Velocity(names[i]) ** 2 for i in free]
    others = [HALF * Symbol(f"p_{names[i]}") ** 2 for i in decoupled]
    shifted = momentum + HALF * image / norm
    return ClassLagrangian(
        lagrangian=add(*kinetic, HALF * norm * quadratic / speed),
        hamiltonian=add(HALF * shifted**2, *others),
        constants=tuple(constants.get(i) for i in range(len(names))),
        kind="L~2" if steady else "L~1",
        turning=k,
        decoupled=decoupled,
        directions=directions,
        norm=norm,
    )


def _directions(motion: ExactMotion) -> dict[int, Expression]:
    """d_i: the minors of the constraints with alternating signs, for every coordinate but the turning one."""
    others = [i for i in range(len(motion.coordinates)) if i != motion.turning]
    found = {}
    for place, i in enumerate(others):
        minor = determinant(tuple(tuple(row[j] for j in others if j != i) for row in motion.constraints))
        found[i] = -minor if place % 2 else minor
    return found


def _square(motion: ExactMotion, directions: dict[int, Expression]) -> Expression:
    terms = [motion.inertia[i][j] * directions[i] * directions[j] for i in directions for j in directions]
    return collect(add(*terms))


def _is_constant(expression: Expression, motion: ExactMotion) -> bool:
    """Whether a function of the turning coordinate has one value at random points, to round-off."""
    points = np.random.default_rng(1).uniform(-3, 3, SAMPLES)
    table = turning_table(motion, points)
    values = array_value(expression, table)
    values = values[np.isfinite(values)]
    return len(values) > 1 and bool(np.ptp(values) <= CONSTANT * np.abs(values).max())


def _stripped(expression: Expression, name: str) -> Expression:
    """The factors that hold the turning coordinate; a constant direction becomes 1."""
    factors = factors_of(expression)
    kept = [factor for factor in factors if not isinstance(factor, Number) and holds(factor, Symbol(name))]
    return multiply(*kept) if kept else number(1)


def _name(coordinate: str, taken: Sequence[str]) -> str:
    choices = [f"C_{coordinate}", f"free_{coordinate}", *(f"C_{coordinate}_{k}" for k in range(2, len(taken) + 4))]
    return next(name for name in choices if name not in taken)


def start_momenta(found: ClassLagrangian, motion: ExactMotion, positions: Array, velocities: Array) -> Array:
    """p = dL~/dv at starts on the constraints, (n,) or (m, n), with its limit where a d_i vanishes there.

    p_i = C_i n q_i'/(d_i r') is a constant of the motion; on the constraints q_i' is c d_i/n, so that
    the quotient stays finite: it is taken from d_i/d_i stripped, a constant. Not finite where r' = 0 or all d_i = 0.
    """
    with np.errstate(all="ignore"):
        rows = _start_momenta(found, motion, np.atleast_2d(positions), np.atleast_2d(velocities))
        return rows.reshape(positions.shape)


def _start_momenta(found: ClassLagrangian, motion: ExactMotion, positions: Array, velocities: Array) -> Array:
    k, mass, rate = found.turning, motion.mass, velocities[:, found.turning]
    table = turning_table(motion, positions[:, k])
    raw = _directions(motion)
    d = np.zeros(positions.shape)
    for i, tree in raw.items():
        d[:, i] = array_value(tree, table)
    length = np.sqrt(np.einsum("mi,ij,mj->m", d, mass, d))
    speed = np.einsum("mi,ij,mj->m", d, mass, velocities) / length
    norm = array_value(found.norm, table)
    momenta = velocities.astype(float)
    shift = np.zeros(len(positions))
    for i, name in enumerate(found.constants):
        if name is None:
            continue
        constant = motion.values[name]
        ratio = _constant_ratio(raw[i], found.directions[i], motion)
        momenta[:, i] = constant * (norm / length) * speed * ratio / rate
        shift += array_value(found.directions[i], table) * momenta[:, i] ** 2 / (2 * norm * constant)
    momenta[:, k] = rate - shift
    return momenta


def _constant_ratio(raw: Expression, stripped: Expression, motion: ExactMotion) -> float:
    """raw/stripped, which does not depend on the turning coordinate."""
    points = np.random.default_rng(2).uniform(-3, 3, SAMPLES)
    table = turning_table(motion, points)
    top, bottom = array_value(raw, table), array_value(stripped, table)
    best = int(np.nanargmax(np.where(np.isfinite(top) & np.isfinite(bottom), np.abs(bottom), np.nan)))
    return float(top[best] / bottom[best])


POINTS = 24
ENOUGH = 4
TOLERANCE = 1e-7
NOTICED = 1e-3  # of the motion of a run, whose velocities come from momenta


def keeps_motion(
    scene: Scene,
    lagrangian: Expression,
    accelerations: tuple[Expression, ...],
    values: dict[str, float],
    domain: tuple[Expression, ...] = (),
) -> bool | None:
    """True or False where enough points of the domain, where its formulas are positive, have values; None elsewhere."""
    positions, velocities = _points(scene)
    times = np.random.default_rng(5).uniform(0, scene.grid.step * scene.grid.steps, len(positions)) + scene.grid.begin
    table = table_of(scene.coordinates, positions, velocities, values, times)
    worst = distance_of_motion(lagrangian, scene.coordinates, accelerations, table)
    inside = np.all([array_value(end, table) > 0 for end in domain], axis=0)
    finite = worst[np.isfinite(worst) & inside]
    return None if len(finite) < ENOUGH else bool((finite < TOLERANCE).all())


def distance_of_motion(
    lagrangian: Expression,
    coordinates: tuple[str, ...],
    accelerations: tuple[Expression, ...],
    table: dict[Expression, Array | float],
) -> Array:
    """The greatest Euler-Lagrange residual at each of m points (m,), measured by its largest term."""
    residuals = euler_lagrange_residual(lagrangian, coordinates, accelerations)
    sizes = [np.abs(array_value(residual, table)) / _size(residual, table) for residual in residuals]
    worst: Array = np.max(sizes, axis=0)
    return worst


def _size(residual: Expression, table: dict[Expression, Array | float]) -> Array:
    """The size of the largest term, which the residual is measured by."""
    terms = residual.terms if isinstance(residual, Sum) else (residual,)
    size = np.ones(len(array_value(residual, table)))
    for term in terms:
        size = np.maximum(size, np.abs(array_value(term, table)))
    return size


def _points(scene: Scene) -> tuple[Array, Array]:
    random = np.random.default_rng(7)
    n = len(scene.coordinates)
    found_q, found_v = [scene.positions], [scene.velocities]
    for _ in range(POINTS):
        q = scene.positions + random.normal(0, 0.3, n)
        v = scene.velocities + 0.2 * (1 + np.abs(scene.velocities)) * random.normal(0, 1, n)
        given = dict(zip(scene.coordinates, map(float, v), strict=True))
        try:
            v = initial_velocities(
                scene.coordinates, scene.constraints, scene.lagrangian, scene.values, q, given, project=True
            )
        except InputError:
            continue
        found_q.append(q)
        found_v.append(v)
    return np.array(found_q), np.array(found_v)

"""Exact motions by quadrature, for systems recognized by their structure and not by their name.

Let L have constant coefficients, let the constraints omega_a(r) v = 0 depend on one coordinate r only,
contain no r', and leave one direction to the n - 1 other coordinates. Then r'' = 0, and the others have
the velocity c e(r), e(r) being that direction with e M e = 1: reactions do no work, so c is constant.

    r(t) = r_0 + u t,    q(t) = q_0 + c * integral of e(r_0 + u s) for s from 0 to t

That holds for the class of the paper with V = 0 (disk, knife edge: circles) and needs no A != 0.
Without constraints, or with constant ones, the motion is straight. Source: own computation; for the
class Mestdag, Bloch, Fernandez (2009), section 2.

`class_lagrangian` is the free Lagrangian L~ of the second associated system, with H~. Where the exact motion is q_i' =
c d_i(r)/n(r), n = sqrt(d M d), r'' = 0 (as above), the second associated system r'' = 0, q_i'' = (d_i/n)' (n/d_i) r'
q_i' is variational for every d:

    L~ = r'^2/2 + (n/2r') sum C_i q_i'^2/d_i,        H~ = (p_r + (1/2n) sum d_i p_i^2/C_i)^2/2

and where n is constant, coordinates with constant d_i may have q_i'^2/2 instead (the paper's L~2).
Constant factors and signs of d_i are left to the free constants C_i; H~ is smooth through d_i = 0.
Source: Mestdag, Bloch, Fernandez (2009), proposition 1.2, for d = (1, -A_a); the general d by own computation.

`keeps_motion` tests at points on the constraints whether a Lagrangian has the true motion among its solutions. The
Euler-Lagrange residual L_vv f + L_vq v - L_q is computed with the accelerations f of the true motion. It need
only vanish on the constraints: the free system may differ from the true one elsewhere.

`accelerations_and_multipliers` is in a form that is regular wherever the constraints are independent. With g = L_vv, F
= L_q - L_vq v - L_vt + Q and constraints w v = 0:

    a = g^-1 (F + w^T lambda),   lambda = -(w g^-1 w^T)^-1 (w' v + w g^-1 F)

Unlike the equations in independent velocities they have no singular points such as cos(phi) = 0.
Source: A. M. Bloch, Nonholonomic Mechanics and Control, 2003, chapter 5; adjugates by Laplace expansion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inverse_service import errors
from inverse_service.expressions import collecting, derivative, graphs, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import initial, numeric_formulas
from inverse_service.simulation.scene_data import Scene

NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
MOST_PIECES = 4096
MOST_NODES = 2_000_000
INTERVALS_AT_ONCE = 5_000
TOLERANCE = 4e-16
RANK_LOST = (
    "along the motion the constraints lose rank, or the kinetic energy is not positive on them, so the exact motion "
    "is not determined: change a parameter or the start"
)
SAMPLES = 32
CONSTANT = 1e-13
POINTS = 24
ENOUGH = 4
SAME_MOTION = 1e-7
NOTICED = 1e-3  # of the motion of a run, whose velocities come from momenta
DEGENERATE = (
    "the matrix of the velocities is singular (d2L/dv_i dv_j, or constraints that depend on one another), so no "
    "accelerations follow: give every coordinate its kinetic energy, with other parameters or effects of the scene."
)
# Beyond this size the expansion of a full determinant would fill pages.
MOST_FULL_ROWS = 5


@dataclass(frozen=True, slots=True)
class ExactMotion:
    """Coefficients omega (m, n) as trees in the one coordinate `turning`, mass matrix (n, n) as trees and numbers.

    `turning` is None where the motion is straight.
    """

    coordinates: tuple[str, ...]
    inertia: euler_lagrange.Matrix
    mass: Array
    constraints: tuple[tuple[ex.Expression, ...], ...]
    turning: int | None
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class NoExactMotion:
    """Why no exact solution is known."""

    reason: str


def motion_by_quadrature(
    coordinates: Sequence[str],
    lagrangian: ex.Expression,
    constraints: Sequence[ex.Expression],
    values: Mapping[str, float],
) -> ExactMotion | NoExactMotion:
    """The exact motion of a system of the class above, or the reason why it is not in that class."""
    names = tuple(coordinates)
    inertia = euler_lagrange.hessian(lagrangian, names)
    mass = _mass(lagrangian, inertia, names, values)
    if mass is None:
        return NoExactMotion("The kinetic energy has coefficients that are not constant, or there is a potential.")
    if np.linalg.matrix_rank(mass) < len(names):
        return NoExactMotion("The kinetic energy is degenerate.")
    rows = [_coefficients(constraint, names) for constraint in constraints]
    linear = [row for row in rows if row is not None]
    if len(linear) < len(rows):
        return NoExactMotion("A constraint is not linear and homogeneous in the velocities.")
    used = {node.name for row in linear for entry in row for node in ex.walk(entry) if isinstance(node, ex.Symbol)}
    turning = [k for k, name in enumerate(names) if name in used]
    if ex.TIME.name in used or len(turning) > 1:
        return NoExactMotion("The constraints depend on more than one coordinate.")
    found = ExactMotion(names, inertia, mass, tuple(linear), turning[0] if turning else None, dict(values))
    return found if not turning else _with_one_direction(found)


def _with_one_direction(found: ExactMotion) -> ExactMotion | NoExactMotion:
    k, names = found.turning or 0, found.coordinates
    if any(row[k] != ex.ZERO for row in found.constraints):
        return NoExactMotion(f"A constraint contains the velocity of {names[k]}, on which it depends.")
    if np.delete(found.mass[k], k).any():
        return NoExactMotion(f"The kinetic energy couples {names[k]} with another coordinate.")
    if len(found.constraints) != len(names) - 2:
        return NoExactMotion(f"The constraints leave more than one direction in addition to {names[k]}.")
    return found


def _mass(
    lagrangian: ex.Expression, inertia: euler_lagrange.Matrix, names: tuple[str, ...], values: Mapping[str, float]
) -> Array | None:
    rates = [ex.Velocity(name) for name in names]
    table: dict[ex.Expression, float] = {ex.Symbol(name): value for name, value in values.items()}
    kinetic = ex.add(
        *(ex.HALF * entry * rates[i] * rates[j] for i, row in enumerate(inertia) for j, entry in enumerate(row))
    )
    rest = collecting.collect(lagrangian - kinetic)
    try:
        numeric_formulas.array_value(rest, table)
        return np.array([[float(numeric_formulas.array_value(entry, table)[0]) for entry in row] for row in inertia])
    except numeric_formulas.NoValue:
        return None


def _coefficients(constraint: ex.Expression, names: tuple[str, ...]) -> tuple[ex.Expression, ...] | None:
    """The coefficients of the velocities; None where the constraint has any other part."""
    row = tuple(collecting.collect(derivative.differentiate(constraint, ex.Velocity(name))) for name in names)
    if any(isinstance(node, ex.Velocity) for entry in row for node in ex.walk(entry)):
        return None
    rest = constraint - ex.add(*(entry * ex.Velocity(n) for entry, n in zip(row, names, strict=True)))
    return row if collecting.collect(rest) == ex.ZERO else None


def positions_of(motion: ExactMotion, positions: Array, velocities: Array, times: Array) -> tuple[Array, Array]:
    """Positions and velocities, (m, n) each, at `times` (m,) from a start (n,) that keeps the constraints.

    Raises ValueError where the constraints lose rank on the way: the motion is not determined there.
    """
    times = np.asarray(times, dtype=float)
    if motion.turning is None or velocities[motion.turning] == 0:
        return positions + times[:, None] * velocities, np.broadcast_to(velocities, (len(times), len(velocities)))
    k = motion.turning
    rate, others = float(velocities[k]), [i for i in range(len(velocities)) if i != k]
    mass = motion.mass[np.ix_(others, others)]
    start = _direction(motion, np.array([positions[k]]))[0]
    speed = float(start @ mass @ velocities[others])
    found = np.empty((len(times), len(velocities)))
    found[:, k] = positions[k] + rate * times
    found[:, others] = positions[others] + speed * _integral(motion, float(positions[k]), rate, times)
    rates = np.empty_like(found)
    rates[:, k] = rate
    rates[:, others] = speed * _direction(motion, found[:, k])
    return found, rates


def _integral(motion: ExactMotion, start: float, rate: float, times: Array) -> Array:
    """The integral of e from 0 to each time, (m, n - 1); Gauss-Legendre on pieces, halved until it converges."""
    edges = np.concatenate([[0.0], times])
    parts = np.empty((len(times), len(motion.coordinates) - 1))
    for first in range(0, len(times), INTERVALS_AT_ONCE):
        last = min(len(times), first + INTERVALS_AT_ONCE)
        parts[first:last] = _settled(motion, start, rate, edges[first : last + 1])
    return np.cumsum(parts.astype(np.longdouble), axis=0).astype(float)


def _settled(motion: ExactMotion, start: float, rate: float, edges: Array) -> Array:
    """Each interval of `edges` cut into 1, 2, 4, … pieces until the integrals change by round-off only, (m, n - 1)."""
    # A node is known to a relative 1e-16, and e no better than that.
    reach = 1 + abs(start) + abs(rate) * float(np.abs(edges).max())
    tolerance = TOLERANCE * reach * float(np.abs(np.diff(edges)).max())
    pieces = 1
    found, steady = _composite(motion, start, rate, edges, pieces)
    while pieces < MOST_PIECES and 2 * pieces * len(edges) * len(NODES) <= MOST_NODES:
        pieces *= 2
        finer, steady = _composite(motion, start, rate, edges, pieces)
        change = float(np.abs(finer - found).max())
        found = finer
        if change <= tolerance and steady:
            return found
    if not steady:
        raise ValueError(RANK_LOST)
    return found


def _composite(motion: ExactMotion, start: float, rate: float, edges: Array, pieces: int) -> tuple[Array, bool]:
    """The integral of e over each interval of `edges`, (m, n - 1), and whether e turns by less than 90 degrees
    from node to node: where the rank is lost, e jumps to -e however fine the nodes are."""
    width = np.diff(edges)[:, None, None] / pieces
    middle = edges[:-1, None, None] + width * (np.arange(pieces)[None, :, None] + 0.5)
    nodes = middle + width / 2 * NODES
    flat = _direction(motion, (start + rate * nodes).ravel())
    steady = bool(((flat[1:] * flat[:-1]).sum(axis=1) > 0).all())
    inner = np.einsum("ijkl,k->ijl", flat.reshape(*nodes.shape, -1), WEIGHTS)
    summed: Array = (inner * width / 2).sum(axis=1)
    return summed, steady


def turning_table(motion: ExactMotion, turning: Array) -> dict[ex.Expression, Any]:
    """The values of the parameters, and these of the turning coordinate, for `array_value`."""
    table: dict[ex.Expression, Any] = {ex.Symbol(name): value for name, value in motion.values.items()}
    return table | {ex.Symbol(motion.coordinates[motion.turning or 0]): turning}


def _direction(motion: ExactMotion, turning: Array) -> Array:
    """e(r), (m, n - 1): the cross product of the rows of omega, with e M e = 1. It never jumps in sign."""
    k = motion.turning or 0
    others = [i for i in range(len(motion.coordinates)) if i != k]
    table = turning_table(motion, turning)
    rows = np.empty((len(turning), len(motion.constraints), len(others)))
    for a, row in enumerate(motion.constraints):
        for j, i in enumerate(others):
            rows[:, a, j] = numeric_formulas.array_value(row[i], table)
    minors = [np.linalg.det(np.delete(rows, j, axis=2)) * (-1) ** j for j in range(len(others))]
    direction = np.column_stack(minors)
    mass = motion.mass[np.ix_(others, others)]
    norm = np.sqrt(np.einsum("ij,jk,ik->i", direction, mass, direction))
    if not np.isfinite(norm).all() or norm.min() <= 1e-12 * max(1.0, float(norm.max())):
        raise ValueError(RANK_LOST)
    found: Array = direction / norm[:, None]
    return found


@dataclass(frozen=True, slots=True)
class ClassLagrangian:
    """L~, H~ in Symbol("p_x"), and their free constants, one for each coupled coordinate; `directions` d_i without
    constant factors.

    `kind` is "L~2" where n is constant and "L~1" elsewhere.
    """

    lagrangian: ex.Expression
    hamiltonian: ex.Expression
    constants: tuple[str | None, ...]
    kind: str
    turning: int
    directions: tuple[ex.Expression, ...]
    norm: ex.Expression


def class_lagrangian(motion: ExactMotion, taken: Sequence[str] = ()) -> ClassLagrangian | None:
    """L~ of the second associated system; None where the motion is straight or a direction vanishes.

    `taken` are names that the free constants C_x (one for each coordinate x) must not have.
    """
    if motion.turning is None:
        return None
    k, names = motion.turning, motion.coordinates
    raw = _directions(motion)
    steady = _is_constant(_square(motion, raw), motion)
    decoupled = tuple(i for i in raw if raw[i] == ex.ZERO or (steady and not ex.holds(raw[i], ex.Symbol(names[k]))))
    if len(decoupled) == len(raw):
        return None
    norm = ex.ONE if steady else ex.square_root(_square(motion, raw))
    coupled = [i for i in raw if i not in decoupled]
    directions = tuple(_split(raw[i], names[k])[0] if i in coupled else ex.ONE for i in range(len(names)))
    constants = {i: _name(names[i], [*taken, *names]) for i in coupled}
    speed, momentum = ex.Velocity(names[k]), ex.Symbol(f"p_{names[k]}")
    quadratic = ex.add(*(
        ex.Symbol(constants[i]) * ex.Velocity(names[i])**2 / directions[i] for i in coupled
    ))  # fmt: skip
    image = ex.add(*(
        directions[i] * ex.Symbol(f"p_{names[i]}")**2 / ex.Symbol(constants[i]) for i in coupled
    ))  # fmt: skip
    free = [i for i in range(len(names)) if i == k or i in decoupled]
    kinetic = [ex.HALF * ex.Velocity(names[i]) ** 2 for i in free]
    others = [ex.HALF * ex.Symbol(f"p_{names[i]}") ** 2 for i in decoupled]
    shifted = momentum + ex.HALF * image / norm
    return ClassLagrangian(
        lagrangian=ex.add(*kinetic, ex.HALF * norm * quadratic / speed),
        hamiltonian=ex.add(ex.HALF * shifted**2, *others),
        constants=tuple(constants.get(i) for i in range(len(names))),
        kind="L~2" if steady else "L~1",
        turning=k,
        directions=directions,
        norm=norm,
    )


def _directions(motion: ExactMotion) -> dict[int, ex.Expression]:
    """d_i: the minors of the constraints with alternating signs, for every coordinate but the turning one."""
    others = [i for i in range(len(motion.coordinates)) if i != motion.turning]
    found = {}
    for place, i in enumerate(others):
        minor = determinant(tuple(tuple(row[j] for j in others if j != i) for row in motion.constraints))
        found[i] = -minor if place % 2 else minor
    return found


def _square(motion: ExactMotion, directions: dict[int, ex.Expression]) -> ex.Expression:
    terms = [motion.inertia[i][j] * directions[i] * directions[j] for i in directions for j in directions]
    return collecting.collect(ex.add(*terms))


def _is_constant(expression: ex.Expression, motion: ExactMotion) -> bool:
    """Whether a function of the turning coordinate has one value at random points, to round-off."""
    points = np.random.default_rng(1).uniform(-3, 3, SAMPLES)
    table = turning_table(motion, points)
    values = numeric_formulas.array_value(expression, table)
    values = values[np.isfinite(values)]
    return len(values) > 1 and bool(np.ptp(values) <= CONSTANT * np.abs(values).max())


def _split(direction: ex.Expression, name: str) -> tuple[ex.Expression, ex.Expression]:
    """The factors that hold the turning coordinate, and the others, which are constant."""
    factors = ex.factors_of(direction)
    moving = [factor for factor in factors if ex.holds(factor, ex.Symbol(name))]
    return ex.multiply(*moving), ex.multiply(*(factor for factor in factors if factor not in moving))


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
        d[:, i] = numeric_formulas.array_value(tree, table)
    length = np.sqrt(np.einsum("mi,ij,mj->m", d, mass, d))
    speed = np.einsum("mi,ij,mj->m", d, mass, velocities) / length
    norm = numeric_formulas.array_value(found.norm, table)
    momenta = velocities.astype(float)
    shift = np.zeros(len(positions))
    for i, name in enumerate(found.constants):
        if name is None:
            continue
        constant = motion.values[name]
        ratio = numeric_formulas.array_value(_split(raw[i], motion.coordinates[k])[1], table)
        momenta[:, i] = constant * (norm / length) * speed * ratio / rate
        shift += numeric_formulas.array_value(found.directions[i], table) * momenta[:, i] ** 2 / (2 * norm * constant)
    momenta[:, k] = rate - shift
    return momenta


def keeps_motion(
    scene: Scene,
    lagrangian: ex.Expression,
    accelerations: tuple[ex.Expression, ...],
    values: dict[str, float],
    domain: tuple[ex.Expression, ...] = (),
) -> bool | None:
    """True or False where enough points of the domain, where its formulas are positive, have values; None elsewhere."""
    positions, velocities = _points(scene)
    times = np.random.default_rng(5).uniform(0, scene.grid.step * scene.grid.steps, len(positions)) + scene.grid.begin
    table = numeric_formulas.table_of(scene.coordinates, positions, velocities, values, times)
    worst = distance_of_motion(lagrangian, scene.coordinates, accelerations, table)
    inside = np.all([numeric_formulas.array_value(end, table) > 0 for end in domain], axis=0)
    finite = worst[np.isfinite(worst) & inside]
    return None if len(finite) < ENOUGH else bool((finite < SAME_MOTION).all())


def distance_of_motion(
    lagrangian: ex.Expression,
    coordinates: tuple[str, ...],
    accelerations: tuple[ex.Expression, ...],
    table: dict[ex.Expression, Array | float],
) -> Array:
    """The greatest Euler-Lagrange residual at each of m points (m,), measured by its largest term."""
    residuals = euler_lagrange.euler_lagrange_residual(lagrangian, coordinates, accelerations)
    sizes = [np.abs(numeric_formulas.array_value(residual, table)) / _size(residual, table) for residual in residuals]
    worst: Array = np.max(sizes, axis=0)
    return worst


def _size(residual: ex.Expression, table: dict[ex.Expression, Array | float]) -> Array:
    """The size of the largest term, relative to which the residual is measured."""
    terms = residual.terms if isinstance(residual, ex.Sum) else (residual,)
    size = np.ones(len(numeric_formulas.array_value(residual, table)))
    for term in terms:
        size = np.maximum(size, np.abs(numeric_formulas.array_value(term, table)))
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
            v = initial.initial_velocities(
                scene.coordinates, scene.constraints, scene.lagrangian, scene.values, q, given, project=True
            )
        except errors.InputError:
            continue
        found_q.append(q)
        found_v.append(v)
    return np.array(found_q), np.array(found_v)


def regular_accelerations(
    coordinates: Sequence[str],
    lagrangian: ex.Expression,
    constraints: Sequence[ex.Expression],
    forces: Sequence[ex.Expression] = (),
) -> tuple[ex.Expression, ...] | None:
    """All n accelerations over (q, v), with additional forces Q; None if the matrices are too large to invert."""
    found = accelerations_and_multipliers(coordinates, lagrangian, constraints, forces)
    return None if found is None else found[0]


def accelerations_and_multipliers(
    coordinates: Sequence[str],
    lagrangian: ex.Expression,
    constraints: Sequence[ex.Expression],
    forces: Sequence[ex.Expression] = (),
) -> tuple[tuple[ex.Expression, ...], tuple[ex.Expression, ...]] | None:
    """a and lambda; the constraints exert the forces w^T lambda."""
    names = tuple(coordinates)
    inertia = inverse(euler_lagrange.hessian(lagrangian, names))
    if inertia is None:
        return None
    own = tuple(-e for e in euler_lagrange.euler_lagrange_sums(lagrangian, names, [ex.ZERO] * len(names)))
    free = _applied(inertia, tuple(map(ex.add, own, forces)) if forces else own)
    if not constraints:
        return free, ()
    rows = tuple(
        tuple(collecting.collect(derivative.differentiate(w, ex.Velocity(name))) for name in names) for w in constraints
    )
    lifted = tuple(_applied(inertia, row) for row in rows)
    gram = inverse(tuple(tuple(ex.dot(row, lift) for lift in lifted) for row in rows))
    if gram is None:
        return None
    defects = [_rate(w, names) + ex.dot(row, free) for w, row in zip(constraints, rows, strict=True)]
    multipliers = tuple(-ex.dot(line, defects) for line in gram)
    moved = (free[i] + ex.dot([lift[i] for lift in lifted], multipliers) for i in range(len(names)))
    return tuple(moved), multipliers


def inverse(matrix: euler_lagrange.Matrix) -> euler_lagrange.Matrix | None:
    """The inverse of a symmetric matrix, block by block; None where a block is larger than MOST_FULL_ROWS.

    InputError where it is singular everywhere.
    """
    span = range(len(matrix))
    found: list[list[ex.Expression]] = [[ex.ZERO for _ in span] for _ in span]
    for block in graphs.components({i: [j for j in span if matrix[i][j] != ex.ZERO] for i in span}):
        if len(block) > MOST_FULL_ROWS:
            return None
        inner = tuple(tuple(matrix[i][j] for j in block) for i in block)
        whole = determinant(inner)
        if whole == ex.ZERO:
            raise errors.InputError(DEGENERATE)
        for a, i in enumerate(block):
            for b, j in enumerate(block):
                found[i][j] = _cofactor(inner, b, a) / whole
    return tuple(map(tuple, found))


def determinant(matrix: euler_lagrange.Matrix) -> ex.Expression:
    """The determinant by expansion along the first row; 1 for a matrix without rows."""
    if not matrix:
        return ex.ONE
    terms = [entry * _cofactor(matrix, 0, j) for j, entry in enumerate(matrix[0]) if entry != ex.ZERO]
    return collecting.collect(ex.add(*terms))


def _cofactor(matrix: euler_lagrange.Matrix, row: int, column: int) -> ex.Expression:
    minor = tuple(
        tuple(entry for j, entry in enumerate(line) if j != column) for i, line in enumerate(matrix) if i != row
    )
    value = determinant(minor)
    return -value if (row + column) % 2 else value


def _rate(expression: ex.Expression, names: tuple[str, ...]) -> ex.Expression:
    """The part of the derivative in time that holds no acceleration."""
    along = (derivative.differentiate(expression, ex.Symbol(name)) * ex.Velocity(name) for name in names)
    return collecting.collect(ex.add(*along, derivative.differentiate(expression, ex.TIME)))


def _applied(matrix: euler_lagrange.Matrix, vector: Sequence[ex.Expression]) -> tuple[ex.Expression, ...]:
    return tuple(ex.dot(row, vector) for row in matrix)

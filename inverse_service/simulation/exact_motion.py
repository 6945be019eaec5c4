"""Exact motions by quadrature, and the free Lagrangian of their class, for systems recognized by
their structure.

Let L have constant coefficients, let the constraints omega_a(r) v = 0 depend on one coordinate r
only, contain no r', and leave one direction d(r) to the n - 1 other coordinates. Then r'' = 0, and
the others have the velocity c d/n with n = sqrt(d M d): reactions do no work, so c is constant.
With e = d/n

    r(t) = r_0 + u t,    q(t) = q_0 + c * integral of e(r_0 + u s) for s from 0 to t

That holds for the class of the paper with V = 0 (disk, knife edge: circles) and needs no A != 0;
without constraints, or with constant ones, the motion is straight. The second associated system r''
= 0, q_i'' = (d_i/n)' (n/d_i) r' q_i' is variational for every d:

    L~ = r'^2/2 + (n/2r') sum C_i q_i'^2/d_i,        H~ = (p_r + (1/2n) sum d_i p_i^2/C_i)^2/2

Where n is constant, coordinates with constant d_i may have q_i'^2/2 instead (the paper's L~2).
Constant factors and signs of d_i are left to the free constants C_i; H~ is smooth through d_i = 0.
Source: Mestdag, Bloch, Fernandez (2009), section 2 and proposition 1.2, for d = (1, -A_a); the
general d by own computation.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inverse_service.expressions import arrays, collecting, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import initial, scene_data
from inverse_service.simulation.sentences import say

NODES = 10  # of each piece of a quadrature
MOST_PIECES = 4096
MOST_NODES = 2_000_000
INTERVALS_AT_ONCE = 5_000
TOLERANCE = 4e-16
SAMPLES = 32
CONSTANT = 1e-13


@dataclass(frozen=True, slots=True)
class ExactMotion:
    """Coefficients omega (m, n) as trees in the one coordinate `turning`, mass matrix (n, n) as
    trees and numbers.

    `turning` is None where the motion is straight.
    """

    coordinates: tuple[str, ...]
    inertia: euler_lagrange.Matrix
    mass: Array
    constraints: tuple[tuple[ex.Expression, ...], ...]
    turning: int | None
    values: Mapping[str, float]


def motion_by_quadrature(what: initial.System, values: Mapping[str, float]) -> ExactMotion:
    """The exact motion of a system of the class above; Unavailable, with the reason, where it is
    not in that class.
    """
    if (lagrangian := what.lagrangian) is None:
        raise scene_data.Unavailable("The system is given by its equations.")
    names = what.coordinates
    table: dict[ex.Expression, float] = {ex.Symbol(name): value for name, value in values.items()}
    inertia = euler_lagrange.hessian(lagrangian, names)
    rates = [ex.Velocity(name) for name in names]
    kinetic = ex.dot(rates, [ex.HALF * ex.dot(row, rates) for row in inertia])
    try:
        potential = collecting.collect(lagrangian - kinetic)
        _, *entries = arrays.array_values(
            [potential, *(entry for row in inertia for entry in row)], table
        )
    except arrays.NoValue:
        raise scene_data.Unavailable(say("not_constant_masses")) from None
    mass = np.array(entries).reshape(len(names), -1)
    if np.linalg.matrix_rank(mass) < len(names):
        raise scene_data.Unavailable("The kinetic energy is degenerate.")
    rows = initial.forms_of(what)
    nodes = [node for row in rows for entry in row for node in ex.walk(entry)]
    if any(isinstance(node, ex.Velocity) for node in nodes) or {
        ex.ZERO,
        *initial.drifts_of(what),
    } != {ex.ZERO}:
        raise scene_data.Unavailable(
            "A constraint is not linear and homogeneous in the velocities."
        )
    used = {node.name for node in nodes if isinstance(node, ex.Symbol)}
    turning = [k for k, name in enumerate(names) if name in used]
    if ex.TIME.name in used or len(turning) > 1:
        raise scene_data.Unavailable("The constraints depend on more than one coordinate.")
    for k in turning:
        if any(row[k] != ex.ZERO for row in rows):
            raise scene_data.Unavailable(
                f"A constraint contains the velocity of {names[k]}, on which it depends."
            )
        if np.delete(mass[k], k).any():
            raise scene_data.Unavailable(
                f"The kinetic energy couples {names[k]} with another coordinate."
            )
        if len(rows) != len(names) - 2:
            raise scene_data.Unavailable(
                f"The constraints leave more than one direction in addition to {names[k]}."
            )
    return ExactMotion(
        names, inertia, mass, tuple(map(tuple, rows)), next(iter(turning), None), dict(values)
    )


def positions_of(
    motion: ExactMotion, positions: Array, velocities: Array, times: Array
) -> tuple[Array, Array]:
    """Positions and velocities, (m, n) each, at `times` (m,) from a start (n,) that keeps the
    constraints.

    Raises Unavailable where the constraints lose rank on the way: the motion is not determined
    there.
    """
    times = np.asarray(times, dtype=float)
    if motion.turning is None or velocities[motion.turning] == 0:
        return positions + times[:, None] * velocities, np.broadcast_to(
            velocities, (len(times), len(velocities))
        )
    k = motion.turning
    rate, others = float(velocities[k]), [i for i in range(len(velocities)) if i != k]
    mass = motion.mass[np.ix_(others, others)]
    start = _direction(motion, np.array([positions[k]]))[0]
    speed = float(start @ mass @ velocities[others])
    found = np.empty((len(times), len(velocities)))
    found[:, k] = positions[k] + rate * times
    edges, parts = np.concatenate([[0.0], times]), np.empty((len(times), len(others)))
    for first in range(0, len(times), INTERVALS_AT_ONCE):
        last = min(len(times), first + INTERVALS_AT_ONCE)
        parts[first:last] = _settled(motion, float(positions[k]), rate, edges[first : last + 1])
    integrals = np.cumsum(parts.astype(np.longdouble), axis=0).astype(float)
    found[:, others] = positions[others] + speed * integrals
    rates = np.empty_like(found)
    rates[:, k] = rate
    rates[:, others] = speed * _direction(motion, found[:, k])
    return found, rates


def _settled(motion: ExactMotion, start: float, rate: float, edges: Array) -> Array:
    """The integral of e over each interval of `edges`, (m, n - 1), by Gauss-Legendre on 1, 2, 4, …
    pieces of it until that changes by round-off only.
    """
    # A node is known to a relative 1e-16, and e no better than that.
    reach = 1 + abs(start) + abs(rate) * float(np.abs(edges).max())
    tolerance = TOLERANCE * reach * float(np.abs(np.diff(edges)).max())
    found, steady, pieces = np.array(np.inf), True, 1
    while pieces == 1 or (pieces <= MOST_PIECES and pieces * len(edges) * NODES <= MOST_NODES):
        finer, steady = _composite(motion, start, rate, edges, pieces)
        change = float(np.abs(finer - found).max(initial=0.0))
        found, pieces = finer, 2 * pieces
        if change <= tolerance and steady:
            break
    if not steady:
        raise scene_data.Unavailable(say("exact_rank_lost"))
    return found


def _composite(
    motion: ExactMotion, start: float, rate: float, edges: Array, pieces: int
) -> tuple[Array, bool]:
    """The integral of e over each interval of `edges`, (m, n - 1), and whether e turns by less than
    90 degrees from node to node: where the rank is lost, e jumps to -e however fine the nodes are.
    """
    places, weights = np.polynomial.legendre.leggauss(NODES)
    width = np.diff(edges)[:, None, None] / pieces
    middle = edges[:-1, None, None] + width * (np.arange(pieces)[None, :, None] + 0.5)
    nodes = middle + width / 2 * places
    flat = _direction(motion, (start + rate * nodes).ravel())
    steady = bool(((flat[1:] * flat[:-1]).sum(axis=1) > 0).all())
    inner = np.einsum("ijkl,k->ijl", flat.reshape(*nodes.shape, -1), weights)
    summed: Array = (inner * width / 2).sum(axis=1)
    return summed, steady


def turning_table(motion: ExactMotion, turning: Array) -> dict[ex.Expression, Any]:
    """The values of the parameters, and these of the turning coordinate, for `array_value`."""
    table: dict[ex.Expression, Any] = {
        ex.Symbol(name): value for name, value in motion.values.items()
    }
    return table | {ex.Symbol(motion.coordinates[motion.turning or 0]): turning}


def _direction(motion: ExactMotion, turning: Array) -> Array:
    """e(r), (m, n - 1): the cross product of the rows of omega, with e M e = 1. It never jumps in
    sign.
    """
    k = motion.turning or 0
    others = [i for i in range(len(motion.coordinates)) if i != k]
    table = turning_table(motion, turning)
    rows = np.empty((len(turning), len(motion.constraints), len(others)))
    for a, row in enumerate(motion.constraints):
        for j, i in enumerate(others):
            rows[:, a, j] = arrays.array_value(row[i], table)
    minors = [np.linalg.det(np.delete(rows, j, axis=2)) * (-1) ** j for j in range(len(others))]
    direction = np.column_stack(minors)
    mass = motion.mass[np.ix_(others, others)]
    norm = np.sqrt(np.einsum("ij,jk,ik->i", direction, mass, direction))
    if not np.isfinite(norm).all() or norm.min() <= 1e-12 * max(1.0, float(norm.max())):
        raise scene_data.Unavailable(say("exact_rank_lost"))
    found: Array = direction / norm[:, None]
    return found


def class_lagrangian(
    motion: ExactMotion, given: Mapping[str, float]
) -> scene_data.FreeLagrangian | None:
    """L~ of the second associated system; None where the motion is straight or a direction
    vanishes.

    It has a free constant C_x for each coordinate x that is coupled, whose values are `given` or 1.
    """
    if motion.turning is None:
        return None
    k, names, raw = motion.turning, motion.coordinates, _directions(motion)
    square = collecting.collect(
        ex.add(*(motion.inertia[i][j] * raw[i] * raw[j] for i in raw for j in raw))
    )
    steady = _is_constant(square, motion)
    coupled = [
        i
        for i in raw
        if raw[i] != ex.ZERO and (not steady or ex.holds(raw[i], ex.Symbol(names[k])))
    ]
    if not coupled:
        return None
    norm = ex.ONE if steady else ex.square_root(square)
    directions, factors = zip(*(_split(raw[i], names[k]) for i in coupled), strict=True)
    labels = [_free_name(names[i], {*motion.values, *names}) for i in coupled]
    constants = [*map(ex.Symbol, labels)]
    rates = [ex.Velocity(name) for name in names]
    momenta = [ex.Symbol(f"p_{name}") for name in names]
    terms = [c * rates[i] ** 2 / d for i, c, d in zip(coupled, constants, directions, strict=True)]
    images = [
        d * momenta[i] ** 2 / c for i, c, d in zip(coupled, constants, directions, strict=True)
    ]
    free = [i for i in range(len(names)) if i not in coupled]
    shifted = momenta[k] + ex.HALF * ex.add(*images) / norm
    energies = [shifted if i == k else momenta[i] for i in free]

    @np.errstate(all="ignore")
    def start_momenta(positions: Array, velocities: Array, values: Mapping[str, Any]) -> Array:
        """p = dL~/dv at starts on the constraints, (n,) or (m, n), with its limit where a d_i
        vanishes there.

        p_i = C_i n q_i'/(d_i r') is a constant of the motion; on the constraints q_i' is c d_i/n,
        so that the quotient stays finite: it is taken from d_i/d_i stripped, a constant. Not finite
        where r' = 0 or all d_i = 0.
        """
        places, speeds = np.atleast_2d(positions), np.atleast_2d(velocities)
        table, rate = turning_table(replace(motion, values=values), places[:, k]), speeds[:, k]
        d = np.zeros(places.shape)
        d[:, [*raw]] = np.transpose(arrays.array_values([*raw.values()], table))
        length = np.sqrt(np.einsum("mi,ij,mj->m", d, motion.mass, d))
        speed = np.einsum("mi,ij,mj->m", d, motion.mass, speeds) / length
        size, *known = arrays.array_values([norm, *directions, *factors], table)
        found = speeds.astype(float)
        shift = np.zeros(len(places))
        for i, label, along, ratio in zip(
            coupled, labels, known, known[len(coupled) :], strict=False
        ):
            found[:, i] = values[label] * (size / length) * speed * ratio / rate
            shift += along * found[:, i] ** 2 / (2 * size * values[label])
        found[:, k] = rate - shift
        return found.reshape(positions.shape)

    lagrangian = ex.add(
        *(ex.HALF * rates[i] ** 2 for i in free), ex.HALF * norm * ex.add(*terms) / rates[k]
    )
    hamiltonian, known = (
        ex.add(*(ex.HALF * energy**2 for energy in energies)),
        {x: given.get(x, 1.0) for x in labels},
    )
    source = f"{'L~2' if steady else 'L~1'} of the second associated system"
    return scene_data.FreeLagrangian(lagrangian, hamiltonian, known, source, start_momenta)


def _free_name(name: str, taken: Collection[str]) -> str:
    """The first of C_x, free_x, C_x_2, C_x_3, ... that is not taken."""
    choices = (
        f"C_{name}",
        f"free_{name}",
        *(f"C_{name}_{count}" for count in range(2, len(taken) + 4)),
    )
    return next(choice for choice in choices if choice not in taken)


def _directions(motion: ExactMotion) -> dict[int, ex.Expression]:
    """d_i: the minors of the constraints with alternating signs, for every coordinate but the
    turning one.
    """
    others = [i for i in range(len(motion.coordinates)) if i != motion.turning]
    found = {}
    for place, i in enumerate(others):
        minor = collecting.determinant(
            [[row[j] for j in others if j != i] for row in motion.constraints]
        )
        found[i] = -minor if place % 2 else minor
    return found


def _is_constant(expression: ex.Expression, motion: ExactMotion) -> bool:
    """Whether a function of the turning coordinate has one value at random points, to round-off."""
    points = np.random.default_rng(1).uniform(-3, 3, SAMPLES)
    table = turning_table(motion, points)
    values = arrays.array_value(expression, table)
    values = values[np.isfinite(values)]
    return len(values) > 1 and bool(np.ptp(values) <= CONSTANT * np.abs(values).max())


def _split(direction: ex.Expression, name: str) -> tuple[ex.Expression, ex.Expression]:
    """The factors that hold the turning coordinate, and the others, which are constant."""
    factors = ex.factors_of(direction)
    moving = [factor for factor in factors if ex.holds(factor, ex.Symbol(name))]
    return ex.multiply(*moving), ex.multiply(
        *(factor for factor in factors if factor not in moving)
    )

"""Exact motions by quadrature, for systems recognized by their structure and not by their name.

Let L have constant coefficients, let the constraints omega_a(r) v = 0 depend on one coordinate r only,
contain no r', and leave one direction to the n - 1 other coordinates. Then r'' = 0, and the others have
the velocity c e(r), e(r) being that direction with e M e = 1: reactions do no work, so c is constant.

    r(t) = r_0 + u t,    q(t) = q_0 + c * integral of e(r_0 + u s) for s from 0 to t

That holds for the class of the paper with V = 0 (disk, knife edge: circles) and needs no A != 0.
Without constraints, or with constant ones, the motion is straight. Source: own computation; for the
class Mestdag, Bloch, Fernandez (2009), section 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import HALF, TIME, ZERO, Expression, Symbol, Velocity, add, walk
from inverse_service.integrators.trajectory import Array
from inverse_service.mechanics.euler_lagrange import Matrix, hessian
from inverse_service.simulation.array_values import NoValue, array_value

NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
MOST_PIECES = 4096
MOST_NODES = 2_000_000
INTERVALS_AT_ONCE = 5_000
TOLERANCE = 4e-16
RANK_LOST = (
    "on the way the constraints lose rank, or the kinetic energy along them is not positive, so the exact motion is "
    "not determined: change a parameter or the start"
)


@dataclass(frozen=True, slots=True)
class ExactMotion:
    """Coefficients omega (m, n) as trees in the one coordinate `turning`, mass matrix (n, n) as trees and numbers.

    `turning` is None where the motion is straight.
    """

    coordinates: tuple[str, ...]
    inertia: Matrix
    mass: Array
    constraints: tuple[tuple[Expression, ...], ...]
    turning: int | None
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class NoExactMotion:
    """Why no exact solution is known."""

    reason: str


def motion_by_quadrature(
    coordinates: Sequence[str],
    lagrangian: Expression,
    constraints: Sequence[Expression],
    values: Mapping[str, float],
) -> ExactMotion | NoExactMotion:
    """The exact motion of a system of the class above, or why it is not of it."""
    names = tuple(coordinates)
    inertia = hessian(lagrangian, names)
    mass = _mass(lagrangian, inertia, names, values)
    if mass is None:
        return NoExactMotion("The kinetic energy has coefficients that are not constant, or there is a potential.")
    if np.linalg.matrix_rank(mass) < len(names):
        return NoExactMotion("The kinetic energy is degenerate.")
    rows = [_coefficients(constraint, names) for constraint in constraints]
    linear = [row for row in rows if row is not None]
    if len(linear) < len(rows):
        return NoExactMotion("A constraint is not linear and homogeneous in the velocities.")
    used = {node.name for row in linear for entry in row for node in walk(entry) if isinstance(node, Symbol)}
    turning = [k for k, name in enumerate(names) if name in used]
    if TIME.name in used or len(turning) > 1:
        return NoExactMotion("The constraints depend on more than one coordinate.")
    found = ExactMotion(names, inertia, mass, tuple(linear), turning[0] if turning else None, dict(values))
    return found if not turning else _with_one_direction(found)


def _with_one_direction(found: ExactMotion) -> ExactMotion | NoExactMotion:
    k, names = found.turning or 0, found.coordinates
    if any(row[k] != ZERO for row in found.constraints):
        return NoExactMotion(f"A constraint contains the velocity of {names[k]}, on which it depends.")
    if np.delete(found.mass[k], k).any():
        return NoExactMotion(f"The kinetic energy couples {names[k]} with another coordinate.")
    if len(found.constraints) != len(names) - 2:
        return NoExactMotion(f"The constraints leave more than one direction besides {names[k]}.")
    return found


def _mass(lagrangian: Expression, inertia: Matrix, names: tuple[str, ...], values: Mapping[str, float]) -> Array | None:
    rates = [Velocity(name) for name in names]
    table: dict[Expression, float] = {Symbol(name): value for name, value in values.items()}
    kinetic = add(*(HALF * entry * rates[i] * rates[j] for i, row in enumerate(inertia) for j, entry in enumerate(row)))
    rest = collect(lagrangian - kinetic)
    try:
        array_value(rest, table)
        return np.array([[float(array_value(entry, table)[0]) for entry in row] for row in inertia])
    except NoValue:
        return None


def _coefficients(constraint: Expression, names: tuple[str, ...]) -> tuple[Expression, ...] | None:
    """The coefficients of the velocities; None where the constraint has any other part."""
    row = tuple(collect(differentiate(constraint, Velocity(name))) for name in names)
    if any(isinstance(node, Velocity) for entry in row for node in walk(entry)):
        return None
    rest = constraint - add(*(entry * Velocity(n) for entry, n in zip(row, names, strict=True)))
    return row if collect(rest) == ZERO else None


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
    """The integral of e from 0 to each time, (m, n - 1); Gauss-Legendre on pieces that are halved until it stands."""
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


def turning_table(motion: ExactMotion, turning: Array) -> dict[Expression, Any]:
    """The values of the parameters, and these of the turning coordinate, for `array_value`."""
    table: dict[Expression, Any] = {Symbol(name): value for name, value in motion.values.items()}
    return table | {Symbol(motion.coordinates[motion.turning or 0]): turning}


def _direction(motion: ExactMotion, turning: Array) -> Array:
    """e(r), (m, n - 1): the cross product of the rows of omega, with e M e = 1. It never jumps in sign."""
    k = motion.turning or 0
    others = [i for i in range(len(motion.coordinates)) if i != k]
    table = turning_table(motion, turning)
    rows = np.empty((len(turning), len(motion.constraints), len(others)))
    for a, row in enumerate(motion.constraints):
        for j, i in enumerate(others):
            rows[:, a, j] = array_value(row[i], table)
    minors = [np.linalg.det(np.delete(rows, j, axis=2)) * (-1) ** j for j in range(len(others))]
    direction = np.column_stack(minors)
    mass = motion.mass[np.ix_(others, others)]
    norm = np.sqrt(np.einsum("ij,jk,ik->i", direction, mass, direction))
    if not np.isfinite(norm).all() or norm.min() <= 1e-12 * max(1.0, float(norm.max())):
        raise ValueError(RANK_LOST)
    found: Array = direction / norm[:, None]
    return found

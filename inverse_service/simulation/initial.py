"""Initial velocities: filled in where the constraints determine them, projected on request, else
checked.

Constraints w(q) v + c(q) = 0. The projection is orthogonal in the kinetic energy, g = L_vv:

    v - g^-1 w^T (w g^-1 w^T)^-1 (w v + c)
"""

import math
import random
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.expressions import arrays, calculus, collecting, functions, tree as ex
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import scene_graph
from inverse_service.simulation.numeric_formulas import arrays_by_name
from inverse_service.simulation.scene_data import Members, Problem, Scene
from inverse_service.simulation.sentences import say

TOLERANCE = 1e-9
RANK = 1e-10
NEARBY = 6
MOST_ITERATIONS = 60


System = Problem | Scene  # coordinates, a Lagrangian where there is one, and constraints
Values = Mapping[str, float | Array]  # one number, or one for each start


def forms_of(what: System) -> list[tuple[ex.Expression, ...]]:
    """w(q): the coefficients of the velocities, a row for each constraint."""
    return [euler_lagrange.momenta(w, what.coordinates) for w in what.constraints]


def drifts_of(what: System) -> list[ex.Expression]:
    """c(q): what is free of the velocities in each constraint."""
    rest = {ex.Velocity(name): ex.ZERO for name in what.coordinates}
    return [collecting.collect(ex.substitute(w, rest)) for w in what.constraints]


def saddle(what: System, table: Mapping[ex.Expression, Any]) -> Array:
    """[[g, w^T], [w, 0]] at the points of a table, (N, n + m, n + m)."""
    graph, inputs, count = scene_graph.on_table(
        what.coordinates, what.lagrangian, what.constraints, table
    )
    return graph.saddle(inputs, count)


def at_start(scene: Scene, values: Values) -> dict[ex.Expression, Any]:
    """The names of all formulas with their values at the start."""
    moment = np.array([scene.grid.begin])
    return arrays_by_name(
        scene.coordinates, scene.positions[None], scene.velocities[None], values, moment
    )


def check_constraints(what: System, values: Values, positions: Array) -> None:
    """Raise InputError for constraints that are nonlinear in the velocities or dependent, or that
    leave no motion.
    """
    names, constraints = what.coordinates, what.constraints
    for place, slopes in enumerate(forms_of(what), 1):
        if all(slope == ex.ZERO for slope in slopes):
            raise InputError(f"constraint {place} has no velocity in it: leave it out.", "/system")
        if any(isinstance(node, ex.Velocity) for slope in slopes for node in ex.walk(slope)):
            raise InputError(say("not_linear", place), "/system")
    if not constraints:
        return
    nearby = np.random.default_rng(3)
    rank = np.linalg.matrix_rank(_linear(what, values, positions[None])[0][0])
    for _ in range(NEARBY):
        with suppress(InputError):  # where they have no values
            rows = _linear(what, values, positions[None] + nearby.normal(0, 1, len(positions)))[0][
                0
            ]
            rank = max(rank, np.linalg.matrix_rank(rows))
    if rank < len(constraints):
        raise InputError(say("dependent", rank, len(constraints)), "/system")
    if rank >= len(names):
        raise InputError(say("no_motion_left", rank, len(names)), "/system")


def without_value(scene: Scene) -> NDArray[np.bool_]:
    """Whether the Lagrangian of the scene has no value at the start, (1,), or at those of the
    members, (N,).

    Its derivatives may have values there: that of log(x - 5) has one at x = 1, where there is no
    motion.
    """
    starts = scene.ensemble or Members(scene.positions[None], scene.velocities[None], {})
    if scene.lagrangian is None:
        return np.zeros(len(starts.positions), dtype=bool)
    moments = np.full(len(starts.positions), scene.grid.begin)
    values: dict[str, float | Array] = {**scene.values, **starts.values}
    table = arrays_by_name(scene.coordinates, starts.positions, starts.velocities, values, moments)
    return ~np.isfinite(arrays.array_value(scene.lagrangian, table))


def ended_at_start(scene: Scene) -> Trajectory | None:
    """The run that ends before its first step where the Lagrangian has no value at the start; None
    elsewhere.

    Of an ensemble, each member ends for itself.
    """
    if scene.ensemble is not None or not without_value(scene).all():
        return None
    begin = scene.grid.begin
    outcome = Outcome(
        "off_domain", 0, begin, say("start_without_value", begin), None, "start somewhere else"
    )
    return Trajectory.of_start(begin, scene.positions, scene.velocities, outcome)


def is_degenerate(scene: Scene) -> bool:
    """Whether L_vv, on the velocities that the constraints leave, is singular at the start and
    about it.
    """
    assert scene.lagrangian is not None
    shape, draw = (NEARBY, 2, len(scene.coordinates)), random.Random(4)
    shifts = np.array([draw.gauss(0, 0.1) for _ in range(math.prod(shape))]).reshape(shape)
    shifts[0] = 0.0
    states = np.stack([scene.positions, scene.velocities]) + shifts
    moments = replace(scene.grid, steps=NEARBY - 1, record_every=1).times
    whole = saddle(
        scene, arrays_by_name(scene.coordinates, states[:, 0], states[:, 1], scene.values, moments)
    )
    known, size = np.isfinite(whole).all(axis=(1, 2)), np.abs(whole).max(axis=2)
    if not known.all():
        return False
    return not any(
        (sizes > 0).all() and _has_full_rank(one / sizes[:, None])
        for one, sizes in zip(whole, size, strict=True)
    )


def _has_full_rank(matrix: Array) -> bool:
    """Whether a matrix with rows of size 1 is regular to the accuracy of its entries: at once where
    it is diagonal, as of any number of bodies.
    """
    if np.count_nonzero(matrix) == np.count_nonzero(np.diagonal(matrix)):
        return bool(np.diagonal(matrix).all())
    return bool(np.linalg.matrix_rank(matrix) == len(matrix))


def is_singular_at_start(scene: Scene) -> bool:
    """Whether [[L_vv, w^T], [w, 0]] is singular at the start to the accuracy of its entries, so
    that neither accelerations nor velocities follow there; those of an ensemble end for themselves.
    """
    if scene.ensemble is not None:
        return False
    (whole,) = saddle(scene, at_start(scene, scene.values))
    sizes = np.abs(whole).max(axis=1)
    if not np.isfinite(sizes).all():
        return False
    return bool((sizes == 0).any() or not _has_full_rank(whole / sizes[:, None]))


def initial_velocities(
    what: System, values: Values, positions: Array, given: Values, project: bool
) -> Array:
    """The velocities of a start (n,), or of N starts (N, n), on the constraints; `values` and
    `given` are numbers or (N,).

    InputError (pointer below /initial) where some are missing that the constraints do not
    determine, and where the given ones violate the constraints and `project` is not set.
    """
    names, places = what.coordinates, np.atleast_2d(positions)
    rows, offsets = _linear(what, values, places)
    velocities = _filled(names, rows, offsets, given)
    defects = _times(rows, velocities) + offsets
    beyond = np.abs(defects) - TOLERANCE * (
        1 + _times(np.abs(rows), np.abs(velocities)) + np.abs(offsets)
    )
    worst = int(np.argmax(beyond)) if beyond.size else 0
    if beyond.size and beyond.flat[worst] > 0:
        # Projected, orthogonally in the kinetic energy.
        n = len(names)
        mass = saddle(what, arrays_by_name(names, places, velocities, values))[:, :n, :n]
        if not np.isfinite(mass).all():
            raise InputError(say("no_kinetic_at_start"), "/initial")
        lifted = np.asarray(np.linalg.pinv(mass) @ rows.transpose(0, 2, 1), dtype=float)
        multipliers = _times(np.asarray(np.linalg.pinv(rows @ lifted), dtype=float), defects)
        better = velocities - _times(lifted, multipliers)
        if (
            not np.isfinite(better).all()
            or np.abs(_times(rows, better - velocities) + defects).max() > 1e-6
        ):
            raise InputError(say("not_projected"), "/initial")
        off = (beyond > 0).any(axis=1)
        if not project:
            member, place = divmod(worst, len(what.constraints))
            hint = ", ".join(
                f"{name} {value:.9g}" for name, value in zip(names, better[member], strict=True)
            )
            fault = f"member {member}: " if len(places) > 1 else ""
            fault += say("violated", place + 1, defects[member, place])
            plain = say("violated_plain", fault, hint)
            raise InputError(
                say("violated_project", fault, hint), "/initial/velocities", plain=plain
            )
        velocities[off] = better[off]
    return velocities.reshape(positions.shape)


def _times(matrices: Array, vectors: Array) -> Array:
    """(N, m, n) times (N, n)."""
    found: Array = np.einsum("kmn,kn->km", matrices, vectors)
    return found


def angles(scene: Scene) -> NDArray[np.bool_]:
    """Which coordinates are angles, (n,): they occur only in sines and cosines of their integer
    multiples.
    """
    known = ex.distinct_nodes(scene.formulas)
    waves = [
        node for node in known if isinstance(node, ex.Apply) and node.function in functions.CIRCULAR
    ]

    def is_angle(name: ex.Symbol) -> bool:
        turns: dict[ex.Expression, ex.Expression] = {}
        for wave in waves:
            slope = calculus.differentiate(wave.argument, name)
            if isinstance(slope, ex.Number) and slope != ex.ZERO and slope.value.denominator == 1:
                turns[wave] = ex.PI
        return bool(turns) and not any(
            ex.holds(ex.substitute(tree, turns), name) for tree in scene.formulas
        )

    return np.array([is_angle(ex.Symbol(name)) for name in scene.coordinates])


def velocities_from_momenta(
    what: System, values: Mapping[str, float], positions: Array, target: Array
) -> Array:
    """v with dL/dv(q, v) = p, (n,); one step for a quadratic L, Newton elsewhere. InputError where
    that fails.
    """
    if what.lagrangian is None:
        raise InputError(say("no_momenta"), "/initial/momenta")
    names, n = what.coordinates, len(what.coordinates)
    masses = euler_lagrange.hessian(what.lagrangian, names)
    trees = [
        *euler_lagrange.momenta(what.lagrangian, names),
        *(entry for row in masses for entry in row),
    ]
    for attempt in (0.0, 1.0, 0.1):
        velocities = np.full(n, attempt)
        for _ in range(MOST_ITERATIONS):
            table = arrays_by_name(names, positions[None], velocities[None], values)
            found = np.array(arrays.array_values(trees, table))[:, 0]
            if not np.isfinite(found).all():
                break
            left = target - found[:n]
            if np.abs(left).max() <= 1e-13 * (1 + np.abs(target).max()):
                return velocities
            velocities = velocities + np.linalg.lstsq(found[n:].reshape(n, n), left, rcond=None)[0]
    raise InputError(say("no_velocities_of_momenta"), "/initial/momenta")


def _linear(what: System, values: Values, positions: Array) -> tuple[Array, Array]:
    """The coefficients of the velocities (N, m, n) and what is free of them (N, m) at the positions
    (N, n).
    """
    names, constraints = what.coordinates, what.constraints
    table = arrays_by_name(names, positions, np.zeros(positions.shape), values)
    shape = (len(constraints), len(names), len(positions))
    entries = [entry for row in forms_of(what) for entry in row]
    rows = np.array(arrays.array_values(entries, table)).reshape(shape).transpose(2, 0, 1)
    offsets = np.array(arrays.array_values(constraints, table)).reshape(shape[::2]).T
    if not (np.isfinite(rows).all() and np.isfinite(offsets).all()):
        raise InputError(say("no_constraint_at_start"), "/initial/positions")
    return rows, offsets


def _filled(names: tuple[str, ...], rows: Array, offsets: Array, given: Values) -> Array:
    velocities = np.zeros((len(rows), len(names)))
    for k, name in enumerate(names):
        velocities[:, k] = given.get(name, 0.0)
    missing = [k for k, name in enumerate(names) if name not in given]
    if not missing:
        return velocities
    inner = rows[:, :, missing]
    sizes = np.linalg.svd(inner, compute_uv=False)
    ranks = (sizes > RANK * np.maximum(sizes.max(axis=1, initial=0.0), 1e-300)[:, None]).sum(axis=1)
    if (ranks < len(missing)).any():
        one = inner[int(np.argmin(ranks))]  # what its null space moves is open
        open_ = np.flatnonzero(
            np.abs(np.eye(len(missing)) - np.linalg.pinv(one, RANK) @ one).max(axis=0) > 1e-8
        )
        shown, wanted = ", ".join(names[missing[k]] for k in open_), len(missing) - int(ranks.min())
        add_ = "them" if wanted == len(open_) else f"{wanted} of them"
        fault = (
            say("velocities_missing", shown, add_)
            if len(open_) > 1
            else say("velocity_missing", shown)
        )
        raise InputError(fault, "/initial/velocities")
    square = inner.shape[1] == inner.shape[2]
    inverse = np.asarray((np.linalg.inv if square else np.linalg.pinv)(inner), dtype=float)
    velocities[:, missing] = -_times(inverse, offsets + _times(rows, velocities))
    return velocities

"""What lies between two points of a run: whether a force acts there that neither of them shows.

Along the straight way from point to point, with its mean velocity, each force F_i(q, v, t) is compared with the broken
line through its values at PIECES places. Bounds of F over boxes of the way, cut where they are wide, show the impulse
of the difference however narrow it is: no place is missed between two samples. Too much is a share HIDDEN of the
kinetic energy, as h |v| int |F_i - line| ds against 2 T.

Forces are dL/dq_i and the further forces, or the accelerations. Polynomials are not looked at: nothing narrow is in
them. What lies beside the straight ways, and in the coefficients of constraints, is not looked at either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import TIME, Apply, Expression, Number, Power, Symbol, Velocity, walk
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation.derivation import Derived, derived_for_truth, with_accelerations
from inverse_service.simulation.execution import HIDDEN_QUANTITY
from inverse_service.simulation.impulses import SHARE, Ways, hidden_impulses
from inverse_service.simulation.methods import run
from inverse_service.simulation.observing import point_kinetic
from inverse_service.simulation.quantities import Observed
from inverse_service.simulation.scene_data import (
    OWN_STEPS,
    SCIPY,
    Grid,
    MethodChoice,
    Observation,
    Scene,
    Start,
    Stop,
    Unavailable,
)
from inverse_service.simulation.truth import PARTED, Truth
from inverse_service.simulation.watches import RESOLVE

HIDDEN, PIECES, OWN_PIECES = 0.1, 16, 4  # less for methods with steps of their own, whose stages lie between
MOST_STEPS, MOST_OF_MEMBERS = 100_000, 2**16
_NEAR = 5  # steps
_MOST_AGAIN, _ALIKE = 16, 1e-3
Paths = Callable[[NDArray[np.int64]], tuple[Array, Ways]]
AGAIN = MethodChoice("adaptive", tolerance=1e-12)
LEAPT = "there the reference solutions went by a force that is too narrow for their steps"
LOOKED = (
    "The forces were bounded on the straight way between every two points: none changes the momentum by more than "
    f"{HIDDEN:g} of itself unseen. What lies beside these ways was not looked at."
)
POLYNOMIAL = "Nothing was looked for between the points: the forces are polynomials of the state."
VELOCITIES = "Nothing was looked for between the points; a force that is narrow in the velocities may lie there."
TOO_MANY = f"What lies between the points was not looked at: there are more than {MOST_STEPS:,} steps."
UNDECIDED = (
    "The forces were bounded on the straight way between every two points; on {} of {} ways that decided nothing."
)
OWN = "What lies between the points was not looked at: the method chooses steps of its own."
MEMBERS = "Of {} of {} members: {}"
NO_GUARD = "What lies between the points was not looked at: the guard was off."


def forces(scene: Scene, velocities: bool = False) -> tuple[Expression, ...]:
    """The forces that may hide something, as they are no polynomials of place and time, or of `velocities` too."""
    trees = scene.accelerations or ()
    if scene.lagrangian is not None:
        trees = tuple(differentiate(scene.lagrangian, Symbol(name)) for name in scene.coordinates) + scene.forces
    places: set[Expression] = {TIME, *map(Symbol, scene.coordinates)}
    places |= set(map(Velocity, scene.coordinates)) if velocities else set()
    return tuple(tree for tree in trees if any(_is_narrow(node, places) for node in walk(tree)))


def forces_of_velocities(scene: Scene) -> tuple[Expression, ...]:
    """Those that may be narrow in the velocities."""
    speeds: set[Expression] = set(map(Velocity, scene.coordinates))
    return tuple(
        tree for tree in forces(scene, velocities=True) if any(_is_narrow(node, speeds) for node in walk(tree))
    )


def nothing_sought(scene: Scene) -> str:
    """Why nothing was looked for, where no force hides anything from place to place."""
    return VELOCITIES if forces(scene, velocities=True) else POLYNOMIAL


def _is_narrow(node: Expression, places: set[Expression]) -> bool:
    if isinstance(node, Power):
        exponent = node.exponent
        if isinstance(exponent, Number) and exponent.value.denominator == 1 and exponent.value > 0:
            return False
    elif not isinstance(node, Apply):
        return False
    return any(part in places for part in walk(node))


def momentum_scale(scene: Scene, ways: Ways, members: int = 1) -> Array:
    """2 T/|v| of each way, (m,), those of one member after another: the greatest of the few about it, as where a
    motion turns it may be round-off."""
    rates = ways.moves / ways.step
    if scene.lagrangian is None:
        doubled = (rates**2).sum(axis=1)
    else:
        doubled = 2 * point_kinetic(scene, ways.starts, rates, ways.times, ways.values)
    doubled, squares = doubled.reshape(members, -1), (rates**2).sum(axis=1).reshape(members, -1)
    near = greatest_near(doubled) + doubled.max(axis=1, keepdims=True) / 20
    found: Array = near / np.maximum(np.sqrt(greatest_near(squares)), 1e-300)
    return found.ravel()


def greatest_near(kinetic: Array) -> Array:
    """The greatest of the few about each, along the last axis; nan counts for nothing."""
    padded = np.pad(kinetic, [(0, 0)] * (kinetic.ndim - 1) + [(_NEAR, _NEAR)], "edge")
    found: Array = np.fmax.reduce(sliding_window_view(padded, 2 * _NEAR + 1, axis=-1), axis=-1)
    return found


def hidden_in(run: Observed, derived: Derived, stop: Stop | None) -> tuple[Outcome | None, str]:
    """The outcome of a run to the end that something between its points would have led elsewhere, and a sentence that
    says what was looked at. `run` has all its points."""
    scene, at, choice = run.scene, run.trajectory, run.requested.choice
    trees = forces(scene)
    if choice is None or len(at.times) < 2:
        return None, ""
    if not trees or not choice.guard or scene.grid.steps > len(at.times) - 1:
        return None, nothing_sought(scene) if not trees else TOO_MANY if choice.guard else NO_GUARD
    ways = Ways(at.positions[:-1], np.diff(at.positions, axis=0), at.times[:-1], scene.grid.step, run.values)
    own = choice.method in OWN_STEPS | set(SCIPY)
    pieces = OWN_PIECES if own else PIECES
    found = hidden_impulses(scene.coordinates, trees, ways, HIDDEN * momentum_scale(scene, ways), pieces, stop)
    for step in np.flatnonzero(found.impulses)[:_MOST_AGAIN]:
        if own and _leads_alike(scene, derived, at, int(step), found.part[step]):
            continue
        size = float(found.impulses[step])
        return Outcome("unresolved", int(step), float(at.times[step]), HIDDEN_QUANTITY, size, RESOLVE), LOOKED
    unsure = int(found.open.sum()) + max(0, int((found.impulses > 0).sum()) - _MOST_AGAIN)
    return None, UNDECIDED.format(unsure, len(at.times) - 1) if unsure else LOOKED


def hidden_in_members(
    scene: Scene,
    choice: MethodChoice,
    count: int,
    paths: Paths,
    stop: Stop | None,
) -> tuple[dict[int, tuple[int, float]], str]:
    """{member: (step, impulse)} of an ensemble of `count`, and a sentence: some are looked at, and all where something
    is found. `paths` gives the positions (N, m, n) of some members with all points, and their ways."""
    if not forces(scene) or not choice.guard:
        return {}, NO_GUARD if forces(scene) else nothing_sought(scene)
    if choice.method in OWN_STEPS | set(SCIPY) or scene.grid.steps > MOST_OF_MEMBERS:
        return {}, OWN if choice.method in OWN_STEPS | set(SCIPY) else TOO_MANY
    at_once = max(1, MOST_OF_MEMBERS // max(scene.grid.steps, 1))
    sample = np.unique(np.linspace(0, count - 1, min(count, at_once)).astype(int))
    rest = np.setdiff1d(np.arange(count), sample)
    found = _of_members(scene, sample, paths, stop)
    looked = len(sample)
    for first in range(0, len(rest) if found else 0, at_once):
        if stop is not None and stop():
            break
        more = rest[first : first + at_once]
        found |= _of_members(scene, more, paths, stop)
        looked += len(more)
    return found, MEMBERS.format(f"{looked:,}", f"{count:,}", LOOKED[:1].lower() + LOOKED[1:])


def _of_members(
    scene: Scene,
    members: NDArray[np.int64],
    paths: Paths,
    stop: Stop | None,
) -> dict[int, tuple[int, float]]:
    positions, ways = paths(members)
    allowed = HIDDEN * momentum_scale(scene, ways, len(members))
    there = np.flatnonzero(np.isfinite(ways.moves).all(axis=1) & np.isfinite(ways.starts).all(axis=1))
    found = hidden_impulses(scene.coordinates, forces(scene), ways.part(there), allowed[there], PIECES, stop)
    first: dict[int, tuple[int, float]] = {}
    for k in np.flatnonzero(found.impulses):
        member, step = divmod(int(there[k]), positions.shape[1] - 1)
        first.setdefault(int(members[member]), (step, float(found.impulses[k])))
    return first


def without_hidden(scene: Scene, derived: Derived, truth: Truth, stop: Stop | None) -> Truth:
    """The true motion, unknown from where its references went by something that leads elsewhere."""
    trees = forces(scene)
    if truth.against == "exact" or not trees:
        return truth
    count = len(truth.times) if not truth.reason else int(np.isfinite(truth.positions).all(axis=1).sum())
    ways = Ways(truth.positions[:count - 1], np.diff(truth.positions[:count], axis=0), truth.times[:count - 1],
                scene.grid.step * scene.grid.record_every, scene.values)  # fmt: skip
    found = hidden_impulses(scene.coordinates, trees, ways, HIDDEN * momentum_scale(scene, ways), OWN_PIECES, stop)
    for step in np.flatnonzero(found.impulses)[:_MOST_AGAIN]:
        path = Trajectory(truth.times, truth.positions, None, truth.velocities, Outcome("completed"), 0, 0, 0.0, 0.0)
        if not _leads_alike(scene, derived, path, int(step), found.part[step]):
            lost = np.arange(len(truth.times)) > step
            known = [np.where(lost[:, None], np.nan, rows) for rows in (truth.positions, truth.velocities)]
            bounds_ = np.where(lost, np.nan, truth.bounds)
            return replace(truth, positions=known[0], velocities=known[1], bounds=bounds_,
                           reason=PARTED.format(truth.times[step], LEAPT))  # fmt: skip
    return truth


def _leads_alike(scene: Scene, derived: Derived, at: Trajectory, step: int, part: Array) -> bool:
    """Whether a way begun again, with short steps where something is hidden, ends where it did."""
    problem = with_accelerations(scene, derived_for_truth(scene, derived))
    if isinstance(problem, Unavailable) or at.velocities is None:
        return False
    length, (first, last) = float(at.times[step + 1] - at.times[step]), part
    width = max(last - first, 1e-9)
    first, last = max(0.0, first - width), min(1.0, last + width)
    position, velocity, moment = at.positions[step], at.velocities[step], float(at.times[step])
    for share, count in ((first, 1), (last - first, SHARE), (1.0 - last, 1)):
        if share <= 0:
            continue
        start = Start(tuple(position), velocities=tuple(velocity))
        grid = Grid(share * length / count, count, count, moment)
        found = run(problem, AGAIN, start, grid, dict(scene.values), Observation(momenta=False))
        if not found.outcome.completed or found.velocities is None:
            return False
        position, velocity, moment = found.positions[-1], found.velocities[-1], moment + share * length
    moved = np.linalg.norm(at.positions[step + 1] - at.positions[step])
    apart = np.linalg.norm(position - at.positions[step + 1]), np.linalg.norm(velocity - at.velocities[step + 1])
    return bool(apart[0] <= _ALIKE * moved and apart[1] <= _ALIKE * np.linalg.norm(at.velocities[step : step + 2]))

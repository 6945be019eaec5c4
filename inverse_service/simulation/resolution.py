"""Whether the steps of a run saw what it moves through: a run to the end that leapt over something is `unresolved`.

In two steps: the energy, a constant, changes by half of the kinetic energy; of a method with a tolerance, by far more
than that. A run with a Lagrangian that has another motion there than the given equations is `off_domain`.

A run that is none of these stays `completed`; how far it is from the motion, `estimates` says.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from inverse_service.expressions.tree import TIME, Apply, holds, walk
from inverse_service.integrators.method_table import OWN_STEPS, SCIPY
from inverse_service.integrators.trajectory import Array, Outcome, Trajectory
from inverse_service.simulation.array_values import array_value, table_of
from inverse_service.simulation.free_lagrangians import NOTICED, distance_of_motion
from inverse_service.simulation.observing import (
    end_of_energy,
    lagrangian_of_energy,
    point_energy,
    point_kinetic,
    why_energy_varies,
)
from inverse_service.simulation.quantities import Observed, velocities_at_points
from inverse_service.simulation.watches import OTHER_MOTION, RESOLVE

_JUMPS = "the change of the energy, a constant, in two steps: more than {} of the kinetic energy"
_NOISE = 1e-6
_ROUND_OFF = 1e-14  # of formulas such as log(cos(x)) near 0, whose parts are of size 1
_ROUNDINGS = 4.0  # of the places at the ends of two steps
_OF_TOLERANCE = 1e8  # tolerances that the energy may change in two steps, in kinetic energies: steps of their own may
# enter a narrow force before they see it, and lose what it did until then
_OTHER = "the Euler-Lagrange equations of the free Lagrangian at the motion"
TOO_LARGE = 0.1  # of the size of the motion
SEES = frozenset({"adaptive", "stiff", *SCIPY})  # their estimate of the error sees it
ELSEWHERE = "`adaptive` ends {:.3g} from there: a force changes with t within the steps. Take a smaller step."
_NEAR = 5  # steps


def jump_of_energy(run: Observed) -> Outcome | None:
    """The outcome where one step or two change the energy, a constant, by half of the kinetic energy, or by what the
    tolerance of the method does not explain."""
    choice = run.requested.choice
    if choice is not None and not choice.guard:
        return None
    at, steps = run.trajectory, run.scene.grid.steps
    known = energies_of(run) if 0 < steps < len(at.times) else None  # every step was recorded
    if known is None:
        return None
    energies, kinetic = known
    share, noise = 0.5, np.zeros(len(energies) - 1)
    if choice is not None and choice.method in OWN_STEPS:
        share, rounded = min(share, _OF_TOLERANCE * choice.tolerance), rounding_of_energy(run, energies)
        noise = _ROUND_OFF + _ROUNDINGS * np.maximum(rounded[1:], rounded[:-1])
    near = greatest_near(kinetic)[1:] + kinetic.max() / 10
    allowed = share * near + min(_NOISE, share) * np.abs(energies[1:]) + noise
    before = np.stack([energies[:-1], np.concatenate([energies[:1], energies[:-2]])])  # one step, and two
    changes = energies[1:] - before
    places = np.flatnonzero((np.abs(changes) > allowed).any(axis=0))
    if not len(places):
        return None
    step = int(places[0])
    change = float(changes[np.abs(changes[:, step]).argmax(), step])
    return Outcome("unresolved", step, float(at.times[step]), _JUMPS.format(f"{share:.1g}"), change, RESOLVE)


def energies_of(run: Observed) -> tuple[Array, Array] | None:
    """E and the kinetic energy at the recorded points, (m,) each; None where E is no constant, or not known."""
    scene, at = run.scene, run.trajectory
    if lagrangian_of_energy(scene) is None or why_energy_varies(scene):
        return None
    velocities = velocities_at_points(run)
    if velocities is None or end_of_energy(scene, at.positions, velocities, at.times):
        return None
    points = scene, at.positions, velocities, at.times
    return point_energy(*points), point_kinetic(*points)


def rounding_of_energy(run: Observed, energies: Array) -> Array:
    """How far the next number after each place moves E, (m,): a motion near x = 10^9 is known to 10^-7 only."""
    at, found = run.trajectory, np.zeros_like(energies)
    if (velocities := velocities_at_points(run)) is None:
        return found
    for k in range(at.positions.shape[1]):
        places = at.positions.copy()
        places[:, k] = np.nextafter(places[:, k], np.inf)
        found += np.abs(point_energy(run.scene, places, velocities, at.times) - energies)
    return np.nan_to_num(found)


def greatest_near(kinetic: Array) -> Array:
    """The greatest of the few about each, along the last axis; nan counts for nothing."""
    padded = np.pad(kinetic, [(0, 0)] * (kinetic.ndim - 1) + [(_NEAR, _NEAR)], "edge")
    found: Array = np.fmax.reduce(sliding_window_view(padded, 2 * _NEAR + 1, axis=-1), axis=-1)
    return found


def other_motion(run: Observed) -> Outcome | None:
    """The outcome where the Lagrangian of the method has another motion at a point of the run than the equations.

    What is known of its domain is watched at every step; a Lagrangian that is given brings none.
    """
    scene, problem, at = run.scene, run.problem, run.trajectory
    if scene.accelerations is None or problem is None or problem.free_lagrangian is None:
        return None
    velocities = velocities_at_points(run)
    if velocities is None:
        return None
    table = table_of(scene.coordinates, at.positions, velocities, run.values, at.times)
    apart = distance_of_motion(problem.free_lagrangian, scene.coordinates, scene.accelerations, table)
    apart += np.sum([0 * array_value(f, table) for f in scene.accelerations], axis=0)  # no number where one has none
    apart[0] = 0.0  # where the start was looked at, which may be a pole that the motion leaves
    places = np.flatnonzero(~(apart <= NOTICED))
    if not len(places):
        return None
    point = int(places[0])
    step = min(point * scene.grid.record_every, scene.grid.steps)
    return Outcome("off_domain", step, float(at.times[point]), _OTHER, float(apart[point]), OTHER_MOTION)


def has_functions_of_time(run: Observed) -> bool:
    """Whether t is in a function of the formulas: that may change faster than the steps, and a pulse lie between two of
    them, which neither they nor half of them show."""
    problem, choice = run.problem, run.requested.choice
    if problem is None or choice is None or not choice.guard or choice.method in SEES:
        return False
    trees = (problem.lagrangian, problem.free_lagrangian, *(problem.accelerations or ()), *problem.forces)
    nodes = (node for tree in trees if tree is not None for node in walk(tree))
    return any(isinstance(node, Apply) and holds(node.argument, TIME) for node in nodes)


def apart_from(run: Observed, other: Trajectory) -> str:
    """A doubt where a run of DOP853 ends elsewhere, by a tenth of the motion's size."""
    at = run.trajectory
    if not other.outcome.completed or not len(at.times):
        return ""
    apart = float(np.abs(other.positions[-1] - at.positions[-1]).max())
    return ELSEWHERE.format(apart) if apart > TOO_LARGE * float(np.ptp(other.positions, axis=0).max()) else ""

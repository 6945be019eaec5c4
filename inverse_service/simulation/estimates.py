"""How far a run to the end is from the motion: an estimate of its error, and sentences where that is large.

The method is run again with half the step h. With an error C h^p both are apart by (1 - 2^-p) of that of the run; a
method with steps of its own gets a tenth of its tolerance too, where that is above round-off. What both runs do alike
is not seen by this: the energy, a constant, and the true motion, where that is known, are looked at too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.integrators.method_table import METHODS, OWN_STEPS
from inverse_service.integrators.trajectory import Array, Trajectory
from inverse_service.simulation.initial import angles
from inverse_service.simulation.observing import greatest
from inverse_service.simulation.quantities import Observed
from inverse_service.simulation.resolution import TOO_LARGE, energies_of
from inverse_service.simulation.scene_data import Grid, Requested, Scene, Truth, Unavailable, places_of
from inverse_service.simulation.watches import SMALLEST

MOST_STEPS = 1_000_000
CHANGED, TIGHTER, TIGHTEST, LEAST_RANGE, ROUND_OFF = 0.1, 0.1, 1e-14, 0.01, 1e-15
VARIES = "The energy, a constant, changes by {:.3g}, {:.2g} times the mean kinetic energy (at the start it is {:.3g})."
HALF = "half the step"
STRICTER, LOOSER = f"{HALF} and a tenth of the tolerance", f"{HALF} and ten times the tolerance"
AGAIN, TRUE = "With {} the method", "The true motion"
ELSEWHERE = "{} leads elsewhere: from t = {:.6g} on {} is off by about {:.3g}. Take a smaller step or tolerance."
GOES_ON = ("completed", "cancelled")
ENDS_EARLY = "With {} the run ends at t = {:.6g}, {}."


@dataclass(frozen=True, slots=True)
class Finer:
    """The same method on a finer `grid`, `how` a person says it, and the part of the error by which both are apart."""

    requested: Requested
    grid: Grid
    how: str
    part: float


def finer(requested: Requested, grid: Grid) -> Finer:
    """Half the step, over the first MOST_STEPS, at the same recorded times; where the method chooses its own steps
    within those another tolerance too."""
    choice, every = requested.choice, grid.record_every
    assert choice is not None
    steps = min(grid.steps, max(1, MOST_STEPS // every) * every)
    half = replace(grid, step=grid.step / 2, steps=2 * steps, record_every=2 * every)
    if choice.method not in OWN_STEPS:
        return Finer(requested, half, HALF, 1 - 0.5 ** (order_of(requested) or 1))
    if TIGHTER * choice.tolerance < TIGHTEST:
        return Finer(requested, half, HALF, 1.0)
    return Finer(replace(requested, choice=replace(choice, tolerance=TIGHTER * choice.tolerance)), half, STRICTER, 1.0)


def order_of(requested: Requested) -> int | None:
    """The order in h of the positions of a run, or of the steps that a method chooses itself; None where it varies."""
    choice = requested.choice
    if choice is None or not METHODS[choice.method].orders:
        return None if choice is None else METHODS[choice.method].order
    is_symmetric = choice.method == "runge_kutta" or choice.alpha == 0.5 or choice.symmetrised
    return choice.order if is_symmetric and requested.convention == "momenta" else 1


def errors_of(
    positions: Array, nearer: Array, turns: NDArray[np.bool_], part: float = 1.0
) -> tuple[Array, Array]:  # fmt: skip
    """Both (..., m, n): by how much positions are off, by round-off at least, and which share of the range of the
    coordinate that is, of at least LEAST_RANGE of the widest one, and of one of the angles `turns` at most a turn."""
    ranges = np.nanmax(nearer, axis=-2, keepdims=True) - np.nanmin(nearer, axis=-2, keepdims=True)
    ranges = np.where(turns, np.minimum(ranges, 2 * np.pi), ranges)
    noise = ROUND_OFF * np.abs(positions)
    least = np.maximum(LEAST_RANGE * ranges.max(axis=-1, keepdims=True), 100 * noise)
    errors = np.maximum(np.abs(positions - nearer) / part, noise)
    return errors, errors / np.maximum(np.maximum(ranges, least), SMALLEST)


Repeat = Callable[[Scene, Requested], Trajectory | Unavailable]


def _again(run: Observed, repeat: Repeat) -> tuple[Finer, Trajectory | Unavailable]:
    """The finer run: without the guard where that ends it early, and with ten times the tolerance where it is the same
    to the last bit, as that of a Taylor series whose own steps are shorter than those of both grids."""
    again = finer(run.requested, run.scene.grid)
    scene, choice = replace(run.scene, grid=again.grid), again.requested.choice
    found = repeat(scene, again.requested)
    if choice is None or isinstance(found, Unavailable):
        return again, found
    if found.outcome.kind not in GOES_ON:
        return again, repeat(scene, replace(again.requested, choice=replace(choice, guard=False)))
    if choice.method in OWN_STEPS and np.array_equal(found.positions, run.trajectory.positions):
        other = replace(again.requested, choice=replace(choice, tolerance=choice.tolerance / TIGHTER))
        return replace(again, how=LOOSER), repeat(scene, other)
    return again, found


def estimated(run: Observed, repeat: Repeat) -> dict[str, Any]:
    """{estimated_error, estimated_error_share, estimated_until, doubt}: the greatest error of a position, and the
    greatest share of the range of a coordinate; until when, where that is not the end; sentences where they are large.

    `repeat` runs a method of a scene.
    """
    at, doubts, turns = run.trajectory, [_change_of_energy(run)], angles(run.scene)
    numbers: dict[str, Any] = {}
    again, found = _again(run, repeat)
    if isinstance(found, Trajectory):
        count = min(len(found.times), len(at.times))
        errors, shares = errors_of(at.positions[:count], found.positions[:count], turns, again.part)
        numbers = {"estimated_error": greatest(errors), "estimated_error_share": greatest(shares)}
        numbers |= {"estimated_until": float(at.times[count - 1])} if count < len(at.times) else {}
        doubts.append(_elsewhere(run, errors, shares, AGAIN.format(again.how)))
        early = count < len(at.times) and found.outcome.kind not in GOES_ON
        if early and not doubts[-1]:
            doubts.append(ENDS_EARLY.format(again.how, found.times[-1], found.outcome.kind.replace("_", " ")))
    if isinstance(run.truth, Truth) and not any(doubts[1:]):
        doubts.append(
            _elsewhere(run, *errors_of(at.positions, run.truth.positions[places_of(run.truth, at.times)], turns), TRUE)
        )
    return numbers | {"doubt": " ".join(filter(None, doubts))}


def _elsewhere(run: Observed, errors: Array, shares: Array, which: str) -> str:
    """Where a coordinate is off by more than TOO_LARGE of its range."""
    far = shares > TOO_LARGE
    if not far.any():
        return ""
    first = int(far.any(axis=1).argmax())
    k = int(far[first].argmax())
    worst = float(np.nanmax(errors[:, k]))
    return ELSEWHERE.format(which, run.trajectory.times[first], run.scene.coordinates[k], worst)


def _change_of_energy(run: Observed) -> str:
    """max |E - E_0|, where it is more than CHANGED of the mean kinetic energy, which no constant in L changes; a tenth
    of that suffices where it is CHANGED of E_0, which is what `max_energy_error` shows."""
    if (known := energies_of(run)) is None:
        return ""
    energies, mean = known[0], max(float(known[1].mean()), SMALLEST)
    change, start = float(np.abs(energies - energies[0]).max()), abs(float(energies[0]))
    is_much = change > CHANGED * min(mean, max(start, CHANGED * mean))
    return VARIES.format(change, change / mean, start) if is_much else ""

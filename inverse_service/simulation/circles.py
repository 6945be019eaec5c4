"""Circles that match a plane path by least squares, and how they change.

The paper matches the variational solution by the circle through three of its points, (x - a)^2 + (y
- b)^2 = c^2; the least-squares circle uses all of them. Source: Mestdag, Bloch, Fernandez (2009),
section 4; Kasa (1976) for the start of the fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.sentences import say

# Below this sine of the largest angle three points are taken to lie on a line.
COLLINEAR = 1e-10
# Squares of larger numbers overflow.
LARGEST = 1e150
MOST_CORRECTIONS = 30
SHARE = 0.01
FEWEST_POINTS = 30
# Below pi the turning of a chord is no other angle; the margin is for rates that change.
LARGEST_TURN = 2.0
SAME_CHORD = 0.2


@dataclass(frozen=True, slots=True)
class Circle:
    """Center (x, y) and radius in the unit of the coordinates; `misfit` is the root mean square of
    |p - c| - r.
    """

    center: tuple[float, float]
    radius: float
    misfit: float = 0.0


@dataclass(frozen=True, slots=True)
class CircleDrift:
    """The matching circles of the first and of the last revolution.

    `revolutions` is the turning of the path over 2 pi; below one the whole path is both windows,
    and nothing can be said on a drift: `first` and `last` are then equal.
    """

    first: Circle
    last: Circle
    revolutions: float

    @property
    def centre_drift(self) -> float:
        """The distance of the two centers."""
        return float(np.hypot(*np.subtract(self.last.center, self.first.center)))


def circle_numbers(
    points: Array, exact: Array | None, every: int = 1, reach: float = np.inf
) -> dict[str, Any]:
    """The `circle` part of a summary; {"circle": None} with a note where the path is not round (a
    line, too few points).

    `every` says which steps were recorded, `reach` how long the way between two of them is at the
    start: a revolution is seen only where that turns by less than half of one.
    """
    drift = circle_drift(points, 0.0 if every == 1 else reach)
    if drift is None:
        return {"circle": None, "circle_note": say("not_round")}
    # The paper's matching circle: through three points a third of a revolution apart (or of the
    # path).
    last, known, whole = (
        len(points) - 1,
        np.isfinite(drift.revolutions),
        least_squares_circle(points),
    )
    third = max(1, int(last / max(1.0, drift.revolutions) / 3)) if known else 1
    three = least_squares_circle(points[[0, third, 2 * third]])
    numbers: dict[str, Any] = {
        "radius_first": drift.first.radius,
        "radius_last": drift.last.radius,
        "radius_change": drift.last.radius / drift.first.radius - 1,
        "centre_drift": drift.centre_drift,
        "misfit": drift.first.misfit,
        # The greatest distance of the path from its least-squares circle, relative to the radius.
        "shape_misfit": None if whole is None else float(radial_distance(points, whole).max()),
        "revolutions": drift.revolutions if known else None,
        "through_three_points": None
        if three is None
        else {"radius": three.radius, "center": list(three.center)},
    }
    if not known or drift.revolutions < 1:
        numbers["note"] = say("less_than_a_revolution" if known else "no_revolutions")
    reference = None if exact is None else least_squares_circle(exact)
    if reference is not None and reference.misfit <= 1e-6 * reference.radius:
        numbers["exact_radius"] = reference.radius
        numbers["max_radial_distance"] = float(radial_distance(points, reference).max())
    return {"circle": numbers}


def least_squares_circle(points: Array) -> Circle | None:
    """The circle that minimizes sum (|p_k - c| - r)^2 over (m, 2) points; None for fewer than
    three, or a line.

    Started from the algebraic fit sum (|p_k - c|^2 - r^2)^2, then Gauss-Newton.
    """
    points = np.asarray(points, dtype=float)
    if len(points) < 3 or not np.isfinite(points).all():
        return None
    mean = points.mean(axis=0)
    scale = float(np.abs(points - mean).max())
    if not 0 < scale < LARGEST:
        return None
    reduced = (points - mean) / scale
    matrix = np.column_stack([reduced, np.ones(len(points))])
    if np.linalg.svd(reduced, compute_uv=False)[-1] <= COLLINEAR * np.sqrt(len(points)):
        return None
    solution = np.linalg.lstsq(matrix, (reduced**2).sum(axis=1), rcond=None)[0]
    center = solution[:2] / 2
    # Gauss-Newton on the center, the radius being the mean distance; it stops where it no longer
    # gains.
    found, best = center, _cost(reduced, center)
    for _ in range(MOST_CORRECTIONS):
        difference = reduced - found
        distances = np.hypot(*difference.T)
        if not distances.all():
            break
        directions = -difference / distances[:, None]
        slopes = directions - directions.mean(axis=0)
        tried = found + np.linalg.lstsq(slopes, -(distances - distances.mean()), rcond=None)[0]
        if not (cost := _cost(reduced, tried)) < best:
            break
        found, best = tried, cost
    distances = np.hypot(*(reduced - found).T)
    radius = distances.mean()
    misfit = float(np.sqrt(((distances - radius) ** 2).mean()))
    absolute = mean + scale * found
    return Circle((float(absolute[0]), float(absolute[1])), float(scale * radius), scale * misfit)


def _cost(points: Array, center: Array) -> float:
    distances = np.hypot(*(points - center).T)
    return float(((distances - distances.mean()) ** 2).sum())


def circle_drift(points: Array, reach: float = 0.0) -> CircleDrift | None:
    """Matching circles of the first and the last revolution of a path, (m, 2); None where there is
    no circle.

    A revolution has as many points as steps fit into it, the chords turning by less than 2 pi: no
    direction counts twice. The first point is given and not computed: the first revolution starts
    after it. `reach` is the length of the way between two points, where not every step is known:
    chords that turn by more than LARGEST_TURN do not show revolutions, which are nan then, and the
    circles are those of the first and the last SHARE of the points.
    """
    points = np.asarray(points, dtype=float)
    whole = least_squares_circle(points)
    if whole is None:
        return None
    turning, back = np.abs(turned(points)), np.abs(turned(points[::-1]))
    revolutions = float(turning[-1]) / (2 * np.pi)
    full = 2 * np.pi * (1 - 1e-9)
    counts = [int((np.maximum.accumulate(angles) < full).sum()) - 1 for angles in (turning, back)]
    if reach:
        share = max(FEWEST_POINTS, int(SHARE * len(points)))
        near = least_squares_circle(points[1 : 1 + share]) or whole
        angle, chord = reach / near.radius, float(np.hypot(*(points[2] - points[1])))
        expected = 2 * near.radius * np.sin(angle / 2)
        if not (angle < LARGEST_TURN and abs(chord - expected) <= SAME_CHORD * expected):
            revolutions, counts = float("nan"), [share, share]
    if max(counts) + 2 >= len(points) or min(counts) < 3:
        return CircleDrift(whole, whole, revolutions)
    first, last = (
        least_squares_circle(points[1 : 1 + counts[0]]),
        least_squares_circle(points[-counts[1] :]),
    )
    return None if first is None or last is None else CircleDrift(first, last, revolutions)


def turned(points: Array) -> Array:
    """The angle in radians by which the chords p_k -> p_(k+1) have turned since the first, (m -
    1,).

    Chords of length zero keep the direction of the one before.
    """
    chords = np.diff(points, axis=0)
    moving = np.hypot(*chords.T) > 0
    places = np.maximum.accumulate(np.where(moving, np.arange(len(chords)), -1))
    places[places < 0] = int(np.argmax(moving))
    directions = np.arctan2(chords[:, 1], chords[:, 0])[places]
    angles = np.unwrap(directions)
    turning: Array = angles - angles[0]
    return turning


def radial_distance(points: Array, circle: Circle) -> Array:
    """| |p_k - c| - r | / r for each of (m, 2) points, dimensionless."""
    distances = np.hypot(*(np.asarray(points, dtype=float) - np.asarray(circle.center)).T)
    found: Array = np.abs(distances - circle.radius) / circle.radius
    return found


def phase_error(points: Array, exact: Array) -> Array:
    """The angle in radians by which the path runs ahead of the exact one, (m,) for (m, 2) points.

    It is read off the directions of the chords, so that a center that drifts and a radius that
    changes do not enter; row 0 is that of the first chord.
    """
    if len(points) < 2:
        return np.zeros(len(points))
    own, true = np.diff(points, axis=0), np.diff(exact, axis=0)
    difference = np.unwrap(np.arctan2(own[:, 1], own[:, 0]) - np.arctan2(true[:, 1], true[:, 0]))
    difference -= 2 * np.pi * np.round(difference[0] / (2 * np.pi))
    together: Array = np.concatenate([difference[:1], difference])
    return together

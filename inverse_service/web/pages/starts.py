"""Motions from several starts, how long each lasts, and one as a picture file, for pages without scripts and links."""

import io
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from inverse_service.errors import InputError
from inverse_service.expressions import arrays, printing, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.numeric_formulas import arrays_by_name
from inverse_service.web.pages.preview import moving_of, values_of

# Positions and velocities of the first coordinates; the last of each serves for all later ones.
STARTS = (
    ((0.1, 0.0), (1.0, 1.0, 0.0)),
    ((1.0, 0.5, 0.2), (0.1, 1.0, 0.3)),
    ((1.0, 0.3, 0.1), (0.2, 0.4, 0.1)),
    ((0.5, 0.2, 0.1), (0.1, 0.2, 0.3)),
    ((3.0, 1.0, 0.5), (0.1, 0.5, 0.2)),
    ((-1.0, -0.5, -0.2), (-0.1, -0.3, 0.2)),
    ((0.2, -0.3, 0.1), (-0.05, 0.1, 0.07)),
)
FAR = 6.0  # of a coordinate, or twice its start: beyond it is not drawn
LARGEST = 50.0  # of accelerations and of places
NEAR = 0.02  # a condition of the domain that comes closer to zero
LEAST_PART = 0.1  # of the determinant of the Hessian at the start
STEPS, STEP = 500, 0.04
ACCENT, SOFT, PAPER = "#1b4f8f", "#565f70", "#fbfaf6"
SIZES = {"svg": (4.1, 3.85), "png": (6.0, 3.15)}  # in inches; a shared link shows 1200 x 630 pixels
RESOLUTION = 200


def every_start(n: int) -> Array:
    """Positions and velocities (2, m, n) of all starts."""
    return np.array([[[part[min(k, len(part) - 1)] for k in range(n)] for part in parts]
                     for parts in zip(*STARTS, strict=True)])  # fmt: skip


class Lasted(NamedTuple):
    """How a motion goes from each start."""

    steps: Array
    evenness: Array
    motion: Array


@np.errstate(all="ignore")
def lasted(
    scene: Any,
    formulas: Sequence[ex.Expression],
    hessian: Sequence[ex.Expression],
    q: Array,
    v: Array,
    steps: int,
) -> Lasted:
    """For how many steps the classical Runge-Kutta method stays within bounds from each start (m,).

    And how even the determinant of the Hessian is on the way, from 0 to below 1; and the motions
    (steps, 2, m, n).
    """
    n, h = len(scene.coordinates), float(scene.grid.step)

    def values(q: Array, v: Array) -> Array:
        table = arrays_by_name(scene.coordinates, q, v, scene.values)
        columns = [
            np.broadcast_to(arrays.array_value(formula, table), len(q))
            for formula in (*formulas, *hessian)
        ]
        matrices = (
            np.stack(columns[len(formulas) :], axis=1).reshape(-1, n, n)
            if hessian
            else np.ones((len(q), 1, 1))
        )
        return np.stack([*columns[: len(formulas)], np.linalg.det(matrices)], axis=1)

    found, alive, first = np.zeros(len(q)), np.ones(len(q), dtype=bool), values(q, v)
    floor = np.full_like(first[:, n:], NEAR)
    floor[:, -1] = LEAST_PART * np.abs(first[:, -1])
    least = most = np.abs(first[:, -1])
    motion = []
    for _ in range(steps):
        a = values(q, v)
        alive &= (
            np.isfinite(a).all(1)
            & (np.abs(a[:, :n]) < LARGEST).all(1)
            & (np.abs(q) < LARGEST).all(1)
        )
        alive &= (np.abs(a[:, n:]) > floor).all(1) & (
            np.sign(a[:, n:]) == np.sign(first[:, n:])
        ).all(1)
        if not alive.any():
            break
        least = np.where(alive, np.minimum(least, np.abs(a[:, -1])), least)
        most = np.where(alive, np.maximum(most, np.abs(a[:, -1])), most)
        motion.append((q, v))
        b = values(q + h / 2 * v, v + h / 2 * a[:, :n])
        c = values(q + h / 2 * (v + h / 2 * a[:, :n]), v + h / 2 * b[:, :n])
        d = values(q + h * (v + h / 2 * b[:, :n]), v + h * c[:, :n])
        q = q + h * v + h * h / 6 * (a + b + c)[:, :n]
        v = v + h / 6 * (a + 2 * b + 2 * c + d)[:, :n]
        found += alive
    return Lasted(found, np.nan_to_num(0.9 * least / most), np.array(motion))


def drawn_motion(result: Mapping[str, Any]) -> tuple[Array, tuple[str, str]] | None:
    """A motion as points (m, 2) with the names of its axes: the velocity over a single coordinate,
    or a path.

    Of a general member; the part that is near. None where the accelerations cannot be evaluated.
    """
    moving = moving_of(result)
    if moving is None:
        return None
    coordinates, time = moving.names.coordinates, result["system"].get("time", "t")
    values = values_of(result, moving) | ({time: 0.0} if time != "t" else {})
    try:
        q, v = every_start(len(coordinates))
        table = arrays_by_name(coordinates, q, v, values)
        for name, slope in moving.velocities.items():
            v[:, coordinates.index(name)] = arrays.array_value(slope, table)
        scene: Any = SimpleNamespace(
            coordinates=coordinates, values=values, grid=SimpleNamespace(step=STEP)
        )
        steps, _, motion = lasted(scene, moving.accelerations, (), q, v, STEPS)
    except (InputError, KeyError, ValueError, ArithmeticError):
        return None
    best = int(np.argmax(steps))
    if steps[best] < 2:
        return None
    path = motion[: int(steps[best]), :, best]
    far = np.abs(path[:, 0]).max(axis=1) > np.maximum(FAR, 2 * np.abs(path[0, 0]).max())
    path = path[: max(2, int(np.argmax(far)))] if far.any() else path
    if len(coordinates) == 1:
        return path[:, :, 0], (
            printing.displayed_name(coordinates[0]),
            f"{printing.displayed_name(coordinates[0])}\u2032",
        )
    pair = ("x", "y") if {"x", "y"} <= set(coordinates) else coordinates[:2]
    return path[:, 0][:, [coordinates.index(name) for name in pair]], (
        printing.displayed_name(pair[0]),
        printing.displayed_name(pair[1]),
    )


def picture_of(result: Mapping[str, Any], ending: str, words: str) -> bytes | None:
    """The motion as SVG or PNG, the PNG with the verdict next to it; None if there is no motion to draw."""
    found = drawn_motion(result)
    if found is None:
        return None
    points, axes = found
    with mpl.rc_context({"svg.hashsalt": "answer", "font.size": 9, "text.usetex": False}):
        figure = Figure(SIZES[ending], facecolor=PAPER if ending == "png" else "none")
        place = figure.add_axes(
            (0.55, 0.16, 0.4, 0.72) if ending == "png" else (0.14, 0.12, 0.82, 0.8)
        )
        place.plot(points[:, 0], points[:, 1], color=ACCENT, linewidth=1.6)
        place.plot(*points[0], "o", color=PAPER, markeredgecolor=ACCENT, markersize=7)
        place.set_xlabel(axes[0])
        place.set_title(axes[1], loc="left", fontsize=9)
        place.set_facecolor("none")
        for side in ("top", "right"):
            place.spines[side].set_visible(False)
        if len(result["system"]["coordinates"]) > 1:
            place.set_aspect("equal", "datalim")
        if ending == "png":
            figure.text(0.06, 0.82, "inverse problem", color=ACCENT, fontsize=10)
            figure.text(0.06, 0.5, words, color="#1c2330", fontsize=13, va="center", wrap=True)
        stream = io.BytesIO()
        metadata = {"Date": None} if ending == "svg" else {}
        figure.savefig(stream, format=ending, dpi=RESOLUTION, metadata=metadata)
    return stream.getvalue()

"""The picture of an answer as a file: for pages without scripts, and for links that are shared."""

from __future__ import annotations

import io
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from inverse_service.errors import InputError
from inverse_service.expressions.derivative import define_functions
from inverse_service.integrators.trajectory import Array
from inverse_service.reading.names import Names
from inverse_service.reading.reader import has_acceleration, read_formula
from inverse_service.simulation.numeric_formulas import array_value, table_of
from inverse_service.web.pages import starts

STEPS, STEP = 500, 0.04
ACCENT, SOFT, PAPER = "#1b4f8f", "#565f70", "#fbfaf6"
SIZES = {"svg": (4.1, 3.85), "png": (6.0, 3.15)}  # in inches; a shared link shows 1200 x 630 pixels
RESOLUTION = 200


def motion_of(result: Mapping[str, Any]) -> tuple[Array, tuple[str, str]] | None:
    """A motion as points (m, 2) with the names of its axes: the velocity over a single coordinate, or a path.

    Parameters are 1. None where the accelerations cannot be evaluated.
    """
    system = result["system"]
    if system is None or any(has_acceleration(text) for text in system["equations"].values()):
        return None
    coordinates, functions = tuple(system["coordinates"]), system.get("functions") or {}
    time = system.get("time", "t")
    values = dict.fromkeys(system["parameters"], 1.0) | ({time: 0.0} if time != "t" else {})
    names = Names(coordinates, tuple(values), functions)
    moving = (result.get("nonholonomic") or {}).get("equations_of_motion")
    texts = {name: f["text"] for name, f in moving["accelerations"].items()} if moving else system["equations"]
    dependent = moving["first_order"] if moving else {}
    try:
        definitions = {name: (tuple(of), read_formula(f"1 + {of[0]}^2/4", names)) for name, of in functions.items()}
        f = [define_functions(read_formula(texts[name], names), definitions) for name in coordinates]
        slopes = {
            name: define_functions(read_formula(one["text"], names), definitions) for name, one in dependent.items()
        }
        q, v = starts.every_start(len(coordinates))
        table = table_of(coordinates, q, v, values)
        for name, slope in slopes.items():
            v[:, coordinates.index(name)] = array_value(define_functions(slope, definitions), table)
        scene: Any = SimpleNamespace(coordinates=coordinates, values=values, grid=SimpleNamespace(step=STEP))
        lasted, _, motion = starts.lasted(scene, f, (), q, v, STEPS)
    except (InputError, KeyError, ValueError, ArithmeticError):
        return None
    best = int(np.argmax(lasted))
    if lasted[best] < 2:
        return None
    path = motion[: int(lasted[best]), :, best]
    if len(coordinates) == 1:
        return path[:, :, 0], (coordinates[0], f"{coordinates[0]}\u2032")
    pair = ("x", "y") if {"x", "y"} <= set(coordinates) else coordinates[:2]
    return path[:, 0][:, [coordinates.index(name) for name in pair]], (pair[0], pair[1])


def picture_of(result: Mapping[str, Any], ending: str, words: str) -> bytes | None:
    """The motion as SVG or PNG, the PNG with the verdict beside it; None where there is no motion to draw."""
    found = motion_of(result)
    if found is None:
        return None
    points, axes = found
    with mpl.rc_context({"svg.hashsalt": "answer", "font.size": 9, "text.usetex": False}):
        figure = Figure(SIZES[ending], facecolor=PAPER if ending == "png" else "none")
        place = figure.add_axes((0.55, 0.12, 0.4, 0.76) if ending == "png" else (0.12, 0.1, 0.84, 0.86))
        place.plot(points[:, 0], points[:, 1], color=ACCENT, linewidth=1.6)
        place.plot(*points[0], "o", color=PAPER, markeredgecolor=ACCENT, markersize=7)
        place.set_xlabel(axes[0])
        place.set_ylabel(axes[1])
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

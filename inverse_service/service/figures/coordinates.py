"""Coordinates against time, for systems without a plane path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from inverse_service.service.figures.style import SETTINGS, TRUE_COLOUR, look, new_figure, plain, shown, spread

Array = NDArray[np.float64]
MOST_POINTS = 4000


def coordinate_figure(
    result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]], truth: Mapping[str, Array] | None
) -> tuple[Figure, str]:
    """One panel a coordinate, one line a method, the true motion in black."""
    names = result["system"]["coordinates"]
    with matplotlib.rc_context(SETTINGS):
        figure = new_figure(7.6, 1.5 * len(names) + 1.2)
        panels = figure.subplots(len(names), 1, squeeze=False, sharex=True).ravel()
        for axes, name in zip(panels, names, strict=True):
            times = result["step"] * result["record_every"] * np.arange(len(truth[name])) if truth else None
            if truth is not None and times is not None:
                axes.plot(times, truth[name], color=TRUE_COLOUR, linewidth=1.1, zorder=3, label="true motion")
            for place, method in enumerate(result["methods"]):
                if method["label"] in tables and method["method"] != "exact":
                    _line(axes, place, method, tables[method["label"]], name)
            axes.set_ylabel(name)
        panels[-1].set_xlabel("t")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8.5)
    start = f"{result['name'] or 'Motion'}: {result['steps']} steps of {shown(result['step'])}."
    return figure, start + _finding(result)


def _finding(result: Mapping[str, Any]) -> str:
    """Which method is nearest to the true motion at the end, and which stopped before."""
    own = [m for m in result["methods"] if m["method"] not in ("exact", "reference")]
    errors = {m["label"]: m["final_error"] for m in own if m.get("final_error") and m["outcome"] == "completed"}
    words = ""
    if errors:
        best, worst = min(errors, key=errors.__getitem__), max(errors, key=errors.__getitem__)
        words = f" At the end {best} is nearest to the true motion ({shown(errors[best])} away)"
        words += "." if best == worst else f", {worst} farthest ({shown(errors[worst])})."
    stopped = [f"{m['label']} ends at t = {shown(m['stopped']['time'])}" for m in own if m.get("stopped")]
    return words + (f" {'; '.join(stopped)}." if stopped else "")


def _line(axes: Any, place: int, method: Mapping[str, Any], table: Mapping[str, Array], name: str) -> None:
    style = look(place, method["method"])
    every = max(1, len(table["t"]) // MOST_POINTS)
    t, values = table["t"][::every], table[name][::every]
    axes.plot(
        t, values, color=style.colour, linestyle=style.line, linewidth=1.1, marker=style.marker, markersize=4,
        fillstyle="none", markevery=spread(len(t), 14, 5 * place), label=plain(method["label"]),
    )  # fmt: skip

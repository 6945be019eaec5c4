"""Observed quantities against time on a logarithmic axis, and error against work, one line a method."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inverse_service.integrators.trajectory import Array
from inverse_service.service.figures.style import SETTINGS, look, new_figure, plain, shown, spread

Tables = Mapping[str, Mapping[str, Array]]
BINS = 160
FLOOR = 1e-17
Column = Callable[[Mapping[str, Any], Mapping[str, Array]], Array | None]


def energy_error(name: str) -> Column:
    """|E/E_0 - 1|, or |E - E_0| where E_0 is 0, of a column of energies."""

    def error(method: Mapping[str, Any], table: Mapping[str, Array]) -> Array | None:
        if name not in table:
            return None
        start = method["energy_start"]
        found: Array = np.abs(table[name] - start) / (abs(start) or 1.0)
        return found

    return error


def constraint_defect(method: Mapping[str, Any], table: Mapping[str, Array]) -> Array | None:
    """The greatest defect of all constraints."""
    columns = [np.abs(column) for name, column in table.items() if name.startswith("constraint_")]
    return np.max(columns, axis=0) if columns else None


def column(name: str) -> Column:
    """A column of the table as it is, its absolute value."""
    return lambda method, table: np.abs(table[name]) if name in table else None


QUANTITIES: dict[str, tuple[str, str, Column]] = {
    "energy": ("|E/E₀ - 1|", "energy error", energy_error("energy")),
    "discrete_energy": (
        "|E/E₀ - 1| of the discrete Lagrangian",
        "discrete energy error",
        energy_error("discrete_energy"),
    ),
    "constraints": ("greatest |ω(q) q'|", "defect of the constraints", constraint_defect),
    "error": ("greatest distance from the true motion", "trajectory error", column("error")),
    "phase": ("|phase error| in radians", "phase error", column("phase_error")),
}


def series_figure(name: str, result: Mapping[str, Any], tables: Tables) -> tuple[Figure, str] | None:
    """The figure of one observed quantity with its caption; None where no method has it."""
    label, words, column_of = QUANTITIES[name]
    lines: list[tuple[int, Mapping[str, Any], Array, Array]] = []
    for place, method in enumerate(result["methods"]):
        table = tables.get(method["label"])
        values = None if table is None else column_of(method, table)
        if table is not None and values is not None and method["method"] != "exact":
            lines.append((place, method, table["t"], values))
    if not lines:
        return None
    with matplotlib.rc_context(SETTINGS):
        figure = new_figure(7.6, 4.3)
        axes = figure.subplots()
        for shift, (place, method, times, values) in enumerate(lines):
            style = look(place, method["method"])
            t, height = _envelope(times, values)
            axes.plot(
                t, height, color=style.colour, linestyle=style.line, linewidth=1.3, marker=style.marker, markersize=4.5,
                markevery=spread(len(t), 12, 7 * shift), fillstyle="none", label=plain(method["label"]),
            )  # fmt: skip
        axes.set_yscale("log")
        axes.set(xlabel="t", ylabel=label, ylim=_limits(lines))
        figure.legend(loc="outside right upper", fontsize=8.5)
    return figure, series_caption(words, lines)


def _envelope(times: Array, values: Array) -> tuple[Array, Array]:
    """The greatest value in each of BINS equal pieces, so that no peak is lost; zeros are drawn at the floor."""
    if len(values) > 1 and values[0] == 0:  # the start is given: nothing has gone wrong there yet
        times, values = times[1:], values[1:]
    heights = np.maximum(np.where(np.isfinite(values), values, np.nan), FLOOR)
    if len(values) <= 2 * BINS:
        return times, heights
    edges = np.linspace(0, len(values), BINS + 1).astype(int)
    return times[edges[1:] - 1], np.array([np.nanmax(heights[a:b]) for a, b in pairwise(edges)])


def _limits(lines: list[tuple[int, Mapping[str, Any], Array, Array]]) -> tuple[float, float]:
    """From the smallest to the greatest positive value, with room; not below round-off."""
    values = np.concatenate([line[3] for line in lines])
    values = values[np.isfinite(values) & (values > 0)]
    if not len(values):
        return 1e-17, 1e-15
    low = max(3e-18, 0.3 * min(float(np.nanmax(line[3][1:], initial=0.0)) or 1e-16 for line in lines) / 100)
    return low, 4 * float(values.max())


def series_caption(words: str, lines: list[tuple[int, Mapping[str, Any], Array, Array]]) -> str:
    """Which method keeps the quantity best, which worst."""
    sizes = {method["label"]: float(np.nanmax(values)) for _, method, _, values in lines if np.isfinite(values).any()}
    sizes = {name: size for name, size in sizes.items() if math.isfinite(size)}
    if not sizes:
        return ""
    best, worst = min(sizes, key=sizes.__getitem__), max(sizes, key=sizes.__getitem__)
    if best == worst:
        return f"Greatest {words}: {shown(sizes[best])} ({best})."
    return f"Greatest {words}: {best} has the least ({shown(sizes[best])}), {worst} the most ({shown(sizes[worst])})."


AXES = (("best_seconds", "steady time in s (best)"), ("force_evaluations", "force evaluations"))


def precision_figure(result: Mapping[str, Any]) -> tuple[Figure, str]:
    """The figure of a work-precision document and its caption.

    Points are joined in the order of h and end at the round-off floor; what failed is not drawn.
    """
    with matplotlib.rc_context(SETTINGS):
        figure = new_figure(10.4, 5.0)
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (key, label) in zip(panels, AXES, strict=True):
            for place, method in enumerate(result["methods"]):
                _curve(axes, place, method, key)
            axes.set(xscale="log", yscale="log", xlabel=label)
        panels[0].set_ylabel("relative error of the trajectory")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8.5)
    title = f"{result['name']}. " if result["name"] else ""
    return figure, f"{title}Lower left is better. {result['conclusion']} {_below(result)}"


def _curve(axes: Axes, place: int, method: Mapping[str, Any], key: str) -> None:
    drawn = [s for s in method["settings"] if s["error"] and s["best_seconds"] and not s["at_floor"] and s[key]]
    style = look(place, method["method"])
    axes.plot(
        [s[key] for s in drawn], [s["relative_error"] for s in drawn], color=style.colour, linestyle=style.line,
        linewidth=1.3, marker=style.marker, markersize=5, fillstyle="none", label=plain(method["label"]),
    )  # fmt: skip


def _below(result: Mapping[str, Any]) -> str:
    failed = len(result["failed"])
    listed = f" {failed} settings failed or were not measured and are listed in the table." if failed else ""
    machine = result["machine"]
    silent = [
        method["label"] for method in result["methods"] if not any(s["force_evaluations"] for s in method["settings"])
    ]
    listed += f" {', '.join(silent)} counts no force evaluations." if silent else ""
    return f"Curves end at the round-off floor.{listed} {machine['processor']}, {machine['cores']} cores."

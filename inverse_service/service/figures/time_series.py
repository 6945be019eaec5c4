"""Observed quantities against time, with their signs and their sizes, and error against work, one line per method."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inverse_service.integrators.trajectory import Array
from inverse_service.service.figures import style as styles, views
from inverse_service.service.scenes.prices import best_first

FLOOR = 1e-17
BINS = 160
MOST_PANELS = 4
# A signed panel shows values up to this multiple of the median of the greatest values; larger ones leave it.
REACH = 8


def series_figure(
    name: str, result: Mapping[str, Any], tables: views.Tables, truth: Mapping[str, Array] | None = None
) -> tuple[Figure, str] | None:
    """The figure of one observed quantity with its caption: signed panels, and its size on a logarithmic axis.

    None where no method has it.
    """
    quantity = views.QUANTITIES[name]
    sizes = [(*line[:3], np.abs(line[3])) for line in views.lines_of(result, tables, quantity.size)]
    panels = [(label, lines) for label, one in quantity.signed(result, tables, truth)
              if (lines := views.lines_of(result, tables, one))][:MOST_PANELS]  # fmt: skip
    if not sizes and not panels:
        return None
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(7.6, 3.4 + 1.7 * len(panels))
        heights = [1] * len(panels) + [1.9] * bool(sizes)
        axes = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights).ravel()
        notes = [note for one, panel in zip(axes, panels, strict=False) if (note := _signed(one, *panel))]
        every = _sizes(axes[-1], sizes, quantity.label) if sizes else 1
        axes[-1].set(xlabel=styles.with_unit(result.get("time", "t"), result))
        handles, labels = axes[-1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8.5)
    return figure, series_caption(quantity.words, sizes) + styles.thinned(every) + "".join(dict.fromkeys(notes))


def _signed(axes: Axes, label: str, lines: Sequence[views.Line]) -> str:
    """Draw a panel centered at zero. Return a sentence if a line leaves it."""
    greatest = [float(np.nanmax(np.abs(np.where(np.isfinite(line[3]), line[3], np.nan)))) for line in lines]
    largest = max(greatest)
    reach = (
        min(largest, REACH * float(np.median([one for one in greatest if one > 1e-9 * largest] or [largest]))) or 1e-16
    )
    for place, method, times, values in lines:
        styles.draw_line(axes, times, values, styles.look(place, method["method"]), method["label"])
    axes.axhline(0, color="#888888", linewidth=0.6, zorder=1)
    axes.set(ylabel=styles.plain(label), ylim=(-1.08 * reach, 1.08 * reach))
    return " Larger values are outside the signed panels." if largest > reach else ""


def _sizes(axes: Axes, lines: Sequence[views.Line], label: str) -> int:
    """The sizes on a logarithmic axis; of how many points a piece has."""
    most = 1
    for shift, (place, method, times, values) in enumerate(lines):
        style = styles.look(place, method["method"])
        # The start is given and has no error; zeros are drawn at the floor.
        heights = np.maximum(views.without_start(np.where(np.isfinite(values), values, np.nan)), FLOOR)
        t, _, high, every = styles.envelope(times, heights, BINS)
        most = max(most, every)
        axes.plot(
            t, high, color=style.color, linestyle=style.line, linewidth=1.3, marker=style.marker, markersize=4.5,
            markevery=styles.spread(len(t), 12, 7 * shift), fillstyle="none", label=styles.plain(method["label"]),
        )  # fmt: skip
    axes.set(yscale="log", ylim=_limits(lines), ylabel=label)
    return most


def _limits(lines: Sequence[views.Line]) -> tuple[float, float]:
    """From the smallest to the greatest positive value, with a margin, but not below round-off."""
    values = np.concatenate([line[3] for line in lines])
    values = values[np.isfinite(values) & (values > 0)]
    if not len(values):
        return 1e-17, 1e-15
    low = max(3e-18, 0.3 * min(float(np.nanmax(line[3][1:], initial=0.0)) or 1e-16 for line in lines) / 100)
    return low, 4 * float(values.max())


def series_caption(words: str, lines: Sequence[views.Line]) -> str:
    """Say which method preserves the quantity best and which one worst."""
    sizes = {method["label"]: float(np.nanmax(values)) for _, method, _, values in lines if np.isfinite(values).any()}
    sizes = {name: size for name, size in sizes.items() if math.isfinite(size)}
    if not sizes:
        return ""
    best, worst = min(sizes, key=sizes.__getitem__), max(sizes, key=sizes.__getitem__)
    if best == worst:
        return f"Greatest {words}: {styles.shown(sizes[best])} ({best})."
    least, most = styles.shown(sizes[best]), styles.shown(sizes[worst])
    return f"Greatest {words}: {best} has the least ({least}), {worst} the most ({most})."


FAMILIES = {"geometric": "#0072B2", "explicit": "#D55E00", "implicit": "#009E73", "taylor": "#CC79A7"}
BY_ORDER = ((2, ":"), (4, "-."), (6, "--"), (99, "-"))
DRAWN_FIRST, PALE, LABEL_HEIGHT = 8, 0.3, 0.045  # curves in full color; how pale others are; of the height of the panel
PANELS = (("seconds", "time in s"), ("evaluations", "force evaluations"))


def precision_figure(result: Mapping[str, Any], evaluations: bool = False) -> tuple[Figure, str]:
    """The figure of a work-precision document and its caption: time against the error, and evaluations on request.

    A color for each family of methods, a line style for each order, the names at the ends of the curves. Points are
    joined in the order of h and end at the round-off floor; what failed is not drawn.
    """
    panels = PANELS[: 1 + evaluations]
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(7.6 * len(panels), 5.0)
        for axes, (key, label) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            ends = [
                end for place, name in enumerate(best_first(result)) if (end := _curve(axes, place, name, result, key))
            ]
            axes.set(xscale="log", yscale="log", xlabel="relative error of the trajectory, smaller to the right")
            axes.set_ylabel(label)
            axes.invert_xaxis()
            _label_ends(axes, [end for end in ends if end is not None])
    title = f"{result['name']}. " if result["name"] else ""
    return figure, f"{title}{result['sentences'][0]} Lower is better; curves end at the round-off floor."


End = tuple[float, float, str, Any]


def _curve(axes: Axes, place: int, name: str, result: Mapping[str, Any], key: str) -> End | None:
    """Draw a method; (x, y, name, color) of its end."""
    drawn = [
        run for run in result["runs"] if run["method"] == name and run["error"] and run[key] and not run["at_floor"]
    ]
    method = next(one for one in result["methods"] if one["label"] == name)
    if not drawn:
        return None
    color = FAMILIES.get(method["family"], styles.TRUE_COLOR)
    line = next(line for order, line in BY_ORDER if (method["order"] or 99) <= order)
    faint = 1.0 if place < DRAWN_FIRST else PALE
    x, y = [run["error"] for run in drawn], [run[key] for run in drawn]
    axes.plot(x, y, color=color, linestyle=line, linewidth=1.5, alpha=faint, label=styles.plain(name))
    return x[-1], y[-1], name, (color, faint)


def _label_ends(axes: Axes, ends: Sequence[End]) -> None:
    """The names at the ends of the curves, moved up where they would lie on each other."""
    low, high = (math.log10(limit) for limit in axes.get_ylim())
    gap, top = LABEL_HEIGHT * (high - low), -math.inf
    for x, y, name, (color, faint) in sorted(ends, key=lambda end: end[1]):
        top = max(math.log10(y), top + gap)
        axes.annotate(
            styles.plain(name), (x, y), (1.02, (top - low) / (high - low)), textcoords="axes fraction", color=color,
            alpha=max(faint, 0.6), fontsize=8.5, va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": color, "alpha": 0.3 * faint, "linewidth": 0.6},
        )  # fmt: skip

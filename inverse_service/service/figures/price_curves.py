"""Error against work, one line per method."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from inverse_service.service.figures import style as styles
from inverse_service.service.scenes.prices import best_first, power

FAMILIES = {"geometric": "#0072B2", "explicit": "#D55E00", "implicit": "#009E73", "taylor": "#CC79A7"}
BY_ORDER = ((2, ":"), (4, "-."), (6, "--"), (99, "-"))
DRAWN_FIRST, PALE, LABEL_HEIGHT = 8, 0.3, 0.045  # curves in full color; how pale others are; of the height of the panel
PANELS = (("seconds", "time in s"), ("evaluations", "force evaluations"))
End = tuple[float, float, str, Any]


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
            for axis in (axes.xaxis, axes.yaxis):  # plain numbers: matplotlib parses each formula as long as it draws
                axis.set_major_formatter(lambda value, _: power(value))
                axis.set_minor_formatter(NullFormatter())
            _label_ends(axes, [end for end in ends if end is not None])
    title = f"{result['name']}. " if result["name"] else ""
    return figure, f"{title}{result['sentences'][0]} Lower is better; curves end at the round-off floor."


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
        place = (top - low) / (high - low)
        end = axes.transAxes.inverted().transform(axes.transData.transform((x, y)))
        leader, faded = {"color": color, "clip_on": False, "transform": axes.transAxes}, max(faint, 0.6)
        axes.plot([end[0], 1.01], [end[1], place], alpha=0.3 * faint, linewidth=0.6, **leader)
        axes.text(1.02, place, styles.plain(name), alpha=faded, fontsize=8.5, va="center", **leader)

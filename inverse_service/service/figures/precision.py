"""Error against time and against force evaluations, log-log, one line a method."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inverse_service.service.figures.style import SETTINGS, look, new_figure, plain

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

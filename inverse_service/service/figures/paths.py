"""The path in a plane of two coordinates, one panel a method, all at one scale with equal axes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inverse_service.integrators.trajectory import Array
from inverse_service.service.figures import style as styles
from inverse_service.simulation.matching_circle import turned

Tables = Mapping[str, Mapping[str, Array]]
MOST_POINTS = 6000
MOST_MARKERS = 45
PANEL = 3.1
ALPHA = "\N{GREEK SMALL LETTER ALPHA}"
# A path that reaches further than this many times the true one leaves the picture, which the title says.
REACH = 1.6
WIDEST_TURN = 0.8


def path_figure(result: Mapping[str, Any], tables: Tables, truth: Mapping[str, Array] | None) -> tuple[Figure, str]:
    """The figure and its caption."""
    pair = result["circle_coordinates"]
    drawn = [m for m in result["methods"] if m["label"] in tables and m["method"] not in ("exact", "reference")]
    drawn = drawn or [m for m in result["methods"] if m["label"] in tables]
    true = None if truth is None else np.column_stack([truth[name] for name in pair])
    paths = {m["label"]: np.column_stack([tables[m["label"]][name] for name in pair]) for m in drawn}
    box = _box(true, list(paths.values()))
    columns = 2 if len(drawn) == 4 else min(3, max(1, len(drawn)))
    rows = math.ceil(len(drawn) / columns)
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(max(5.2, PANEL * columns + 0.4), PANEL * rows + 1.1)
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for axes in grid.ravel()[len(drawn) :]:
            axes.set_visible(False)
        for place, (axes, method) in enumerate(zip(grid.ravel(), drawn, strict=False)):
            _panel(axes, place, method, paths[method["label"]], true, box, pair)
    return figure, path_caption(result, drawn, truth is not None)


def _panel(
    axes: Axes, place: int, method: Mapping[str, Any], path: Array, true: Array | None, box: tuple[Array, float],
    pair: Sequence[str],
) -> None:  # fmt: skip
    style = styles.look(place, method["method"])
    if true is not None:
        thin = _thinned(true)
        axes.plot(*thin.T, color=styles.TRUE_COLOR, zorder=3, label="true motion", **_stroke(thin, 1.1))
    thin = _thinned(path)
    axes.plot(*thin.T, color=style.color, alpha=0.75, zorder=2, **_stroke(thin, 0.7))
    axes.plot(
        *thin.T, color=style.color, linestyle="none", marker=style.marker, markersize=4, fillstyle="none",
        markevery=styles.spread(len(thin), MOST_MARKERS), zorder=4,
    )  # fmt: skip
    matching = (method.get("circle") or {}).get("through_three_points")
    if matching is not None:  # the paper's matching circle, through three points of the first revolution
        turn = np.linspace(0, 2 * np.pi, 361)
        x, y = (matching["center"][k] + matching["radius"] * wave(turn) for k, wave in enumerate((np.cos, np.sin)))
        axes.plot(x, y, color=style.color, linestyle=(0, (4, 3)), linewidth=1, zorder=1, label="matching circle")
    axes.plot(*path[0], marker="o", color="black", markersize=4, zorder=5)
    center, half = box
    axes.set(xlim=(center[0] - half, center[0] + half), ylim=(center[1] - half, center[1] + half))
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(styles.plain(_title(method)), fontsize=9.5)
    axes.set_xlabel(f"{pair[0]}\n{_below(method, path, center, half)}", fontsize=8.5)
    axes.set_ylabel(pair[1])


def _title(method: Mapping[str, Any]) -> str:
    parts = [method["method"], *([f"{ALPHA} = {method['alpha']}"] if method["alpha"] is not None else [])]
    order = method["order"]
    return ", ".join([*parts, *([f"order {order}"] if order not in (None, 1, 2) else [])])


def _below(method: Mapping[str, Any], path: Array, center: Array, half: float) -> str:
    """What the panel shows, in words."""
    notes = []
    circle = method.get("circle")
    if circle and circle.get("max_radial_distance") is not None:
        notes.append(f"off the circle by {styles.shown(100 * circle['max_radial_distance'])} %")
    elif circle and (circle["revolutions"] or 0) >= 1:
        notes.append(f"radius {styles.shown(circle['radius_first'])} to {styles.shown(circle['radius_last'])}")
    if len(path) > 2 * MOST_POINTS:
        notes.append(f"one point of {len(path) // MOST_POINTS} is drawn")
    if method["outcome"] != "completed":
        notes.append(f"ends: {method['outcome']}")
    far = float(np.abs(path - center).max())
    if far > half:
        notes.append("leaves the picture")
    return "; ".join(notes)


def path_caption(result: Mapping[str, Any], drawn: Sequence[Mapping[str, Any]], compared: bool) -> str:
    """The finding: whose circle holds best and worst."""
    sizes = {
        m["label"]: abs(m["circle"]["radius_change"])
        for m in drawn
        if m.get("circle") and (m["circle"]["revolutions"] or 2) >= 2 and math.isfinite(m["circle"]["radius_change"])
    }
    start = f"{result['name'] or 'Path'}: {styles.run_of(result)}."
    black = " The black curve is the true motion." if compared else ""
    if any((m.get("circle") or {}).get("through_three_points") for m in drawn):
        black += " Dashed: the matching circles through three points."
    if not sizes:
        return f"{start}{black} Dots mark the start."
    best, worst = min(sizes, key=sizes.__getitem__), max(sizes, key=sizes.__getitem__)
    if len(sizes) == 1:
        change = _share(sizes[best])
        return f"{start}{black} From the first revolution to the last, {best} changes the radius by {change}."
    steady = [label for label, size in sizes.items() if size < 0.01]
    kept = f" {styles.joined(steady)} keep{'s' if len(steady) == 1 else ''} it within 1 %." if steady else ""
    return (
        f"{start}{black} From the first revolution to the last, the radius changes least by {best} "
        f"({_share(sizes[best])}) and most by {worst} ({_share(sizes[worst])}).{kept}"
    )


def _share(size: float) -> str:
    return f"{styles.shown(100 * size)} %" if size < 10 else f"a factor {styles.shown(1 + size)}"


def _box(true: Array | None, paths: Sequence[Array]) -> tuple[Array, float]:
    """Center and half width of the picture."""
    base = true if true is not None and len(true) else np.vstack(paths)
    base = base[np.isfinite(base).all(axis=1)]
    low, high = base.min(axis=0), base.max(axis=0)
    half = max(float((high - low).max()) / 2, 1e-12)
    center = (low + high) / 2
    reach = max((float(np.nanmax(np.abs(path - center))) for path in paths), default=half)
    return center, 1.06 * min(max(half, reach), REACH * half)


def _stroke(path: Array, width: float) -> dict[str, Any]:
    """A line through the points, or dots where they are so far apart that a line would hide the path."""
    turns = np.abs(np.diff(turned(path))) if len(path) > 3 else np.zeros(1)
    if np.median(turns) < WIDEST_TURN:
        return {"linewidth": width, "linestyle": "-"}
    return {"linestyle": "none", "marker": ".", "markersize": 1.2 * width}


def _thinned(path: Array) -> Array:
    return path[:: max(1, len(path) // MOST_POINTS)]

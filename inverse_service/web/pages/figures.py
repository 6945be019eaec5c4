"""Figures of a simulation: as data for the page's script, and as pictures where there is none."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from inverse_service.web.pages.preview import angles_of_texts

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9", "#8A6D3B", "#7E57C2")
DASHES = ("solid", "dash", "dashdot", "dot", "longdash", "longdashdot", "solid", "dash")
MOST_POINTS = 800
DIGITS = 7
ROUNDING = 1e-13
SERIES = {
    "energy": ("Energy error", "|E/E\u2080 \u2212 1|"),
    "constraints": ("Constraint defect", "greatest |\u03c9(q) q\u2032|"),
    "error": ("Trajectory error", "greatest distance from the true motion"),
}
NAMES = ("path", "coordinates", "work-precision", *SERIES)


def figure_names(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(name, title) of the figures that this result has."""
    if result["format"].startswith("inverse-service/work-precision"):
        return [("work-precision", "Work and precision")]
    if any("members" in method for method in result["methods"]):
        return []  # of an ensemble the page has the table
    observed, found = set(result["observe"]), []
    if "trajectory" in observed:
        if result["circle_coordinates"]:
            found.append(("path", "Path in the plane"))
        found.append(("coordinates", "Coordinates in time"))
    return found + [(name, SERIES[name][0]) for name in SERIES if name in observed and _has(result, name)]


def _has(result: Mapping[str, Any], name: str) -> bool:
    return any(series(name, method) for method in result["methods"])


def columns_of(method: Mapping[str, Any]) -> Mapping[str, list[float | None]]:
    """The recorded columns of a method, empty where it has none."""
    columns: Mapping[str, list[float | None]] = (method.get("points") or {}).get("columns", {})
    return columns


def series(name: str, method: Mapping[str, Any]) -> list[float | None]:
    """The values of an observed quantity; None where they are zero, unknown or only the rounding of the start."""
    columns = columns_of(method)
    if name == "energy":
        start = method.get("energy_start")
        values = columns.get("energy", [])
        errors = [None if e is None or start is None else (e - start) / (abs(start) or 1.0) for e in values]
        return _after_start([_positive(error) for error in errors])
    if name == "constraints":
        rows = [column for key, column in columns.items() if key.startswith("constraint_")]
        worst = [max((abs(w) for w in at if w is not None), default=None) for at in zip(*rows, strict=True)]
        return _after_start([_positive(value) for value in worst])
    return _after_start([_positive(value) for value in columns.get(name, [])])


def _after_start(values: list[float | None]) -> list[float | None]:
    """Without the rounding of the start, which a two-step method has twice: it would stretch the axis for nothing."""
    start = [None if value is not None and value < ROUNDING else value for value in values[:2]]
    return start + values[2:]


def _positive(value: float | None) -> float | None:
    return None if not value else abs(value)


def figure_data(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What the script draws: each figure with its axes and its lines."""
    return [_figure(name, title, result) for name, title in figure_names(result)] + _space(result)


def _figure(name: str, title: str, result: Mapping[str, Any]) -> dict[str, Any]:
    if name == "work-precision":
        lines = [_precision_line(k, method) for k, method in enumerate(result["methods"])]
        return _axes(name, title, "steady time in s", "relative error", lines, log_x=True, log_y=True)
    if name == "path":
        a, b = result["circle_coordinates"]
        lines = [_line(k, m, columns_of(m).get(a), columns_of(m).get(b)) for k, m in enumerate(result["methods"])]
        return _axes(name, title, a, b, lines, equal=True)
    if name == "coordinates":
        lines = [
            {**_line(k, m, columns_of(m).get("t"), columns_of(m).get(c)), "group": c}
            for k, m in enumerate(result["methods"])
            for c in result["system"]["coordinates"]
        ]
        return _axes(name, title, "t", "", lines, groups=result["system"]["coordinates"])
    lines = [
        _line(k, m, columns_of(m).get("t"), series(name, m))
        for k, m in enumerate(result["methods"])
        if m["method"] != "exact"
    ]
    return _axes(name, title, "t", SERIES[name][1], lines, log_y=True)


def _axes(name: str, title: str, x: str, y: str, lines: Sequence[Mapping[str, Any]], **more: Any) -> dict[str, Any]:
    return {"name": name, "title": title, "x": x, "y": y, "lines": [line for line in lines if line["x"]], **more}


def _line(k: int, method: Mapping[str, Any], x: Sequence[Any] | None, y: Sequence[Any] | None) -> dict[str, Any]:
    every = max(1, math.ceil(len(x or ()) / MOST_POINTS))
    is_true = method["method"] in ("exact", "reference")
    return {
        "label": method["label"],
        "colour": "ink" if is_true else COLOURS[k % len(COLOURS)],
        "dash": "solid" if is_true else DASHES[k % len(DASHES)],
        "x": [_short(value) for value in (x or ())[::every]] if y else [],
        "y": [_short(value) for value in (y or ())[::every]],
    }


def _precision_line(k: int, method: Mapping[str, Any]) -> dict[str, Any]:
    good = [s for s in method["settings"] if s["error"] and s["best_seconds"] and not s["at_floor"]]
    x, y = [s["best_seconds"] for s in good], [s["relative_error"] for s in good]
    return {**_line(k, {"label": method["label"], "method": method["method"]}, x, y), "markers": True}


def _space(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The motion in three dimensions: three coordinates, or the plane and time."""
    if "trajectory" not in result.get("observe", ()):
        return []
    coordinates = result["system"]["coordinates"]
    pair = result["circle_coordinates"]
    axes = ["x", "y", "z"] if {"x", "y", "z"} <= set(coordinates) else [*(pair or coordinates[:2]), "t"]
    if len(axes) != 3:
        return []
    lines = []
    for k, method in enumerate(result["methods"]):
        columns = columns_of(method)
        if all(columns.get(axis) for axis in axes):
            line = _line(k, method, columns[axes[0]], columns[axes[1]])
            every = max(1, math.ceil(len(columns["t"]) / MOST_POINTS))
            lines.append({**line, "z": [_short(value) for value in columns[axes[2]][::every]]})
    return [{"name": "space", "title": "In three dimensions", "axes": axes, "lines": lines}] if lines else []


def motion_of(result: Mapping[str, Any]) -> dict[str, Any] | None:
    """The motion of each method with the columns of all coordinates, thinned; None where nothing moved."""
    coordinates = result["system"]["coordinates"]
    tracks = []
    for method in result["methods"]:
        columns = columns_of(method)
        if len(columns.get("t", ())) > 1 and all(name in columns for name in coordinates):
            every = max(1, math.ceil(len(columns["t"]) / MOST_POINTS))
            t, *q = ([_short(value) for value in columns[name][::every]] for name in ("t", *coordinates))
            tracks.append({"label": method["label"], "t": t, "q": q})
    return (
        {"coordinates": coordinates, "angles": angles_of_texts(result["system"]), "tracks": tracks} if tracks else None
    )


def _short(value: Any) -> Any:
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def picture(result: Mapping[str, Any], name: str, ending: str) -> bytes | None:
    """A figure as an SVG or PNG file; None for a figure that the result does not have."""
    if name not in dict(figure_names(result)):
        return None
    import matplotlib

    from inverse_service.service.figures.style import RESOLUTION, SETTINGS

    stream = io.BytesIO()
    with matplotlib.rc_context(SETTINGS):
        metadata = {"Title": name} | ({"Date": None} if ending == "svg" else {})
        figure = _figure_of(result, name)
        if figure is not None:
            figure.savefig(stream, format=ending, dpi=RESOLUTION, metadata=metadata)
    return stream.getvalue() or None


def _figure_of(result: Mapping[str, Any], name: str) -> Any:
    import numpy as np

    from inverse_service.service.figures.drawing import coordinate_figure
    from inverse_service.service.figures.paths import path_figure
    from inverse_service.service.figures.series import precision_figure, series_figure

    if name == "work-precision":
        return precision_figure(result)[0]
    tables = {
        method["label"]: {column: np.asarray(values, dtype=float) for column, values in columns_of(method).items()}
        for method in result["methods"]
        if columns_of(method)
    }
    if name == "path":
        return path_figure(result, tables, None)[0]
    if name == "coordinates":
        return coordinate_figure(result, tables, None)[0]
    drawn = series_figure(name, result, tables)
    return None if drawn is None else drawn[0]

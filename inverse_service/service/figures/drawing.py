"""All figures of a simulation: coordinates against time, ensembles, paths and observed quantities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from inverse_service.integrators.trajectory import Array
from inverse_service.service.figures import style as styles
from inverse_service.service.figures.paths import path_figure
from inverse_service.service.figures.time_series import QUANTITIES, series_figure
from inverse_service.simulation.matching_circle import turned

MOST_POINTS = 4000
PALE = "#9aa3b2"
DASHES: Any = {
    "solid": "-", "dash": "--", "dashdot": "-.", "dot": ":", "longdash": (0, (8, 2)), "longdashdot": (0, (8, 2, 1, 2)),
}  # fmt: skip


def coordinate_figure(
    result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]], truth: Mapping[str, Array] | None
) -> tuple[Figure, str]:
    """One panel a coordinate, one line a method, the true motion in black."""
    names = result["system"]["coordinates"]
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(7.6, 1.5 * len(names) + 1.2)
        panels = figure.subplots(len(names), 1, squeeze=False, sharex=True).ravel()
        for axes, name in zip(panels, names, strict=True):
            times = result["step"] * result["record_every"] * np.arange(len(truth[name])) if truth else None
            every = 1
            if truth is not None and times is not None:
                styles.draw_line(axes, times, truth[name], styles.look(0, "exact"), "true motion")
            for place, method in enumerate(result["methods"]):
                if method["label"] in tables and method["method"] != "exact":
                    table, style = tables[method["label"]], styles.look(place, method["method"])
                    every = max(
                        every, styles.draw_line(axes, table["t"], table[name], style, method["label"], 5 * place)
                    )
            axes.set_ylabel(styles.with_unit(name, result))
        panels[-1].set_xlabel(styles.with_unit("t", result))
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8.5)
    start = f"{result['name'] or 'Motion'}: {styles.run_of(result)}."
    return figure, start + _finding(result) + styles.thinned(every)


def portrait_figure(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> tuple[Figure, str] | None:
    """Velocity against position, one panel a coordinate; None where no method has velocities."""
    names = result["system"]["coordinates"][:MOST_COORDINATES]
    lines = [(styles.look(place, m["method"]), m["label"], table) for place, m in enumerate(result["methods"])
             if (table := tables.get(m["label"])) is not None and f"v_{names[0]}" in table]  # fmt: skip
    if not lines:
        return None
    wide = min(3, len(names))
    every = max(1, max(len(table["t"]) for _, _, table in lines) // MOST_POINTS)
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(max(5.2, 3.1 * wide + 0.4), 2.8 * -(-len(names) // wide) + 0.9)
        panels = figure.subplots(-(-len(names) // wide), wide, squeeze=False).ravel()
        for axes, name in zip(panels, names, strict=False):
            for style, label, table in lines:
                axes.plot(
                    table[name][::every], table[f"v_{name}"][::every], color=style.color, linewidth=0.9,
                    linestyle="none" if every > 1 else style.line, marker="." if every > 1 else "",
                    markersize=1.5, label=styles.plain(label),
                )  # fmt: skip
            axes.set(xlabel=styles.with_unit(name, result), ylabel=f"{name}'")
        for axes in panels[len(names) :]:
            axes.set_visible(False)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8.5)
    dots = f" Dots are one point of {every}." if every > 1 else ""
    return figure, f"{result['name'] or 'Phase portrait'}: velocity against position of each coordinate.{dots}"


def view_figure(views: Sequence[Mapping[str, Any]], width: float, height: float) -> Figure:
    """The views that the page's script draws too, one panel each; the true motion lies wide and pale under the rest."""
    figure = styles.new_figure(width, height)
    for axes, view in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        for line in view["lines"]:
            is_true = line["color"] == "ink"
            points = (np.asarray(line[key], dtype=float) for key in "xy")
            look_of_line = {"linestyle": "none", "marker": ".", "markersize": 3} if view.get("dots") else {
                "linestyle": DASHES[line["dash"]], "linewidth": 4 if is_true else 1.3}  # fmt: skip
            color = PALE if is_true else line["color"]
            axes.plot(
                *points, color=color, label=styles.plain(line["label"]), zorder=1 if is_true else 2, **look_of_line
            )
        axes.set(
            title=view["label"], xlabel=view["x"], ylabel=view["y"], yscale="log" if view.get("log_y") else "linear"
        )
        if view.get("equal"):
            axes.set_aspect("equal", adjustable="datalim")
        if view["label"]:
            axes.legend()
    return figure


def _finding(result: Mapping[str, Any]) -> str:
    """Which method is nearest to the true motion at the end, and which stopped before."""
    own = [m for m in result["methods"] if m["method"] not in ("exact", "reference")]
    errors = {m["label"]: m["final_error"] for m in own if m.get("final_error") and m["outcome"] == "completed"}
    words = ""
    if errors:
        best, worst = min(errors, key=errors.__getitem__), max(errors, key=errors.__getitem__)
        words = f" At the end {best} is nearest to the true motion ({styles.shown(errors[best])} away)"
        words += "." if best == worst else f", {worst} farthest ({styles.shown(errors[worst])})."
    stopped = [f"{m['label']} ends at t = {styles.shown(m['stopped']['time'])}" for m in own if m.get("stopped")]
    return words + (f" {'; '.join(stopped)}." if stopped else "")


DRAWN = 24  # members drawn as lines
MOST_COORDINATES = 6


def ensemble_figure(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> tuple[Figure, str]:
    """One panel a coordinate and method: median, band from least to greatest, and lines of some members."""
    methods = [(k, method) for k, method in enumerate(result["methods"]) if method["label"] in tables]
    names = result["system"]["coordinates"][:MOST_COORDINATES]
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(3.6 * len(methods), 2.2 * len(names))
        panels = figure.subplots(len(names), len(methods), squeeze=False, sharex=True)
        for column, (place, method) in enumerate(methods):
            table, style = tables[method["label"]], styles.look(place, method["method"])
            for row, name in enumerate(names):
                _panel(panels[row][column], table["t"], table[name], style.color)
                panels[row][column].set_ylabel(name)
            panels[0][column].set_title(method["label"])
            panels[-1][column].set_xlabel("t")
    count = methods[0][1]["members"]
    members = f"{count} member{'s' if count != 1 else ''}"
    caption = f"{members}: the median, the range of all, and {min(DRAWN, count)} of them as thin lines."
    return figure, caption


def _panel(axes: Any, times: Array, values: Array, color: str) -> None:
    kept = values[np.isfinite(values[:, 0])]
    known = np.isfinite(kept).any(axis=0)
    times, kept = times[known], kept[:, known]
    low, middle, high = np.nanmin(kept, axis=0), np.nanmedian(kept, axis=0), np.nanmax(kept, axis=0)
    axes.fill_between(times, low, high, color=color, alpha=0.15, linewidth=0)
    for row in kept[np.linspace(0, len(kept) - 1, min(DRAWN, len(kept))).astype(int)]:
        axes.plot(times, row, color=color, linewidth=0.5, alpha=0.5)
    axes.plot(times, middle, color=color, linewidth=1.6)


def section_figure(result: Mapping[str, Any]) -> tuple[Figure, str] | None:
    """The points at events: velocity against position of each coordinate, a panel for each event and coordinate; None
    where no event has two points. A coordinate that is zero at its event has no panel."""
    names = result["system"]["coordinates"][:MOST_COORDINATES]
    methods = [(k, m) for k, m in enumerate(result["methods"]) if any(e["count"] > 1 for e in m.get("events", ()))]
    if not methods:
        return None
    panels = [(k, name) for k, event in enumerate(methods[0][1]["events"]) for name in names if name != event["when"]]
    wide = min(3, len(panels))
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(3.4 * wide + 0.6, 3.0 * -(-len(panels) // wide) + 0.6)
        grid = figure.subplots(-(-len(panels) // wide), wide, squeeze=False).ravel()
        for axes, (k, name) in zip(grid, panels, strict=False):
            for place, method in methods:
                columns = method["events"][k]["columns"]
                axes.plot(
                    columns[name], columns[f"v_{name}"], ".", color=styles.look(place, method["method"]).color,
                    markersize=3, label=styles.plain(method["label"]),
                )  # fmt: skip
            title = styles.plain(f"{methods[0][1]['events'][k]['when']} = 0")
            axes.set(xlabel=styles.with_unit(name, result), ylabel=f"{name}'", title=title)
        for axes in grid[len(panels) :]:
            axes.set_visible(False)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside right upper", fontsize=8.5)
    return figure, f"{result['name'] or 'Section'}: the states at which each event happens."


def sweep_figure(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> tuple[Figure, str] | None:
    """What members of an ensemble end with, against the parameter that differs; None where none or several do."""
    methods = [(k, method) for k, method in enumerate(result["methods"]) if method["label"] in tables]
    columns = {
        m["label"]: {name.removeprefix("member_"): column for name, column in tables[m["label"]].items()
                     if name.startswith("member_")}
        for _, m in methods
    }  # fmt: skip
    first = columns[methods[0][1]["label"]]
    varied = [name for name in result["system"]["parameters"] if name in first and np.ptp(first[name])]
    shown = [name for name in first if name.endswith("_end") or name == "max_energy_error"][:MOST_COORDINATES]
    if len(varied) != 1 or not shown:
        return None
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(7.0, 1.7 * len(shown) + 0.8)
        panels = figure.subplots(len(shown), 1, squeeze=False, sharex=True).ravel()
        for axes, name in zip(panels, shown, strict=True):
            for place, method in methods:
                own = columns[method["label"]]
                axes.plot(
                    own[varied[0]], own[name], ".", color=styles.look(place, method["method"]).color, markersize=3,
                    label=styles.plain(method["label"]),
                )  # fmt: skip
            axes.set_ylabel(name.replace("_", " "))
        panels[-1].set_xlabel(varied[0])
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", fontsize=8.5)
    return figure, f"{result['name'] or 'Sweep'}: the end of each member against {varied[0]}."


def draw_simulation(
    folder: Path,
    result: Mapping[str, Any],
    tables: Mapping[str, Mapping[str, Array]],
    truth: Mapping[str, Array] | None,
) -> list[dict[str, Any]]:
    """Write the figures of what was observed; the names of the files with their captions."""
    if not tables:
        return []
    found = []
    observed = set(result["observe"])
    if any("members" in method for method in result["methods"]):
        pairs = {"ensemble": ensemble_figure(result, tables), "sweep": sweep_figure(result, tables)}
        return [
            {"files": styles.save(pair[0], folder, name, pair[1]), "caption": pair[1]}
            for name, pair in pairs.items()
            if pair
        ]
    if observed & {"trajectory", "matching_circle"} and _is_round(result, tables):
        figure, caption = path_figure(result, tables, truth)
        found.append({"files": styles.save(figure, folder, "path", caption), "caption": caption})
    elif "trajectory" in observed:
        figure, caption = coordinate_figure(result, tables, truth)
        found.append({"files": styles.save(figure, folder, "coordinates", caption), "caption": caption})
    if observed >= {"trajectory", "velocities"} and (drawn := portrait_figure(result, tables)) is not None:
        found.append({"files": styles.save(drawn[0], folder, "phase-portrait", drawn[1]), "caption": drawn[1]})
    if (drawn := section_figure(result)) is not None:
        found.append({"files": styles.save(drawn[0], folder, "section", drawn[1]), "caption": drawn[1]})
    for name in QUANTITIES:
        asked = name in observed or (name == "discrete_energy" and "energy" in observed)
        drawn = series_figure(name, result, tables, truth) if asked else None
        if drawn is not None:
            figure, caption = drawn
            found.append({"files": styles.save(figure, folder, name, caption), "caption": caption})
    return found


def _is_round(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> bool:
    """Whether some path in the plane of the circle goes round once; others are shown coordinate by coordinate."""
    pair = result["circle_coordinates"]
    if pair is None:
        return False
    paths = [np.column_stack([table[name] for name in pair]) for table in tables.values() if len(table["t"]) > 2]
    return "matching_circle" in result["observe"] or any(abs(turned(path)[-1]) >= 2 * np.pi for path in paths)

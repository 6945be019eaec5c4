"""Figures as files: coordinates against time, ensembles, paths, observed quantities, error against
work.

A path in a plane of two coordinates has one panel per method, all at one scale with equal axes.
"""

import io
import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from inverse_service.service.scenes import views
from inverse_service.service.scenes.views import (
    Table,
    Tables,
    best_first,
    power_of_ten,
    short_number,
)
from inverse_service.simulation import circles

# The style of all figures: sizes in inches, colors, lines.
TRUE_COLOR = "#222222"
SETTINGS: Any = matplotlib.rc_params_from_file(
    Path(__file__).parent / "figures.mplstyle", use_default_template=False
)
RESOLUTION = 160
CAPTION_SIZE = 9
PALE, REACH_SIGNED = "#9aa3b2", 8.0
DASHES: Any = {
    "solid": "-", "dash": "--", "dashdot": "-.", "dot": ":", "longdash": (0, (8, 2)), "longdashdot": (0, (8, 2, 1, 2)),
}  # fmt: skip
DRAWN = 24  # members drawn as lines
MOST_COORDINATES = MOST_PANELS = 6
Result = Mapping[str, Any]  # of a simulation, or of work against precision
# A path that extends beyond this multiple of the true one leaves the picture, as its axis says.
REACH = 1.6
FAMILIES = {
    "geometric": "#0072B2",
    "explicit": "#D55E00",
    "implicit": "#009E73",
    "taylor": "#CC79A7",
}
BY_ORDER = ((2, ":"), (4, "-."), (6, "--"), (99, "-"))
DRAWN_FIRST, FAINT, LABEL_HEIGHT = (
    8,
    0.3,
    0.045,
)  # curves in full color; how faint others are; of a panel's height
PANELS = (("seconds", "time in s"), ("evaluations", "force evaluations"))
End = tuple[float, float, str, Any]


def save(figure: Figure, folder: Path, name: str, caption: str) -> list[str]:
    """Write NAME.svg and NAME.png with the caption below the picture. Return the names written."""
    width = float(figure.get_size_inches()[0])
    lines = textwrap.wrap(caption, int(width * 14.5)) if caption else []
    if lines:
        figure.supxlabel(
            plain("\n".join(lines)), x=0.012, ha="left", fontsize=CAPTION_SIZE, color="#333333"
        )
    names = [f"{name}.svg", f"{name}.png"]
    for file in names:
        (folder / file).write_bytes(_encoded(figure, name, file[-3:]))
        figure.set_layout_engine(
            "none"
        )  # the places found for the first file are those of the second
    return names


def _encoded(figure: Figure, name: str, ending: str) -> bytes:
    stream, metadata = io.BytesIO(), {"Title": name} | ({"Date": None} if ending == "svg" else {})
    with matplotlib.rc_context(SETTINGS):
        figure.savefig(stream, format=ending, dpi=RESOLUTION, metadata=metadata)
    return stream.getvalue()


def run_of(result: Result) -> str:
    """The run in words: 600 steps of 0.05, 1 step of 0.1."""
    return f"{result['steps']} step{'s' if result['steps'] != 1 else ''} of {shown(result['step'])}"


def plain(text: str) -> str:
    """A text of the user, in which a dollar sign does not begin a matplotlib formula."""
    return text.replace("$", "\\$")


def shown(value: float) -> str:
    """A number in a caption."""
    return short_number(value, 3 if 1e-3 <= abs(value) < 1e4 else 2)


def view_figure(
    given: Sequence[Mapping[str, Any] | None], caption: str = "", wide: int = 3
) -> tuple[Figure, str] | None:
    """Views as the page draws them too, with a caption: one panel each, `wide` in a row, with one
    legend for all; the true motion is a broad pale line below the others.
    """
    drawn = [view for view in given if view is not None]
    if not drawn:
        return None
    wide = min(wide, len(drawn))
    width, height = (7.6, 2.0) if wide == 1 else (3.1 * wide + 0.4, 2.8)
    rows = -(-len(drawn) // wide)
    with matplotlib.rc_context(SETTINGS):
        figure = Figure(figsize=(width, height * rows + 0.8), layout="constrained")
        grid: list[Axes] = list(figure.subplots(rows, wide, squeeze=False).ravel())
        for axes, view in zip(grid, drawn, strict=False):
            for line in view["lines"]:
                is_true = line["color"] == "ink"
                points = (np.asarray(line[key], dtype=float) for key in "xy")
                look_of_line: Any = {"linestyle": "none", "marker": ".", "markersize": 2} if view.get("dots") else {
                    "linestyle": DASHES[line["dash"]], "linewidth": 4 if is_true else 1.1}  # fmt: skip
                color = PALE if is_true else line["color"]
                axes.plot(
                    *points,
                    color=color,
                    label=plain(line["label"]),
                    zorder=1 if is_true else 2,
                    **look_of_line,
                )
            axes.set(xlabel=plain(view["x"]), ylabel=plain(view["y"]), title=plain(view["label"]))
            if view.get("log_y"):
                axes.set_yscale("log")
            elif view.get("signed"):
                # About 0: lines of more than REACH_SIGNED times the median of the greatest values
                # leave the picture.
                greatest = [
                    max((abs(y) for y in line["y"] if y is not None), default=0.0)
                    for line in view["lines"]
                ]
                usual = [one for one in greatest if one > 1e-9 * max(greatest)]
                reach = 1.08 * (
                    min(max(greatest), REACH_SIGNED * float(np.median(usual or [0.0]))) or 1e-16
                )
                axes.set_ylim(-reach, reach)
            if view.get("limits"):
                center, half = view["limits"]
                axes.set(
                    xlim=(center[0] - half, center[0] + half),
                    ylim=(center[1] - half, center[1] + half),
                )
            if view.get("equal"):
                axes.set_aspect("equal", adjustable="box" if view.get("limits") else "datalim")
        for empty in grid[len(drawn) :]:
            empty.set_visible(False)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside right upper", fontsize=8.5)
    return figure, caption


def series_figure(name: str, result: Result, tables: Tables) -> tuple[Figure, str] | None:
    """An observed quantity in time: its size on a logarithmic axis, and each of its columns with
    its sign.
    """
    lines = views.method_lines(result, tables, views.FIGURES[name].size)
    sizes = {method["label"]: float(np.nanmax(np.abs(values))) for _, method, _, values in lines}
    caption = extremes(views.FIGURES[name].words, sizes) + _bands(tables)
    return view_figure(views.quantity_views(name, result, tables)[:MOST_PANELS], caption, 1)


def extremes(words: str, sizes: Mapping[str, float]) -> str:
    """Say which method has the least and which one the greatest of what should be small."""
    if not (sizes := {name: size for name, size in sizes.items() if math.isfinite(size)}):
        return ""
    best, worst = min(sizes, key=sizes.__getitem__), max(sizes, key=sizes.__getitem__)
    if best == worst:
        return f"Greatest {words}: {shown(sizes[best])} ({best})."
    return f"Greatest {words}: {best} has the least ({shown(sizes[best])}), {worst} the most ({shown(sizes[worst])})."


def _bands(tables: Tables) -> str:
    """The sentence of a caption if bands replace lines."""
    most = max(len(table["t"]) for table in tables.values())
    return f" Bands reach from the least to the greatest of {most // views.BINS} points." * (
        most > views.MOST_POINTS
    )


def with_truth(result: Result, tables: Tables, truth: Table | None) -> tuple[Result, Tables]:
    """The true motion as one more method, unless it is one."""
    if truth is None or any(method["method"] == "exact" for method in result["methods"]):
        return result, tables
    label = "true motion"
    return {**result, "methods": [*result["methods"], {"label": label, "method": "exact"}]}, {
        **tables,
        label: truth,
    }


def ensemble_figure(result: Result, tables: Tables) -> tuple[Figure, str]:
    """One panel per coordinate and method: the median, the band from least to greatest, and lines
    of some members.
    """
    methods = [
        (k, method) for k, method in enumerate(result["methods"]) if method["label"] in tables
    ]
    names = result["system"]["coordinates"][:MOST_COORDINATES]
    with matplotlib.rc_context(SETTINGS):
        figure = Figure(figsize=(3.6 * len(methods), 2.2 * len(names)), layout="constrained")
        panels = figure.subplots(len(names), len(methods), squeeze=False, sharex=True)
        for column, (place, method) in enumerate(methods):
            table = tables[method["label"]]
            for row, name in enumerate(names):
                axes, color = panels[row][column], views.color_of(place)
                kept = table[name][np.isfinite(table[name][:, 0])]
                known = np.isfinite(kept).any(axis=0)
                times, kept = table["t"][known], kept[:, known]
                low, high = np.nanmin(kept, axis=0), np.nanmax(kept, axis=0)
                axes.fill_between(times, low, high, color=color, alpha=0.15, linewidth=0)
                for line in kept[np.linspace(0, len(kept) - 1, min(DRAWN, len(kept))).astype(int)]:
                    axes.plot(times, line, color=color, linewidth=0.5, alpha=0.5)
                axes.plot(times, np.nanmedian(kept, axis=0), color=color, linewidth=1.6)
                axes.set_ylabel(name)
            panels[0][column].set_title(method["label"])
            panels[-1][column].set_xlabel("t")
    count = methods[0][1]["members"]
    members = f"{count} member{'s' if count != 1 else ''}"
    caption = (
        f"{members}: the median, the full range, and {min(DRAWN, count)} of them as thin lines."
    )
    return figure, caption


def sweep_figure(result: Result, tables: Tables) -> tuple[Figure, str] | None:
    """The final values of the members of an ensemble against the parameter that varies; None unless
    one does.
    """
    columns = [
        (k, m, {name.removeprefix("member_"): column for name, column in tables[m["label"]].items()
                if name.startswith("member_")})
        for k, m in enumerate(result["methods"]) if m["label"] in tables
    ]  # fmt: skip
    first = columns[0][2]
    varied = [
        name for name in result["system"]["parameters"] if name in first and np.ptp(first[name])
    ]
    ends = [name for name in first if name.endswith("_end") or name == "max_energy_error"][
        :MOST_COORDINATES
    ]
    if len(varied) != 1 or not ends:
        return None

    def lines_to(name: str) -> list[views.Line]:
        return [(k, m, own[varied[0]], own[name]) for k, m, own in columns]

    panels = [
        views.view_of("", varied[0], name.replace("_", " "), lines_to(name), dots=True)
        for name in ends
    ]
    return view_figure(
        panels, f"{result['name'] or 'Sweep'}: the end of each member against {varied[0]}.", 2
    )


def draw_simulation(
    folder: Path, result: Result, tables: Tables, truth: Table | None
) -> list[dict[str, Any]]:
    """Write the figures of the observed quantities. Return the names of the files with their
    captions.
    """
    if not tables:
        return []
    observed, names = set(result["observe"]), result["system"]["coordinates"][:MOST_COORDINATES]
    drawn: dict[str, tuple[Figure, str] | None] = {}
    if any("members" in method for method in result["methods"]):
        drawn = {"ensemble": ensemble_figure(result, tables), "sweep": sweep_figure(result, tables)}
    else:
        whole, columns = with_truth(result, tables, truth)
        pair, is_round = result["circle_coordinates"], "matching_circle" in observed
        for table in tables.values() if pair and not is_round else ():
            # A full turn in the plane of the circle; other paths are shown by coordinate.
            path = np.column_stack([table[name] for name in pair])
            is_round = is_round or (len(path) > 2 and abs(circles.turned(path)[-1]) >= 2 * np.pi)
        if observed & {"trajectory", "matching_circle"} and pair and is_round:
            drawn["path"] = path_figure(whole, columns)
        elif "trajectory" in observed:
            caption = f"{result['name'] or 'Motion'}: {run_of(result)}.{_bands(tables)}"
            drawn["coordinates"] = view_figure(
                [views.time_view(name, whole, columns) for name in names], caption, 1
            )
        if observed >= {"trajectory", "velocities"}:
            portraits = [views.portrait_view(one, result, tables) for one in names]
            caption = f"{result['name'] or 'Phase portrait'}: velocity against position of each coordinate."
            drawn["phase-portrait"] = view_figure(portraits, caption)
        caption = f"{result['name'] or 'Section'}: the states at which each event happens."
        drawn["section"] = view_figure(views.section_views(result)[:MOST_PANELS], caption)
        others = views.observed_views(result, tables)[: 2 * MOST_PANELS]
        caption = f"{result['name'] or 'Observed quantities'}: {run_of(result)}.{_bands(tables)}"
        drawn["observed"] = view_figure(others, caption, 2)
        for name in views.FIGURES:
            if name in observed or (name == "discrete_energy" and "energy" in observed):
                drawn[name] = series_figure(name, whole, columns)
    made = ((name, *pair) for name, pair in drawn.items() if pair is not None)
    return [
        {"files": save(figure, folder, name, words), "caption": words}
        for name, figure, words in made
    ]


def picture(result: Result, name: str, ending: str) -> bytes | None:
    """A figure of the page as an SVG or PNG file; None for one that the result does not have."""
    if name == "work-precision":
        drawn: tuple[Figure, str] | None = precision_figure(result)
    else:
        found = (one["views"] for one in views.figures_of(result) if one["name"] == name)
        drawn = view_figure(next(found, [])[:MOST_PANELS], wide=2)
    return None if drawn is None else _encoded(drawn[0], name, ending)


def path_figure(result: Result, tables: Tables) -> tuple[Figure, str] | None:
    """A panel for each method, all of one scale: its path, the true one, and the paper's matching
    circle, which goes through three points of the first revolution.
    """
    whole = views.path_view(result, tables)
    if whole is None:
        return None
    true = [line for line in whole["lines"] if line["color"] == "ink"][:1]
    own = [line for line in whole["lines"] if line["color"] != "ink"] or whole["lines"]
    paths = [np.array([line["x"], line["y"]], dtype=float).T for line in own]
    base = np.array([true[0]["x"], true[0]["y"]], dtype=float).T if true else np.vstack(paths)
    base = base[np.isfinite(base).all(axis=1)]
    low, high = base.min(axis=0), base.max(axis=0)
    center, half = (low + high) / 2, max(float((high - low).max()) / 2, 1e-12)
    reach = max((float(np.nanmax(np.abs(path - center))) for path in paths), default=half)
    half = 1.06 * min(max(half, reach), REACH * half)
    turn, panels = np.linspace(0, 2 * np.pi, 361), []
    for line, path in zip(own, paths, strict=True):
        method = result["methods"][line["place"]]
        notes, circle = list[str](), method.get("circle") or {}
        lines, found = [*true, {**line, "dash": "solid"}], circle.get("through_three_points")
        if found is not None:
            x, y = (
                found["center"][k] + found["radius"] * wave(turn)
                for k, wave in enumerate((np.cos, np.sin))
            )
            lines.append({**line, "label": "matching circle", "dash": "dash", "x": x, "y": y})
        if circle.get("max_radial_distance") is not None:
            notes.append(f"off the circle by {shown(100 * circle['max_radial_distance'])} %")
        elif (circle.get("revolutions") or 0) >= 1:
            notes.append(
                f"radius {shown(circle['radius_first'])} to {shown(circle['radius_last'])}"
            )
        if method["outcome"] != "completed":
            notes.append(f"ends: {method['outcome']}")
        if float(np.abs(path - center).max()) > half:
            notes.append("leaves the picture")
        below = f"{whole['x']}\n{'; '.join(notes)}"
        panels.append(
            {**whole, "label": line["label"], "x": below, "lines": lines, "limits": (center, half)}
        )
    # The caption says what is drawn, and which methods preserve the circle best and worst.
    methods = [result["methods"][line["place"]] for line in own]
    circles_of = {method["label"]: method["circle"] for method in methods if method.get("circle")}
    parts = [f"{result['name'] or 'Path'}: {run_of(result)}."]
    parts += ["The broad pale curve is the true motion."] * len(true)
    if any(circle.get("through_three_points") for circle in circles_of.values()):
        parts.append("Dashed: the matching circles through three points.")
    known = {
        name: circle for name, circle in circles_of.items() if (circle["revolutions"] or 2) >= 2
    }
    sizes = {name: abs(circle["radius_change"]) for name, circle in known.items()}
    words = "relative change of the radius from the first revolution to the last"
    caption = " ".join(filter(None, [*parts, extremes(words, sizes)]))
    return view_figure(panels, caption, 2 if len(panels) == 4 else 3)


class PrecisionFigure(NamedTuple):
    """The figure, and a sentence that describes it."""

    figure: Figure
    description: str


def precision_figure(result: Result, evaluations: bool = False) -> PrecisionFigure:
    """The figure of a work-precision document and its caption: time against the error, and
    evaluations on request.

    A color for each family of methods, a line style for each order, the names at the ends of the
    curves. Points are joined in the order of h and end at the round-off floor; what failed is not
    drawn.
    """
    panels = PANELS[: 1 + evaluations]
    with matplotlib.rc_context(SETTINGS):
        figure = Figure(figsize=(7.6 * len(panels), 5.0), layout="constrained")
        for axes, (key, label) in zip(
            figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True
        ):
            ends = [
                _curve(axes, place, name, result, key)
                for place, name in enumerate(best_first(result))
            ]
            axes.set(
                xscale="log",
                yscale="log",
                xlabel="relative error of the trajectory, smaller to the right",
            )
            axes.set_ylabel(label)
            axes.invert_xaxis()
            for axis in (
                axes.xaxis,
                axes.yaxis,
            ):  # plain numbers: matplotlib parses each formula as long as it draws
                axis.set_major_formatter(lambda value, _: power_of_ten(value))
                axis.set_minor_formatter(NullFormatter())
            _label_ends(axes, [end for end in ends if end is not None])
    title = f"{result['name']}. " if result["name"] else ""
    return PrecisionFigure(
        figure,
        f"{title}{result['sentences'][0]} Lower is better; curves end at the round-off floor.",
    )


def _curve(axes: Axes, place: int, name: str, result: Result, key: str) -> End | None:
    """Draw a method; (x, y, name, color) of its end."""
    drawn = [
        run
        for run in result["runs"]
        if run["method"] == name and run["error"] and run[key] and not run["at_floor"]
    ]
    method = next(one for one in result["methods"] if one["label"] == name)
    if not drawn:
        return None
    color = FAMILIES.get(method["family"], TRUE_COLOR)
    line = next(line for order, line in BY_ORDER if (method["order"] or 99) <= order)
    faint = 1.0 if place < DRAWN_FIRST else FAINT
    x, y = [run["error"] for run in drawn], [run[key] for run in drawn]
    axes.plot(x, y, color=color, linestyle=line, linewidth=1.5, alpha=faint, label=plain(name))
    return x[-1], y[-1], name, (color, faint)


def _label_ends(axes: Axes, ends: Sequence[End]) -> None:
    """The names at the ends of the curves, moved up where they would lie on each other."""
    low, high = (math.log10(limit) for limit in axes.get_ylim())
    gap, top = LABEL_HEIGHT * (high - low), -math.inf
    for x, y, name, (color, faint) in sorted(ends, key=lambda end: end[1]):
        top = max(math.log10(y), top + gap)
        place = (top - low) / (high - low)
        end = axes.transAxes.inverted().transform(axes.transData.transform((x, y)))
        leader, faded = (
            {"color": color, "clip_on": False, "transform": axes.transAxes},
            max(faint, 0.6),
        )
        axes.plot([end[0], 1.01], [end[1], place], alpha=0.3 * faint, linewidth=0.6, **leader)
        axes.text(1.02, place, plain(name), alpha=faded, fontsize=8.5, va="center", **leader)

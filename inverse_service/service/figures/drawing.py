"""All figures of a simulation: coordinates against time, ensembles, paths, observed quantities, and animations.

A path in a plane of two coordinates has one panel per method, all at one scale with equal axes. An animation shows
the bodies of a scene with their trails, in real time or within SECONDS.
"""

import io
import math
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Array
from inverse_service.service.figures import price_curves, style as styles, views
from inverse_service.simulation import circles

PALE, REACH_SIGNED = "#9aa3b2", 8.0
DASHES: Any = {
    "solid": "-", "dash": "--", "dashdot": "-.", "dot": ":", "longdash": (0, (8, 2)), "longdashdot": (0, (8, 2, 1, 2)),
}  # fmt: skip
DRAWN = 24  # members drawn as lines
MOST_COORDINATES = MOST_PANELS = 6
Tables = Mapping[str, Mapping[str, Array]]
# A path that extends beyond this multiple of the true one leaves the picture, as its axis says.
REACH = 1.6
FRAMES_A_SECOND, SECONDS, TRAIL = 25, 8.0, 1.0  # frames, length at most, length of a trail in seconds of the picture
INCHES, DOTS = 4.8, 100
NO_BODY = (
    'The scene has no body to draw: give "points", as in {"bob": ["l*sin(a)", "-l*cos(a)"]}, or coordinates x and y.'
)


def view_figure(shown: Sequence[Mapping[str, Any] | None], wide: int = 3) -> Figure | None:
    """Views as the page draws them too, one panel each; the true motion is a broad pale line below the others."""
    drawn = [view for view in shown if view is not None]
    if not drawn:
        return None
    wide = min(wide, len(drawn))
    width, height = (7.6, 2.0) if wide == 1 else (3.1 * wide + 0.4, 2.8)
    with styles.panels(len(drawn), wide, width, height) as (figure, grid):
        for axes, view in zip(grid, drawn, strict=False):
            for line in view["lines"]:
                is_true = line["color"] == "ink"
                points = (np.asarray(line[key], dtype=float) for key in "xy")
                look_of_line: Any = {"linestyle": "none", "marker": ".", "markersize": 2} if view.get("dots") else {
                    "linestyle": DASHES[line["dash"]], "linewidth": 4 if is_true else 1.1}  # fmt: skip
                color = PALE if is_true else line["color"]
                axes.plot(
                    *points, color=color, label=styles.plain(line["label"]), zorder=1 if is_true else 2, **look_of_line
                )
            axes.set(xlabel=styles.plain(view["x"]), ylabel=styles.plain(view["y"]), title=styles.plain(view["label"]))
            if view.get("log_y"):
                axes.set_yscale("log")
            elif view.get("signed"):
                axes.set_ylim(*_limits(view["lines"]))
            if view.get("limits"):
                center, half = view["limits"]
                axes.set(xlim=(center[0] - half, center[0] + half), ylim=(center[1] - half, center[1] + half))
            if view.get("equal"):
                axes.set_aspect("equal", adjustable="box" if view.get("limits") else "datalim")
    return figure


def _limits(lines: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """About 0: lines of more than REACH_SIGNED times the median of the greatest values leave the picture."""
    greatest = [max((abs(y) for y in line["y"] if y is not None), default=0.0) for line in lines]
    usual = [one for one in greatest if one > 1e-9 * max(greatest)]
    reach = 1.08 * (min(max(greatest), REACH_SIGNED * float(np.median(usual or [0.0]))) or 1e-16)
    return -reach, reach


def series_figure(
    name: str, result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]],
    truth: Mapping[str, Array] | None = None,
) -> tuple[Figure, str] | None:  # fmt: skip
    """An observed quantity in time: its size on a logarithmic axis, and each of its columns with its sign."""
    result, tables = _with_truth(result, tables, truth)
    sizes = views.lines_of(result, tables, views.QUANTITIES[name].size)
    figure = view_figure(views.quantity_views(name, result, tables)[:MOST_PANELS], 1)
    return _with_caption(figure, series_caption(views.QUANTITIES[name].words, sizes) + _bands(tables))


def series_caption(words: str, lines: Sequence[views.Line]) -> str:
    """Say which method preserves the quantity best and which one worst."""
    sizes = {method["label"]: float(np.nanmax(np.abs(values))) for _, method, _, values in lines}
    if not (sizes := {name: size for name, size in sizes.items() if math.isfinite(size)}):
        return ""
    best, worst = min(sizes, key=sizes.__getitem__), max(sizes, key=sizes.__getitem__)
    if best == worst:
        return f"Greatest {words}: {styles.shown(sizes[best])} ({best})."
    least, most = styles.shown(sizes[best]), styles.shown(sizes[worst])
    return f"Greatest {words}: {best} has the least ({least}), {worst} the most ({most})."


def _bands(tables: Mapping[str, Mapping[str, Array]]) -> str:
    """The sentence of a caption if bands replace lines."""
    most = max(len(table["t"]) for table in tables.values())
    return f" Bands reach from the least to the greatest of {most // views.BINS} points." * (most > views.MOST_POINTS)


def _with_truth(
    result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]], truth: Mapping[str, Array] | None
) -> tuple[Mapping[str, Any], Mapping[str, Mapping[str, Array]]]:
    """The true motion as one more method, unless it is one."""
    if truth is None or any(method["method"] == "exact" for method in result["methods"]):
        return result, tables
    label = "true motion"
    return {**result, "methods": [*result["methods"], {"label": label, "method": "exact"}]}, {**tables, label: truth}


def ensemble_figure(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> tuple[Figure, str]:
    """One panel per coordinate and method: the median, the band from least to greatest, and lines of some members."""
    methods = [(k, method) for k, method in enumerate(result["methods"]) if method["label"] in tables]
    names = result["system"]["coordinates"][:MOST_COORDINATES]
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(3.6 * len(methods), 2.2 * len(names))
        panels = figure.subplots(len(names), len(methods), squeeze=False, sharex=True)
        for column, (place, method) in enumerate(methods):
            table = tables[method["label"]]
            for row, name in enumerate(names):
                _panel(panels[row][column], table["t"], table[name], views.color_of(place))
                panels[row][column].set_ylabel(name)
            panels[0][column].set_title(method["label"])
            panels[-1][column].set_xlabel("t")
    count = methods[0][1]["members"]
    members = f"{count} member{'s' if count != 1 else ''}"
    caption = f"{members}: the median, the full range, and {min(DRAWN, count)} of them as thin lines."
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


def sweep_figure(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> tuple[Figure, str] | None:
    """The final values of the members of an ensemble against the parameter that varies; None unless one does."""
    columns = [
        (k, m, {name.removeprefix("member_"): column for name, column in tables[m["label"]].items()
                if name.startswith("member_")})
        for k, m in enumerate(result["methods"]) if m["label"] in tables
    ]  # fmt: skip
    first = columns[0][2]
    varied = [name for name in result["system"]["parameters"] if name in first and np.ptp(first[name])]
    shown = [name for name in first if name.endswith("_end") or name == "max_energy_error"][:MOST_COORDINATES]
    if len(varied) != 1 or not shown:
        return None
    panels = [
        views.view_of(
            "",
            varied[0],
            name.replace("_", " "),
            [(k, m, own[varied[0]], own[name]) for k, m, own in columns],
            dots=True,
        )
        for name in shown
    ]
    return _with_caption(
        view_figure(panels, 2), f"{result['name'] or 'Sweep'}: the end of each member against {varied[0]}."
    )


def _with_caption(figure: Figure | None, caption: str) -> tuple[Figure, str] | None:
    return None if figure is None else (figure, caption)


def draw_simulation(
    folder: Path,
    result: Mapping[str, Any],
    tables: Mapping[str, Mapping[str, Array]],
    truth: Mapping[str, Array] | None,
) -> list[dict[str, Any]]:
    """Write the figures of the observed quantities. Return the names of the files with their captions."""
    if not tables:
        return []
    observed, names = set(result["observe"]), result["system"]["coordinates"][:MOST_COORDINATES]
    drawn: dict[str, tuple[Figure, str] | None] = {}
    if any("members" in method for method in result["methods"]):
        drawn = {"ensemble": ensemble_figure(result, tables), "sweep": sweep_figure(result, tables)}
    else:
        shown, columns = _with_truth(result, tables, truth)
        if observed & {"trajectory", "matching_circle"} and _is_round(result, tables):
            drawn["path"] = path_figure(result, tables, truth)
        elif "trajectory" in observed:
            caption = f"{result['name'] or 'Motion'}: {styles.run_of(result)}.{_bands(tables)}"
            drawn["coordinates"] = _with_caption(
                view_figure([views.time_view(name, shown, columns) for name in names], 1), caption
            )
        if observed >= {"trajectory", "velocities"}:
            portraits = [views.portrait_view(one, result, tables) for one in names]
            caption = f"{result['name'] or 'Phase portrait'}: velocity against position of each coordinate."
            drawn["phase-portrait"] = _with_caption(view_figure(portraits), caption)
        caption = f"{result['name'] or 'Section'}: the states at which each event happens."
        drawn["section"] = _with_caption(view_figure(views.section_views(result)[:MOST_PANELS]), caption)
        for name in views.QUANTITIES:
            if name in observed or (name == "discrete_energy" and "energy" in observed):
                drawn[name] = series_figure(name, result, tables, truth)
    return [
        {"files": styles.save(pair[0], folder, name, pair[1]), "caption": pair[1]}
        for name, pair in drawn.items()
        if pair is not None
    ]


def picture(result: Mapping[str, Any], name: str, ending: str) -> bytes | None:
    """A figure of the page as an SVG or PNG file; None for one that the result does not have."""
    if name == "work-precision":
        figure: Figure | None = price_curves.precision_figure(result)[0]
    else:
        shown = (one["views"] for one in views.figures_of(result) if one["name"] == name)
        figure = view_figure(next(shown, [])[:MOST_PANELS], 2)
    if figure is None:
        return None
    stream, metadata = io.BytesIO(), {"Title": name} | ({"Date": None} if ending == "svg" else {})
    with matplotlib.rc_context(styles.SETTINGS):
        figure.savefig(stream, format=ending, dpi=styles.RESOLUTION, metadata=metadata)
    return stream.getvalue()


def _is_round(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> bool:
    """Whether some path in the plane of the circle makes a full turn; other paths are shown by coordinate."""
    pair = result["circle_coordinates"]
    if pair is None:
        return False
    paths = [np.column_stack([table[name] for name in pair]) for table in tables.values() if len(table["t"]) > 2]
    return "matching_circle" in result["observe"] or any(abs(circles.turned(path)[-1]) >= 2 * np.pi for path in paths)


def path_figure(
    result: Mapping[str, Any], tables: Tables, truth: Mapping[str, Array] | None
) -> tuple[Figure, str] | None:
    """A panel for each method, all of one scale: its path, the true one, and the paper's matching circle, which goes
    through three points of the first revolution."""
    result, tables = _with_truth(result, tables, truth)
    whole = views.path_view(result, tables)
    if whole is None:
        return None
    true = [line for line in whole["lines"] if line["color"] == "ink"][:1]
    own = [line for line in whole["lines"] if line["color"] != "ink"] or whole["lines"]
    paths = [np.array([line["x"], line["y"]], dtype=float).T for line in own]
    center, half = _box(np.array([true[0]["x"], true[0]["y"]], dtype=float).T if true else None, paths)
    turn, panels = np.linspace(0, 2 * np.pi, 361), []
    for line, path in zip(own, paths, strict=True):
        method = result["methods"][line["place"]]
        lines, found = [*true, {**line, "dash": "solid"}], (method.get("circle") or {}).get("through_three_points")
        if found is not None:
            x, y = (found["center"][k] + found["radius"] * wave(turn) for k, wave in enumerate((np.cos, np.sin)))
            lines.append({**line, "label": "matching circle", "dash": "dash", "x": x, "y": y})
        below = f"{whole['x']}\n{_below(method, path, center, half)}"
        panels.append({**whole, "label": line["label"], "x": below, "lines": lines, "limits": (center, half)})
    methods = [result["methods"][line["place"]] for line in own]
    return _with_caption(
        view_figure(panels, 2 if len(panels) == 4 else 3), path_caption(result, methods, truth is not None)
    )


def _below(method: Mapping[str, Any], path: Array, center: Array, half: float) -> str:
    """Describe in words what the panel shows."""
    notes = []
    circle = method.get("circle")
    if circle and circle.get("max_radial_distance") is not None:
        notes.append(f"off the circle by {styles.shown(100 * circle['max_radial_distance'])} %")
    elif circle and (circle["revolutions"] or 0) >= 1:
        notes.append(f"radius {styles.shown(circle['radius_first'])} to {styles.shown(circle['radius_last'])}")
    if method["outcome"] != "completed":
        notes.append(f"ends: {method['outcome']}")
    if float(np.abs(path - center).max()) > half:
        notes.append("leaves the picture")
    return "; ".join(notes)


def path_caption(result: Mapping[str, Any], drawn: Sequence[Mapping[str, Any]], compared: bool) -> str:
    """State the result: which methods preserve the circle best and worst."""
    sizes = {
        m["label"]: abs(m["circle"]["radius_change"])
        for m in drawn
        if m.get("circle") and (m["circle"]["revolutions"] or 2) >= 2 and math.isfinite(m["circle"]["radius_change"])
    }
    start = f"{result['name'] or 'Path'}: {styles.run_of(result)}."
    black = " The broad pale curve is the true motion." if compared else ""
    if any((m.get("circle") or {}).get("through_three_points") for m in drawn):
        black += " Dashed: the matching circles through three points."
    if not sizes:
        return f"{start}{black}"
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


def animate(path: Path, result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> None:
    """Write an animation of the first method with a trajectory to a .gif or .mp4 file."""
    if path.suffix not in (".gif", ".mp4"):
        raise InputError("--animate needs the name of a file that ends with .gif or .mp4.")
    if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError("A .mp4 file needs the program ffmpeg: install it, or write a .gif file.")
    table = next((tables[m["label"]] for m in result["methods"] if m["label"] in tables), None)
    bodies = {name: (table[x], table[y]) for name, (x, y) in result["bodies"].items()} if table is not None else {}
    if not bodies and table is not None and {"x", "y"} <= set(result["system"]["coordinates"]):
        bodies = {"": (table["x"], table["y"])}
    if table is None or not bodies:
        raise InputError(NO_BODY)
    frames = _frames(table["t"], bodies, with_origin=bool(result["bodies"]))
    if path.suffix == ".gif":
        from PIL import Image

        first = Image.fromarray(next(frames)).quantize(64)
        rest = (Image.fromarray(frame).quantize(palette=first, dither=Image.Dither.NONE) for frame in frames)
        first.save(path, save_all=True, append_images=rest, duration=1000 // FRAMES_A_SECOND, loop=0)
        return
    size, rate = f"{int(INCHES * DOTS)}x{int(INCHES * DOTS)}", str(FRAMES_A_SECOND)
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", rate, "-i", "-"]
    command = ["ffmpeg", "-loglevel", "error", "-y", *given, "-pix_fmt", "yuv420p", str(path)]
    with suppress(BrokenPipeError), subprocess.Popen(command, stdin=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        for frame in frames:
            ffmpeg.stdin.write(frame.tobytes())
    if ffmpeg.returncode:
        raise InputError("ffmpeg could not make the .mp4 file: write a .gif file.")


def _frames(times: Array, bodies: Mapping[str, tuple[Array, Array]], with_origin: bool) -> Iterator[NDArray[np.uint8]]:
    """Pictures (height, width, 3) of the bodies with their trails, in real time or within SECONDS; axes are drawn
    once."""
    length = min(SECONDS, float(times[-1] - times[0]) or 1.0)
    moments = np.linspace(times[0], times[-1], max(2, int(FRAMES_A_SECOND * length)))
    ways = {name: np.array([np.interp(moments, times, column) for column in place]) for name, place in bodies.items()}
    points = np.concatenate([*ways.values(), *([np.zeros((2, 1))] if with_origin else [])], axis=1)
    low, high = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    middle, half = (low + high) / 2, 0.55 * float((high - low).max()) or 1.0
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(INCHES, INCHES)
        figure.set_dpi(DOTS)
        axes, canvas = figure.subplots(), cast(Any, FigureCanvasAgg)(figure)  # matplotlib annotates none of it
        axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), aspect="equal")
        clock = axes.text(0.02, 0.98, "", transform=axes.transAxes, va="top", weight="bold", animated=True)
        pairs = []
        for place, name in enumerate(ways):
            look: Any = {"color": views.color_of(place), "animated": True}
            (trail,) = axes.plot([], [], linewidth=1, alpha=0.5, **look)
            pairs.append((trail, axes.plot([], [], "o", markersize=8, label=styles.plain(name) or None, **look)[0]))
        canvas.draw()
        background = canvas.copy_from_bbox(figure.bbox)
        for frame, moment in enumerate(moments):
            canvas.restore_region(background)
            first = max(0, frame - int(TRAIL * FRAMES_A_SECOND))
            for (trail, dot), way in zip(pairs, ways.values(), strict=True):
                trail.set_data(way[:, first : frame + 1])
                dot.set_data(way[:, frame : frame + 1])
            clock.set_text(f"t = {moment:.2f}")
            for artist in (*(one for pair in pairs for one in pair), clock):
                axes.draw_artist(artist)
            yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()

"""A moving picture of a run: the bodies of a scene with their trails, in real time or as long as SECONDS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators.trajectory import Array
from inverse_service.service.figures import style as styles

FRAMES_A_SECOND, SECONDS, TRAIL = 25, 8.0, 1.0  # frames, length at most, length of a trail in seconds of the picture
ENDINGS = {".gif": "pillow", ".mp4": "ffmpeg"}
NO_BODY = (
    'The scene has no body to draw: give "points", as in {"bob": ["l*sin(a)", "-l*cos(a)"]}, or coordinates x and y.'
)


def animate(path: Path, result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> None:
    """Write the run of the first method that has one to a .gif or .mp4 file."""
    if path.suffix not in ENDINGS:
        raise InputError("The moving picture of --animate is a file that ends with .gif or .mp4.")
    table = next((tables[m["label"]] for m in result["methods"] if m["label"] in tables), None)
    bodies = {name: (table[x], table[y]) for name, (x, y) in result["bodies"].items()} if table is not None else {}
    if not bodies and table is not None and {"x", "y"} <= set(result["system"]["coordinates"]):
        bodies = {"": (table["x"], table["y"])}
    if table is None or not bodies:
        raise InputError(NO_BODY)
    from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter

    if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise InputError("A .mp4 file needs the program ffmpeg: install it, or write a .gif file.")
    times = table["t"]
    length = min(SECONDS, float(times[-1] - times[0]) or 1.0)
    frames = max(2, int(FRAMES_A_SECOND * length))
    moments = np.linspace(times[0], times[-1], frames)
    ways = {name: [np.interp(moments, times, column) for column in place] for name, place in bodies.items()}
    with matplotlib.rc_context(styles.SETTINGS):
        figure = styles.new_figure(4.8, 4.8)
        axes = figure.subplots()
        points = np.array([column for way in ways.values() for column in way])
        low, high = (np.array([pick(points[k::2]) for k in (0, 1)]) for pick in (np.nanmin, np.nanmax))
        if result["bodies"]:
            low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        half = 0.55 * float((high - low).max()) or 1.0
        middle = (low + high) / 2
        axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), aspect="equal")
        dots, trails = [], []
        for place, name in enumerate(ways):
            color = styles.look(place, "").color
            trails.append(axes.plot([], [], color=color, linewidth=1, alpha=0.5)[0])
            dots.append(axes.plot([], [], "o", color=color, markersize=8, label=styles.plain(name) or None)[0])

        def draw(frame: int) -> list[Any]:
            first = max(0, frame - int(TRAIL * FRAMES_A_SECOND))
            for dot, trail, (x, y) in zip(dots, trails, ways.values(), strict=True):
                dot.set_data([x[frame]], [y[frame]])
                trail.set_data(x[first : frame + 1], y[first : frame + 1])
            axes.set_title(f"t = {moments[frame]:.2f}")
            return [*dots, *trails]

        moving = FuncAnimation(figure, draw, frames, blit=False)
        writer = PillowWriter(FRAMES_A_SECOND) if path.suffix == ".gif" else FFMpegWriter(FRAMES_A_SECOND)
        moving.save(path, writer=writer, dpi=100)

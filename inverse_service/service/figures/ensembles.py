"""An ensemble in one figure: each coordinate in time, members between their least and greatest, some of them drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from inverse_service.service.figures.style import SETTINGS, look, new_figure

Array = NDArray[np.float64]
DRAWN = 24  # members drawn as lines
MOST_COORDINATES = 6


def ensemble_figure(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> tuple[Figure, str]:
    """One panel a coordinate and method: median, band from least to greatest, and lines of some members."""
    methods = [(k, method) for k, method in enumerate(result["methods"]) if method["label"] in tables]
    names = result["system"]["coordinates"][:MOST_COORDINATES]
    with matplotlib.rc_context(SETTINGS):
        figure = new_figure(3.6 * len(methods), 2.2 * len(names))
        panels = figure.subplots(len(names), len(methods), squeeze=False, sharex=True)
        for column, (place, method) in enumerate(methods):
            table, style = tables[method["label"]], look(place, method["method"])
            for row, name in enumerate(names):
                _panel(panels[row][column], table["t"], table[name], style.colour)
                panels[row][column].set_ylabel(name)
            panels[0][column].set_title(method["label"])
            panels[-1][column].set_xlabel("t")
    count = methods[0][1]["members"]
    caption = f"{count} members: the median, the range of all, and {min(DRAWN, count)} of them as thin lines."
    return figure, caption


def _panel(axes: Any, times: Array, values: Array, colour: str) -> None:
    kept = values[np.isfinite(values[:, 0])]
    known = np.isfinite(kept).any(axis=0)
    times, kept = times[known], kept[:, known]
    low, middle, high = np.nanmin(kept, axis=0), np.nanmedian(kept, axis=0), np.nanmax(kept, axis=0)
    axes.fill_between(times, low, high, color=colour, alpha=0.15, linewidth=0)
    for row in kept[np.linspace(0, len(kept) - 1, min(DRAWN, len(kept))).astype(int)]:
        axes.plot(times, row, color=colour, linewidth=0.5, alpha=0.5)
    axes.plot(times, middle, color=colour, linewidth=1.6)

"""The figures of the report, drawn from simulated scenes and saved beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.figure

from inverse_service.service.scenes import views
from inverse_service.service.scenes.drawing import (
    SETTINGS,
    TRUE_COLOR,
    path_figure,
    save,
    series_figure,
    with_truth,
)
from paper.scenes import Run
from paper.statement import Figure

MARKERS = "os^D"
ALPHA = "\N{GREEK SMALL LETTER ALPHA}"


def paths(run: Run, folder: Path, name: str, caption: str) -> Figure:
    """Paths in the plane, one panel a method, with the exact curve."""
    drawn = path_figure(*with_truth(run.result, run.tables, run.truth))
    assert drawn is not None
    figure, finding = drawn
    save(figure, folder, name, caption)
    return Figure(name, caption, finding)


def series(run: Run, quantity: str, folder: Path, name: str, caption: str) -> Figure:
    """An observed quantity against time, signed and on a logarithmic axis."""
    drawn = series_figure(quantity, *with_truth(run.result, run.tables, run.truth))
    if drawn is None:
        raise ValueError(f"no method of the scene has the quantity {quantity}")
    figure, finding = drawn
    save(figure, folder, name, caption)
    return Figure(name, caption, finding)


def planes(
    runs: Sequence[Run], pairs: Sequence[tuple[str, str]], folder: Path, name: str, caption: str
) -> Figure:
    """Curves in planes of two coordinates: one column a pair and one row a run, exact curve in black."""
    with matplotlib.rc_context(SETTINGS):
        wide = len(pairs) if len(runs) == 1 else min(3, len(runs))
        panels = [(run, pair) for run in runs for pair in pairs]
        rows = -(-len(panels) // wide)
        figure = matplotlib.figure.Figure(
            figsize=(3.1 * wide + 0.4, 2.7 * rows + 0.9), layout="constrained"
        )
        grid = figure.subplots(rows, wide, squeeze=False).ravel()
        for axes, (run, (a, b)) in zip(grid, panels, strict=False):
            if run.truth is not None:
                axes.plot(
                    run.truth[a], run.truth[b], color=TRUE_COLOR, linewidth=1.2, label="exact"
                )
            drawn = [
                m
                for m in run.result["methods"]
                if m["label"] in run.tables and m["method"] != "exact"
            ]
            for place, method in enumerate(drawn):
                table = run.tables[method["label"]]
                axes.plot(
                    table[a], table[b], color=views.color_of(place), marker=MARKERS[place % 4], markersize=4,
                    markevery=(5 * place, max(1, len(table[a]) // 12)), fillstyle="none", label=method["method"],
                )  # fmt: skip
            axes.set(
                xlabel=a,
                ylabel=b,
                title=f"{ALPHA} = {drawn[0]['alpha']}" if len(runs) > 1 else f"{a}{b}",
            )
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper", fontsize=8.5)
    save(figure, folder, name, caption)
    shown = ", ".join(f"{a} against {b}" for a, b in pairs)
    return Figure(
        name, caption, f"{shown} for {len(runs)} values of alpha, each beside the exact curve."
    )

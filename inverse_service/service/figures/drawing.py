"""All figures of a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.service.figures.coordinates import coordinate_figure
from inverse_service.service.figures.ensembles import ensemble_figure
from inverse_service.service.figures.paths import path_figure
from inverse_service.service.figures.series import QUANTITIES, series_figure
from inverse_service.service.figures.style import save
from inverse_service.simulation.matching_circle import turned

Array = NDArray[np.float64]


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
        figure, caption = ensemble_figure(result, tables)
        return [{"files": save(figure, folder, "ensemble", caption), "caption": caption}]
    if observed & {"trajectory", "matching_circle"} and _is_round(result, tables):
        figure, caption = path_figure(result, tables, truth)
        found.append({"files": save(figure, folder, "path", caption), "caption": caption})
    elif "trajectory" in observed:
        figure, caption = coordinate_figure(result, tables, truth)
        found.append({"files": save(figure, folder, "coordinates", caption), "caption": caption})
    for name in QUANTITIES:
        drawn = series_figure(name, result, tables) if name in observed else None
        if drawn is not None:
            figure, caption = drawn
            found.append({"files": save(figure, folder, name, caption), "caption": caption})
    return found


def _is_round(result: Mapping[str, Any], tables: Mapping[str, Mapping[str, Array]]) -> bool:
    """Whether some path in the plane of the circle goes round once; others are shown coordinate by coordinate."""
    pair = result["circle_coordinates"]
    if pair is None:
        return False
    paths = [np.column_stack([table[name] for name in pair]) for table in tables.values() if len(table["t"]) > 2]
    return "matching_circle" in result["observe"] or any(abs(turned(path)[-1]) >= 2 * np.pi for path in paths)

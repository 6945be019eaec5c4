"""Figures show what was observed, tell methods apart without colour, and say the finding."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inverse_service.service.figures.drawing import draw_simulation
from inverse_service.service.figures.paths import path_figure
from inverse_service.service.figures.series import series_figure
from inverse_service.service.figures.style import look, shown
from inverse_service.service.scenes.simulating import simulate_tables

DISK = json.loads((Path(__file__).parents[2] / "docs" / "scenes" / "disk-table.json").read_text())


@pytest.fixture(scope="module")
def disk() -> dict[str, Any]:
    return simulate_tables(DISK)


def test_eight_methods_differ_in_line_and_marker() -> None:
    looks = [look(place, "variational") for place in range(8)]
    assert len({str(one.line) for one in looks}) == 8
    assert len({one.marker for one in looks}) == 8
    assert len({one.colour for one in looks}) == 8


def test_paths_have_equal_axes_and_the_true_motion(disk: dict[str, Any]) -> None:
    figure, caption = path_figure(disk["result"], disk["tables"], disk["truth"])
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert len(panels) == 6
    assert all(axes.get_aspect() == 1 for axes in panels)
    assert all(axes.get_lines()[0].get_label() == "true motion" for axes in panels)
    circles = [[line for line in axes.get_lines() if line.get_label() == "matching circle"] for axes in panels]
    for method, found in zip(disk["result"]["methods"], circles, strict=True):
        (line,) = found
        known = method["circle"]["through_three_points"]
        x, y = line.get_xdata() - known["centre"][0], line.get_ydata() - known["centre"][1]
        assert np.allclose(np.hypot(x, y), known["radius"])
    assert "changes least by nonholonomic-0.5" in caption
    assert "most by nonholonomic-1 (a factor 531)" in caption


def test_series_keep_every_peak_and_name_best_and_worst(disk: dict[str, Any]) -> None:
    drawn = series_figure("energy", disk["result"], disk["tables"])
    assert drawn is not None
    figure, caption = drawn
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    for method in disk["result"]["methods"]:
        assert max(lines[method["label"]].get_ydata()) == pytest.approx(method["max_energy_error"])
    assert "variational-0.5 has the least" in caption
    discrete = series_figure("discrete_energy", disk["result"], disk["tables"])
    assert discrete is not None
    assert "nonholonomic-0.5 has the least" in discrete[1]
    assert "nonholonomic-1 the most" in caption
    assert series_figure("energy", disk["result"], {}) is None


def test_systems_without_a_round_path_are_drawn_by_coordinate(tmp_path: Path) -> None:
    scene = {
        "system": {"coordinates": ["u"], "lagrangian": "u'^2/2 - u^2/2"}, "step": 0.1, "steps": 30,
        "initial": {"positions": {"u": 1}, "velocities": {"u": 0}}, "methods": ["variational"],
        "observe": ["trajectory", "error"],
    }  # fmt: skip
    found = simulate_tables(scene)
    figures = draw_simulation(tmp_path, found["result"], found["tables"], found["truth"])
    assert [figure["files"][0] for figure in figures] == ["coordinates.svg", "error.svg"]
    assert "At the end variational-0.5 is nearest to the true motion" in figures[0]["caption"]
    assert draw_simulation(tmp_path, found["result"], {}, None) == []


def test_paths_known_at_few_steps_are_dots(disk: dict[str, Any]) -> None:
    angles = 10.0 * np.arange(500)
    path = {"t": angles, "x": np.cos(angles), "y": np.sin(angles)}
    result = {**disk["result"], "methods": disk["result"]["methods"][:1]}
    figure, _ = path_figure(result, {"variational-0": path}, None)
    assert figure.axes[0].get_lines()[0].get_linestyle() == "None"


@pytest.mark.parametrize(("value", "text"), [(0.0, "0"), (0.0123456, "0.0123"), (1e-12, "1.0e-12"), (98765.0, "9.9e4")])
def test_numbers_of_captions_are_short(value: float, text: str) -> None:
    assert shown(value) == text


@pytest.mark.parametrize("label", ["$x^$", "$\\frac{$", "$\\notacommand$", "costs $5 and $6"])
def test_a_label_is_no_formula_of_the_drawing_program(label: str, disk: dict[str, Any], tmp_path: Path) -> None:
    methods = [method | {"label": label} for method in disk["result"]["methods"][:1]]
    table = {label: next(iter(disk["tables"].values()))}
    figures = draw_simulation(tmp_path, disk["result"] | {"methods": methods}, table, None)
    assert len(figures) >= 2

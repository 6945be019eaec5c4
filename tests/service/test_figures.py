"""Figures show what was observed, tell methods apart without color, and say the finding."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inverse_service.service.figures.drawing import coordinate_figure, draw_simulation, portrait_figure
from inverse_service.service.figures.paths import path_figure
from inverse_service.service.figures.style import envelope, look, shown, thinned
from inverse_service.service.figures.time_series import series_figure
from inverse_service.service.scenes.simulating import simulate_tables

DISK = json.loads((Path(__file__).parents[2] / "docs" / "scenes" / "disk-table.json").read_text())


@pytest.fixture(scope="module")
def disk() -> dict[str, Any]:
    return simulate_tables(DISK)


def test_eight_methods_differ_in_line_and_marker() -> None:
    looks = [look(place, "variational") for place in range(8)]
    assert len({str(one.line) for one in looks}) == 8
    assert len({one.marker for one in looks}) == 8
    assert len({one.color for one in looks}) == 8


@pytest.mark.slow
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
        x, y = line.get_xdata() - known["center"][0], line.get_ydata() - known["center"][1]
        assert np.allclose(np.hypot(x, y), known["radius"])
    assert "changes least by nonholonomic-0.5" in caption
    assert "most by nonholonomic-1 (a factor 531)" in caption


@pytest.mark.slow
def test_series_keep_every_peak_and_name_best_and_worst(disk: dict[str, Any]) -> None:
    drawn = series_figure("energy", disk["result"], disk["tables"])
    assert drawn is not None
    figure, caption = drawn
    lines = {line.get_label(): line for line in figure.axes[-1].get_lines()}
    for method in disk["result"]["methods"]:
        assert max(lines[method["label"]].get_ydata()) == pytest.approx(method["max_energy_error"])
    assert "variational-0.5 has the least" in caption
    discrete = series_figure("discrete_energy", disk["result"], disk["tables"])
    assert discrete is not None
    assert "nonholonomic-0.5 has the least" in discrete[1]
    assert "nonholonomic-1 the most" in caption
    assert series_figure("energy", disk["result"], {}) is None


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("label", ["$x^$", "$\\frac{$", "$\\notacommand$", "costs $5 and $6"])
def test_a_label_is_no_formula_of_the_drawing_program(label: str, disk: dict[str, Any], tmp_path: Path) -> None:
    methods = [method | {"label": label} for method in disk["result"]["methods"][:1]]
    table = {label: next(iter(disk["tables"].values()))}
    figures = draw_simulation(tmp_path, disk["result"] | {"methods": methods}, table, None)
    assert len(figures) >= 2


def test_signs_of_a_constraint_and_of_the_energy_are_seen(disk: dict[str, Any]) -> None:
    """Figures 4 and 6 of the paper: the variational energy and constraint oscillate about a level, and about zero."""
    drawn = series_figure("constraints", disk["result"], disk["tables"])
    assert drawn is not None
    first, second, sizes = drawn[0].axes
    assert [first.get_ylabel(), second.get_ylabel()] == ["constraint 1", "constraint 2"]
    assert sizes.get_yscale() == "log"
    assert first.get_yscale() == "linear"
    values = disk["tables"]["variational-0"]["constraint_1"]
    (line,) = [one for one in first.get_lines() if len(one.get_xdata()) == len(values)][:1]
    assert min(line.get_ydata()) < 0 < max(line.get_ydata())
    drawn = series_figure("energy", disk["result"], disk["tables"])
    assert drawn is not None
    assert "leaves the signed panels" in drawn[1]


def test_differences_to_the_true_motion_are_drawn_by_coordinate(disk: dict[str, Any]) -> None:
    drawn = series_figure("error", disk["result"], disk["tables"], disk["truth"])
    assert drawn is not None
    panels = drawn[0].axes
    assert [axes.get_ylabel() for axes in panels[:-1]] == [
        f"{name} - true {name}" for name in ("phi", "theta", "x", "y")
    ]
    table = disk["tables"]["variational-0"]
    assert np.allclose(panels[2].get_lines()[0].get_ydata(), table["x"] - disk["truth"]["x"])


def test_thinned_lines_keep_the_least_and_the_greatest() -> None:
    """A spike of one point in 20,000 is in the band, and the caption says that there are bands."""
    times, values = np.arange(20_000.0), np.sin(np.arange(20_000.0))
    values[7_777], values[12_345] = -40, 50
    t, low, high, every = envelope(times, values)
    assert every == 50
    assert len(t) == len(low) == len(high) == 400
    assert (low.min(), high.max()) == (-40, 50)
    assert "50 points each" in thinned(every)
    assert thinned(1) == ""


def test_a_gap_of_values_stays_a_gap() -> None:
    values = np.full(2_000, np.nan)
    values[:700] = 1
    _, low, high, _ = envelope(np.arange(2_000.0), values)
    assert np.isnan(low[-1])
    assert np.isnan(high[-1])
    assert low[0] == high[0] == 1


@pytest.mark.slow
def test_phase_portraits_and_units(tmp_path: Path) -> None:
    scene = {
        "system": {"coordinates": ["u"], "lagrangian": "u'^2/2 - u^2/2"}, "step": 0.1, "steps": 30,
        "initial": {"positions": {"u": 1}, "velocities": {"u": 0}}, "methods": ["variational"],
        "observe": ["trajectory", "velocities"], "units": {"u": "m", "t": "s"},
    }  # fmt: skip
    found = simulate_tables(scene)
    figures = draw_simulation(tmp_path, found["result"], found["tables"], found["truth"])
    assert [figure["files"][0] for figure in figures] == ["coordinates.svg", "phase-portrait.svg"]
    drawn = portrait_figure(found["result"], found["tables"])
    assert drawn is not None
    (axes,) = drawn[0].axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("u [m]", "u'")
    figure, _ = coordinate_figure(found["result"], found["tables"], None)
    assert figure.axes[-1].get_xlabel() == "t [s]"

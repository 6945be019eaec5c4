"""Poincare sections of stored results."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.service.scenes.simulating import simulate
from inverse_service.web.pages.figures import figure_data, figure_names, motion_of, picture

SCENE: dict[str, Any] = {
    "system": {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 - (x^2 + y^2)/2 - x^2*y + y^3/3"},
    "initial": {"positions": {"x": 0, "y": 0.1}, "velocities": {"x": 0.3, "y": 0.1}},
    "step": 0.05, "time": 60, "methods": ["stormer-verlet", "adaptive"],
}  # fmt: skip


@pytest.mark.slow
def test_a_poincare_section_is_drawn_point_by_point() -> None:
    """Henon and Heiles at x = 0, rising: the plane of y and y'."""
    result = simulate(SCENE | {"events": [{"when": "x", "direction": 1}]})
    assert ("section", "Points at events") in figure_names(result)
    (section,) = (one for one in figure_data(result) if one["name"] == "section")
    assert [view["label"] for view in section["views"]] == ["x = 0: y, y\u2032"]
    for line in section["views"][0]["lines"]:
        assert len(line["x"]) == len(line["y"]) > 5
    assert section["views"][0]["dots"]
    svg = picture(result, "section", "svg")
    assert svg is not None
    assert b"<svg" in svg


def test_without_events_there_is_no_section() -> None:
    result = simulate(SCENE | {"time": 1})
    assert "section" not in dict(figure_names(result))
    assert picture(result, "section", "svg") is None


def test_a_path_with_fewer_points_than_steps_is_drawn_as_points() -> None:
    """Chords of every k-th step would show a circle as a ring."""
    for time, dots in ((60, False), (600, True)):
        result = simulate(SCENE | {"time": time, "methods": ["stormer-verlet"]})
        (path,) = (one for one in figure_data(result) if one["name"] == "path")
        (space,) = (one for one in figure_data(result) if one["name"] == "space")
        motion = motion_of(result)
        assert motion is not None
        assert path["views"][0]["dots"] is space["dots"] is motion["dots"] is dots

"""What is drawn of a run: on logarithmic axes, as differences, in phase portraits, with signs."""

from __future__ import annotations

import math

import pytest

from inverse_service.web.pages.figures import figure_data, series


def method(**columns: list[float | None]) -> dict[str, object]:
    return {"energy_start": 2.0, "points": {"columns": columns}}


def test_the_rounding_of_the_start_is_left_out_and_nothing_else() -> None:
    assert series("error", method(error=[0.0, 1e-16, 1e-16, 1e-3])) == [None, None, 1e-16, 1e-3]
    assert series("error", method(error=[1e-5, 1e-4])) == [1e-5, 1e-4]
    assert series("error", method(error=[])) == []


def test_the_energy_error_is_relative_to_the_start() -> None:
    assert series("energy", method(energy=[2.0, 2.5, None, 1.0])) == [None, 0.25, None, 0.5]


def test_the_worst_constraint_counts() -> None:
    found = series("constraints", method(constraint_1=[0.1, -0.3, None], constraint_2=[-0.2, 0.1, None]))
    assert found == [0.2, 0.3, None]


def simulated() -> dict[str, object]:
    """Two methods on a circle, the second with an error that grows; a constraint with a sign."""
    t = [0.1 * k for k in range(40)]
    true = {
        "t": t,
        "x": [math.cos(s) for s in t],
        "energy": [1.0] * 40,
        "constraint_1": [1e-9 * math.sin(s) for s in t],
    }
    wrong = {**true, "x": [math.cos(s) + 0.01 * s for s in t], "energy": [1.0 - 0.1 * s for s in t]}
    methods = [{"method": "euler", "label": "euler", "energy_start": 1.0, "points": {"columns": wrong}},
               {"method": "exact", "label": "exact", "energy_start": 1.0, "points": {"columns": true}}]  # fmt: skip
    return {"format": "inverse-service/simulation/1", "observe": ["trajectory", "energy", "constraints"],
            "methods": methods, "circle_coordinates": None,
            "system": {"coordinates": ["x"], "constraints": ["x'"]}}  # fmt: skip


def test_a_stored_run_shows_differences_phase_portraits_and_signs() -> None:
    figures = {figure["name"]: figure["views"] for figure in figure_data(simulated())}
    labels = {name: [view["label"] for view in views] for name, views in figures.items()}
    assert labels["coordinates"] == ["x in time", "x, difference from the true motion", "x, phase portrait"]
    assert labels["energy"] == ["size, logarithmic", "E, with its sign"]
    [line] = figures["coordinates"][1]["lines"]
    assert line["y"] == pytest.approx([0.01 * s for s in line["x"]], abs=1e-6)
    portrait = figures["coordinates"][2]["lines"][1]
    inner = list(zip(portrait["x"], portrait["y"], strict=True))[1:-1]
    assert all(x * x + v * v == pytest.approx(1, abs=5e-3) for x, v in inner)
    assert figures["energy"][1]["lines"][0]["y"][-1] < 1
    assert min(figures["constraints"][1]["lines"][0]["y"]) < 0 < max(figures["constraints"][1]["lines"][0]["y"])

"""A system given by equations has the energy of the Lagrangian that the solver finds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service import solve
from inverse_service.service.scenes.drawing import series_figure
from inverse_service.service.scenes.simulating import simulate
from inverse_service.service.scenes.views import figures_of
from tests.values import slow


def run(equations: list[str], velocity: float, method: Any, **further: Any) -> dict[str, Any]:
    initial = {"positions": {"x": 0.5}, "velocities": {"x": velocity}}
    scene = {
        "system": {"coordinates": ["x"], "equations": equations},
        "initial": initial,
        "step": 0.05,
        "time": 10,
    }
    (found,) = simulate(scene | {"methods": [method], "observe": ["energy"]} | further)["methods"]
    return dict(found)


def test_the_midpoint_rule_keeps_the_energy_of_an_oscillator_given_by_its_equation() -> None:
    found = run(["x'' = -x"], 0, "variational")
    assert found["energy_start"] == pytest.approx(0.125)
    assert found["max_energy_error"] < 1e-14


def test_methods_without_a_lagrangian_have_the_same_energy() -> None:
    """E = (q_0^2 + v_0^2)/2 of RK4, whose amplification for x'' = -x is 1 - h^6/144 per step: 200
    steps lose 2.2e-8.
    """
    found = run(["x'' = -x"], 0, "runge-kutta")
    assert found["max_energy_error"] == pytest.approx(200 * 2 * 0.05**6 / 144, rel=0.02)


@pytest.mark.slow
def test_quadratic_friction_has_an_energy() -> None:
    """x'' = -x'^2: H = exp(2 x) x'^2/2 up to a factor and a constant is conserved."""
    assert (
        run(["x'' = -x'^2"], 1, {"method": "runge-kutta", "order": 8})["max_energy_error"] < 1e-12
    )


@pytest.mark.slow
def test_an_energy_with_t_has_no_error() -> None:
    found = run(["x'' = -x - x'/10"], 0, "runge-kutta")
    assert found["max_energy_error"] is None
    assert "contains t" in found["energy_note"]


@pytest.mark.slow
def test_an_energy_ends_where_its_lagrangian_ends() -> None:
    """The autonomous L of the damped oscillator divides by x, and the motion passes x = 0."""
    document = {
        "coordinates": ["x"],
        "equations": {"x": "-x - x'/10"},
        "time_dependent_lagrangian": False,
    }
    result = {**solve(document), "with_time": None}
    found = run([], 0, "runge-kutta", system={"result": result})
    assert found["outcome"] == "completed"
    assert found["max_energy_error"] is None
    assert "the motion passes there" in found["energy_note"]


def test_a_motion_without_a_lagrangian_has_no_energy() -> None:
    system = {"coordinates": ["x", "y"], "equations": {"x": "y' + x*y", "y": "x^2*x'"}}
    initial = {"positions": {"x": 0.1, "y": 0.1}, "velocities": {"x": 0.1, "y": 0}}
    scene = {
        "system": system,
        "initial": initial,
        "step": 0.05,
        "steps": 10,
        "methods": ["runge-kutta"],
    }
    (found,) = simulate(scene | {"observe": ["energy"]})["methods"]
    assert found["max_energy_error"] is None
    assert "no Lagrangian was found" in found["energy_note"]


@pytest.mark.slow
def test_an_energy_that_is_not_kept_is_drawn_as_it_is_and_not_as_an_error() -> None:
    scene = {"system": {"coordinates": ["x"], "equations": ["x'' = -x - x'/10"]}, "step": 0.05, "time": 1,
             "initial": {"positions": {"x": 0.5}, "velocities": {"x": 0}}, "methods": ["runge-kutta"],
             "observe": ["trajectory", "energy"]}  # fmt: skip
    result = simulate(scene)
    (energy,) = [figure for figure in figures_of(result) if figure["name"] == "energy"]
    assert energy["title"] == "Energy"
    both, view, drift = energy["views"]
    columns = result["methods"][0]["points"]["columns"]
    kept, mechanical = both["lines"]
    of_motion = [
        (x**2 + v**2) / 2 / 0.125 for x, v in zip(columns["x"], _slopes(columns), strict=True)
    ]
    assert mechanical["y"][5:-5] == pytest.approx(of_motion[5:-5], rel=1e-2)
    assert mechanical["y"][-1] < 0.97
    assert kept["y"] == pytest.approx(np.ones(len(kept["y"])), abs=1e-4)
    assert max(map(abs, drift["lines"][0]["y"])) < 1e-4
    assert (view["y"], view["lines"][0]["y"]) == (
        "E = T + V",
        pytest.approx(columns["mechanical_energy"], rel=1e-6),
    )
    drawn = series_figure(
        "energy",
        result,
        {"runge-kutta": {name: np.array(values) for name, values in columns.items()}},
    )
    assert drawn is not None
    figure, caption = drawn
    assert [axes.get_ylabel() for axes in figure.axes] == [view["y"] for view in energy["views"]]
    assert caption == ""


def _slopes(columns: dict[str, list[float]]) -> list[float]:
    return list(np.gradient(np.array(columns["x"]), np.array(columns["t"])))


@pytest.mark.parametrize("radius", [slow(0.7), slow(1.3), 3.7])
def test_an_energy_of_round_off_is_not_a_scale(radius: float) -> None:
    """A parabolic orbit has E = v^2/2 - 1/r = 0, and rounding gives -2e-16 at r = 1.3."""
    system = {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 + 1/sqrt(x^2 + y^2)"}
    speed = (2 / radius) ** 0.5
    initial = {"positions": {"x": radius, "y": 0}, "velocities": {"x": 0, "y": speed}}
    scene = {"system": system, "initial": initial, "step": 0.05, "time": 20, "observe": ["energy"]}
    (found,) = simulate(scene | {"methods": ["runge-kutta"]})["methods"]
    assert (found["energy_start"], found["energy_error_is"][:8]) == (0, "absolute")
    assert found["max_energy_error"] < 1e-6
    members = {"initial": {"velocities": {"y": [speed, 1.1 * speed]}}}
    (many,) = simulate(scene | {"methods": ["runge-kutta"], "ensemble": members})["methods"]
    assert max(many["members_columns"]["max_energy_error"]) < 1e-5

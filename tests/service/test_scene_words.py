"""A scene takes a system in the words of every other document: the name of the time, and names for formulas."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.scenes.simulating import simulate

RUN: dict[str, Any] = {
    "initial": {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 1}},
    "step": 0.01,
    "steps": 50,
    "methods": ["runge-kutta"],
}
KEPLER = {"equations": {"x": "-x/sqrt(x^2+y^2)^3", "y": "-y/sqrt(x^2+y^2)^3"}}


def end(scene: dict[str, Any]) -> dict[str, float]:
    method = simulate(scene)["methods"][0]
    assert method["outcome"] == "completed"
    positions: dict[str, float] = method["final"]["positions"]
    return positions


@pytest.mark.slow
@pytest.mark.parametrize(
    "system",
    [
        {"equations": {"x": "-x/r^3", "y": "-y/r^3"}, "where": {"r": "sqrt(x^2+y^2)"}},
        {"lagrangian": "(x'^2 + y'^2)/2 + 1/r", "coordinates": ["x", "y"], "where": {"r": "sqrt(x^2+y^2)"}},
        {"equations": "x''(s) = -x/r^3; y''(s) = -y/r^3", "where": {"r": "sqrt(x^2+y^2)"}, "id": 3, "_note": "orbit"},
    ],
)
def test_a_name_for_a_formula_is_put_in(system: dict[str, Any]) -> None:
    assert end({"system": system, **RUN}) == pytest.approx(end({"system": KEPLER, **RUN}), abs=1e-9)


def test_the_name_of_the_time_holds_in_the_formulas_of_the_scene_too() -> None:
    run = {
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.01,
        "steps": 50,
        "methods": ["runge-kutta"],
    }
    ours = {"system": {"lagrangian": "x'^2/2 - x^2/2", "coordinates": ["x"]}, "forces": {"x": "cos(3*t)"}, **run}
    named = {**ours, "system": {**ours["system"], "time": "tau"}, "forces": {"x": "cos(3*tau)"}}
    assert end(named) == end(ours)
    assert end(ours) != end({**ours, "forces": {"x": "0"}})


@pytest.mark.slow
def test_a_result_in_which_the_time_is_named_can_be_simulated() -> None:
    document = {"equations": {"x": "-x + cos(s)"}, "time": "s"}
    result = solve_document(document, SolveOptions(time_limit=20))
    run = {
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.01,
        "steps": 20,
        "methods": ["runge-kutta"],
    }
    assert end({"system": {"result": result}, **run}) == end({"system": {"equations": {"x": "-x + cos(t)"}}, **run})


def test_a_coordinate_t_is_refused_where_the_columns_have_one() -> None:
    scene = {"system": {"equations": "t'' = -t; x'' = -x", "time": "s"}, **RUN}
    with pytest.raises(InputError, match="column t for the time") as caught:
        simulate(scene)
    assert caught.value.pointer == "/system/coordinates"

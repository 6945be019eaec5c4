"""The price of each effect and observed quantity, where a scene observes its cost."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.service.scenes.scene_reading import read_scene
from inverse_service.service.scenes.scene_refusals import scene_schema
from inverse_service.service.scenes.simulating import simulate
from tests.service.test_scene_refusals import DISK

FALLING: dict[str, Any] = {
    "system": {"coordinates": ["x", "y"], "lagrangian": "x'^2/2 + y'^2/2 - g*x - x^2*y^2 + B*(x*y' - y*x')",
               "parameters": ["g", "B"]},
    "parameters": {"g": 1, "B": "1/2"},
    "initial": {"positions": {"x": 0, "y": 1}, "velocities": {"x": 1, "y": 0}},
    "step": 0.01,
    "steps": 50,
    "methods": [{"method": "variational", "alpha": "1/2"}, "runge-kutta"],
    "observe": ["energy", "cost"],
}  # fmt: skip


def parts(method: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    return {(part["kind"], part["name"]): part for part in method["cost"]["parts"]}


def test_the_time_of_a_step_is_not_that_of_a_call() -> None:
    """To call a kernel takes as long as some hundred explicit steps: of a short run more steps are timed."""
    short = FALLING | {
        "methods": ["stormer-verlet"],
        "effects": ["kinetic", "potential"],
        "parameters": {"g": 1, "B": 0},
    }
    (few,), (many,) = (simulate(short | {"steps": steps})["methods"] for steps in (20, 100_000))
    assert few["cost"]["steps"] > 20
    assert few["cost"]["operations"] == many["cost"]["operations"]
    assert 0 < few["cost"]["step_ns"] < 5 * many["cost"]["step_ns"]


def test_every_effect_and_observed_quantity_has_its_price() -> None:
    for method in simulate(FALLING)["methods"]:
        found = parts(method)
        assert set(found) == {
            ("effect", "constraints"), ("effect", "potential"), ("effect", "magnetic"), ("observed", "energy"),
        }  # fmt: skip
        assert method["cost"]["step_ns"] > 0
        assert method["cost"]["operations"] > sum(found[kind]["operations"] for kind in [("effect", "potential")]) > 0
        assert found["effect", "magnetic"]["operations"] > 0
        assert found["observed", "energy"]["operations"] > 0
        # There are no constraints, so they cost nothing and nothing is measured.
        assert found["effect", "constraints"] == {
            "name": "constraints", "kind": "effect", "step_ns": 0.0, "operations": 0,
            "note": "The system has no such part.",
        }  # fmt: skip


def test_an_effect_that_the_scene_leaves_out_has_no_price() -> None:
    method = simulate(FALLING | {"effects": ["potential"], "methods": ["runge-kutta"]})["methods"][0]
    assert set(parts(method)) == {("effect", "potential"), ("observed", "energy")}


def test_nothing_is_prepared_where_the_cost_is_not_observed() -> None:
    scene = FALLING | {"observe": ["energy"], "methods": ["runge-kutta"]}
    assert not read_scene(scene_schema(scene))[0].without
    method = simulate(scene)["methods"][0]
    assert "cost" not in method
    assert "cost" not in method["seconds"]


def test_the_effects_of_a_free_lagrangian_are_not_taken_apart() -> None:
    scene = DISK | {"methods": [{"method": "variational", "alpha": 0}, {"method": "nonholonomic", "alpha": 0}, "exact"]}
    variational, nonholonomic, exact = simulate(scene | {"observe": ["constraints", "cost"]})["methods"]
    assert set(parts(variational)) == {("observed", "constraints")}
    assert "all effects together" in variational["cost"]["note"]
    assert parts(nonholonomic)["effect", "constraints"]["operations"] > 0
    assert "cost" not in exact


@pytest.mark.parametrize("observe", [["cost"], ["trajectory", "cost"]])
def test_a_system_given_by_equations_has_the_price_of_its_step_alone(observe: list[str]) -> None:
    system = {"coordinates": ["x"], "equations": {"x": "-sin(x)"}}
    scene = FALLING | {"system": system, "parameters": {}, "methods": ["runge-kutta"], "observe": observe,
                       "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}}  # fmt: skip
    found = simulate(scene)["methods"][0]["cost"]
    assert found["operations"] > 0
    assert found["parts"] == []

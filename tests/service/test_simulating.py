"""Scenes give the known numbers, compute only what they name, and report the outcome of each
method.
"""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inverse_service.errors import InputError
from inverse_service.kernels.codegen.compiled import kernel_text
from inverse_service.service.documents.plain_data import read_json
from inverse_service.service.scenes.scene_lagrangian import finder
from inverse_service.service.scenes.scene_reading import read_scene, scene_schema
from inverse_service.service.scenes.simulating import MOST_POINTS, simulate, simulate_tables
from inverse_service.simulation.derivation import Derived, problem_of
from inverse_service.simulation.numeric_formulas import Formulas
from inverse_service.simulation.observing import ENERGY_START, observables
from inverse_service.simulation.scene_data import Problem
from inverse_service.simulation.schemes import program_of

SCENES = Path(__file__).parents[2] / "docs" / "scenes"


def scene(name: str, **changes: Any) -> dict[str, Any]:
    found: dict[str, Any] = read_json((SCENES / f"{name}.json").read_bytes())
    return {
        key: value for key, value in (copy.deepcopy(found) | changes).items() if value is not None
    }


def by_label(result: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {method["label"]: method for method in result["methods"]}


@pytest.fixture(scope="module")
def table() -> dict[str, dict[str, Any]]:
    return by_label(simulate(scene("disk-table")))


# Radial distance, radius change, energy, constraint: to 5 %, or half a unit of the last digit
# known; None is round-off.
KNOWN = {
    "variational-0": (1.8e-1, -9e-5, 4.2e-2, 1.2e-2),
    "variational-0.5": (3.4e-3, 3e-7, 1.8e-3, 5e-4),
    "variational-1": (9.8e-2, 6e-4, 3.6e-2, 1e-2),
    "nonholonomic-0": (0.97, -0.998, 0.60, None),
    "nonholonomic-0.5": (3.3e-3, None, None, None),
    "nonholonomic-1": (797, 530, 3.8e5, None),
}


@pytest.mark.slow
@pytest.mark.parametrize("label", KNOWN)
def test_the_disk_gives_the_known_figures(label: str, table: dict[str, dict[str, Any]]) -> None:
    found = table[label]
    circle = found["circle"]
    measured = (circle["max_radial_distance"], circle["radius_change"], found["max_discrete_energy_error"],
                found["max_constraint"])  # fmt: skip
    assert found["outcome"] == "completed"
    assert found["steps"] == 500
    for value, known in zip(measured, KNOWN[label], strict=True):
        assert value == pytest.approx(known, rel=0.051) if known is not None else abs(value) < 2e-12


@pytest.mark.slow
def test_drift_phase_and_trajectory_are_distinguished(table: dict[str, dict[str, Any]]) -> None:
    """A spiral has the right phase, the variational circle does not; at 1/2 the nonholonomic circle
    is exact.
    """
    assert table["nonholonomic-0"]["max_phase_error"] == pytest.approx(0.1)
    assert abs(table["variational-0"]["final_phase_error"]) > 0.5
    assert table["nonholonomic-0.5"]["max_phase_error"] < 1e-12
    assert table["nonholonomic-0.5"]["circle"]["centre_drift"] < 1e-12
    assert table["nonholonomic-1"]["circle"]["centre_drift"] > 40
    assert table["variational-0"]["max_momentum_drift"] < 1e-14


@pytest.mark.slow
@pytest.mark.parametrize(("alpha", "ratio"), [
    (0, 0.996669443519), ("1/3", 0.998888991766), ("1/2", 1.0), (1, 1.003341686156),
])  # fmt: skip
def test_the_radius_ratio_of_each_step_is_exact(alpha: Any, ratio: float) -> None:
    document = scene("disk-table", step=0.1, steps=40, time=None, observe=["trajectory"])
    document["methods"] = [{"method": "nonholonomic", "alpha": alpha}]
    theta = simulate_tables(document)["tables"].popitem()[1]["theta"]
    rolled = theta[1:] - theta[:-1]
    assert rolled[1:] / rolled[:-1] == pytest.approx(ratio, abs=1e-11)


@pytest.mark.slow
def test_the_scene_of_the_contract_runs() -> None:
    found = by_label(simulate(scene("disk", steps=400)))
    assert list(found) == ["variational-0", "nonholonomic-0", "modified-0", "exact", "reference"]
    assert found["reference"]["max_error"] < 1e-11
    assert found["nonholonomic-0"]["circle"]["radius_last"] < 0.9
    stopped = found["modified-0"]["stopped"]
    # For these data 1 + cos phi + sin phi, the singular set of the modified method, is reached at
    # phi = pi.
    assert found["modified-0"]["outcome"] == "singular"
    assert stopped["time"] == pytest.approx(math.pi - 0.1, abs=0.1)
    assert "determinant" in stopped["quantity"]
    assert "smaller free constants" in stopped["remedy"]


def kernel(document: dict[str, Any]) -> str:
    """The source text of the first method's kernel."""
    schema = scene_schema(document)
    found, system = read_scene(schema)
    derived = Derived(found, finder(schema, system))
    problem, choice = problem_of(found.methods[0], derived), found.methods[0].choice
    assert isinstance(problem, Problem)
    assert choice is not None
    problem = replace(problem, parameters=(*problem.parameters, ENERGY_START))
    return kernel_text(program_of(Formulas(problem), choice, observables(found, choice)))


@pytest.mark.slow
def test_results_are_always_plain_json() -> None:
    document = scene("disk-table", step=3, steps=50, time=None)
    document["methods"] += [
        "modified",
        "exact",
        "reference",
        {"method": "variational", "form": "raw"},
    ]
    result = simulate(document)
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    outcomes = {method["label"]: method["outcome"] for method in result["methods"]}
    assert outcomes["exact"] == "completed"
    stopped = [m for m in result["methods"] if m["outcome"] not in ("completed", "unavailable")]
    assert stopped
    assert all(m["stopped"]["remedy"] or m.get("reason") for m in stopped)


@pytest.mark.slow
def test_a_run_can_start_on_the_zero_of_a_constraint() -> None:
    """sin(phi) = 0 at the start: the momenta are limits of 0/0."""
    document = scene("disk", steps=200, observe=["error", "constraints"])
    document["initial"]["positions"]["phi"] = 0
    document["initial"]["velocities"]["theta"] = "1/4"
    document["methods"] = [{"method": "variational", "alpha": a} for a in (0, "1/2", 1)]
    for method in simulate(document)["methods"]:
        assert method["outcome"] == "completed"
        assert method["max_error"] < 0.1


@pytest.mark.slow
def test_a_system_that_is_not_variational_says_so_and_the_rest_runs() -> None:
    document = scene("disk", steps=50, methods=["variational", "nonholonomic"], observe=["error"])
    document["terms"], document["effects"] = {"spring": "-x^2/2"}, ["constraints", "spring"]
    found = by_label(simulate(document))
    assert found["variational-0.5"]["outcome"] == "unavailable"
    assert "not variational" in found["variational-0.5"]["reason"]
    assert found["nonholonomic-0.5"]["max_error"] < 1e-3
    assert found["nonholonomic-0.5"]["error_against"] == "reference"
    assert found["nonholonomic-0.5"]["error_uncertainty"] < 1e-11


@pytest.mark.slow
def test_the_third_lagrangian_keeps_the_constraint_through_zero() -> None:
    document = scene("particle", steps=400, free_lagrangian="third", methods=["variational"])
    document["initial"] = {"positions": {"x": -1, "y": 0, "z": 0}, "velocities": {"x": 1, "y": 1}}
    method = simulate(document)["methods"][0]
    assert method["outcome"] == "completed"
    assert method["free_lagrangian_source"] == "the known Lagrangian of the third associated system"
    assert method["max_constraint_at_points"] < 1e-13


def test_a_solve_result_is_simulated_with_its_lagrangian() -> None:
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.service.documents.documents import solve_system

    result = solve_system(
        {"coordinates": ["x"], "equations": {"x": "-4*x"}}, SolveOptions(time_limit=20)
    )
    document = {
        "system": {"result": result}, "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.01, "time": 1, "methods": ["variational"], "observe": ["error"],
    }  # fmt: skip
    method = simulate(document)["methods"][0]
    assert method["free_lagrangian_source"] == "the result given"
    assert method["max_error"] < 1e-4


def test_series_are_thinned_and_say_how() -> None:
    result = simulate(scene("disk", methods=["nonholonomic"], observe=["trajectory"], steps=9000))
    points = result["methods"][0]["points"]
    assert points["every"] == 5
    assert len(points["columns"]["t"]) <= MOST_POINTS
    assert points["columns"]["t"][1] == pytest.approx(0.25)


def test_the_last_step_counts_for_any_interval_of_records() -> None:
    document = scene(
        "disk", methods=["nonholonomic", "exact"], observe=["error"], steps=47, record_every=10
    )
    found = simulate_tables(document)
    assert found["tables"]["nonholonomic-0.5"]["t"][-1] == pytest.approx(47 * 0.05)
    errors = by_label(found["result"])
    assert 0 < errors["nonholonomic-0.5"]["final_error"] < 1e-2
    assert errors["exact"]["max_error"] == 0


@pytest.mark.parametrize(
    ("system", "terms"),
    [
        ({"document": {"coordinates": ["y"], "lagrangian": "y'^2/2 - 9.81*y - 0.35*y^2"}}, {}),
        ({"coordinates": ["y"], "lagrangian": "y'^2/2 - 9.81*y"}, {"spring": "-0.35*y^2"}),
        ({"coordinates": ["y"], "equations": {"y": "-9.81 - 0.35*y"}}, {}),
    ],
)
def test_numbers_of_a_simulated_system_are_printed_as_they_were_typed(
    system: dict[str, Any], terms: dict[str, str]
) -> None:
    found = simulate(
        {"system": system, "initial": {"positions": {"y": 1}, "velocities": {"y": 0}}, "step": 0.1, "steps": 2}
        | {"methods": ["runge-kutta"], "terms": terms}
    )  # fmt: skip
    shown = found["system"]["lagrangian"] or found["system"]["equations"]["y"]
    assert "9.81" in shown
    assert "0.35" in shown


def test_one_coordinate_has_no_circle() -> None:
    document = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "step": 0.1, "steps": 5,
        "methods": ["variational"], "observe": ["matching_circle", "phase", "energy", "constraints"],
    }  # fmt: skip
    result = simulate(document)
    assert result["circle_coordinates"] is None
    assert result["methods"][0]["circle"] is None
    assert result["methods"][0]["max_constraint"] is None


DAMPED = "((x + 4*x')*atan((x + 4*x')/(x*sqrt(15)))/(x*sqrt(15)) - log(2*x^2 + 2*x'^2 + x*x')/2)/2"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["hamiltonian", "raw"])
def test_a_pole_of_the_free_lagrangian_on_the_way_is_named(form: str) -> None:
    """The damped oscillator passes x = 0, and this Lagrangian divides by x; the guard alone would
    not say why.
    """
    found = simulate({
        "system": {"document": {"coordinates": ["x"], "equations": {"x": "-x - x'/2"}}},
        "initial": {"positions": {"x": 1}, "velocities": {"x": "1/10"}},
        "free_lagrangian": DAMPED, "step": 0.02, "steps": 1000,
        "methods": [{"method": "variational", "form": form}, "runge-kutta"],
    })  # fmt: skip
    stopped = found["methods"][0]["stopped"]
    assert found["methods"][0]["outcome"] == "singular"
    assert stopped["quantity"] == "x"
    assert 0 < stopped["value"] < 0.2
    assert "free_lagrangian" in stopped["remedy"]
    assert found["methods"][1]["outcome"] == "completed"


def test_the_time_as_a_coordinate_is_the_time() -> None:
    given: dict[str, Any] = {
        "system": {"document": {"coordinates": ["x", "s"], "equations": {"x": "-x + s", "s": "0"}}},
        "initial": {"positions": {"x": 0, "s": 0}, "velocities": {"x": 0, "s": 1}},
        "step": 0.1, "steps": 20, "methods": ["reference"],
    }  # fmt: skip
    columns = simulate(given)["methods"][0]["points"]["columns"]
    times = np.array(columns["t"])
    np.testing.assert_allclose(columns["x"], times - np.sin(times), rtol=0, atol=1e-13)
    given["system"] = {"document": {"coordinates": ["x"], "equations": {"x": "-x + t"}}}
    given["initial"] = {"positions": {"x": 0}, "velocities": {"x": 0}}
    columns = simulate(given)["methods"][0]["points"]["columns"]
    np.testing.assert_allclose(columns["x"], times - np.sin(times), rtol=0, atol=1e-13)


@pytest.mark.parametrize("lagrangian", ["0", "x'", "x", "t", "x'*y' - x'^2/2 - y'^2/2", "x'^2/2"])
def test_no_method_completes_with_a_degenerate_lagrangian(lagrangian: str) -> None:
    scene = {
        "system": {"coordinates": ["x", "y"], "lagrangian": lagrangian},
        "initial": {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0.5, "y": 1}}, "step": 0.1, "steps": 5,
        "methods": ["variational", {"method": "variational", "form": "raw"}, "nonholonomic", "runge-kutta", "reference",
                    "exact"],
        "observe": ["energy", "error", "momenta", "cost"],
    }  # fmt: skip
    for method in simulate(scene)["methods"]:
        assert method["outcome"] in ("unavailable", "singular"), method["label"]


def test_a_kinetic_energy_that_is_degenerate_at_the_start_alone_is_observed() -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "t*x'^2"},
        "initial": {"positions": {"x": 0}, "velocities": {"x": 1}}, "step": 0.1, "steps": 5,
        "methods": ["nonholonomic"], "observe": ["energy", "momenta"],
    }  # fmt: skip
    method = simulate(scene)["methods"][0]
    assert method["outcome"] == "completed"
    assert method["max_momentum_drift"] == 0
    assert len(method["points"]["columns"]["energy"]) == 6


@pytest.mark.parametrize("term", ["1/sin(0)", "x'/(k*sin(0))", "log(sin(0))", "x/(1 - cos(0))"])
def test_a_formula_without_a_value_anywhere_is_reported(term: str) -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": f"x'^2/2 + {term}", "parameters": {"k": 1}},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0.5}}, "step": 0.1, "steps": 5,
        "methods": ["nonholonomic", "variational", "runge-kutta", "heyoka"], "observe": ["energy", "constraints"],
    }  # fmt: skip
    try:
        found = simulate(scene)
    except InputError:
        return
    assert {method["outcome"] for method in found["methods"]} <= {
        "unavailable",
        "off_domain",
        "not_finite",
    }

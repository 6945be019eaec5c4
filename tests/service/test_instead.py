"""What a result says where there is no L(q, q'): parameters that leave one, and the reduced system of constraints."""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_document
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.text_page import text_page

COUPLED = {"equations": {"x": "x^2 + e*y^2", "y": "0"}, "parameters": ["e"]}


def test_parameters_that_leave_a_lagrangian_are_found() -> None:
    result = solve_document(COUPLED, SolveOptions(time_limit=200))
    found = result["instead"]
    assert (result["verdict"], found["kind"], found["conditions"]) == ("not_variational", "parameters", ["e = 0"])
    assert found["equations"] == {"x": "x^2", "y": "0"}
    assert (found["checked"], check_document(json.dumps(result))["verdict"]) == ("valid", "valid")
    assert "where e = 0" in text_page(result, False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "forged", [{"conditions": ["e = 1"]}, {"conditions": []}, {"conditions": ["x = 0"]}, {"equations": {"x": "0"}}]
)
def test_other_parameters_are_refused(forged: dict[str, Any]) -> None:
    result = solve_document(COUPLED, SolveOptions(time_limit=200))
    other = {**result, "instead": {**result["instead"], **forged}}
    assert check_document(json.dumps(other))["verdict"] == "invalid"


@pytest.mark.slow
def test_a_particle_leaves_with_its_reduced_system_and_a_clock() -> None:
    asked = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2+y'^2+z'^2)/2 - x^2/2 - y^2",
        "constraints": ["z' - y*x'"],
        "associated": "first",
    }
    result = solve_document(asked, SolveOptions(time_limit=40))
    found = result["instead"]
    assert (result["verdict"], found["kind"], found["clock"]) == ("not_variational", "reduced", "1/sqrt(y^2 + 1)")
    assert found["certificate"] == result["reduced"]["with_clock"]["certificate"]


def test_the_first_of_them_is_friction() -> None:
    asked = {"equations": {"x": "-2*x + y - c*x'", "y": "x - 2*y - 2*c*y'"}, "parameters": ["c"]}
    assert solve_document(asked, SolveOptions(time_limit=200))["instead"]["kind"] == "rayleigh"


@pytest.mark.slow
def test_a_parameter_is_not_made_a_coordinate() -> None:
    """x'' = a y + y^2, y'' = x^2/2 + 2 x y has an L with x for a, and none for any constant a."""
    result = solve_document(
        {"equations": {"x": "a*y + y^2", "y": "x^2/2 + 2*x*y"}, "parameters": ["a"]}, SolveOptions(time_limit=60)
    )
    other = solve_document({"equations": {"x": "x*y + y^2", "y": "2*x*y + x^2/2"}}, SolveOptions(time_limit=60))
    assert (result["verdict"], other["verdict"]) == ("not_variational", "variational")
    shown = {key: other[key] for key in ("lagrangian", "hamiltonian", "certificate", "checked")}
    found = shown | {"kind": "parameters", "equations": other["system"]["equations"], "clock": "", "dissipation": None}
    for conditions in (["a = x"], ["a = t"], ["a = a"], ["a = x", "a = x"]):
        forged = json.dumps({**result, "instead": found | {"conditions": conditions}})
        assert check_document(forged)["verdict"] == "invalid", conditions

"""Systems with another clock: dtau = N(q) dt."""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_document
from inverse_service.service.documents.documents import solve_document
from tests.inverse_problem.test_kinds import residuals

# The particle with constraint s' = -r1 r2' (Rosenberg 1977), reduced, in V = r2^2/2: N is 1/sqrt(1 + r1^2).
REDUCED = {"a": "0", "b": "-a*a'*b'/(1+a^2) - b/(1+a^2)"}


def solved(equations: dict[str, str], clock: str) -> dict[str, Any]:
    return solve_document({"equations": equations, "clock": clock}, SolveOptions(time_limit=60))


def test_a_reduced_chaplygin_system_has_a_lagrangian_with_the_clock_of_its_measure() -> None:
    result = solved(REDUCED, "(1+a^2)^(-1/2)")
    assert (result["verdict"], result["with_clock"]["verdict"]) == ("not_variational", "variational")
    assert result["with_clock"]["checked"] == "valid"
    assert check_document(json.dumps(result))["verdict"] == "valid"


def test_the_wrong_clock_does_not_help() -> None:
    found = solved(REDUCED, "1 + a^2")["with_clock"]
    assert (found["verdict"], found["checked"]) == ("not_variational", "valid")


def test_the_equations_with_the_clock_are_those_by_hand() -> None:
    """x'' = -x with dtau = x dt: x'' = -1/x - x'^2/x."""
    found = solved({"x": "-x"}, "x")["with_clock"]
    assert found["equations"]["x"] in ("-x'^2/x - 1/x", "-1/x - x'^2/x")


def test_an_answer_for_another_clock_is_refused() -> None:
    result = solved(REDUCED, "1")
    other = solved(REDUCED, "(1+a^2)^(-1/2)")["with_clock"]
    assert check_document(json.dumps({**result, "with_clock": other}))["verdict"] == "invalid"


# The nonholonomic particle in V = x^2/2 + y^2/2, and Suslov's problem, reduced; Kepler needs no other clock.
FOUND = [
    ("reduced particle (Rosenberg 1977)", {"x": "-(x + y*x'*y')/(1+y^2)", "y": "-y"}, "1/sqrt(y^2 + 1)"),
    ("reduced generic class (Fernandez, Mestdag, Bloch 2009)", REDUCED, "1/sqrt(a^2 + 1)"),
    ("Kepler (Landau, Lifshitz 1976, 15)", {"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"}, "1"),
]


@pytest.mark.parametrize(("name", "equations", "factor"), FOUND, ids=[name for name, _, _ in FOUND])
def test_a_clock_is_found(name: str, equations: dict[str, str], factor: str) -> None:
    result = solved(equations, "search")
    found = result["with_clock"]
    assert (found["factor"], found["verdict"], found["checked"]) == (factor, "variational", "valid"), name
    assert max(residuals(found["equations"], found["lagrangian"]["text"])) < 1e-20
    assert check_document(json.dumps(result))["verdict"] == "valid"


def test_a_clock_of_the_factors_of_f_is_found() -> None:
    """Two coupled springs with another clock put in, which the search takes out again."""
    plain = {"x": "-x + y", "y": "x - 3*y"}
    slow = {name: f"({f})/x^2 + x'*{name}'/x" for name, f in plain.items()}
    result = solved(slow, "search")
    assert result["verdict"] == "not_variational"
    assert (result["with_clock"]["verdict"], result["with_clock"]["checked"]) == ("variational", "valid")
    assert check_document(json.dumps(result))["verdict"] == "valid"


def test_without_a_clock_the_answer_says_what_was_tried() -> None:
    found = solved({"x": "x^2+y^2", "y": "0"}, "search")["with_clock"]
    assert (found["verdict"], found["factor"], found["certificate"]) == ("undetermined", "", None)
    assert "N = 1, " in found["reason"]


@pytest.mark.parametrize("clock", ["x'", "t", "0", "x - x", "sqrt(-1 - x^2)", "y +", "w", 7.5, ["x"]])
def test_what_is_no_clock_is_refused(clock: Any) -> None:
    with pytest.raises(InputError) as refused:
        solved({"x": "-x"}, clock)
    assert refused.value.pointer.startswith("/clock")


def test_a_clock_that_is_searched_for_holds_no_time() -> None:
    """With the damping x' the measure e^(2t) is invariant, which is no clock."""
    asked = {"equations": {"x": "-x*y^2 - x'", "y": "-y*x^2 - y'"}, "clock": "search"}
    assert solve_document(asked, SolveOptions(time_limit=60))["with_clock"]["factor"] == ""


def test_a_clock_and_the_equations_need_a_point_in_common() -> None:
    with pytest.raises(InputError, match="real values"):
        solved({"x": "-sqrt(x)", "y": "-y"}, "sqrt(-x)")


def test_the_answer_is_about_the_points_where_the_clock_is_real() -> None:
    found = solved({"x": "-x", "y": "-y"}, "sqrt(x - 2)")["with_clock"]
    assert (found["domain"], found["certificate"]["conditions"]) == (["x > 2"], ["x > 2"])


def test_the_answer_is_about_one_case_of_signs_and_says_which() -> None:
    """|x| is x in the equations with the clock: that is so for x > 0 only."""
    result = solved({"x": "-abs(x)*y'", "y": "-y"}, "1 + x^2")
    found = result["with_clock"]
    assert "sqrt" not in found["equations"]["x"]
    assert found["domain"] == ["x > 0"]
    assert check_document(json.dumps(result))["verdict"] == "valid"
    for forged in ({"domain": []}, {"certificate": {**found["certificate"], "near": {"x": "-1"}, "conditions": []}}):
        assert check_document(json.dumps({**result, "with_clock": {**found, **forged}}))["verdict"] == "invalid"


def test_a_clock_may_hold_parameters_that_have_values() -> None:
    result = solve_document(
        {"equations": {"x": "-x"}, "parameters": {"k": 2}, "clock": "k + x^2"}, SolveOptions(time_limit=60)
    )
    assert result["with_clock"]["factor"] == "x^2 + 2"

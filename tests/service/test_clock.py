"""Systems with another clock: dtau = N(q) dt."""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.documents import check_document, solve_document

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


@pytest.mark.parametrize("clock", ["x'", "t", "0", "y +", "w", 7.5, ["x"]])
def test_what_is_no_clock_is_refused(clock: Any) -> None:
    with pytest.raises(InputError) as refused:
        solved({"x": "-x"}, clock)
    assert refused.value.pointer.startswith("/clock")

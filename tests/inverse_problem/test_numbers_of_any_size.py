"""Documents with tiny, huge and long numbers get their verdict, and the checker agrees."""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service
from inverse_service.errors import LimitError

MORSE = "-2*1.5e10*7.2e-19/1.6e-27*(1 - exp(-1.5e10*(x - 1e-10)))*exp(-1.5e10*(x - 1e-10))"
YUKAWA = "-1e-28*exp(-x/1e-10)*(1/x^2 + 1/(1e-10*x))/1.6e-27"

VARIATIONAL = [
    {"x": "-sin(x) - 1.1e-68*y'", "y": "-sin(y) + 1.1e-68*x'"},
    {"x": "y' - sin(x)", "y": "-exp(-150)*x' - 2*y"},
    {"x": "-x*sqrt(1025)"},
    {"x": "-1/sqrt(x^2 + 2000)"},
    {"x": "-log(x + 3000)"},
    {"x": "-398600*x/sqrt(x^2 + 6378^2)^3"},
    {"x": "-398600.4418*x/(x^2 + y^2)^(3/2)", "y": "-398600.4418*y/(x^2 + y^2)^(3/2)"},
    {"x": MORSE},
    {"x": YUKAWA},
    {"x": "-3*x - (3/10)*x'"},
    {"x": "-x^2000"},
    {"x": "-(x^2 + y^2 + 1)^3000*x", "y": "-(x^2 + y^2 + 1)^3000*y"},
    {"x": "-13/7*x - 0.7*x'"},
    {"x": "((2+sqrt(5))^(1/3) - (1+sqrt(5))/2)*y'*y - x", "y": "-y"},  # which is 0
]
NOT_VARIATIONAL = [
    {"x": "-1e70*sin(x) + y", "y": "-1e70*sin(y) + x'"},
    {"x": "-exp(-1000*x^2)*y'", "y": "-exp(-1000*x^2)*x - y"},
    {"x": "tanh(2000*x)*y'", "y": "-tanh(2000*x)*x - y"},
    {"x": "exp(x') + y^200", "y": "y"},
    {"x": "exp(x') + y^4096", "y": "y"},
    {"x": "(sqrt(5+2*sqrt(6)) - sqrt(2) - sqrt(3))*y^2 - x", "y": "x^2"},
    {"x": "((7+5*sqrt(2))^(-2/3) - 1)*y^2 + x^2", "y": "x"},
]


@pytest.mark.parametrize("equations", VARIATIONAL, ids=lambda equations: str(equations["x"]))
def test_a_number_of_any_size_keeps_its_lagrangian(equations: dict[str, str]) -> None:
    result = inverse_service.solve({"equations": equations})
    assert result["verdict"] == "variational"
    assert result["lagrangian"] is not None
    assert inverse_service.check(result)["verdict"] == "valid"


@pytest.mark.parametrize("equations", NOT_VARIATIONAL, ids=lambda equations: str(equations["x"]))
def test_a_number_of_any_size_keeps_its_proof(equations: dict[str, str]) -> None:
    result = inverse_service.solve({"equations": equations})
    assert result["verdict"] == "not_variational"
    assert inverse_service.check(result)["verdict"] == "valid"


def test_an_exponent_beyond_64_bits_is_refused_with_the_limit() -> None:
    with pytest.raises(LimitError, match="the exponent is too large at column 3"):
        inverse_service.solve({"equations": {"x": "-x^(10^20)"}})


def test_a_function_in_a_condition_is_the_function_in_the_formulas() -> None:
    """On F > 0 sqrt(F^2) is F; the checker meets F in the condition, in the root, in f and in L."""
    equations = {"x": "sqrt(F(x)^2)*y' - y^2", "y": "-F(x)*x' - 2*x*y"}
    result: dict[str, Any] = inverse_service.solve({"equations": equations, "functions": {"F": ["x"]}})
    assert (result["verdict"], result["domain"]) == ("variational", ["F(x) > 0"])
    assert {inverse_service.check(result)["verdict"] for _ in range(5)} == {"valid"}


def test_a_root_of_a_function_does_not_save_another_system() -> None:
    equations = {"x": "sqrt(F(x)^2)*y' - y^2", "y": "-F(x)*x' - y"}
    result = inverse_service.solve({"equations": equations, "functions": {"F": ["x"]}})
    assert result["verdict"] == "not_variational"
    assert inverse_service.check(result)["verdict"] == "valid"

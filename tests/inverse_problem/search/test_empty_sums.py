"""What vanishes by an identity is no term for a Lagrangian, and no fault."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_system


def test_a_sum_that_vanishes_does_not_stop_the_search() -> None:
    force = "sqrt(1 + (k - k)^2)*x'^2*sin(x) - x^5"
    document = {
        "coordinates": ["x"], "equations": {"x": force}, "parameters": ["k"], "time_dependent_lagrangian": False,
    }  # fmt: skip
    found = solve_system(document, SolveOptions(time_limit=5))
    assert found["verdict"] == "variational"
    assert found["checked"] == "valid"


VANISHING = [
    "exp(log(x)) - x",
    "7^x - exp(x*log(7))",
    "log(-x) + log(-1/x)",
    "log(exp(3*x)*y) - 3*x - log(y)",
    "atan(x) + atan(1/x) - pi/2",
    "asinh(x) - log(x + sqrt(1 + x^2))",
    "x/sqrt(1 + x^2) - sin(atan(x))",
]


@pytest.mark.parametrize("zero", VANISHING)
def test_a_coefficient_that_is_0_by_an_identity_does_not_hide_the_lagrangian(zero: str) -> None:
    """x'' = 0, y'' = x' y has this Lagrangian."""
    document = {"coordinates": ["x", "y"], "equations": {"x": f"({zero})*y'", "y": "x'*y"}}
    found = solve_system(document, SolveOptions(time_limit=10, time_dependent=False, conditions=False))
    assert found["checked"] == "valid"
    assert found["lagrangian"]["text"] == "y^2*sqrt(x')/2 + y'^2/(2*sqrt(x'))"

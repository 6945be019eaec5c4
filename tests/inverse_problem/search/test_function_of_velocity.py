"""One coordinate, g = phi(t, x)/F(v): L by quadratures, friction that is linear in x' and in the integral of 1/F."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document


@pytest.mark.parametrize(
    ("equation", "with_time"),
    [
        ("x'*(x'*cos(x)/sin(x) + 1/2)", False),  # F = v, L = v log v/sin x and an integral of 1/sin x
        ("x'*(x'*exp(x^2) + 3)", False),
        ("sqrt(x')*(sin(x) + x*x'^(3/2)/2 - sqrt(x')/3)", True),  # F = sqrt(v)
        ("(1 + x'^2)*(cos(x^3) - 2*atan(x'))", True),
        ("x'*(x*log(x) - log(x') + x'/x)", True),
        ("exp(-x')*(sin(x) + t - 3*exp(x'))", True),
    ],
)
def test_one_quadrature_gives_a_lagrangian(equation: str, with_time: bool) -> None:
    answer = solve_document({"equations": {"x": equation}}, SolveOptions(time_dependent=with_time))
    found = answer if answer.get("lagrangian") else answer["with_time"]
    assert found["lagrangian"] is not None
    assert answer["checked"] == "valid"

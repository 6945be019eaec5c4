"""Sums that vanish inside a function are no terms for a Lagrangian, and no fault."""

from __future__ import annotations

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.solving import solve_document


def test_a_sum_that_vanishes_does_not_stop_the_search() -> None:
    force = "sqrt(1 + (k - k)^2)*x'^2*sin(x) - x^5"
    document = {
        "coordinates": ["x"], "equations": {"x": force}, "parameters": ["k"], "time_dependent_lagrangian": False,
    }  # fmt: skip
    found = solve_document(document, SolveOptions(time_limit=5))
    assert found["verdict"] == "variational"
    assert found["checked"] == "valid"

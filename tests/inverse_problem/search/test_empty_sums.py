"""Sums that vanish inside a function are no terms for a Lagrangian, and no fault."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.solving import solve_document


@pytest.mark.parametrize("force", ["exp((k - k)*x) - sin(x)*x'^2", "sqrt(1 + (k - k)^2)*x'^2*sin(x) - x^5"])
def test_a_sum_that_vanishes_does_not_stop_the_search(force: str) -> None:
    document = {"coordinates": ["x"], "equations": {"x": force}, "parameters": ["k"]}
    found = solve_document(document, SolveOptions(time_limit=20))
    assert found["verdict"] == "variational"
    assert found["checked"] == "valid"

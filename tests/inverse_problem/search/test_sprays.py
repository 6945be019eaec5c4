"""Sprays: squares of Finsler functions with one root, and drag whose first integrals are linear in t."""

from __future__ import annotations

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.deadline import now
from inverse_service.inverse_problem.decision.certify import of_lagrangian
from inverse_service.inverse_problem.search.ladder import search
from tests.inverse_problem.search.given import material

FUNK = "(sqrt((1-x^2-y^2)*(x'^2+y'^2)+(x*x'+y*y')^2)+x*x'+y*y')/(1-x^2-y^2)"


@pytest.mark.parametrize(
    ("equations", "with_time"),
    [
        ({"x": f"-x'*{FUNK}", "y": f"-y'*{FUNK}"}, False),
        ({"x": "-x'*sqrt(x'^2+y'^2)", "y": "-y'*sqrt(x'^2+y'^2)"}, True),
        (
            {"x": "-a*x'*sqrt(x'^2+y'^2+z'^2)", "y": "-a*y'*sqrt(x'^2+y'^2+z'^2)", "z": "-a*z'*sqrt(x'^2+y'^2+z'^2)"},
            True,
        ),
    ],
    ids=["funk", "quadratic-drag", "quadratic-drag-in-space"],
)
def test_a_regular_lagrangian_in_closed_form_is_found(equations: dict[str, str], with_time: bool) -> None:
    given = material(equations, with_time)
    found = search(given.analysis, with_time, 1, now() + 20.0, lambda _: None).found
    assert found is not None
    certificate = of_lagrangian(given.analysis, found.lagrangians[0], with_time)
    assert check_certificate(certificate).verdict == "valid"

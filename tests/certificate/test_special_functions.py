"""What the checker says of erf, Bessel functions and their like, and what it leaves open."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import solve
from inverse_service.certificate.checker import check_certificate


def claim(equation: str, lagrangian: str, *parameters: str) -> dict[str, Any]:
    return {
        "format": "inverse-service/certificate/2",
        "system": {
            "coordinates": ["x"],
            "equations": {"x": equation},
            "parameters": list(parameters),
        },
        "question": "autonomous",
        "claim": "variational",
        "kind": "lagrangian",
        "lagrangian": lagrangian,
    }


def test_the_set_of_a_claim_is_where_the_functions_are_real() -> None:
    found = check_certificate(claim("-bessely(1, x)", "x'^2/2 + bessely(0, x)"), seed=1)
    assert found.verdict == "valid"
    assert found.formulas is not None
    assert found.formulas.domain == ("x > 0",)
    entire = check_certificate(claim("-besselj(1, x)", "x'^2/2 + besselj(0, x)"), seed=1)
    assert entire.formulas is not None
    assert entire.formulas.domain == ()


@pytest.mark.slow
def test_an_order_is_general_where_a_divisor_depends_on_it() -> None:
    lagrangian = "(besselj(n, x) - besselj(-n, x))*x'^2/2"
    equation = (
        "-(besselj(n - 1, x) - n*besselj(n, x)/x - besselj(-n - 1, x) - n*besselj(-n, x)/x)"
        "*x'^2/(2*(besselj(n, x) - besselj(-n, x)))"
    )
    found = check_certificate(claim(equation, lagrangian, "n"), seed=1)
    assert found.verdict == "valid"
    assert "single values of n" in found.exceptions  # J_2 = J_(-2)
    potential = check_certificate(
        claim("besselj(n + 1, x) - n*besselj(n, x)/x", "x'^2/2 - besselj(n, x)", "n"), seed=1
    )
    assert (potential.verdict, [*potential.exceptions]) == ("valid", [])


@pytest.mark.slow
def test_a_family_with_a_special_function_is_not_said_to_be_complete() -> None:
    family = solve({"equations": "x'' = a*erf(y); y'' = -y", "parameters": ["a"], "family": True})[
        "family"
    ]
    assert not family["covered"]
    assert [leaf["verdict"] for leaf in family["leaves"]] == ["not_variational", "variational"]

"""All that the program says of a system, its integrals and other answers included, is proven by its
own `check`.
"""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service
from tests.doors import rows

SYSTEMS = {row["id"]: row for row in rows.systems()}
QUICK = (
    "lie-A4-as-time",  # a product of two integrals was found before these
    "monopole-drag",  # H of another answer holds only where its L does
    "force 1/sqrt(1+exp(x))",  # log(sqrt(1 + exp(x)) - 1) is real everywhere
    "book-bead-on-a-freely-turning-hoop-accelerations",  # cos(2 th) in f, sin(th)^2 in H
)


def nightly(name: str) -> Any:
    return pytest.param(name, marks=pytest.mark.nightly)


def test_a_function_in_the_equation_as_given_and_in_f_is_one() -> None:
    """asin twice; "pair-vortex-field-again" has a longer argument."""
    result = inverse_service.solve({"equations": {"x": "asin(y)*y'", "y": "x"}})
    assert result["verdict"] == "not_variational"
    assert inverse_service.check(result)["verdict"] == "valid"


@pytest.mark.parametrize("name", [*QUICK, *(nightly(one) for one in SYSTEMS if one not in QUICK)])
def test_a_whole_result_is_valid(name: str) -> None:
    row = SYSTEMS[name]
    result = inverse_service.solve(row["document"])
    report = inverse_service.check(result)
    is_open = "undetermined" in (result["verdict"], result["verdict_with_time"])
    assert report["verdict"] in ("valid", *(["incomplete"] if is_open else [])), report["reasons"]


def test_a_hamiltonian_with_friction_holds_where_the_equations_do() -> None:
    """L = (x'^2 + x^2 y'^2)/2 is regular where x != 0 alone."""
    result = inverse_service.solve(
        {"equations": ["x'' = x*y'^2", "y'' = -2*x'*y'/x - c*y'"], "parameters": ["c"]}
    )
    assert result["instead"]["kind"] == "rayleigh"
    assert result["instead"]["hamiltonian"]["domain"] == ["x != 0"]
    assert inverse_service.check(result)["verdict"] == "valid"


@pytest.mark.parametrize("equation", ["x'' = -x/(1 + 1/x')", "x'' = -1/(x'*log(x'))"])
def test_a_hamiltonian_in_velocities_holds_where_its_lagrangian_does(equation: str) -> None:
    """p = p(x') has no inverse in closed form, so that H is written in x'."""
    result = inverse_service.solve({"equations": equation})
    hamiltonian = result["hamiltonian"]
    assert hamiltonian["implicit"]
    assert any("x'" in condition for condition in result["lagrangian"]["domain"])
    assert {*result["lagrangian"]["domain"]} <= {*hamiltonian["domain"]}
    assert inverse_service.check(result)["verdict"] == "valid"

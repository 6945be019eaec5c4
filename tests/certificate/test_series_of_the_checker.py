"""Documents that need power series: values at zero, derivatives of arbitrary functions, curvature
of constraints.
"""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import Document, all_rows, claim, motion
from tests.certificate.test_known_attacks import certificate, of_lagrangian


def verdict(document: Document) -> str:
    return check_certificate(document, seed=1).verdict


@pytest.mark.parametrize(
    "one",
    ["exp(0)", "cos(0)", "exp(x - x)", "cos(sin(0))", "exp(log(1))", "cosh(0)", "exp(atan(0))"],
)
def test_functions_have_their_value_at_zero(one: str) -> None:
    """Factors that are 1: with another value the force would differ."""
    assert verdict(of_lagrangian("-x", "-y", f"x'^2/2 + y'^2/2 - x^2/2*{one} - y^2/2")) == "valid"
    assert (
        verdict(of_lagrangian("-x", "-y", f"x'^2/2 + y'^2/2 - x^2/2*({one} + 1) - y^2/2"))
        == "invalid"
    )


@pytest.mark.parametrize("order", [2, 3])
def test_a_derivative_of_an_arbitrary_function_is_that_of_its_series(order: int) -> None:
    """V = A(x) y + B(x, y): no rows refute the Lagrangian T - V."""
    functions: Any = {"A": ["x"], "B": ["x", "y"]}
    forces = {"x": "-A'(x)*y - B[1,0](x, y)", "y": "-A(x) - B[0,1](x, y)"}
    rows = all_rows(2, 4, order)
    assert (
        verdict(certificate(forces, "nonexistence", order=order, rows=rows, functions=functions))
        == "invalid"
    )
    other = {"x": "-A'(x)*y - B[1,0](x, y)", "y": "-A'(x) - B[0,1](x, y)"}
    assert (
        verdict(certificate(other, "nonexistence", order=order, rows=rows, functions=functions))
        == "valid"
    )


def test_an_integral_of_a_velocity_has_all_its_derivatives() -> None:
    """L = F(x') + x^2/2 with F' = log x' for x'' = x x'."""
    integrals: Any = {"F": {"arguments": ["x'"], "derivatives": {"x'": "log(x')"}}}
    assert (
        verdict(of_lagrangian("x*x'", "0", "F(x') + x^2/2 + y'^2/2", integrals=integrals))
        == "valid"
    )
    assert (
        verdict(of_lagrangian("x*x'^2", "0", "F(x') + x^2/2 + y'^2/2", integrals=integrals))
        == "invalid"
    )


@pytest.mark.parametrize(
    ("arguments", "term", "expected"),
    [
        (["x"], "F(t, x)", "invalid"),
        (["x", "y'"], "F(t, x, y')", "invalid"),
        (["y'"], "F(t, y')*y'", "valid"),
    ],
)
def test_an_integral_is_arbitrary_where_no_derivative_is_given(
    arguments: list[str], term: str, expected: str
) -> None:
    integrals: Any = {"F": {"arguments": ["t", *arguments], "derivatives": {"t": "0"}}}
    free = of_lagrangian(
        "0", "0", f"x'^2/2 + y'^2/2 + {term}", integrals=integrals, question="time_dependent"
    )
    assert verdict(free) == expected


# --- dependent velocities that contain their own coordinate, and their curvature
def test_a_constraint_that_holds_its_own_coordinate() -> None:
    """z' = z x': z'/z - x' is a total derivative."""
    given = motion({"x": "0"}, {"z": "z*x'"})
    assert verdict(claim(given, "x'^2/2 + z'/z - x' + (z' - z*x')^2/2")) == "valid"
    assert verdict(claim(given, "x'^2/2 + z'/z^2 - x'/z + (z' - z*x')^2/2")) == "invalid"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x'^2 + (y' - x'^2)^2/2", "valid"), ("x'^2/2 + (y' - x'^2)^2/2", "valid"),
        ("y' + (y' - x'^2)^2/2", "invalid"), ("y' + x'^2/2 + (y' - x'^2)^2/2", "valid"),
        ("2*y' - x'^2 + (y' - x'^2)^2/2", "valid"), ("2*y' - 2*x'^2 + (y' - x'^2)^2/2", "valid"),
        ("2*(y' - x'^2) + (y' - x'^2)^2/2", "valid"),
    ],
)  # fmt: skip
def test_the_hessian_on_a_curved_constraint_takes_its_curvature_into_account(
    text: str, expected: str
) -> None:
    """y' = x'^2: with L = l + lambda mu it is the Hessian of l minus lambda times that of x'^2."""
    assert verdict(claim(motion({"x": "0"}, {"y": "x'^2"}), text)) == expected

"""How atoms come from others is guessed: a right guess makes true documents valid, a wrong one proves nothing."""

from __future__ import annotations

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import lagrangian
from tests.certificate.test_primes_and_choices import question


def verdict(difference: str) -> str:
    """Of the claim that x'^2/2 and more that vanishes is a Lagrangian of free motion."""
    return check_certificate(lagrangian("free", f"x'^2/2 + x^2*({difference})", near={"x": "2"}), seed=1).verdict


@pytest.mark.parametrize(
    "difference",
    [
        "sin(x + pi/3) - sin(x)/2 - sqrt(3)*cos(x)/2",
        "sin(x + 1) - sin(x)*cos(1) - cos(x)*sin(1)",
        "log(12*x/5) - 2*log(2) - log(3) + log(5) - log(x)",
        "exp((sqrt(2) + sqrt(3))*x) - exp(sqrt(2)*x)*exp(sqrt(3)*x)",
        "x^(1/2)*(x + 1)^(1/3)*x^(1/3) - x^(5/6)*(x + 1)^(1/3)",
        "x*tan(atan(x)/2) - sqrt(1 + x^2) + 1",
        "log(x^2) - 2*log(x)",
    ],
)
def test_what_is_guessed_right_makes_a_true_document_valid(difference: str) -> None:
    assert verdict(difference) == "valid"


@pytest.mark.parametrize("difference", ["x^(1/5000) - 1", "2^(1/29) - 1", "cos(1) - 5/4", "exp(1) - 2"])
def test_what_is_no_relation_is_taken_for_none(difference: str) -> None:
    assert verdict(difference) != "valid"


@pytest.mark.parametrize(
    ("formula", "degree"), [("x*sin(pi/36)", 72), ("x*2^(1/9)", 18), ("x*3^(1/9)", 18), ("x*5^(1/9)", 18)]
)
def test_primes_have_the_roots_of_numbers_that_a_formula_holds(formula: str, degree: int) -> None:
    asked = question(formula)
    assert all((asked.prime() - 1) % degree == 0 for _ in range(4))


@pytest.mark.parametrize("formula", ["exp(x)", "sin(x)"])
def test_where_only_the_point_itself_can_be_reached_nothing_is_settled(formula: str) -> None:
    """At x = 0 alone x seems to be 0, so that the relations that are guessed are none."""
    document = lagrangian("free", f"x'^2/2 + 0*{formula}", near={"x": "0"}, conditions=["1/10^40 - x^2 > 0"])
    assert check_certificate(document, seed=1).verdict == "incomplete"


def test_a_zero_that_is_not_seen_refutes_nothing() -> None:
    zero = "+".join(f"2*cos({k}*2*pi/61)" for k in range(1, 31))
    assert verdict(f"1 + {zero}") == "incomplete"

"""The checker's reader of equations: places of accelerations, sizes of lists, and operator
precedence.
"""

from __future__ import annotations

import random

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.formulas import read_tokens, value_of
from inverse_service.certificate.question import Question, Tools
from inverse_service.certificate.series import Count
from tests.certificate.documents import changed, lagrangian, nonexistence
from tests.certificate.test_known_attacks import TIMED, certificate, integral, of_lagrangian

OSCILLATOR = "x'^2/2+y'^2/2-x^2/2"


def test_accelerations_may_be_in_sums_and_products_with_anything_else() -> None:
    right = of_lagrangian("x + x'' + (1+x)^2 - (1+x)*(1+x)", "y/2-y/2 - y''", OSCILLATOR)
    assert check_certificate(right, seed=1).verdict == "valid"


@pytest.mark.parametrize(
    "term", ["(x'')^2", "((x''))^2", "x''^2", "1/-x''", "1/(x'')", "exp(x'')", "2^-x''"]
)
def test_accelerations_stand_in_no_power_divisor_or_argument(term: str) -> None:
    for zero in (f"0*{term}", f"{term}-{term}"):
        found = check_certificate(of_lagrangian(f"x''+x+{zero}", "y''", OSCILLATOR), seed=1)
        assert found.reasons == ("Accelerations may occur in sums and products only.",)


@pytest.mark.parametrize("text", ["x''+x)", "x''+x)^2", "(x''+x", ")x''+x"])
def test_brackets_that_do_not_match_are_no_formula(text: str) -> None:
    assert check_certificate(of_lagrangian(text, "y''", OSCILLATOR), seed=1).verdict == "invalid"


@pytest.mark.parametrize("count", [3, 16])
def test_a_system_has_up_to_sixteen_coordinates(count: int) -> None:
    names = [f"x{k}" for k in range(count)]
    document = certificate(
        dict.fromkeys(names, "0"), "lagrangian", lagrangian="+".join(f"{x}'^2" for x in names)
    )
    assert check_certificate(document, seed=1).verdict == "valid"


@pytest.mark.parametrize(
    "zero",
    ["2^3^2-512", "--x-x", "---x+x", "4^(1/2)-2", "2-3-x+x+1", "6/3/2-1", "6/3*2-4", "1+2*3-7"],
)
def test_operators_bind_as_they_are_said_to(zero: str) -> None:
    assert (
        check_certificate(lagrangian("free", f"x'^2/2+x*({zero})*exp(x)"), seed=1).verdict
        == "valid"
    )


def test_a_hessian_of_huge_powers_that_cancel_is_not_proven_regular() -> None:
    document = of_lagrangian("0", "0", "(a^5000-a^2500*a^2500)*x'^2+y'^2", parameters=["a"])
    assert check_certificate(document, seed=1).verdict == "incomplete"


@pytest.mark.parametrize("order", [21, -1, 10**30, 2.0, True])
def test_an_order_is_an_integer_in_its_range(order: object) -> None:
    found = check_certificate(changed(nonexistence("douglas-IIIb", 2), "order", order), seed=1)
    assert found.reasons == ("certificate.order has to be an integer from 0 to 20.",)


@pytest.mark.parametrize(("count", "verdict"), [(1000, "valid"), (1001, "invalid")])
def test_an_object_has_up_to_a_thousand_members(count: int, verdict: str) -> None:
    document = lagrangian("free", "x'^2")
    document |= {f"k{number}": None for number in range(count - len(document))}
    assert check_certificate(document, seed=1).verdict == verdict


@pytest.mark.parametrize(
    ("force", "verdict"), [("exp(t^2)", "valid"), ("exp(t^2)+x/10^20", "invalid")]
)
def test_a_lagrangian_may_hold_a_function_known_by_its_derivative(force: str, verdict: str) -> None:
    document = of_lagrangian(
        force, "0", "x'^2/2+y'^2/2-F(t)*x'", integrals=integral("exp(t^2)"), **TIMED
    )
    assert check_certificate(document, seed=1).verdict == verdict


@pytest.mark.parametrize(
    ("force", "verdict"), [("exp(x^2)", "valid"), ("exp(x^2)+y/10^20", "invalid")]
)
def test_a_function_known_by_its_derivative_holds_its_own_arguments_only(
    force: str, verdict: str
) -> None:
    document = of_lagrangian(force, "0", "x'^2/2+y'^2/2+F(x)", integrals=integral("exp(x^2)", "x"))
    assert check_certificate(document, seed=1).verdict == verdict


DEGREES = {
    "x*y": (2, 0, 2, 0), "0.75": (0, 0, 2, 3), "x/0.75": (1, 0, 4, 2), "x+0.75": (1, 0, 5, 3), "0.75+x": (1, 0, 5, 3),
    "1/x+1/y": (1, 2, 4, 4),
    "x^3+1/y": (4, 1, 6, 2), "1/x^3+y": (4, 3, 6, 4), "x^5+y+1": (5, 0, 8, 1), "x^5": (5, 0, 5, 0),
    "x^(-5)": (0, 5, 0, 5), "(x/y)^3": (3, 3, 3, 3), "x^4096": (4096, 0, 4096, 0), "x^9999": (4097, 0, 4097, 0),
    "x^0": (0, 0, 0, 0), "pi*A(x)": (2, 0, 2, 0), "exp(x)": (1, 1, 1, 1), "sqrt(x)": (1, 1, 1, 1),
    "sqrt(x^3*y^5)": (8, 8, 1, 1), "log(x^3*y^5)": (1, 0, 1, 1), "(x^3+y)^(2/3)": (8, 8, 1, 1),
    "sin(x)": (2, 2, 2, 2), "atan(x)": (1, 0, 1, 1), "exp(5*log(x))": (5, 5, 1, 1),
}  # fmt: skip


@pytest.mark.parametrize("text", DEGREES)
def test_degrees_and_bits_of_numerator_and_denominator_are_counted(text: str) -> None:
    """Lemma 2 needs them: products add, sums use a common denominator, and powers multiply."""
    system = {
        "coordinates": ["x", "y"],
        "equations": {"x": "0", "y": "0"},
        "functions": {"A": ["r"]},
    }
    asked, formula = (
        Question(Tools(random.Random(1), 1e9), system, claim={"near": {"x": "2", "y": "3"}}),
        read_tokens(text, ""),
    )
    asked.prepare(lambda ring: value_of(ring, formula), [formula])
    assert value_of(Count(asked), formula)[:4] == DEGREES[text]

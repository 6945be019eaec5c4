"""What the checker's reader makes of equations: where accelerations may stand, how much a list may hold, what binds."""

from __future__ import annotations

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import changed, lagrangian, nonexistence
from tests.certificate.test_known_attacks import TIMED, certificate, integral, of_lagrangian

OSCILLATOR = "x'^2/2+y'^2/2-x^2/2"


def test_accelerations_may_stand_in_sums_and_products_beside_anything_else() -> None:
    right = of_lagrangian("x + x'' + (1+x)^2 - (1+x)*(1+x)", "y/2-y/2 - y''", OSCILLATOR)
    assert check_certificate(right, seed=1).verdict == "valid"


@pytest.mark.parametrize("term", ["(x'')^2", "((x''))^2", "x''^2", "1/-x''", "1/(x'')", "exp(x'')", "2^-x''"])
def test_accelerations_stand_in_no_power_divisor_or_argument(term: str) -> None:
    for zero in (f"0*{term}", f"{term}-{term}"):
        found = check_certificate(of_lagrangian(f"x''+x+{zero}", "y''", OSCILLATOR), seed=1)
        assert found.reasons == ("Accelerations may stand in sums and products only.",)


@pytest.mark.parametrize("text", ["x''+x)", "x''+x)^2", "(x''+x", ")x''+x"])
def test_brackets_that_do_not_match_are_no_formula(text: str) -> None:
    assert check_certificate(of_lagrangian(text, "y''", OSCILLATOR), seed=1).verdict == "invalid"


@pytest.mark.parametrize("count", [3, 16])
def test_a_system_has_up_to_sixteen_coordinates(count: int) -> None:
    names = [f"x{k}" for k in range(count)]
    document = certificate(dict.fromkeys(names, "0"), "lagrangian", lagrangian="+".join(f"{x}'^2" for x in names))
    assert check_certificate(document, seed=1).verdict == "valid"


@pytest.mark.parametrize(
    "zero", ["2^3^2-512", "--x-x", "---x+x", "4^(1/2)-2", "2-3-x+x+1", "6/3/2-1", "6/3*2-4", "1+2*3-7"]
)
def test_operators_bind_as_they_are_said_to(zero: str) -> None:
    assert check_certificate(lagrangian("free", f"x'^2/2+x*({zero})*exp(x)"), seed=1).verdict == "valid"


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


@pytest.mark.parametrize(("force", "verdict"), [("exp(t^2)", "valid"), ("exp(t^2)+x/10^20", "invalid")])
def test_a_lagrangian_may_hold_a_function_known_by_its_derivative(force: str, verdict: str) -> None:
    document = of_lagrangian(force, "0", "x'^2/2+y'^2/2-F(t)*x'", integrals=integral("exp(t^2)"), **TIMED)
    assert check_certificate(document, seed=1).verdict == verdict

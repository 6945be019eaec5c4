"""The checker's own reader and series agree with mpmath and with the identities of the functions."""

from __future__ import annotations

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import lagrangian

EQUAL = [
    ("tan(x)", "sin(x)/cos(x)"),
    ("cot(x)*tan(x)", "1"),
    ("sec(x)^2 - tan(x)^2", "1"),
    ("csc(x)*sin(x)", "1"),
    ("sin(2*x)", "2*sin(x)*cos(x)"),
    ("cosh(x)^2 - sinh(x)^2", "1"),
    ("tanh(x)*coth(x)", "1"),
    ("sech(x)*cosh(x) + csch(x)*sinh(x)", "2"),
    ("sin(asin(x/9))", "x/9"),
    ("cos(acos(x/9))", "x/9"),
    ("tan(atan(x))", "x"),
    ("sinh(asinh(x))", "x"),
    ("cosh(acosh(2 + x^2))", "2 + x^2"),
    ("tanh(atanh(x/9))", "x/9"),
    ("asin(x/9) + acos(x/9)", "pi/2"),
    ("exp(log(1 + x^2))", "1 + x^2"),
    ("log((1 + x^2)*exp(x))", "log(1 + x^2) + x"),
    ("sqrt(2)*sqrt(3)", "sqrt(6)"),
    ("(1 + x^2)^(-3/2)", "1/(sqrt(1 + x^2)*(1 + x^2))"),
    ("(1 + x^2)^(1/3)^2", "(1 + x^2)^(1/9)"),
    ("(1 + x^2)^x", "exp(x*log(1 + x^2))"),
    ("2^3^2", "512"),
    ("-x^2", "-(x*x)"),
    ("2^-1", "0.5"),
    ("x--x", "2*x"),
    ("6/3/2*x", "x"),
    ("1-2-3", "-4"),
    ("x^11/x^9", "x^2"),
    ("(x-x)^3 + 0*x", "0"),
]


@pytest.mark.parametrize(("left", "right"), EQUAL)
def test_equal_formulas_are_equal(left: str, right: str) -> None:
    document = lagrangian("free", f"x'^2/2 + (({left}) - ({right}))*exp(x)")
    assert check_certificate(document, seed=2).verdict == "valid"


@pytest.mark.parametrize(("left", "right"), EQUAL)
def test_formulas_that_differ_by_little_are_not_equal(left: str, right: str) -> None:
    document = lagrangian("free", f"x'^2/2 + (({left}) - ({right}) + x/10^20)*exp(x)")
    assert check_certificate(document, seed=2).verdict == "invalid"


UNREADABLE = [
    "x'^2 +", "(x'^2", "x'^2)", "x' x'", "2x'^2", "x'**2", "sin x'", "sin(x', x)", "sqrt()", "x'^", "*x'", "x'^2 @ 1",
    "x'^2; 1", "__import__(1)", "x'.real", "1e5*x'^2", "0x10*x'^2", "x_dot^2", "x''^2", "diff(x', x)", "diff(x)",
    "t'^2", "sin'(x')", "x'^2 + \u0661", "x'^2\x00", "lambda", "abs(x')", "9" * 401 + "*x'^2",
]  # fmt: skip


@pytest.mark.parametrize("text", UNREADABLE)
def test_what_is_no_formula_is_refused_with_a_sentence(text: str) -> None:
    found = check_certificate(lagrangian("free", text), seed=1)
    assert found.verdict == "invalid"
    assert len(found.reasons) == 1
    assert found.reasons[0].endswith(".")
    assert len(found.reasons[0]) < 200


@pytest.mark.parametrize(
    "text",
    ["(" * 5000 + "x'" + ")" * 5000, "x'" + "^x'" * 5000, "sin(" * 70 + "x'" + ")" * 70, "x'^2+" * 20_000 + "x"],
)
def test_formulas_beyond_the_limits_are_refused(text: str) -> None:
    assert check_certificate(lagrangian("free", text), seed=1).verdict == "invalid"


def test_long_sums_and_many_minus_signs_are_read() -> None:
    text = "x'^2/2" + "+x-x" * 4000 + "-" * 4000 + "0"
    assert check_certificate(lagrangian("free", text), seed=1).verdict == "valid"

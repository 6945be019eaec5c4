"""The checker's own reader and series agree with mpmath and with the identities of the
functions.
"""

from __future__ import annotations

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import lagrangian
from tests.doors.rows import rows

EQUAL = [(row["left"], row["right"]) for row in rows("equal")]


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
    "B[1](x', x)", "B[1,0,0](x', x)", "B[1,0]", "B[](x', x)", "B[-1,0](x', x)", "B[20,1](x', x)", "B'(x', x)",
    "x[1]", "x'[1](x)", "sin[1](x)", "x^2^", "x^(2", "x^2'", "x^2x", "diff(B(x', x), x + x)", "diff(B(x, x), x)",
    "diff(B(x', x))", "diff(B(x', x), q)", "diff(B(x' x), x)", "diff(sin(x), x)", "diff(diff(B(x', x), x), x)",
]  # fmt: skip


@pytest.mark.parametrize("text", UNREADABLE)
def test_an_invalid_formula_is_rejected_with_a_sentence(text: str) -> None:
    document = lagrangian("free", text)
    document["system"]["functions"] = {"B": ["x", "y"]}
    found = check_certificate(document, seed=1)
    assert found.verdict == "invalid"
    assert len(found.reasons) == 1
    assert found.reasons[0].endswith(".")
    assert len(found.reasons[0]) < 200


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "(" * 5000 + "x'" + ")" * 5000,
        "x'" + "^x'" * 5000,
        "sin(" * 201 + "x'" + ")" * 201,
        "x'^2+" * 20_000 + "x",
    ],
)
def test_formulas_beyond_the_limits_are_refused(text: str) -> None:
    assert check_certificate(lagrangian("free", text), seed=1).verdict == "invalid"


@pytest.mark.slow
def test_long_sums_and_many_minus_signs_are_read() -> None:
    text = "x'^2/2" + "+x-x" * 4000 + "-x+" + "-" * 4000 + "x"
    assert check_certificate(lagrangian("free", text), seed=1).verdict == "valid"


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    ["(" * 100 + "x'" + ")" * 100, "sin(" * 100 + "x'" + ")" * 100, "x*(1 + x'*(" * 50 + "x'" + "))" * 50,
     "(2 + x')" + "^(1/(2 + x)" * 95 + ")" * 95],
)  # fmt: skip
def test_a_hundred_levels_of_nesting_are_read(text: str) -> None:
    assert check_certificate(lagrangian("free", f"x'^2/2 + 0*({text})"), seed=1).verdict == "valid"


def test_the_two_ways_of_writing_partial_derivatives_agree() -> None:
    """x'' = B_x(x, y), y'' = B_y(x, y) has L = T + B; for B(x, 2 y) and B(x + y, x - y) the chain
    rule applies.
    """
    document = lagrangian("free-pair", "(x'^2 + y'^2)/2 + B(x, y)")
    document["system"]["functions"] = {"B": ["u", "w"]}
    for right in (
        {"x": "diff(B(x, y), x)", "y": "diff( B( x , y ) , y )"},
        {"x": "B[1,0](x, y)", "y": "B[0,1](x, y)"},
    ):
        document["system"]["equations"] = right
        assert check_certificate(document, seed=1).verdict == "valid"
    document["lagrangian"] = "(x'^2 + y'^2)/2 + B[2,0](x + y, x - y)"
    document["system"]["equations"] = {
        "x": "B[3,0](x + y, x - y) + B[2,1](x + y, x - y)", "y": "B[3,0](x + y, x - y) - B[2,1](x + y, x - y)"
    }  # fmt: skip
    assert check_certificate(document, seed=1).verdict == "valid"
    document["system"]["equations"]["y"] = "B[3,0](x + y, x - y) - B[1,2](x + y, x - y)"
    assert check_certificate(document, seed=1).verdict == "invalid"


def test_one_function_at_equal_arguments_is_one_number_however_they_are_written() -> None:
    """This holds in real numbers too, where equal arguments differ in the last digits."""
    document = lagrangian("free", "x'^2/2 + A(x*sin(x)^2 + x*cos(x)^2) - A(x)")
    document["system"]["functions"] = {"A": ["u"]}
    assert check_certificate(document, seed=1).verdict == "valid"
    document["lagrangian"] = "x'^2/2 + A(x*sin(x)^2 + x*cos(x)^2) - A(x + 1/10^30)"
    assert check_certificate(document, seed=1).verdict == "invalid"

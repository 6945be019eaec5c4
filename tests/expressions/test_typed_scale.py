"""Next to typed decimal numbers, a root of a sum has the coefficients that follow from them."""

from fractions import Fraction

import pytest
from mpmath import mpf

from inverse_service.expressions import calculus, printing, tree as ex
from inverse_service.expressions.typed_scale import in_typed_scale
from inverse_service.reading import reader
from inverse_service.reading.names import Names

NAMES = Names(("x",), ("m", "k"))
TYPED = frozenset((Fraction(1, 100), Fraction(981, 100)))
SHOWN = {
    "sqrt(40000*m*k - 1)": "200*sqrt(m*k - 0.000025)",
    "1/sqrt(40000*m*k - 1)": "0.01/(2*sqrt(m*k - 0.000025))",
    "(40000*m*k - 1)^(3/2)": "8000000*(m*k - 0.000025)^(3/2)",
    "log((200*m + k)/sqrt(40000*m*k - 1))": "log((m + 0.01*k/2)/sqrt(m*k - 0.000025))",
    "(200*m + k)*k": "(200*m + k)*k",
    "sqrt(40000*m*k + 3)": "sqrt(40000*m*k + 3)",
    "sqrt(2*m*k - 1)": "sqrt(2*m*k - 1)",
    "sqrt(40000*m*k - 1)*(5*m/2 + k/40)": "200*sqrt(m*k - 0.000025)*(5*m/2 + 0.025*k)",
    "sqrt(m)": "sqrt(m)",
    "0": "0",
}


def read(text: str) -> ex.Expression:
    return reader.read_formula(text, NAMES)


@pytest.mark.parametrize("text", SHOWN)
def test_a_root_has_the_scale_of_what_was_typed(text: str) -> None:
    with printing.with_decimals(TYPED):
        assert printing.to_text(read(text)) == SHOWN[text]


@pytest.mark.parametrize("text", SHOWN)
def test_the_scaled_formula_is_equal(text: str) -> None:
    tree, at = read(text), {ex.Symbol("m"): mpf("1.7"), ex.Symbol("k"): mpf("0.9")}
    shown = in_typed_scale(tree, TYPED)
    assert calculus.evaluate(shown, at) == pytest.approx(calculus.evaluate(tree, at), rel=1e-12)


def test_without_typed_numbers_and_in_the_given_order_nothing_changes() -> None:
    tree = read("sqrt(40000*m*k - 1)")
    assert in_typed_scale(tree, frozenset()) is tree
    with printing.with_decimals(TYPED), printing.in_given_order():
        assert printing.to_text(tree) == "sqrt(40000*m*k - 1)"

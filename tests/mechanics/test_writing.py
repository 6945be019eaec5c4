"""Products written for people: fewer sums and functions, the same values on the same domain."""

from __future__ import annotations

import random

import mpmath
import pytest

from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Symbol
from inverse_service.mechanics.writing import joined
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x", "y"), (), {})
SHORTER = {
    "sqrt(y^2 - 2*y + 2)*sqrt(y^2 + 2*y + 2)*x": "sqrt(y^4 + 4)*x",
    "x/((y^2 - y + 1)^(1/3)*(y^2 + y + 1)^(1/3))": "x/(y^4 + y^2 + 1)^(1/3)",
    "1/((x - 1)*(x + 1))": "1/(x^2 - 1)",
    "(x - 1)^2*(x^2 + x + 1)^2": "(x^3 - 1)^2",
    "(x + 1)*(x - 1)*(x^2 + 1)": "x^4 - 1",
    "sin(x)*x/cos(x)": "tan(x)*x",
}
AS_THEY_ARE = [
    "sqrt(x - 1)*sqrt(x + 1)",
    "(1 - x)^(1/3)*(1 + x)^(1/3)",
    "sqrt(x^2 + x + 1)*(x^2 - x + 1)",
    "(x + 1)*(y + 1)",
    "sqrt(x^2 + y)*sqrt(x^2 - y)",
]


@pytest.mark.parametrize("text", SHORTER)
def test_sums_to_one_power_are_put_together_where_that_is_shorter(text: str) -> None:
    assert to_text(joined(read_formula(text, NAMES))) == SHORTER[text]


@pytest.mark.parametrize("text", AS_THEY_ARE)
def test_roots_of_what_can_be_negative_stay_apart(text: str) -> None:
    tree = read_formula(text, NAMES)
    assert joined(tree) == tree


@pytest.mark.parametrize("text", [*SHORTER, *AS_THEY_ARE])
def test_values_and_domain_stay_what_they_are(text: str) -> None:
    tree, dice = read_formula(text, NAMES), random.Random(text)
    for _ in range(40):
        point = {Symbol(name): mpmath.mpf(dice.uniform(-3, 3)) for name in "xy"}
        try:
            value = evaluate(tree, point)
        except NoRealValue:
            with pytest.raises(NoRealValue):
                evaluate(joined(tree), point)
        else:
            assert mpmath.almosteq(evaluate(joined(tree), point), value, 1e-9)

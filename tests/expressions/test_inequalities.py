"""What is seen to be positive, or not zero, from the form of a tree alone."""

from __future__ import annotations

import random

import pytest

from inverse_service.expressions.inequalities import is_plainly_nonzero, is_plainly_positive
from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula

NAMES = Names(("x", "y"), ("c",), {})


@pytest.mark.parametrize(
    "text",
    [
        "3",
        "x^2 + 1",
        "exp(-x)",
        "1/x^2",
        "1/sqrt(x)",
        "2*cosh(y)",
        "sqrt(x^2 + 1)",
        "x^2*y^4 + 1/2",
        "x^2 - 2*x + 2",
        "x^4 - x + 1",
        "(x^2 - 4*x + 5)*(x^2 + 1) - 1/2",
        "2 - cos(x)",
        "3 - sin(x)*cos(y) - sin(y)^2",
        "3/2 - sqrt(2)*cos(x)",
    ],
)
def test_what_is_positive_wherever_it_is_defined_is_seen(text: str) -> None:
    assert is_plainly_positive(read_formula(text, NAMES))


@pytest.mark.parametrize(
    "text",
    [
        "0",
        "-1",
        "x",
        "x^2",
        "sqrt(x)",
        "x^2 - 1",
        "x^3 + 1",
        "1/x",
        "x^(1/3) + 1",
        "c^2",
        "sinh(x)",
        "-exp(x)",
        "x*y + 1",
        "x^2 - 2*x + 1",
        "x^4 - 4*x + 3",
        "x^3 - 2*x^2 + 2",
        "-x^2 + 2*x - 2",
        "1 - cos(x)",
        "1 + 2*sin(x)*cos(x)",
        "7/5 - sqrt(2)*cos(x)",
    ],
)
def test_what_can_be_zero_or_negative_is_not_called_positive(text: str) -> None:
    assert not is_plainly_positive(read_formula(text, NAMES))


def test_nonzero_uses_what_is_known_and_nothing_else() -> None:
    x, product, other = (read_formula(text, NAMES) for text in ("x", "x^2*exp(y)/c", "x + y"))
    assert is_plainly_nonzero(product, {x})
    assert not is_plainly_nonzero(product, set())
    assert not is_plainly_nonzero(other, {x})
    assert is_plainly_nonzero(read_formula("1/(x + y)", NAMES), set())
    assert is_plainly_nonzero(read_formula("-x", NAMES), {x})
    assert not is_plainly_nonzero(read_formula("0", NAMES), {x})


def test_no_random_formula_called_positive_has_a_value_that_is_not() -> None:
    dice = random.Random(7)

    def made(depth: int) -> str:
        if depth == 0:
            return dice.choice(["x", "y", "c", "2", "-1", "1/2"])
        left, right = made(depth - 1), made(depth - 1)
        shapes = [
            f"({left}) + ({right})",
            f"({left})*({right})",
            f"({left})^2",
            f"({left})^3",
            f"exp({left})",
            f"1/({left})^2",
            f"-({left})",
        ]
        return dice.choice(shapes)

    called = 0
    for _ in range(2_000):
        text = made(dice.choice([1, 2, 3]))
        try:
            tree = read_formula(text, NAMES)
        except ValueError:
            continue
        if not is_plainly_positive(tree):
            continue
        called += 1
        at = {"x": 0.7, "y": -1.3, "c": -0.4}
        assert sympy_value(text, at) > 0, text
    assert called > 100


def sympy_value(text: str, at: dict[str, float]) -> float:
    import sympy

    return float(sympy.sympify(text.replace("^", "**"), rational=True).subs(at))

"""What is seen to be positive, or not zero, from the form of a tree alone."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

from inverse_service.expressions.inequalities import Range, _power_of, _times, is_plainly_nonzero, is_plainly_positive
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

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
        "(2 + cos(x))^1000",
        "cos(x)^100 + sin(x)^9 + 2",
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
        "2*(10^20 + sqrt(2)*cos(x)) - 2*10^20 + 1",
        "(2 + cos(x))^(1/3) - 3/2",
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


@pytest.mark.slow
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


ENDS = [-math.inf, *map(Fraction, (-3, -1, 0, 0)), Fraction(1, 3), Fraction(2), math.inf]
EXPONENTS = [Fraction(text) for text in ("1", "2", "3", "66", "65", "-1", "-2", "1/2", "1/3", "-1/2", "3/2")]


def some_range(dice: random.Random) -> Range:
    low, high = sorted(dice.sample(ENDS, 2))
    opens = [isinstance(end, float) or (low < high and dice.random() < 0.5) for end in (low, high)]
    return Range(low, high, *opens)


def holds(found: Range, value: Fraction) -> bool:
    above = value >= found.low if not found.low_open else value > found.low
    return above and (value <= found.high if not found.high_open else value < found.high)


def member(found: Range, dice: random.Random) -> Fraction:
    low, high = max(found.low, Fraction(-50)), min(found.high, Fraction(50))
    tried = [low, high, Fraction(0), low + (high - low) * Fraction(dice.randrange(1, 1000), 1000)]
    return dice.choice([Fraction(value) for value in tried if holds(found, Fraction(value))])


def test_products_and_powers_of_numbers_of_two_ranges_lie_in_the_range_that_is_found() -> None:
    dice = random.Random(5)
    for _ in range(1_000):
        one, other = some_range(dice), some_range(dice)
        assert holds(_times(one, other), member(one, dice) * member(other, dice))
        exponent, base = dice.choice(EXPONENTS), member(one, dice)
        if exponent.denominator == 1 and (base or exponent > 0):
            assert holds(_power_of(one, exponent), base ** int(exponent))
        elif base > 0:  # a root lies within what is a hundredth more on both sides of the rounded one
            about = Fraction(float(base) ** float(exponent))
            found = _power_of(one, exponent)
            assert found.low <= about * Fraction(101, 100)
            assert found.high >= about * Fraction(1 - 2**-40)

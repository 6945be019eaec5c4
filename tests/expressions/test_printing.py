"""What is printed reads back: the same value, and then the same text for ever."""

from __future__ import annotations

import random
import re
import time
import xml.etree.ElementTree as ElementTree
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from mpmath import mp, mpf

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.functions import FUNCTION
from inverse_service.expressions.printing import to_latex, to_mathml, to_text
from inverse_service.expressions.tree import (
    MINUS_ONE,
    ONE,
    PI,
    TIME,
    ZERO,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Power,
    Symbol,
    Velocity,
    add,
    multiply,
    number,
    power,
    walk,
)
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x", "y", "r1", "phi"), ("m", "R"), {"A": ("r1",), "B": ("x", "y")})
LEAVES = [
    Symbol("x"),
    Symbol("y"),
    Symbol("phi"),
    Symbol("m"),
    TIME,
    PI,
    Velocity("x"),
    Velocity("r1"),
    Acceleration("y"),
]
EXPONENTS = [Fraction(k) for k in (-3, -2, -1, 2, 3)] + [
    Fraction(1, 2),
    Fraction(-1, 2),
    Fraction(-3, 2),
    Fraction(1, 3),
]


def _compound(inner: some.SearchStrategy[Expression]) -> some.SearchStrategy[Expression]:
    several = some.lists(inner, min_size=2, max_size=4)
    return some.one_of(
        several.map(lambda parts: add(*parts)),
        several.map(lambda parts: multiply(*parts)),
        inner.map(lambda part: multiply(MINUS_ONE, part)),
        some.builds(power, inner.filter(lambda part: part != ZERO), some.sampled_from(EXPONENTS)),
        some.builds(power, inner.filter(lambda part: part != ZERO), inner),
        some.builds(Apply, some.sampled_from(sorted(FUNCTION)), inner),
        some.builds(lambda u, k: Arbitrary("A", (u,), (k,)), inner, some.integers(0, 3)),
        some.builds(lambda u, w, k: Arbitrary("B", (u, w), (k, 1)), inner, inner, some.integers(0, 2)),
    )


NUMBERS = some.fractions(-20, 20, max_denominator=12).map(number)
TREES = some.recursive(NUMBERS | some.sampled_from(LEAVES), _compound, max_leaves=12)


def _values(trees: list[Expression], seed: int) -> list[object]:
    """The values of all trees at one point; arbitrary functions are a fixed function of their arguments."""
    source = random.Random(seed)
    table = {leaf: mpf(source.uniform(0.2, 2)) for leaf in LEAVES if leaf != PI}
    return [_value(tree, dict(table)) for tree in trees]


def _value(tree: Expression, table: dict[Expression, object]) -> object:
    for node in reversed(list(walk(tree))):
        if isinstance(node, Arbitrary) and node not in table:
            arguments = [evaluate(argument, table) for argument in node.arguments]
            weights = [mpf(k + 2 + order) / 7 for k, order in enumerate(node.orders)]
            table[node] = mp.sin(1 + mp.fdot(weights, arguments))
    return evaluate(tree, table)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(TREES)
def test_text_reads_back_to_the_same_value(tree: Expression) -> None:
    try:
        with mp.workdps(30):
            _values([tree], 1)
    except NoRealValue:
        return  # the tree means nothing at this point, and the reader may refuse it
    try:
        again = read_formula(to_text(tree), NAMES)
    except LimitError:
        return  # a number with too many digits, or too large an exponent
    with mp.workdps(30):
        first, second = _values([tree, again], 1)
        assert mp.almosteq(first, second, 1e-15, 1e-15)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(TREES)
def test_text_of_what_was_read_is_the_same_text(tree: Expression) -> None:
    text = to_text(tree)
    try:
        first = read_formula(text, NAMES)
    except LimitError:
        return  # a number with too many digits, or too large an exponent
    except InputError as error:
        assert re.search("no real value|not real|has no value|division by zero", error.detail)  # noqa: PT017
        return
    assert to_text(first) == text
    assert read_formula(to_text(first), NAMES) == first


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(TREES)
def test_mathml_is_one_well_formed_element(tree: Expression) -> None:
    element = ElementTree.fromstring(to_mathml(tree))
    assert element.tag == "{http://www.w3.org/1998/Math/MathML}math"


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(TREES.filter(lambda tree: not any(isinstance(node, Arbitrary) for node in walk(tree))))
def test_latex_reads_back_to_the_same_formula(tree: Expression) -> None:
    text = to_text(tree)
    try:
        read_formula(text, NAMES)
    except InputError:
        return
    assert to_text(read_formula("{" + to_latex(tree) + "}", NAMES)) == text


TABLE = [
    (ZERO, "0", "0"),
    (number(Fraction(-3, 2)), "-3/2", r"-\frac{3}{2}"),
    (multiply(Symbol("x"), Symbol("x")), "x^2", "x^{2}"),
    (add(multiply(MINUS_ONE, Symbol("x")), Symbol("y")), "-x + y", "-x + y"),
    (multiply(Symbol("x"), power(Symbol("y"), -1)), "x/y", r"\frac{x}{y}"),
    (multiply(MINUS_ONE, add(Symbol("x"), Symbol("y"))), "-(x + y)", r"-\left(x + y\right)"),
    (power(Symbol("x"), Fraction(-1, 2)), "1/sqrt(x)", r"\frac{1}{\sqrt{x}}"),
    (multiply(number(Fraction(1, 2)), power(Velocity("r1"), 2)), "r1'^2/2", r"\frac{\dot{r}_{1}^{2}}{2}"),
    (power(Apply("sin", Symbol("phi")), 2), "sin(phi)^2", r"\sin^{2}\left(\phi\right)"),
    (Apply("exp", multiply(MINUS_ONE, TIME)), "exp(-t)", "e^{-t}"),
    (power(Apply("exp", ONE), 2), "exp(2)", r"\exp\left(2\right)"),
    (Acceleration("phi"), "phi''", r"\ddot{\phi}"),
    (Arbitrary("A", (Symbol("r1"),), (1,)), "A'(r1)", r"A'\left(r_{1}\right)"),
    (Arbitrary("A", (Symbol("r1"),), (4,)), "A''''(r1)", r"A^{(4)}\left(r_{1}\right)"),
    (
        Arbitrary("B", (Symbol("x"), Symbol("y")), (1, 2)),
        "diff(B(x, y), x, y, y)",
        r"\frac{\partial^{3} B}{\partial x \partial y^{2}}\left(x, y\right)",
    ),
    (Arbitrary("B", (Symbol("x"), Symbol("x")), (1, 0)), "B[1,0](x, x)", r"B^{(1,0)}\left(x, x\right)"),
    (Symbol("x_left"), "x_left", r"x_{\mathrm{left}}"),
    (power(power(Symbol("x"), Symbol("y")), 2), "(x^y)^2", r"\left(x^{y}\right)^{2}"),
    (Power(number(2), Symbol("x")), "2^x", "2^{x}"),
    (multiply(number(3), Power(number(2), Symbol("x"))), "3*2^x", r"3 \cdot 2^{x}"),
    # The reader takes |u| as sqrt(u^2); formulas for eyes show it as it was written.
    (power(power(Symbol("x"), 2), Fraction(1, 2)), "sqrt(x^2)", r"\left|x\right|"),
    (
        power(power(add(Symbol("x"), power(power(Symbol("y"), 2), Fraction(1, 2))), 2), Fraction(1, 2)),
        "sqrt((x + sqrt(y^2))^2)",
        r"\left|x + \left|y\right|\right|",
    ),
    # A decimal number where the fraction is much longer.
    (multiply(number(Fraction("398600.4418")), power(Symbol("x"), -1)), "398600.4418/x", r"\frac{398600.4418}{x}"),
    (multiply(number(Fraction("-0.06171")), Symbol("x")), "-0.06171*x", "-0.06171 x"),
    (multiply(number(Fraction("0.003")), Symbol("x")), "3*x/1000", r"\frac{3 x}{1000}"),
    (multiply(number(Fraction(1, 1024)), Symbol("x")), "x/1024", r"\frac{x}{1024}"),
    (multiply(number(Fraction(12345, 7000)), Symbol("x")), "2469*x/1400", r"\frac{2469 x}{1400}"),
]


@pytest.mark.parametrize(("tree", "text", "latex"), TABLE)
def test_formulas_look_as_people_write_them(tree: Expression, text: str, latex: str) -> None:
    assert (to_text(tree), to_latex(tree)) == (text, latex)


def test_mathml_shows_dots_subscripts_and_greek_letters() -> None:
    shown = to_mathml(multiply(Velocity("r1"), Symbol("phi")))
    assert "<mover" in shown
    assert "<mn>1</mn>" in shown
    assert "\u03c6" in shown
    assert "<mo>|</mo><mrow><mi>x</mi></mrow><mo>|</mo>" in to_mathml(read_formula("|x|", NAMES))


@pytest.mark.parametrize(
    ("opening", "closing"),
    [
        ("(y*(1/", ")^-2)^3"),
        ("(y*(", ")^2)^-1"),
        ("(1/sqrt(", "))^3"),
        ("(1/(y*(", ")^2)^2)^2"),
        ("(x/sqrt(y/(", ")^3)^2)^2"),
    ],
)
def test_nested_powers_cost_little_to_print(opening: str, closing: str) -> None:
    tree = read_formula(opening * 15 + "x" + closing * 15, NAMES)
    begin = time.process_time()
    for show in (to_text, to_latex, to_mathml):
        show(tree)
    assert time.process_time() - begin < 0.5


@pytest.mark.parametrize("text", ["x*(t + 1)", "-x*(x + t)", "x'*(t - x)*2", "t*(t - 1)*x"])
def test_a_bracket_with_the_time_after_a_coordinate_is_read_back_as_a_factor(text: str) -> None:
    tree = read_formula(text, NAMES)
    assert to_text(read_formula("{" + to_latex(tree) + "}", NAMES)) == to_text(tree)

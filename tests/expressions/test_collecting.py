"""Collected trees have the value of the original and are the same for equal sums of products."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
from mpmath import mp, mpf

from inverse_service.expressions.collecting import collect, expand
from inverse_service.expressions.collecting_trees import merge_powers, terms_tree
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import ONE, ZERO, Arbitrary, Expression, Power, Symbol, Velocity, number, walk
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

NAMES = Names(("x", "y"), ("c", "k"), {"A": ("x",)})


def read(text: str) -> Expression:
    return parse(text, NAMES)


COLLECTED = {
    "(x+y)^2 - x^2": "2*x*y + y^2",
    "0*x": "0",
    "x - x": "0",
    "x/x": "1",
    "sqrt(8*x)*sqrt(x)": "2*sqrt(2)*x",
    "sqrt(x^2)": "sqrt(x^2)",
    "sqrt(x^2)^2": "x^2",
    "(x^3)^(1/3)": "x",
    "(x*y)^(1/3)*(x*y)^(2/3)": "x*y",
    "exp(2*x+y)*exp(-x)": "exp(x + y)",
    "exp(log(x)/2)": "sqrt(x)",
    "log(exp(x'-1))": "x' - 1",
    "log(1/x)": "-log(x)",
    "log(x^2)": "log(x^2)",
    "x^k*x^2*x^k": "x^(2*k + 2)",
    "1/(x*y+x^2)": "1/(x*(x + y))",
    "A(y-y+x)^2/A(x)": "A(x)",
    "1/sqrt(c+A(x)^2)*sqrt(c+A(x)^2)": "1",
    "sin(asin(x))": "x",
    "asin(sin(x))": "asin(sin(x))",
    "cosh(asinh(x))": "sqrt(x^2 + 1)",
    "sqrt(exp(2*x)*y)": "sqrt(y)*exp(x)",
    "exp(c*t)*(x'^2 - x^2)": "-x^2*exp(c*t) + x'^2*exp(c*t)",
}


@pytest.mark.parametrize("text", COLLECTED)
def test_like_terms_are_collected(text: str) -> None:
    assert to_text(collect(read(text))) == COLLECTED[text]


SAME_VALUE = [
    *COLLECTED, "(x+y)^k*(x+y)", "x*(x/y)^(4/3)", "(x - 2*y)^-3*(2*x-4*y)", "1/sqrt(12 - 4*x'^2 - 4*y'^2)",
    "sqrt(x*y + x)/(x + x*y)", "sin(x+y)^2 + cos(y+x)^2", "exp(x)^(1/3)*exp(1)", "log(c*exp(x)/y)", "k^x/k",
    "pi*x/pi^2", "(2*c)^(2/3)/(3*c)^(1/2)", "log(1/(x*y))", "(x+1)^5/(x+1)^(3/2)", "x^(-3/2)*x", "log(sqrt(x))",
    "sinh(acosh(1+x))",
]  # fmt: skip


@pytest.mark.parametrize("text", SAME_VALUE)
@pytest.mark.parametrize("form", [collect, merge_powers])
def test_the_value_stays(text: str, form: object) -> None:
    assert callable(form)
    before = read(text)
    after = form(before)
    source = random.Random(text)
    nodes = [node for tree in (before, after) for node in walk(tree)]
    leaves = {node for node in nodes if isinstance(node, Symbol | Velocity | Arbitrary)}
    with mp.workdps(50):
        point = {leaf: mpf(source.randrange(10**9, 10**10)) / (4 * 10**10) for leaf in leaves - {Symbol("pi")}}
        calls = {call: point[Symbol("x")] + 1 for call in leaves if isinstance(call, Arbitrary)}
        point |= calls
        assert abs(evaluate(before, point) - evaluate(after, point)) < mpf(10) ** -45


@pytest.mark.parametrize("text", SAME_VALUE)
def test_collecting_twice_changes_nothing(text: str) -> None:
    once = collect(read(text))
    assert collect(once) == once


@pytest.mark.parametrize(
    ("left", "right"),
    [("(x+y)*(x-y)", "x^2-y^2"), ("A(x+y)", "A(y+x)"), ("sqrt(4*x+4)", "2*sqrt(1+x)"), ("(c*x)^2/c", "x*c*x")],
)
def test_equal_sums_have_one_form(left: str, right: str) -> None:
    assert collect(read(left)) == collect(read(right))


def test_a_power_that_is_too_large_is_an_atom() -> None:
    tree = Power(read("x + y + c + k"), number(500))
    assert collect(tree) == tree
    assert expand(tree) == ((((tree, Fraction(1)),), Fraction(1)),)


def test_a_huge_power_of_a_number_is_an_atom() -> None:
    tree = Power(number(7), number(10**9))
    assert collect(tree) == tree


def test_division_by_zero_stays() -> None:
    assert collect(Power(ZERO, number(-1))) == Power(ZERO, number(-1))


def test_the_empty_sum_is_zero() -> None:
    assert expand(ZERO) == ()
    assert terms_tree(expand(ZERO)) == ZERO
    assert terms_tree(expand(ONE)) == ONE


@pytest.mark.parametrize(
    ("text", "collected"),
    [("sin(-x)", "-sin(x)"), ("asin(-2*x)^3", "-asin(2*x)^3"), ("cos(-x*y)", "cos(x*y)"), ("tan(-x) + tan(x)", "0")],
)
def test_the_sign_of_an_argument_comes_out_of_odd_and_even_functions(text: str, collected: str) -> None:
    names = Names(("x", "y"), (), {})
    assert to_text(collect(parse(text, names))) == collected

"""Derivatives on trees agree with difference quotients to many digits."""

from __future__ import annotations

import pytest
from mpmath import mp, mpf

from inverse_service.expressions.calculus import (
    NoRealValue,
    differentiate,
    differentiate_in_time,
    evaluate,
)
from inverse_service.expressions.functions import FUNCTION
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    ZERO,
    Apply,
    Expression,
    Ordered,
    Symbol,
    Velocity,
    number,
)
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

NAMES = Names(("x", "y"), ("m",), {"A": ("x",), "B": ("x", "y")})
X, Y, V = Symbol("x"), Symbol("y"), Velocity("x")
FORMULAS = [
    f"{name}({'1, ' * FUNCTION[name].ordered}{'x + 1/2' if name == 'acosh' else 'x*y/2'})"
    for name in sorted(FUNCTION)
]
FORMULAS += ["x^3/y", "x^(1/2)*y^(3/2)", "2^x", "x^y", "1/(x + y)^2", "sqrt(x*y + 1)"]
FORMULAS += ["m", "t", "x'*x", "sin(x)^2*cos(x)"]


def _table(x: mpf) -> dict[Expression, mpf]:
    return {X: x, Y: mpf("0.7"), V: mpf("0.3"), Symbol("m"): mpf(2), Symbol("t"): mpf(3)}


@pytest.mark.parametrize("formula", FORMULAS)
def test_partial_derivative_is_the_limit_of_quotients(formula: str) -> None:
    tree = parse(formula, NAMES)
    derivative = differentiate(tree, X)
    with mp.workdps(40):
        point = mpf("0.9")
        numeric = mp.diff(lambda x: evaluate(tree, _table(x)), point)
        assert mp.almosteq(evaluate(derivative, _table(point)), numeric, 1e-15, 1e-15)


def test_velocity_and_coordinate_are_different_variables() -> None:
    tree = parse("x'^2*x", NAMES)
    assert to_text(differentiate(tree, V)) == "2*x'*x"
    assert to_text(differentiate(tree, X)) == "x'^2"


def test_arbitrary_functions_obey_the_chain_rule() -> None:
    assert to_text(differentiate(parse("A(x^2)", NAMES), X)) == "2*A'(x^2)*x"
    assert (
        to_text(differentiate(parse("B(x*y, y)", NAMES), Y)) == "B[1,0](x*y, y)*x + B[0,1](x*y, y)"
    )


def test_derivative_by_an_absent_name_is_zero() -> None:
    assert differentiate(parse("sin(x)^x*A(x)", NAMES), Symbol("z")) == ZERO


def test_derivative_along_the_motion_has_accelerations() -> None:
    assert (
        to_text(differentiate_in_time(parse("m*x*x'*t", NAMES), ("x", "y")))
        == "m*x'^2*t + m*x*x''*t + m*x*x'"
    )


def test_derivative_by_a_sum_and_third_time_derivatives_are_errors() -> None:
    with pytest.raises(ValueError, match="symbol"):
        differentiate(X, parse("x + y", NAMES))
    with pytest.raises(ValueError, match="third"):
        differentiate_in_time(parse("x''", NAMES), ("x",))


@pytest.mark.parametrize(
    "formula", ["1/(x - x)", "log(y - y)", "sqrt(-x)", "acosh(x/9)", "z", "A(x)"]
)
def test_value_that_is_not_real_is_an_error(formula: str) -> None:
    tree = parse(formula, Names(("x", "y"), ("z",), {"A": ("x",)}))
    with pytest.raises(NoRealValue):
        evaluate(tree, {X: mpf(1), Y: mpf(2)})


def test_every_elementary_function_can_be_evaluated_and_differentiated() -> None:
    for name, row in FUNCTION.items():
        argument = number(1) if name == "acosh" else X
        tree = Ordered(name, argument, number(1)) if row.ordered else Apply(name, argument)
        assert differentiate(tree, X) is not None
        if name != "acosh":
            assert mp.isfinite(evaluate(tree, {X: mpf("0.5")}))

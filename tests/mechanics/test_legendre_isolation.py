"""A momentum is solved for the one velocity in it: where its conditions hold, a root is the velocity."""

from __future__ import annotations

import pytest
from mpmath import mp, mpf

from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import Expression, Symbol, Velocity
from inverse_service.mechanics.legendre.isolation import Root, isolate
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

V, P = Velocity("x"), Symbol("p")


def tree(text: str) -> Expression:
    return parse(text, Names(("x",), ("a", "p")))


def roots(text: str) -> list[Root]:
    return list(isolate(tree(text), V, P))


INVERTED = [
    "x'", "2*x' + x", "a*x'^2", "x'^3 - x", "x'^(-2)", "x'^(1/3)", "x'^a", "(1 + a)^x'", "exp(x' - x)", "log(3 + x')",
    "sin(x')", "cos(x')", "tan(x'/2)", "sinh(x')", "cosh(x' + 1)", "tanh(x')", "asin(x'/9)", "acos(x'/9)", "atan(a*x')",
    "asinh(x')", "acosh(5 + x')", "atanh(x'/9)", "a/(1 + x'^2)", "sqrt(1 + x'^2)", "x*exp(-x'^2/2)",
]  # fmt: skip


@pytest.mark.parametrize("text", INVERTED)
def test_a_root_under_its_conditions_is_the_velocity(text: str) -> None:
    """For v on both sides of zero: F(v) = p, and the root whose conditions hold at v is v itself."""
    found, met = roots(text), 0
    for speed in ("0.7", "-0.4"):
        table = {Symbol("x"): mpf("0.3"), Symbol("a"): mpf("1.7"), V: mpf(speed)}
        try:
            momentum = evaluate(tree(text), table)
            chosen = [root for root in found if all(evaluate(c, table | {P: momentum}) > 0 for c in root.conditions)]
        except NoRealValue:
            continue
        assert len(chosen) == 1
        assert mp.almosteq(evaluate(chosen[0].value, table | {P: momentum}), mpf(speed), 1e-10)
        met += 1
    assert met


@pytest.mark.parametrize("text", ["x", "a*x^2", "x'*exp(x')", "x' - x'^3", "cot(x')", "sec(x')"])
def test_what_holds_the_velocity_twice_or_in_no_known_way_has_no_root(text: str) -> None:
    assert roots(text) == []

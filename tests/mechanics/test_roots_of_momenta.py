"""Each velocity with F(v) = p is the velocity wherever its conditions hold, and F has that value."""

from __future__ import annotations

import pytest
from mpmath import mp, mpf

from inverse_service.expressions import calculus, tree as ex
from inverse_service.mechanics import inverses
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x", "y"), ("a",), {})
RATE, P = ex.Velocity("x"), ex.Symbol("p")
SLOPES = [
    "x'", "a*x' + y", "x'^2", "x'^3", "x'^4 - y", "1/x'", "1/x'^2", "x'^2 + x'", "x'^3 + x'", "x'^4 + x'^2",
    "x' + 1/x'", "x'^(1/3)", "sqrt(x')", "x'^(3/2)", "exp(x')", "exp(-2*x') - y", "log(x')", "log(x'^2)",
    "sinh(x')", "tanh(a*x')", "asinh(x')", "atan(x')", "tan(x')", "sin(x')", "a^x'", "exp(x') + exp(-x')",
    "x'/sqrt(1 + x'^2)", "x'/sqrt(4 - x'^2)", "1/sqrt(1 + x'^2)", "x'^2/(1 + x'^2)", "sqrt(x'^2 + a)",
    "x' + sqrt(1 + x'^2)", "x' - sqrt(1 + x'^2)", "(x' + sqrt(1 + x'^2))^2", "(x' - sqrt(1 + x'^2))^2",
    "log(x' + sqrt(1 + x'^2))", "log((x' - sqrt(1 + x'^2))^2)", "sqrt(x' + sqrt(x'^2 + 1))",
    "exp(x' - sqrt(x'^2 + 1))", "1/(x' + sqrt(x'^2 + 4))^2", "log(2 + x') - log(2 - x')", "a*atan(x') + y",
    "(x' + y)^2/a", "x'*abs(x')",
]  # fmt: skip
FOUND = {
    "x'", "x'^2", "x'^3", "1/x'", "x'^2 + x'", "exp(x')", "log(x')", "sinh(x')", "x'/sqrt(1 + x'^2)",
    "x' + sqrt(1 + x'^2)", "(x' + sqrt(1 + x'^2))^2", "(x' - sqrt(1 + x'^2))^2", "log(2 + x') - log(2 - x')",
}  # fmt: skip


@pytest.mark.parametrize("text", SLOPES)
def test_a_root_is_the_velocity_where_its_conditions_hold(text: str) -> None:
    slope = read_formula(text, NAMES)
    roots = [*inverses.roots_for(slope, RATE, P)]
    met = 0
    with mp.workdps(30):
        for v in ("-1.3", "-0.6", "0.4", "1.7"):
            point = {RATE: mpf(v), ex.Symbol("y"): mpf("0.3"), ex.Symbol("a"): mpf("1.9")}
            try:
                point[P] = calculus.evaluate(slope, point)
            except calculus.NoRealValue:
                continue
            for root in roots:
                try:
                    holds = all(calculus.evaluate(one, point) > 0 for one in root.conditions)
                    found = calculus.evaluate(root.value, point)
                except calculus.NoRealValue:
                    continue
                if holds:
                    assert abs(found - mpf(v)) < mpf(10) ** -15, (v, root)
                    met += 1
    assert met or text not in FOUND

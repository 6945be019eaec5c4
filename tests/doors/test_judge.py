"""The judge computes derivatives correctly and rejects wrong formulas."""

from __future__ import annotations

import mpmath
import pytest

from tests.doors.formulas import DIGITS, NotReal, Point
from tests.doors.judge import (
    Equations,
    faults_of_hamiltonian,
    faults_of_lagrangian,
    same_formula,
    same_lagrangian,
)

OSCILLATOR = Equations(("x",), ("-x",))
KEPLER = Equations(("x", "y"), ("-m*x/(x^2+y^2)^(3/2)", "-m*y/(x^2+y^2)^(3/2)"))
FORMULAS = (
    *(
        "x^2*y/(1 + x*y)",
        "(x*y)^(3/2) - 2^x",
        "x^y",
        "sqrt(x)*log(y)",
        "exp(x*y) - 3.5e-1*x",
        "sin(x*y)*cos(y)",
    ),
    *(
        "tan(x) + cot(y)",
        "sec(x)*csc(y)",
        "sinh(x)*cosh(y)",
        "tanh(x*y) + coth(x)",
        "sech(x) - csch(y)",
    ),
    *(
        "asin(x/2)*acos(y/2)",
        "atan(x*y) + acot(x)",
        "asinh(x*y)",
        "acosh(2 + x*y)",
        "atanh(x/3) + acoth(2 + y)",
    ),
    *(
        "A(x, y)",
        "A[1,0](x*y, y)",
        "B''(x) + diff(B(x), x)",
        "abs(x - 9)*sign(y)",
        "Heaviside(x)*x^2*y",
    ),
    *("piecewise((x^2, x > 9), (y^3, not (y > 8) and 0 < x < 1), (1, true))",),
)


@pytest.mark.parametrize("text", FORMULAS)
def test_jets_are_values_and_derivatives(text: str) -> None:
    place = {"x": mpmath.mpf("0.61"), "y": mpmath.mpf("0.43")}

    def value(x: mpmath.mpf, y: mpmath.mpf) -> mpmath.mpf:
        return Point({"x": x, "y": y}).value(text)

    with mpmath.workdps(2 * DIGITS):
        jet = Point(place, ("x", "y")).jet(text)
        at = (place["x"], place["y"])
        assert abs(jet.value - value(*at)) < 1e-25
        for i in (0, 1):
            order = [int(k == i) for k in (0, 1)]
            assert abs(jet.slopes.get(i, 0) - mpmath.diff(value, at, tuple(order))) < 1e-15
        for pair, order in (((0, 0), (2, 0)), ((0, 1), (1, 1)), ((1, 1), (0, 2))):
            assert abs(jet.bends.get(pair, 0) - mpmath.diff(value, at, order)) < 1e-10


@pytest.mark.parametrize(
    "text", ["sqrt(0 - x)", "log(-x)", "1/(x - x)", "asin(x + 9)", "(-x)^(1/3)"]
)
def test_a_formula_that_is_not_real_is_not_a_number(text: str) -> None:
    with pytest.raises(NotReal):
        Point({"x": mpmath.mpf(2)}).value(text)


@pytest.mark.parametrize("text", ["x y", "x +", "(x", "f(x))", "x''y", "@", "diff(x)"])
def test_what_is_not_canonical_is_not_read(text: str) -> None:
    with pytest.raises((ValueError, IndexError)):
        Point({"x": mpmath.mpf(2), "y": mpmath.mpf(1)}).value(text)


def test_wrong_lagrangians_are_seen() -> None:
    assert faults_of_lagrangian("x'^2/2 - x^2/2", OSCILLATOR) is None
    assert faults_of_lagrangian("x'^2/2 - x^2/3", OSCILLATOR)
    assert faults_of_lagrangian("x'^2/2 - x^2/2 + x^5/10^12", OSCILLATOR)
    assert faults_of_lagrangian("x*x' + x^2", OSCILLATOR)
    assert faults_of_lagrangian("x'^2/2 - x^2/2", OSCILLATOR, ["x > 1", "x < 0"])
    assert faults_of_lagrangian("x'^2/2 + y'^2/2 + m/sqrt(x^2+y^2)", KEPLER) is None
    assert faults_of_lagrangian("x'^2/2 + y'^2/2 - m/sqrt(x^2+y^2)", KEPLER)
    assert faults_of_lagrangian("(x' + y')^2/2", Equations(("x", "y"), ("0", "0")))


def test_lagrangians_that_differ_by_a_factor_and_a_derivative_are_the_same() -> None:
    same = "3*x'^2 - 3*x^2 + 2*x*x'*sin(t) + x^2*cos(t)"
    assert same_lagrangian(same, "x'^2/2 - x^2/2", OSCILLATOR)
    for other in ("x'^2/2 - x^2", "x'^2/2 - x^2/2 - x", "exp(t)*x'^2/2"):
        assert not same_lagrangian(other, "x'^2/2 - x^2/2", OSCILLATOR)


def test_wrong_hamiltonians_are_seen() -> None:
    good = {"text": "p_x^2/2 + x^2/2", "momenta": {"p_x": "x'"}, "implicit": False}
    assert faults_of_hamiltonian(good, "x'^2/2 - x^2/2", OSCILLATOR) is None
    for wrong in ({"text": "p_x^2/2 - x^2/2"}, {"momenta": {"p_x": "2*x'"}}):
        assert faults_of_hamiltonian(good | wrong, "x'^2/2 - x^2/2", OSCILLATOR)
    implicit = {"text": "x'^2/2 + x^2/2", "momenta": {"p_x": "x'"}, "implicit": True}
    assert faults_of_hamiltonian(implicit, "x'^2/2 - x^2/2", OSCILLATOR) is None


def test_formulas_are_compared_by_value() -> None:
    assert same_formula("x*(y + 1)", "x*y + x")
    assert same_formula("diff(V(x, y), x)", "V[1,0](x, y)")
    assert not same_formula("x*(y + 1)", "x*y + x + 10^(-12)")
    assert not same_formula("V(x)", "W(x)")

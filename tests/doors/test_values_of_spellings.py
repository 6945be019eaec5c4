"""What a formula of a program or a book says has the value that it has there; mpmath computes it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp
import pytest

from inverse_service.errors import InputError
from tests.doors import parsing
from tests.doors.formulas import DIGITS, Point

X, Y, W = "0.37", "1.83", "2.41"
Value = Callable[[Any, Any, Any], Any]
# The argument stands where the program has it: the base of a logarithm, the order of a function.
PLAIN: dict[str, Value] = {
    "log(x)": lambda x, y, w: mp.log(x),
    "ln(x)": lambda x, y, w: mp.log(x),
    "log2(x)": lambda x, y, w: mp.log(x) / mp.log(2),
    "log_2(x)": lambda x, y, w: mp.log(x) / mp.log(2),
    "log10(x)": lambda x, y, w: mp.log10(x),
    "log(x, 3)": lambda x, y, w: mp.log(x) / mp.log(3),
    "Log[3, x]": lambda x, y, w: mp.log(x) / mp.log(3),
    "Log[w, x]": lambda x, y, w: mp.log(x) / mp.log(w),
    "Log[x]": lambda x, y, w: mp.log(x),
    "Ln[x]": lambda x, y, w: mp.log(x),
    "Exp[x]": lambda x, y, w: mp.exp(x),
    "e^x": lambda x, y, w: mp.exp(x),
    "Sqrt[y]": lambda x, y, w: mp.sqrt(y),
    "cbrt(y)": lambda x, y, w: mp.cbrt(y),
    "abs(x - y)": lambda x, y, w: abs(x - y),
    "|x - y|": lambda x, y, w: abs(x - y),
    "Abs[x - y]": lambda x, y, w: abs(x - y),
    "sgn(x - y)": lambda x, y, w: mp.sign(x - y),
    "Sign[x - y]": lambda x, y, w: mp.sign(x - y),
    "signum(x - y)": lambda x, y, w: mp.sign(x - y),
    "max(x, y)": lambda x, y, w: max(x, y),
    "min(x, y)": lambda x, y, w: min(x, y),
    "Max[x, y, w]": lambda x, y, w: max(x, y, w),
    "Min[w, y, x]": lambda x, y, w: min(x, y, w),
    "heaviside(x - y)": lambda x, y, w: mp.mpf(0),
    "UnitStep[y - x]": lambda x, y, w: mp.mpf(1),
    "HeavisideTheta[y - x]": lambda x, y, w: mp.mpf(1),
    "pow(y, 3)": lambda x, y, w: y**3,
    "Power[y, 3]": lambda x, y, w: y**3,
    "tg(x)": lambda x, y, w: mp.tan(x),
    "ctg(x)": lambda x, y, w: mp.cot(x),
    "cotan(x)": lambda x, y, w: mp.cot(x),
    "sec(x)": lambda x, y, w: mp.sec(x),
    "Sec[x]": lambda x, y, w: mp.sec(x),
    "csc(x)": lambda x, y, w: mp.csc(x),
    "cosec(x)": lambda x, y, w: mp.csc(x),
    "sh(x)": lambda x, y, w: mp.sinh(x),
    "ch(x)": lambda x, y, w: mp.cosh(x),
    "th(x)": lambda x, y, w: mp.tanh(x),
    "sech(x)": lambda x, y, w: mp.sech(x),
    "csch(x)": lambda x, y, w: mp.csch(x),
    "coth(x)": lambda x, y, w: mp.coth(x),
    "arcsin(x)": lambda x, y, w: mp.asin(x),
    "ArcCos[x]": lambda x, y, w: mp.acos(x),
    "arctg(x)": lambda x, y, w: mp.atan(x),
    "arsinh(x)": lambda x, y, w: mp.asinh(x),
    "ArcCosh[y]": lambda x, y, w: mp.acosh(y),
    "arth(x)": lambda x, y, w: mp.atanh(x),
    "sin^2(x)": lambda x, y, w: mp.sin(x) ** 2,
    "Sin[x]^2": lambda x, y, w: mp.sin(x) ** 2,
    "ProductLog[x]": lambda x, y, w: mp.lambertw(x).real,
    "LambertW(x)": lambda x, y, w: mp.lambertw(x).real,
    "tgamma(y)": lambda x, y, w: mp.gamma(y),
    "GAMMA(y)": lambda x, y, w: mp.gamma(y),
    "Gamma[y]": lambda x, y, w: mp.gamma(y),
    "digamma(y)": lambda x, y, w: mp.digamma(y),
    "PolyGamma[1, y]": lambda x, y, w: mp.polygamma(1, y),
    "polygamma(0, y)": lambda x, y, w: mp.polygamma(0, y),
    "polygamma(12, y)": lambda x, y, w: mp.polygamma(12, y),
    "erf(x)": lambda x, y, w: mp.erf(x),
    "Erf[x]": lambda x, y, w: mp.erf(x),
    "erfc(x)": lambda x, y, w: mp.erfc(x),
    "erfi(x)": lambda x, y, w: mp.erfi(x),
    "expintegral(y)": lambda x, y, w: mp.ei(y),
    "besselj(2, x)": lambda x, y, w: mp.besselj(2, x),
    "BesselJ[2, x]": lambda x, y, w: mp.besselj(2, x),
    "bessel_y(0, y)": lambda x, y, w: mp.bessely(0, y),
    "Piecewise[{{x, x < y}, {y, True}}]": lambda x, y, w: x,
    "x^2/2": lambda x, y, w: x**2 / 2,
    "-x^2": lambda x, y, w: -(x**2),
    "x^y^2": lambda x, y, w: x ** (y**2),
    "2x(y - x)": lambda x, y, w: 2 * x * (y - x),
    r"\frac{x}{y}": lambda x, y, w: x / y,
    r"\sqrt[3]{y}": lambda x, y, w: mp.cbrt(y),
    r"\ln y": lambda x, y, w: mp.log(y),
    r"\sin^{-1} x": lambda x, y, w: mp.asin(x),
    r"\left|x - y\right|": lambda x, y, w: abs(x - y),
}  # fmt: skip


def value_of(text: str) -> Any:
    document = {"equations": f"x'' = {text}; y'' = 0", "parameters": ["w"]}
    found = parsing.read(document)
    assert not isinstance(found, InputError), found.detail
    return Point({"x": mp.mpf(X), "y": mp.mpf(Y), "w": mp.mpf(W)}).value(
        found["equations"]["x"]["text"]
    )


@pytest.mark.parametrize("text", PLAIN)
def test_a_spelled_function_has_its_value(text: str) -> None:
    with mp.workdps(DIGITS):
        wanted = PLAIN[text](mp.mpf(X), mp.mpf(Y), mp.mpf(W))
        assert abs(value_of(text) - wanted) < mp.mpf(10) ** -20 * (1 + abs(wanted))

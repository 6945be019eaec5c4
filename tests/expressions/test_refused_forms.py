"""Wrong and hostile formulas are refused in time, at the exact column, with what to write instead."""

from __future__ import annotations

import pytest

from inverse_service.errors import InputError, LimitError
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_equations, read_formula

NAMES = Names(("x", "y", "r1", "phi"), ("m", "g", "R"), {"A": ("r1",), "B": ("x", "y")})

REFUSED = [
    ("", 1, "empty"),
    ("   ", 1, "empty"),
    ("foo + 1", 1, "parameters"),
    ("x + foo", 5, "parameters"),
    ("rr1", 1, "did you mean r1"),
    ("2xy", 2, "did you mean x*y"),
    ("z'", 1, "equation"),
    ("sinn(x)", 1, "did you mean sin"),
    ("foo(x)", 1, "functions"),
    ("x(y + 1)", 2, "write x*("),
    ("m(y)", 2, "write m*("),
    ("x'(y)", 3, "write x*("),
    ("x (t + 1)", 3, "function of time"),
    ("x y (z)", 6, "not declared"),
    ("x/y m", 5, "(a/b)*c"),
    ("1/2x", 4, "a/(b*c)"),
    ("x^2y", 4, "x^2*y"),
    ("e^2x", 1, "exp(2)"),
    ("x 2", 3, "write *"),
    ("2 3", 3, "write *"),
    ("1.2.3", 4, "write *"),
    ("sin x y", 7, "sin("),
    ("sin x/2", 6, "sin("),
    ("sin 2x (y)", 8, "sin("),
    ("sin -x", 5, "brackets"),
    ("sin", 4, "argument"),
    ("sin()", 5, "number"),
    ("sin(x, y)", 1, "write one"),
    ("sin^-1(x)", 4, "two meanings"),
    ("sin^(-1)(x)", 4, "two meanings"),
    ("sin'(x)", 4, "argument"),
    ("(x + y", 1, "closed"),
    ("x + y)", 6, "not expected"),
    ("(x + y]", 7, "')'"),
    ("x + ", 5, "formula ends"),
    ("* x", 1, "not expected"),
    ("x */ y", 4, "not expected"),
    ("x ^", 4, "formula ends"),
    ("x, y", 2, "comma"),
    ("1,5*x", 2, "decimal point"),
    ("x = y", 3, "one side"),
    ("x == y", 3, "one side"),
    ("x < y", 3, "one ="),
    ("x \u2264 y", 3, "one ="),
    ("x!", 2, "factorials"),
    ("|x", 1, "closed"),
    ("x|", 3, "missing"),
    ("|x|x||", 7, "missing"),
    ("x'''", 1, "second order"),
    ("diff(x, t, 3)", 9, "second order"),
    ("diff(x)", 1, "no variable"),
    ("diff(x, y + 1)", 11, "')'"),
    ("diff(x, A)", 9, "coordinate"),
    ("diff x", 6, "'('"),
    ("diff(x, t, 1/2)", 13, "')'"),
    ("(x)'", 4, "prime"),
    ("2'", 2, "prime"),
    ("x^2'", 4, "prime"),
    ("m'", 2, "no derivative"),
    ("t'", 2, "no derivative"),
    ("A(x, y)", 1, "A(r1)"),
    ("B(x)", 1, "B(x, y)"),
    ("A^2 (x + 1)", 5, "a factor or its arguments"),
    ("A^-1(x)", 5, "two meanings"),
    ("A^(-1)(x)", 7, "two meanings"),
    ("m^2(t)*x", 4, "an argument or a factor"),
    ("(x + y)(t)", 8, "an argument or a factor"),
    ("sin 2*x", 6, "sin("),
    (r"e^{x}^2", 6, "second power"),
    ("B'(x, y)", 2, "diff(B, x)"),
    ("B[1](x, y)", 2, "write 2"),
    ("B[x,1](x, y)", 9, "')'"),
    ("sign(0)", 1, "other than 0"),
    ("floor(x)", 1, "interval"),
    ("max(x, y)", 1, "larger"),
    ("atan2(y, x)", 1, "atan(y/x)"),
    ("Heaviside(sin(x))", 1, "polynomials"),
    ("piecewise((x, x > 0))", 1, "true"),
    ("piecewise((x, x^2), (1, true))", 18, "inequality"),
    ("piecewise((x, sqrt(x) > 1), (1, true))", 23, "polynomials"),
    ("piecewise((x, x = 0), (1, true))", 17, "open sets"),
    ("piecewise(x, x > 0)", 11, "piece such as"),
    ("gamma(x)", 1, "function of your own"),
    ("erf(x)", 1, "functions"),
    ("i*x", 1, "complex"),
    ("2 + 3I", 6, "complex"),
    ("nan", 1, "finite"),
    ("x + inf", 5, "finite"),
    ("oo", 1, "finite"),
    ("1/0", 3, "zero"),
    ("x/(1 - 1)", 3, "zero"),
    ("0^0", 2, "value"),
    ("0^-1", 2, "value"),
    ("(-8)^(1/3)", 5, "real"),
    ("sqrt(-1)", 1, "real"),
    ("log(0)", 1, "real"),
    ("x + log(-2)", 5, "real"),
    ("asin(2)", 1, "real"),
    ("__import__('os')", 1, "letter"),
    ("x.__class__", 2, "dot"),
    ("lambda x: x", 9, "':'"),
    ("eval(x)", 1, "functions"),
    ("x; import os", 2, "one side"),
    ('"x"', 1, "quotation"),
    ("x\x00", 2, "U+0000"),
    ("x\x1b[0m", 2, "U+001B"),
    ("x\u202ey", 2, "U+202E"),
    ("x\u200by", 2, "U+200B"),
    ("x\ud800", 2, "U+D800"),
    ("x + \U0001f600", 5, "U+1F600"),
    ("\u0661 + x", 1, "U+0661"),
    ("x\u0301", 2, "U+0301"),
    ("\u2202x", 1, "diff"),
    ("x\u207b", 2, "digits"),
    ("0x1F", 1, "decimal digits"),
    ("1_000", 1, "write 1000"),
    ("1_x", 2, "letter"),
    (r"\foo x", 1, "\\foo"),
    (r"x + \int x", 5, "integral"),
    (r"\partial x", 1, "diff"),
    (r"\frac{x}", 1, "argument"),
    (r"\sqrt[n]{x}", 1, "integer"),
    (r"\dot{x + y}", 1, "belongs to a name"),
    (r"\dddot{x}", 1, "second order"),
    (r"\left|x\right)", 8, "is expected"),
    (r"\frac{x}{", 9, "closed"),
    (r"\log_{10} x", 1, "\\ln(x)/\\ln(b)"),
    (r"x^{2", 3, "closed"),
    (r"\dot x^23", 8, "braces"),
    (r"\begin{tabular}x", 1, "environment"),
    (r"x \pm y \cdot", 3, "sign"),
    (r"{x(y)}", 3, "write x*("),
    (r"\dot x(t + 1)", 7, "function of time"),
    ("y (2)", 3, "an equation number"),
    (r"\dot y \quad (2)", 14, "an equation number"),
    (r"\frac{\partial x}{\partial t}", 7, "diff(A"),
    (r"\frac{\partial B}{\partial t}", 7, "diff(A"),
    (r"\frac{\partial B}{\partial x \partial y}", 7, "diff(A"),
    (r"\label{eq", 1, "label"),
    (r"\frac{d}{dt} (x)^2", 17, "derivative ends"),
    (r"\frac{dA}{dr_1}(r_1)", 16, "A'(r_1)"),
    (r"\frac{d}{dt} m \dot x", 16, "derivative ends"),
    (r"\frac{d}{dt} x^2", 15, "derivative ends"),
    (r"\frac{d}{dt} x/y", 15, "derivative ends"),
    (r"\frac{d}{dt} x(y + 1)", 15, "derivative ends"),
    (r"\tan^{-1} x", 5, "two meanings"),
    (r"\sin^{-1}(x)", 5, "two meanings"),
    (r"\frac{d}{x} x", 7, "diff(u, t)"),
    (r"\frac{d}{dt}", 7, "diff(u, t)"),
    (r"m{\left(t \right)} x", 2, "functions"),
    (r"\frac{d}{dt} " * 3 + "x", 1, "second order"),
    (r"\cdot", 1, "not expected"),
    ("x \\", 3, "backslash"),
    (r"{x} < y", 5, "="),
    (r"x_{a+b} \cdot 2", 2, "subscript"),
]

LIMITED = [
    ("9^9^9", 2, "exponent"),
    ("x^4097", 2, "exponent"),
    ("(x^1000)^1000", 9, "exponent"),
    ("x^(1/4097)", 2, "exponent"),
    ("((10^50)^64)^64", 9, "digits"),
    ("*".join(["(10^50)"] * 30), 1, "digits"),
    ("1e999999", 1, "power of ten"),
    ("1e" + "9" * 5_000, 1, "power of ten"),
    ("x + " + "1" * 201, 5, "digits"),
    ("x" * 41, 1, "characters"),
    ("x" * 1_000_000, 20_001, "20,000"),
    ("(" * 2_400 + "x" + ")" * 2_400, 101, "nested"),
    ("(" * 5_000 + "x" + ")" * 5_000, 101, "nested"),
    ("sin(" * 101 + "x" + ")" * 101, 404, "nested"),
    ("sin " * 300 + "x", 401, "nested"),
    ("x^" * 300 + "x", 201, "nested"),
    ("{" * 500 + "x" + "}" * 500, 101, "nested"),
    (r"\sqrt" * 300 + "x", 506, "nested"),
    (r"\frac{d}{dt}" * 300 + "x", 1213, "nested"),
    ("1/(1+" * 99 + "x" + ")" * 99, 1, "nested"),
    ("x+" * 3_000 + "x", 5_001, "parts"),
    ("diff(" + "*".join(["sin(x*y)"] * 90) + ", x, 20)", 817, "differentiate"),
    ("diff(x, x, 21)", 12, "derivative"),
    ("A" + "'" * 21, 1, "derivative"),
]


@pytest.mark.parametrize(("formula", "column", "fragment"), REFUSED)
def test_wrong_formula_is_refused_at_its_column(formula: str, column: int, fragment: str) -> None:
    with pytest.raises(InputError) as caught:
        read_formula(formula, NAMES)
    assert (caught.value.column, fragment in caught.value.detail) == (column, True), caught.value.detail


@pytest.mark.parametrize(("formula", "column", "fragment"), LIMITED, ids=range(len(LIMITED)))
def test_passed_limit_is_named(formula: str, column: int, fragment: str) -> None:
    with pytest.raises(LimitError) as caught:
        read_formula(formula, NAMES)
    assert (caught.value.column, fragment in caught.value.detail) == (column, True), caught.value.detail


@pytest.mark.parametrize(("formula", "column", "fragment"), REFUSED + LIMITED, ids=range(len(REFUSED + LIMITED)))
def test_refusal_is_one_printable_sentence_with_its_place(formula: str, column: int, fragment: str) -> None:
    with pytest.raises(InputError) as caught:
        read_formula(formula, NAMES)
    detail = caught.value.detail
    assert detail.isascii()
    assert detail.isprintable()
    assert detail.endswith(".")
    assert len(detail) < 300
    assert f"column {column}" in detail or isinstance(caught.value, LimitError)


@pytest.mark.parametrize(
    ("text", "column"),
    [("x'' = 1 = 2", 9), ("x'' = ; y'' = 1", 7), ("= x", 1), ("x'' = 1; y'' = foo", 16), ("x'' = (1; 2)", 7)],
)
def test_wrong_equation_is_refused_at_its_column(text: str, column: int) -> None:
    with pytest.raises(InputError) as caught:
        read_equations(text, NAMES)
    assert caught.value.column == column


def test_time_can_be_left_out_of_the_names() -> None:
    with pytest.raises(InputError, match="time"):
        read_formula("t", Names(("x",), time=False))


@pytest.mark.parametrize(
    ("formula", "instead"),
    [("(-1)^(1/3)", "write -1^(1/3)"), ("(-8/27)^(2/3)", "write (8/27)^(2/3)"), ("(-2)^(1/2)", "write another base")],
)
def test_a_root_of_a_negative_number_is_refused_with_the_real_root_of_that_number(formula: str, instead: str) -> None:
    with pytest.raises(InputError) as caught:
        read_formula(formula, NAMES)
    assert instead in str(caught.value)

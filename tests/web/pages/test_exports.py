"""What can be copied from a result runs where it is pasted."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys

import pytest
import sympy as sp

from inverse_service import catalogue
from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.solving import solve_document
from inverse_service.web.pages.exports import curl_of, latex_of, python_call
from inverse_service.web.pages.sympy_code import sympy_program, to_sympy


@pytest.mark.parametrize("name", ["sho", "knife-edge-second", "free-particle-linear-drag", "generic-class-one-second"])
def test_the_sympy_program_shows_that_the_euler_lagrange_equations_hold(name: str) -> None:
    result = solve_document(catalogue.document(name), SolveOptions(time_limit=60.0))
    program = sympy_program(result)
    assert "L = " in program
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert run.stderr == ""
    assert set(run.stdout) <= set("[0, ]\n")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x'^2/2 - x^(1/3)", lambda x, t, A: x.diff(t) ** 2 / 2 - x ** sp.Rational(1, 3)),
        ("-(x + 1)^2*sqrt(x)", lambda x, t, A: -((x + 1) ** 2) * sp.sqrt(x)),
        ("A'(x)*x'", lambda x, t, A: A(x).diff(x) * x.diff(t)),
        ("exp(-x)/(2*x)", lambda x, t, A: sp.exp(-x) / (2 * x)),
        ("(-2)^x - 3", lambda x, t, A: sp.Integer(-2) ** x - 3),
    ],
)
def test_formulas_mean_the_same_in_sympy(text: str, expected: object) -> None:
    t = sp.Symbol("t")
    x, A = sp.Function("x")(t), sp.Function("A")
    code = to_sympy(read_formula(text, Names(("x",), (), {"A": ("x",)})))
    found = eval(code, {"sp": sp, "t": t, "x": x, "A": A, "d": sp.symbols("d:1")})
    assert callable(expected)
    assert sp.simplify((found - expected(x, t, A)).doit()) == 0


def test_names_of_python_do_not_clash() -> None:
    assert to_sympy(read_formula("lambda + L", Names((), ("lambda", "L"), {}))) == "lambda_ + L_"


def test_calls_hold_the_document() -> None:
    document = {"name": "it's", "equations": "x'' = -x"}
    words = shlex.split(curl_of(document, "http://h"))
    assert json.loads(words[-1]) == document
    compile(python_call(document, "http://h"), "call", "exec")


def test_latex_is_balanced() -> None:
    result = solve_document({"equations": "x'' = -x"}, SolveOptions(time_limit=60.0))
    latex = latex_of(result)
    assert latex.count(r"\begin{align*}") == latex.count(r"\end{align*}") >= 2
    assert latex.count("{") == latex.count("}")

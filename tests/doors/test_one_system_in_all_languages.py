"""One system without any symmetry, as programs write it, is one system: x'' = -3 x + 2 y - x'/4 and
y'' = x^2 - 5 y' - 7, so that no sign, entry, or number can take the place of another one.
"""

from __future__ import annotations

import pytest

from inverse_service.reading.scripts import languages, nodes
from inverse_service.service.documents.documents import parse_document
from tests.doors.judge import same_formula

PROGRAMS = {
    "Python": (
        "import numpy as np\nfrom scipy.integrate import solve_ivp\ndef f(TIME, s):\n    x, y, u, v = s\n"
        "    return [u, v, -3*x + 2*y - u/4, x**2 - 5*v - 7]\nsolve_ivp(f, (0, 9), [1, 0, 0, 0])"
    ),
    "Python by entries": (
        "import numpy as np\nfrom scipy.integrate import odeint\ndef f(s, TIME):\n    d = np.zeros(4)\n"
        "    d[0] = s[2]\n    d[1] = s[3]\n    d[2] = -3*s[0] + 2*s[1] - s[2]/4\n"
        "    d[3] = s[0]**2 - 5*s[3] - 7\n    return d\nodeint(f, [1, 0, 0, 0], np.linspace(0, 9))"
    ),
    "SymPy": (
        "import sympy as sp\nTIME = sp.symbols('TIME')\nx = sp.Function('x')(TIME)\ny = sp.Function('y')(TIME)\n"
        "one = sp.Eq(x.diff(TIME, 2), -3*x + 2*y - x.diff(TIME)/4)\n"
        "two = sp.Eq(y.diff(TIME, 2), x**2 - 5*y.diff(TIME) - 7)"
    ),
    "SymPy without a name for the time": (
        "import sympy as sp\nx = sp.Function('x')(sp.Symbol('TIME'))\ny = sp.Function('y')(sp.Symbol('TIME'))\n"
        "one = sp.Eq(x.diff(sp.Symbol('TIME'), 2), -3*x + 2*y - x.diff(sp.Symbol('TIME'))/4)\n"
        "two = sp.Eq(y.diff(sp.Symbol('TIME'), 2), x**2 - 5*y.diff(sp.Symbol('TIME')) - 7)"
    ),
    "C": (
        "void f(double TIME, const double s[], double d[]) {\n  d[0] = s[2];\n  d[1] = s[3];\n"
        "  d[2] = -3*s[0] + 2*s[1] - s[2]/4;\n  d[3] = s[0]*s[0] - 5*s[3] - 7;\n}"
    ),
    "GSL": (
        "#include <gsl/gsl_odeiv2.h>\nint f(double TIME, const double s[], double d[], void *params) {\n"
        "  d[0] = s[2];\n  d[1] = s[3];\n  d[2] = -3*s[0] + 2*s[1] - s[2]/4;\n"
        "  d[3] = s[0]*s[0] - 5*s[3] - 7;\n  return GSL_SUCCESS;\n}"
    ),
    "JavaScript": (
        "function f(TIME, s) {\n  const [x, y, u, v] = s;\n"
        "  return [u, v, -3*x + 2*y - u/4, x**2 - 5*v - 7];\n}"
    ),
    "MATLAB": (
        "f = @(TIME,s) [s(3); s(4); -3*s(1) + 2*s(2) - s(3)/4; s(1)^2 - 5*s(4) - 7];\n"
        "[TIME, s] = ode45(f, [0 9], [1; 0; 0; 0]);"
    ),
    "MATLAB by entries": (
        "function d = f(TIME, s)\nd = zeros(4,1);\nd(1) = s(3);\nd(2) = s(4);\n"
        "d(3) = -3*s(1) + 2*s(2) - s(3)/4;\nd(4) = s(1)^2 - 5*s(4) - 7;\nend"
    ),
    "Julia": (
        "using DifferentialEquations\nfunction f!(d, s, p, TIME)\n  x, y, u, v = s\n  d[1] = u\n  d[2] = v\n"
        "  d[3] = -3x + 2y - u/4\n  d[4] = x^2 - 5v - 7\nend\n"
        "prob = ODEProblem(f!, [1.0, 0, 0, 0], (0.0, 9.0))"
    ),
    "R": (
        "library(deSolve)\nf <- function(TIME, s, parms) {\n  x <- s[1]; y <- s[2]; u <- s[3]; v <- s[4]\n"
        "  list(c(u, v, -3*x + 2*y - u/4, x^2 - 5*v - 7))\n}\n"
        "ode(y = c(1, 0, 0, 0), times = seq(0, 9, 0.1), func = f, parms = NULL)"
    ),
    "Fortran": (
        "subroutine f(n, TIME, s, d)\n  integer :: n\n  real(8) :: TIME, s(n), d(n)\n  d(1) = s(3)\n"
        "  d(2) = s(4)\n  d(3) = -3d0*s(1) + 2d0*s(2) - s(3)/4d0\n  d(4) = s(1)**2 - 5d0*s(4) - 7d0\n"
        "end subroutine"
    ),
    "Go": (
        "func f(TIME float64, s []float64) []float64 {\n\tx, y, u, v := s[0], s[1], s[2], s[3]\n"
        "\treturn []float64{u, v, -3*x + 2*y - u/4, x*x - 5*v - 7}\n}"
    ),
    "Modelica": (
        "model plane\n  Real x(start=1);\n  Real y;\n  Real u;\n  Real v;\nequation\n  der(x) = u;\n"
        "  der(y) = v;\n  der(u) = -3*x + 2*y - u/4;\n  der(v) = x^2 - 5*v - 7;\nend plane;"
    ),
    "Modelica's class": (
        "class plane\n  Real x;\n  Real y;\n  Real u;\n  Real v;\nequation\n  der(v) = x^2 - 5*v - 7;\n"
        "  der(u) = -3*x + 2*y - u/4;\n  der(y) = v;\n  der(x) = u;\nend plane;"
    ),
    "Mathematica": (
        "NDSolve[{x''[t] == -3 x[t] + 2 y[t] - x'[t]/4, y''[t] == x[t]^2 - 5 y'[t] - 7, "
        "x[0] == 1, y[0] == 0, x'[0] == 0, y'[0] == 0}, {x, y}, {t, 0, 9}]"
    ),
    "Maple": (
        "dsolve({diff(x(t),t,t) = -3*x(t) + 2*y(t) - diff(x(t),t)/4, "
        "diff(y(t),t,t) = x(t)^2 - 5*diff(y(t),t) - 7});"
    ),
    "Maxima": (
        "eq1: 'diff(x(t),t,2) = -3*x(t) + 2*y(t) - 'diff(x(t),t)/4$\n"
        "eq2: 'diff(y(t),t,2) = x(t)^2 - 5*'diff(y(t),t) - 7$\ndesolve([eq1, eq2], [x(t), y(t)]);"
    ),
    "LaTeX": (
        r"\ddot{x} = -3x + 2y - \frac{\dot{x}}{4} \\ \ddot{y} = x^{2} - 5\dot{y} - 7"
    ),
    "words": "x'' = -3x + 2y - x'/4, and y'' = x^2 - 5y' - 7.",
}  # fmt: skip
CASES = [
    (language, time)
    for language, text in PROGRAMS.items()
    for time in (("t", "tau") if "TIME" in text else ("t",))
]


@pytest.mark.parametrize(("language", "time"), CASES)
def test_the_system_is_the_same_in_each_language_and_time(language: str, time: str) -> None:
    found = parse_document({"equations": PROGRAMS[language].replace("TIME", time)})
    first, second = sorted(found["coordinates"])
    names = (first, second)
    meant = (f"-3*{first} + 2*{second} - {first}'/4", f"{first}^2 - 5*{second}' - 7")
    for name, text in zip(names, meant, strict=True):
        assert same_formula(found["equations"][name]["text"], text, names), found["equations"]


LAGRANGIAN = (
    "from sympy import *\nt = symbols('t')\nx = Function('x')(t)\ny = Function('y')(t)\n"
    "L = x.diff(t)**2/2 + y.diff(t)**2/2 - x**2*y\n"
    "one = L.diff(x.diff(t)).diff(t) - L.diff(x)\ntwo = L.diff(y.diff(t)).diff(t) - L.diff(y)\n"
)
SOLVED = "solve([{}], [x.diff(t, 2), y.diff(t, 2)])"
OTHER = {"one": "x.diff(t, 2) + 3*y", "two": "y.diff(t, 2) - 5*x"}


@pytest.mark.parametrize("kept", [{"one", "two"}, {"one"}, {"two"}, set[str]()])
def test_a_lagrangian_is_that_of_a_program_only_if_all_of_its_equations_are_solved(
    kept: set[str],
) -> None:
    equations = [name if name in kept else OTHER[name] for name in ("one", "two")]
    text = LAGRANGIAN + SOLVED.format(", ".join(equations))
    if len(kept) == 1:
        with pytest.raises(nodes.NotRead):
            languages.what_it_comes_to(text)
        return
    found = languages.what_it_comes_to(text).document
    assert ("lagrangian" in found) == bool(kept)
    read = parse_document(found)["equations"]
    meant = ("-2*x*y", "-x^2") if kept else ("-3*y", "5*x")
    for name, wanted in zip("xy", meant, strict=True):
        assert same_formula(read[name]["text"], wanted, ("x", "y"))


@pytest.mark.parametrize(
    "text",
    [
        "package plane\n  Real x;\nequation\n  der(x) = -x;\nend plane;",
        "model a\n  Real x;\n  Real v;\nequation\n  der(x) = v;\n  der(v) = -x;\nend b;",
        "model a\n  Real x;\n  Real v;\nalgorithm\n  x := v;\nend a;",
    ],
)
def test_what_is_no_whole_model_is_not_taken_as_one(text: str) -> None:
    with pytest.raises((nodes.NotRead, nodes.Trap)):
        languages.what_it_comes_to(text)

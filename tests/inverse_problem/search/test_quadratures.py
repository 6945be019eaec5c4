"""y'' = a + b y' + c y'^2 with b_y = 2 c_t: one quadrature, symbolic exponents and integral signs included."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from fractions import Fraction
from itertools import count

import mpmath
import pytest
import sympy

from inverse_service.certificate.checker import check_certificate
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.tree import Integral, Symbol, Velocity, multiply, walk
from inverse_service.inverse_problem.search import quadratures
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system
from inverse_service.service.documents.documents import solve_system
from inverse_service.sympy.symbol_names import expression, table_of_result

# Equations with symbolic exponents (Courant and Hilbert, Methods of Mathematical Physics I, chapter V; Abramowitz and
# Stegun, chapters 15 and 22): L is M (y'^2 + …)/2 with the weight M of the Sturm-Liouville form.
SYMBOLIC = [
    ("((2*m + 1)*t*y' - n*(n + 2*m)*y)/(1 - t^2)", ["n", "m"]),
    ("((a - b + (a + b + 2)*t)*y' - n*(n + a + b + 1)*y)/(1 - t^2)", ["n", "a", "b"]),
    ("(a*b*y - (c - (a + b + 1)*t)*y')/(t*(1 - t))", ["a", "b", "c"]),
    ("-k*t^a*y^b", ["k", "a", "b"]),
    ("-2*y'/t - y^n", ["n"]),
    ("-k*y^n - g", ["k", "n", "g"]),
    ("sqrt(1 + y'^2)^2/y", []),
]
BY_AN_INTEGRAL = [
    ("-f(t)*y' - g(t)*y - h(t)", {"f": ["t"], "g": ["t"], "h": ["t"]}, 1),
    ("F(y)", {"F": ["y"]}, 1),
    ("exp(-y^2)", {}, 1),
    ("-h(y)*y'^2 - g(t)*y'", {"h": ["y"], "g": ["t"]}, 2),
]

# b or c with an elementary antiderivative: cot t, log t, an arctangent, partial fractions whose residues hold letters.
ELEMENTARY = [
    ("-(2*cot(t) + 1/t)*y' - a*y/t^2", ["a"]),
    ("-log(t)*y' - y", []),
    ("(2*y - 1)*y'^2/(y^2 + 1)", []),
    ("-((1 - a - b)/(t - c) + (1 - a)/(t - b) + (1 - b)/(t + a))*y' - y", ["a", "b", "c"]),
    ("(atan(y) + tan(y))*y'^2", []),
    ("sqrt(y')*sqrt(-y)", []),
    ("-y'*sqrt(-y)", []),
    ("(-y)^(1/3)*t", []),
]


@pytest.mark.slow
@pytest.mark.parametrize(("equation", "parameters"), ELEMENTARY)
def test_an_elementary_antiderivative_takes_the_place_of_an_integral_sign(equation: str, parameters: list[str]) -> None:
    result = solve_system({"equations": {"y": equation}, "parameters": parameters}, SolveOptions(time_limit=20.0))
    answer = result if result["lagrangian"] is not None else result["with_time"]
    assert answer["checked"] == "valid"
    assert not answer["integrals"]
    assert not answer["hamiltonian"]["implicit"]


# Integrals of the tables (Gradshteyn and Ryzhik, chapter 2) that are no monomials in the functions of the force.
BY_SYMPY = [
    "1/(1 + exp(y))", "y/(a + y)", "1/(y^2*(y - 1))", "1/cos(y)", "1/cosh(y)", "b/cosh(a*y)^2", "sqrt(a^2 - y^2)",
    "1/(2 + cos(y))", "sin(y)/(1 + cos(y)^2)", "1/(y^4 + 1)", "y*acosh(y)", "y^(1/3)/(1 + y)", "atan(y)/y^2",
    "y/sqrt(y^4 + 4)", "1/(y*sqrt(y^2 - 1))", "1/(y*sqrt(1 + y^2))", "sin(y)/sqrt(2 - cos(y)^2)",
    "cos(y)/sqrt(2 + sin(y))", "log(y)^2/(y*sqrt(1 + log(y)^3))", "cos(b*y)*sin(a*y)^2",
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("force", BY_SYMPY)
def test_forces_of_one_coordinate_have_their_potential_of_the_tables(force: str) -> None:
    result = solve_system({"equations": {"y": force}, "parameters": ["a", "b"]}, SolveOptions(time_limit=20.0))
    assert result["checked"] == "valid"
    assert not result["integrals"]
    parts = table_of_result(result)
    y, velocity = sympy.Function("y")(sympy.Symbol("t")), sympy.Symbol("v")
    lagrangian = expression(result["lagrangian"]["text"], parts).subs(y.diff(sympy.Symbol("t")), velocity)
    u = sympy.Symbol("u")
    difference = (lagrangian.diff(y) - expression(force, parts)).subs(y, u)
    near = result["certificate"]["near"]
    values = {sympy.Symbol(name): sympy.Float(text, 40) for name, text in near.items()}
    assert abs(sympy.N(difference.subs(values | {u: values[sympy.Symbol("y")], velocity: 1}), 30)) < 1e-20


# With roots of x times what else is negative on the domain of the force, which lies below 0.
BELOW_ZERO = {
    "-sqrt(1 - (x + 1)^2)": 0,
    "-acos(2*x + 1)": 0,
    "-x/sqrt(-x^2 - 2*x)": 0,
    "-sqrt(-(x + 3)/x)": 1,
    "-sqrt(x*(x + 1)*(x - 1))": 1,
    "-x'*sqrt(-x^2 - 4*x)": 0,
}


@pytest.mark.slow
@pytest.mark.parametrize("equation", BELOW_ZERO)
def test_roots_of_products_of_negative_factors_are_real_in_the_lagrangian(equation: str) -> None:
    result = solve_system({"equations": {"x": equation}}, SolveOptions(time_limit=20.0))
    assert result["lagrangian"] is not None
    assert result["checked"] == "valid"
    assert len(result["integrals"]) == BELOW_ZERO[equation]


@pytest.mark.slow
def test_a_wrong_antiderivative_of_a_library_is_not_taken() -> None:
    """SymPy 1.14 gives 0 for this one: what it finds is asked of the checker."""
    result = solve_system({"equations": {"y": "y^2/(y^4 + a*y^2 + 1)"}, "parameters": ["a"]}, SolveOptions())
    assert result["checked"] == "valid"
    assert "F" in result["integrals"] or "log" in result["lagrangian"]["text"] or "atan" in result["lagrangian"]["text"]


def _work_without_end(rounds: Iterator[int]) -> None:
    while True:
        next(rounds)
        sympy.Symbol("y").is_real  # noqa: B018


def test_a_library_that_knows_no_deadline_is_ended_at_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at the clock is a second later: the third is past the 1.5 s, whatever the machine does."""
    looks, rounds, before = count(), count(), sys.getprofile()
    monkeypatch.setattr(quadratures, "now", lambda: float(next(looks)))
    with pytest.raises(quadratures._TimeIsUp), quadratures._at_most(1.5):
        _work_without_end(rounds)
    assert next(looks) == 3
    assert 0 < next(rounds) <= quadratures._CALLS
    assert sys.getprofile() is before


@pytest.mark.slow
@pytest.mark.parametrize(("equation", "parameters"), SYMBOLIC)
def test_symbolic_exponents_are_integrated(equation: str, parameters: list[str]) -> None:
    answer = solve(read_system(["y"], {"y": equation}, parameters), SolveOptions(time_limit=20.0)).with_time
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.checked == "valid"


@pytest.mark.slow
@pytest.mark.parametrize(("equation", "functions", "count"), BY_AN_INTEGRAL)
def test_where_no_antiderivative_is_elementary_there_is_an_integral_sign(
    equation: str, functions: dict[str, list[str]], count: int
) -> None:
    result = solve_system({"equations": {"y": equation}, "functions": functions}, SolveOptions(time_limit=20.0))
    answer = result if result["lagrangian"] is not None else result["with_time"]
    assert answer["checked"] == "valid"
    assert len(answer["integrals"]) == count
    for name, known in answer["integrals"].items():
        assert name not in functions
        assert f"{name}({', '.join(known['arguments'])})" in answer["lagrangian"]["text"]
        assert r"\int" in answer["lagrangian"]["latex"]


def test_the_checker_refuses_a_wrong_derivative_of_an_integral() -> None:
    result = solve_system({"equations": {"y": "-f(t)*y' - y"}, "functions": {"f": ["t"]}}, SolveOptions())
    certificate = result["certificate"]
    assert check_certificate(certificate).verdict == "valid"
    ((name, known),) = certificate["integrals"].items()
    for slope in ("2*f(t)", f"{name}(t)", "f(t) + y"):
        forged = certificate | {"integrals": {name: known | {"derivatives": {"t": slope}}}}
        assert check_certificate(forged).verdict == "invalid", slope


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equation", "factor"),
    [
        ("-x - x'", "exp(t)"),
        ("-3*x - (3/10)*x'", "exp(3*t/10)"),
        ("-x - 0.05*x'", "exp(t/20)"),
        ("-w*x - c*x'", "exp(c*t)"),
    ],
)
def test_a_damped_oscillator_has_its_textbook_lagrangian(equation: str, factor: str) -> None:
    document = {"equations": {"x": equation}, "parameters": ["w", "c"], "time_dependent_lagrangian": True}
    result = solve_system(document, SolveOptions(time_limit=20.0))
    assert factor in result["lagrangian"]["text"]
    assert "log" not in result["lagrangian"]["text"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "equations",
    [
        {"x": "-x^a*y", "y": "-x^(a + 1)"},
        {"x": "y' - sin(x)", "y": "-0.123456789*x' - 2*y"},
        {"x": "-398600.4418*x/(x^2+y^2)^(3/2)", "y": "-398600.4418*y/(x^2+y^2)^(3/2)"},
        {"x": "-6.674e-11*x/(x^2+y^2)^(3/2) - x'/7", "y": "-6.674e-11*y/(x^2+y^2)^(3/2) - y'/7"},
        {"x": "-sqrt(577)*x + sqrt(3)*y", "y": "-y + x/7"},
    ],
)
def test_a_constant_multiplier_has_any_numbers_and_parameters(equations: dict[str, str]) -> None:
    answer = solve(read_system(list(equations), equations, ["a"]), SolveOptions(time_limit=20.0)).with_time
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.checked == "valid"


@pytest.mark.slow
@pytest.mark.parametrize(
    "f",
    ["-k*x'^n - g", "-(k*x'^n + g)*cos(x)", "exp(-x'^2)*t*x", "-(1 + x'^5)*x"],
    ids=["drag", "field", "time", "fifth"],
)
def test_a_function_of_the_velocity_alone_is_integrated_under_signs(f: str) -> None:
    """x'' = F(x') G(t, x): 1/F is a multiplier (drag by a power of the speed: Timmerman and van der Weele 1999)."""
    system = read_system(["x"], {"x": f}, ["k", "n", "g"])
    answer = solve(system, SolveOptions()).with_time
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.checked == "valid"
    held = [node for node in walk(answer.lagrangian.expression) if isinstance(node, Integral)]
    assert {node.arguments for node in held} == {(Velocity("x"),)}


@pytest.mark.slow
def test_of_two_functions_of_the_velocity_the_elementary_one_is_written_out() -> None:
    result = solve_system({"equations": {"y": "y'*log(y')"}}, SolveOptions(time_limit=20.0))
    assert result["checked"] == "valid"
    ((_, known),) = result["integrals"].items()
    assert known["derivatives"] == {"y'": "1/log(y')"}


EVEN = ["1/2 1/2", "3/2 -1/2", "1/2 3/2 1/2 -1/2", "-3/2 5/2 1/2 1/2"]


@pytest.mark.parametrize("powers", EVEN)
def test_an_even_number_of_roots_of_negative_names_is_the_root_of_their_product(powers: str) -> None:
    exponents = list(map(Fraction, powers.split()))
    names = list(map(Symbol, "xabc"[: len(exponents)]))
    table = {name: mpmath.mpf(-place) for place, name in enumerate(names, 2)}
    product = multiply(*(name**exponent for name, exponent in zip(names, exponents, strict=True)))
    whole = mpmath.fprod(table[name] ** math.floor(e) for name, e in zip(names, exponents, strict=True))
    wanted = whole * mpmath.sqrt(mpmath.fprod(table.values()))
    assert mpmath.almosteq(evaluate(quadratures.real_form(product, table), table), wanted)
    odd = product * Symbol("z") ** Fraction(1, 2)
    assert quadratures.real_form(odd, table | {Symbol("z"): mpmath.mpf(-1)}) == odd

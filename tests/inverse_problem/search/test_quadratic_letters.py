"""Antiderivatives of powers of quadratic letters: arctangents, logarithms, arcsines and quotients of roots."""

from __future__ import annotations

import mpmath
import pytest
import sympy

from inverse_service.expressions.printing import to_text
from inverse_service.inverse_problem.search.quadratic_letters import quadratic_antiderivatives
from inverse_service.inverse_problem.search.terms import monomial_tree
from tests.inverse_problem.search.given import monomial_of, tree

x, y, z, a = sympy.symbols("x y z a", positive=True)
POINT = {x: sympy.Rational(2, 7), y: sympy.Rational(3, 11), z: sympy.Rational(5, 13), a: sympy.Rational(9, 17)}


def as_sympy(text: str) -> sympy.Expr:
    return sympy.sympify(text.replace("^", "**"), locals={"x": x, "y": y, "z": z, "a": a}, rational=True)


@pytest.mark.parametrize(
    ("integrand", "variable"),
    [
        ("y/(x^2+y^2)", "x"),
        ("x/(x^2+y^2)", "y"),
        ("1/(1+x^2)", "x"),
        ("1/(x^2+x+1)", "x"),
        ("1/(a^2*x^2+3)", "x"),
        ("1/sqrt(x^2+y^2)", "x"),
        ("1/sqrt(2*x^2+a)", "x"),
        ("1/sqrt(1-x^2)", "x"),
        ("1/sqrt(a-x^2)", "x"),
        ("y/(x^2+y^2+z^2)^(3/2)", "z"),
    ],
)
def test_the_derivative_is_the_monomial_up_to_a_constant(integrand: str, variable: str) -> None:
    v = sympy.Symbol(variable, positive=True)
    others = [s for s in (x, y, z, a) if s != v]
    for found in quadratic_antiderivatives(monomial_of(integrand), tree(variable)):
        quotient = as_sympy(to_text(monomial_tree(found))).diff(v) / as_sympy(integrand)
        slopes = [quotient.diff(s).subs(POINT).evalf(30) for s in (v, *others)]
        if all(abs(slope) < 1e-20 for slope in slopes) and abs(quotient.subs(POINT).evalf(30)) > 1e-10:
            return
    pytest.fail("no candidate is an antiderivative")


@pytest.mark.parametrize(
    "integrand",
    [
        "sqrt(x^2+1)",
        "(x^2-a)^(3/2)",
        "sqrt(a^2-x^2)",
        "1/(x^2+1)^2",
        "(x^2+x+1)^(-3/2)",
        "(x^2+1)^(-5/2)",
        "(x^2-1)^(-2)",
    ],
)
def test_an_antiderivative_is_a_sum_of_the_candidates(integrand: str) -> None:
    """Least squares at many points with 40 digits leaves no residual."""
    found = [as_sympy(to_text(monomial_tree(m))) for m in quadratic_antiderivatives(monomial_of(integrand), tree("x"))]
    values = {a: sympy.Rational(5, 2)} if "-x^2" in integrand else {a: sympy.Rational(1, 2)}
    places = [sympy.Rational(k, 17) for k in ((18, 41) if "-" in integrand.split("^(-")[0] and "-x^2" not in integrand
              else (3, 14))]  # fmt: skip
    points = [places[0] + (places[1] - places[0]) * sympy.Rational(k, 12) for k in range(len(found) + 3)]
    rows = [[f.diff(x).subs({**values, x: p}).evalf(40) for f in found] for p in points]
    wanted = [as_sympy(integrand).subs({**values, x: p}).evalf(40) for p in points]
    with mpmath.workdps(40):
        matrix, right = mpmath.matrix(rows), mpmath.matrix(wanted)
        solved = mpmath.lu_solve(matrix[: len(found), :], right[: len(found)])
        assert mpmath.norm(matrix * solved - right) < mpmath.mpf(10) ** -20


def test_two_logarithms_take_the_place_of_an_arctangent() -> None:
    """d/dx (log(2 x - 2) - log(2 x + 2)) is 2/(x^2 - 1)."""
    found = {to_text(monomial_tree(m)) for m in quadratic_antiderivatives(monomial_of("1/(x^2-1)"), tree("x"))}
    assert {"log(x + 1)", "log(x - 1)"} <= found


@pytest.mark.parametrize("text", ["x", "1/x", "1/(x+y)", "x^2+1", "1/(1+y^2)", "1/(x^3+1)", "exp(x)/(1+exp(x))"])
def test_other_monomials_have_none(text: str) -> None:
    keys = [monomial_of(text)] if text != "x^2+1" else []
    assert [m for key in keys for m in quadratic_antiderivatives(key, tree("x"))] == []

"""Integrating factors exp(-int c dx) are found where they are products of powers and one exponential."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy

from benchmarks.sympy_form import to_sympy
from inverse_service.expressions.tree import Symbol
from inverse_service.inverse_problem.search.factors import find_factors
from inverse_service.inverse_problem.search.integrating import integrating_factor
from inverse_service.inverse_problem.search.material import coefficient, integrating_candidates
from inverse_service.inverse_problem.search.terms import monomial_tree, tree_of
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document
from tests.inverse_problem.search.forty_digits import same_value
from tests.inverse_problem.search.given import material, monomial_of, tree

FOUND = [
    "2/x", "a/x", "tan(x)", "3*cot(x)", "x/(1+x^2)", "(2*x+1)/(x^2+x+1)", "sin(x)", "-x^2", "a*x", "exp(2*x)",
    "A'(x)/A(x)", "a*A(x)*A'(x)/(b+a*A(x)^2)", "1/x + x", "x/(1+x^2) + cos(x)", "2*exp(x)/(1+exp(x))", "log(x)/x",
    "1/(1+x^2)",
]  # fmt: skip
NOT_FOUND = ["exp(x^2)", "sin(x)/x", "1/(1+x^5)", "A(x)", "sqrt(1+x^3)"]


@pytest.mark.parametrize("c", FOUND)
def test_the_logarithmic_derivative_of_the_factor_is_the_negative_coefficient(c: str) -> None:
    here = material({"x": f"({c})*x'^2"})
    terms = coefficient(here.motion.forces[0], monomial_of("x'^2"))
    factor = integrating_factor(here, terms, Symbol("x"), 3)
    assert factor is not None
    written = to_sympy(monomial_tree(factor))
    assert same_value(sympy.diff(written, sympy.Symbol("x")) / written, -to_sympy(tree_of(terms)))


@pytest.mark.parametrize("c", NOT_FOUND)
def test_a_factor_that_is_no_such_product_is_none(c: str) -> None:
    here = material({"x": f"({c})*x'^2"})
    terms = coefficient(here.motion.forces[0], monomial_of("x'^2"))
    assert integrating_factor(here, terms, Symbol("x"), 3) is None


@pytest.mark.parametrize(
    ("force", "exponent", "factor"),
    [
        ("-y*x'^2*log(x') + x*x'*y'", -2, "exp(x*y)"),
        ("-x'^2/x + x'*y'*tan(y)", -1, "x"),
        ("-x'*log(x') + x'*log(y')", -1, "exp(t)"),
    ],
)
def test_a_diagonal_multiplier_has_its_factor_from_all_velocities(force: str, exponent: int, factor: str) -> None:
    """Gamma(log phi) = -df/dx' - e f/x', linear in all velocities."""
    here = material({"x": force, "y": "0"}, with_time=True)
    found = find_factors(here, 3).fitted[0, Fraction(exponent)]
    assert same_value(to_sympy(monomial_tree(found)), to_sympy(tree(factor)))


@pytest.mark.slow
def test_logarithms_of_velocities_with_factors_of_other_coordinates_are_found() -> None:
    """L = exp(x) log x' + log(y')/x + log(z') y^2 + sin z: no product of a few letters shows exp(x), 1/x and y^2."""
    equations = {
        "x": "x'^2*(1 - log(x') + exp(-x)*log(y')/x^2)",
        "y": "-x'*y'/x - 2*x*y*y'^2*log(z')",
        "z": "2*y'*z'/y - cos(z)*z'^2/y^2",
    }
    result = solve_document({"equations": equations}, SolveOptions())
    assert result["lagrangian"] is not None
    assert result["checked"] == "valid"


def test_candidates_are_the_coefficients_of_products_with_the_own_velocity() -> None:
    here = material({"x": "x*x'^2 + y^2*x'*y' + x'*y'^2", "y": "x*x'^2 - 3*y'"}, with_time=True)
    found = {(i, tree_of(c), variable) for i, c, variable in integrating_candidates(here)}
    assert found == {
        (0, tree_of({monomial_of("x"): 1}), Symbol("x")),
        (0, tree_of({monomial_of("y^2"): 1}), Symbol("y")),
        (1, tree_of({frozenset(): -3}), Symbol("t")),
    }

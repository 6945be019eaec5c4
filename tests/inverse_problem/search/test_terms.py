"""Sums of monomials are formulas: products, derivatives and expansions keep values."""

from __future__ import annotations

import pytest
import sympy

from benchmarks.sympy_form import to_sympy
from inverse_service.expressions.tree import Symbol, Velocity, add, multiply, power
from inverse_service.inverse_problem.search.terms import (
    EMPTY,
    TooManyTerms,
    add_terms,
    derivative,
    derivative_of_terms,
    monomial_tree,
    multiply_terms,
    rank,
    split_content,
    terms_of,
    times,
    tree_of,
)
from tests.inverse_problem.search.forty_digits import same_value
from tests.inverse_problem.search.given import monomial_of, tree

FORMULAS = [
    "0*x", "3/7", "x", "(x + y)^3", "(x + 2*y)*(x - 2*y) - x^2", "x'*(x + y')^2/x^3", "sqrt(x)*x^(3/2)", "sqrt(8*x*y)",
    "(2*x + 4*x*y)^(1/2)", "(x + y)^(-2)", "1/(x*y + x)", "exp(2*x + y - 3*x*y)", "exp(x)/exp(x/3)", "tan(x)*cos(x)",
    "sec(x)^2 + csc(y)*cot(y)", "log(x)^2*log(x*y)", "A(x)^2*A'(x) + A(x)", "a*b^2*sin(a*x)^2 - sin(a*x)", "(1 + x)^9",
    "x'*log(x') + sqrt(1 - x'^2 - y'^2)", "sinh(x)*tanh(y)", "(x^2 + x*y)^3/(x + y)^3", "((x + y)^2)^(1/2)",
]  # fmt: skip
MONOMIALS = ["x^3*y'/x'", "sqrt(x + y)*exp(3*x*y)", "sin(x)^2*cos(x)^(-1)", "A(x)^(1/2)*x'^2", "log(x*y)*x'*log(x')"]


@pytest.mark.parametrize("formula", FORMULAS)
def test_an_expansion_has_the_value_of_the_formula(formula: str) -> None:
    assert same_value(tree_of(terms_of(tree(formula))), tree(formula))


@pytest.mark.parametrize("left", FORMULAS[:8])
@pytest.mark.parametrize("right", FORMULAS[4:12])
def test_sums_and_products_of_terms_are_those_of_formulas(left: str, right: str) -> None:
    a, b = tree(left), tree(right)
    assert same_value(tree_of(add_terms(terms_of(a), terms_of(b), -2)), add(a, multiply(tree("-2"), b)))
    assert same_value(tree_of(multiply_terms(terms_of(a), terms_of(b))), multiply(a, b))


@pytest.mark.parametrize("variable", [Symbol("x"), Symbol("y"), Velocity("x")])
@pytest.mark.parametrize("formula", MONOMIALS)
def test_a_derivative_is_that_of_the_formula(formula: str, variable: Symbol | Velocity) -> None:
    expected = to_sympy(tree(formula)).diff(to_sympy(variable))
    assert same_value(tree_of(derivative(monomial_of(formula), variable)), expected)


def test_the_derivative_of_a_sum_is_the_sum_of_the_derivatives() -> None:
    terms = terms_of(tree("x^2*sin(x) - 3*x/(1 + x^2)"))
    expected = sympy.diff(to_sympy(tree("x^2*sin(x) - 3*x/(1 + x^2)")), sympy.Symbol("x"))
    assert same_value(tree_of(derivative_of_terms(terms, Symbol("x"))), expected)


def test_monomials_are_a_group() -> None:
    keys = [monomial_of(formula) for formula in MONOMIALS]
    for a in keys:
        assert times(a, a, -1) == EMPTY
        assert times(a, EMPTY) == a
        for b in keys:
            assert times(a, b) == times(b, a)
            assert times(times(a, b), b, -1) == a


def test_like_terms_are_collected_and_zeros_dropped() -> None:
    assert terms_of(tree("(x + y)^2 - x^2 - 2*x*y - y^2")) == {}
    assert terms_of(tree("exp(x)*exp(-x)")) == {EMPTY: 1}
    assert terms_of(tree("exp(2*x)")) == terms_of(tree("exp(x)^2"))


@pytest.mark.parametrize("formula", ["6*x^2*y - 4*x*y^2", "-x - y", "x'/y + x'/y^2", "2*exp(2*x) + 4*exp(x)", "5*x"])
def test_the_content_of_a_sum_times_the_rest_is_the_sum(formula: str) -> None:
    content, common, rest = split_content(terms_of(tree(formula)))
    assert same_value(multiply(tree(str(content)), monomial_tree(common), rest), tree(formula))
    if len(terms_of(tree(formula))) > 1:
        assert content > 0
        assert split_content(terms_of(rest))[:2] == (1, EMPTY)


def test_large_expansions_are_refused() -> None:
    long = add(*(power(Symbol(f"u{k}"), 1) for k in range(200)))
    with pytest.raises(TooManyTerms):
        terms_of(multiply(long, long))


def test_simple_monomials_come_first() -> None:
    formulas = ["x", "x^2", "x*y", "1/x", "sin(x)", "sqrt(x)*sin(x)^2"]
    ranks = [rank(monomial_of(formula))[0] for formula in formulas]
    assert rank(EMPTY)[0] < min(ranks)
    assert ranks[0] < ranks[1] == ranks[2] < ranks[-1]
    assert ranks[0] < ranks[3]


@pytest.mark.parametrize(
    ("text", "other"),
    [
        ("sin(y-x)", "-sin(x-y)"),
        ("cos(y-x)", "cos(x-y)"),
        ("cot(z-x)", "-cos(x-z)/sin(x-z)"),
        ("atan(-x+y)", "-atan(x-y)"),
        ("sinh(2*y-x)^2", "sinh(x-2*y)^2"),
        ("log(x-y)", "log(x-y)"),
    ],
)
def test_functions_of_opposite_arguments_have_one_letter(text: str, other: str) -> None:
    assert terms_of(tree(text)) == terms_of(tree(other))
    assert same_value(tree_of(terms_of(tree(text))), tree(text))


def test_logarithms_of_opposite_arguments_are_two_letters() -> None:
    assert terms_of(tree("log(x-y)")) != terms_of(tree("log(y-x)"))


@pytest.mark.parametrize(("given", "value"), [("sin(x - x)", "0"), ("cos(x - x)", "1")])
def test_functions_of_an_empty_sum_are_numbers(given: str, value: str) -> None:
    """Euler-Lagrange equations written by a loop hold cos(a1 - a1)."""
    assert terms_of(tree(given)) == terms_of(tree(value))

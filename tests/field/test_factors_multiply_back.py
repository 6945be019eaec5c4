"""What takes a formula apart into factors, roots, or a number in front loses nothing of it."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
from mpmath import mp, mpf

from inverse_service.expressions import calculus, collecting, terms as tm, tree as ex
from inverse_service.field import exact_field, sign_cases
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x", "y"), ("a",), {})
FORMULAS = [
    "2*x^2 - 4*x*y", "(2*x + 4)^3", "(2*x - 2*y)^2/(3*x + 6)^3", "-(x^2 - y^2)^2*(x - y)^3/5", "x^3/(2*y)^2",
    "(x^2 + 2*x*y + y^2)*(4*x + 4*y)^-2", "-7", "(6*a*x + 3*a)^2*(x + 1/2)", "(x*y - y)/(2*x - 2)^4", "(x/2 + y/3)^2",
    "(2*cos(x) + 4)^3*sin(y)", "(3*exp(x) - 6)^2*x", "(2*x)^5*(-3*y)^3",
]  # fmt: skip
POINT: dict[ex.Expression, mpf] = {
    ex.Symbol("x"): mpf("2.37"),
    ex.Symbol("y"): mpf("1.83"),
    ex.Symbol("a"): mpf("2.41"),
}


def value(tree: ex.Expression) -> mpf:
    return calculus.evaluate(tree, POINT)


def real(exponent: Fraction | int) -> mpf:
    return mpf(Fraction(exponent).numerator) / Fraction(exponent).denominator


def is_near(one: mpf, other: mpf) -> bool:
    return bool(abs(one - other) < mpf(10) ** -20 * (1 + abs(one)))


@pytest.mark.parametrize("text", FORMULAS)
def test_the_factors_of_roots_multiply_to_the_formula(text: str) -> None:
    tree = read_formula(text, NAMES)
    content, factors = sign_cases.root_factors(tree)
    with mp.workdps(30):
        product = mp.fprod(value(factor) ** k for factor, k in factors.items())
        assert is_near(value(tree), product * content.numerator / content.denominator)


@pytest.mark.parametrize("text", FORMULAS)
@pytest.mark.parametrize("exponent", [-2, -1, 1, 2, Fraction(2, 3), Fraction(1, 3)])
def test_a_power_of_terms_is_that_of_the_formula(text: str, exponent: Fraction | int) -> None:
    """Of its size, as an odd root of a negative number has no value."""
    tree = read_formula(text, NAMES)
    with mp.workdps(30):
        sign = 1 if value(tree) > 0 else -1
        whole = (tree if sign > 0 else ex.negate(tree)) ** Fraction(exponent)
        for form in (tm.tree_of(tm.terms_of(whole)), collecting.collect(whole)):
            assert is_near(abs(value(tree)) ** real(exponent), value(form))


@pytest.mark.parametrize("e", [Fraction(-3), Fraction(1, 2), Fraction(5, 2), Fraction(-2, 3)])
@pytest.mark.parametrize("text", ["x", "sqrt(x)", "y^(2/3)", "exp(x)", "exp(2*x)", "x^a", "sin(x)"])
def test_a_power_of_a_generator_is_the_power_of_its_value(text: str, e: Fraction) -> None:
    tree = read_formula(text, NAMES)
    with mp.workdps(30):
        found = exact_field.generator_power(tree, e)
        assert is_near(value(found), value(tree) ** real(e))


@pytest.mark.parametrize("number", [Fraction(8), Fraction(12), Fraction(27, 8), Fraction(5)])
@pytest.mark.parametrize("degree", [2, 3, 4])
def test_a_root_of_a_number_is_a_fraction_times_a_root_without_powers(
    number: Fraction, degree: int
) -> None:
    a, b = tm.root_of_number(number, degree)
    assert a**degree * b == number
    assert b.denominator == 1
    assert all(b.numerator % k**degree for k in range(2, math.isqrt(b.numerator) + 1))

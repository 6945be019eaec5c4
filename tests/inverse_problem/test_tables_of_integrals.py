"""Integrals that stand in every table (Bronstein and Semendjajew; Gradshteyn and Ryzhik, chapter 2)
are found, and their derivatives are the integrands; forms of books are found from their expansion.
"""

from __future__ import annotations

import pytest
from mpmath import mp, mpf

from inverse_service.expressions import calculus, collecting, printing, terms as tm, tree as ex
from inverse_service.mechanics import square_forms
from inverse_service.mechanics.second_order_system import system_of
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.search import antiderivatives

LETTERS = ("a", "b", "c", "n")
NAMES = Names(("x", "y"), LETTERS, {})
SYSTEM = system_of(("x", "y"), [ex.ZERO, ex.ZERO], LETTERS, ())
TABLE = [
    "x^n", "1/x", "(a*x + b)^n", "1/(a*x + b)", "1/(a*x + b)^3", "x/(a*x + b)", "x/(a*x + b)^2", "x^2/(a*x + b)",
    "1/(x*(a*x + b))", "1/(x^2*(a*x + b))", "1/(x^2 + a^2)", "1/(x^2 + 1)^2", "x/(x^2 + a)", "x^3/(x^2 + a)",
    "1/(x^2 - 1)", "x^2/(x^2 + 1)", "1/(x^2 + x + 1)", "x/(x^2 + x + 1)", "1/(x^3 + 1)", "1/(x*(x^2 + 1))",
    "sqrt(a*x + b)", "1/sqrt(a*x + b)", "x*sqrt(x + a)", "x/sqrt(x + a)", "x*sqrt(x^2 + a)", "x/sqrt(x^2 + a)",
    "1/sqrt(x^2 + 1)", "1/sqrt(1 - x^2)", "sqrt(1 - x^2)", "sqrt(x^2 + 1)", "x^2/sqrt(1 - x^2)", "1/(x*sqrt(x^2 + 1))",
    "1/(x^2*sqrt(x^2 + 1))", "1/(x^2 + 1)^(3/2)", "x/(x^2 + a)^(3/2)",
    "sin(a*x)", "cos(a*x + b)", "sin(x)^2", "cos(x)^3", "sin(x)^3*cos(x)^2", "tan(x)", "1/cos(x)^2", "1/tan(x)",
    "1/(sin(x)*cos(x))", "1/(sin(x)*cos(x)^3)",
    "sin(x)/cos(x)^2", "tan(x)^2", "x*sin(x)", "x^2*cos(a*x)", "sin(x)*cos(2*x)", "1/sin(x)", "1/(1 + cos(x))",
    "sinh(a*x)", "cosh(x)^2", "tanh(x)", "1/cosh(x)^2", "x*cosh(x)", "sinh(x)*cosh(x)",
    "exp(a*x)", "x*exp(a*x)", "x^2*exp(-x)", "exp(a*x)*sin(b*x)", "exp(-x)*cos(x)", "x*exp(-x^2)", "1/(1 + exp(x))",
    "exp(x)/(1 + exp(x))", "log(x)", "x*log(x)", "log(x)/x", "log(x)^2", "x^n*log(x)", "1/(x*log(x))",
    "atan(x)", "x*atan(x)", "asin(x)", "log(x^2 + 1)",
]  # fmt: skip


def value(tree: ex.Expression, x: str) -> mpf:
    table: dict[ex.Expression, mpf] = {ex.Symbol("x"): mpf(x), ex.Symbol("y"): mpf("0.7")}
    table |= {ex.Symbol(name): mpf(k) / 7 for k, name in enumerate(LETTERS, 9)}
    return calculus.evaluate(tree, table)


@pytest.mark.parametrize("text", TABLE)
def test_an_integral_of_a_table_is_found(text: str) -> None:
    integrand = read_formula(text, NAMES)
    found = antiderivatives.Integrator(SYSTEM).function_of(
        [ex.Symbol("x")], [tm.terms_of(integrand)]
    )
    assert found is not None
    slope = calculus.differentiate(tm.tree_of(found), ex.Symbol("x"))
    with mp.workdps(30):
        for point in ("0.31", "0.83"):
            wanted = value(integrand, point)
            assert abs(value(slope, point) - wanted) < mpf(10) ** -20 * (1 + abs(wanted))


@pytest.mark.parametrize(
    "text",
    ["1/(sin(x)*cos(x))", "1/(sin(x)^3*cos(x))", "1/(sin(x)*cos(x)^3)", "1/(sin(x)*cos(x))^3"],
)
def test_logarithms_in_an_integral_of_circular_functions_have_constants_before_them(
    text: str,
) -> None:
    """Liouville's theorem: the integral is in the field of the integrand but for c log(u)."""
    x = ex.Symbol("x")
    found = antiderivatives.primitive_of_monomials(x, tm.terms_of(read_formula(text, NAMES)))
    assert found is not None
    terms = tm.terms_of(found)
    logarithms = [key for key in terms if any("log" in str(letter) for letter, _ in key)]
    assert len(logarithms) == 2
    assert all(len(key) == 1 for key in logarithms)
    assert not any((x, 1) in key for key in terms)


BOOKS = [
    # Kinetic energies in momenta, as squares by constants.
    "(cos(u)*p + sin(u)*q)^2/(2*a) + (cos(u)*q - sin(u)*p)^2/(2*b)",
    "p^2/(2*(a + b*sin(x)^2))",
    "(p + q)^2/(2*a) + (p - q)^2/(2*b)",
]  # fmt: skip
MOMENTA = ("p", "q")


@pytest.mark.parametrize("book", BOOKS)
def test_the_shortest_form_of_an_expanded_energy_is_not_longer_than_that_of_the_book(
    book: str,
) -> None:
    names = Names(("x", "y", "u"), ("a", "b", *MOMENTA), {})
    tree = read_formula(book, names)
    letters, others = [*map(ex.Symbol, MOMENTA)], [*map(ex.Symbol, "xyu")]
    found = square_forms.shortest_form(collecting.collect(tree), letters, others)
    with mp.workdps(30):
        table: dict[ex.Expression, mpf] = {
            ex.Symbol(name): mpf(k) / 7 for k, name in enumerate("xyuabpq", 2)
        }
        one, other = (calculus.evaluate(each, table) for each in (tree, found))
        assert abs(one - other) < mpf(10) ** -20 * (1 + abs(one))
    assert ex.node_count(found) <= ex.node_count(tree), printing.to_text(found)

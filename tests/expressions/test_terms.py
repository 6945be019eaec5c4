"""Sums of monomials: the square that a quadratic term and a linear one are part of."""

from __future__ import annotations

from fractions import Fraction

import pytest

from inverse_service.expressions import printing, terms as tm, tree as ex
from inverse_service.reading import names as nm, reader

NAMES = nm.Names(("x", "y"), ("a", "b", "m", "w"))
V = ex.Velocity("x")


def terms_of(text: str) -> tm.Terms:
    return tm.terms_of(reader.read_formula(text, NAMES))


@pytest.mark.parametrize(
    "text",
    [
        "x'^2 + 2*a*x'",
        "m*x'^2/2 - m*w*y*x' + b*y^2",
        "(m + a)*x'^2 + 2*w*y*(m + a)*x' - x*y",
        "x'^2/y + sin(x)*x' + x'*y'",
        "a*x'^2",
    ],
)
def test_a_completed_square_leaves_no_term_with_the_letter(text: str) -> None:
    terms = terms_of(text)
    factor, shift = tm.complete_square(terms, V)
    square = tm.terms_of(tm.tree_of(factor) * (V + tm.tree_of(shift)) ** 2)
    assert not tm.depends_on(tm.add_terms(terms, square, -1), V)


def test_without_a_quadratic_term_twice_the_shift_is_the_linear_factor() -> None:
    factor, shift = tm.complete_square(terms_of("a*y*x' + b"), V)
    assert not factor
    assert tm.scaled(shift, 2) == terms_of("a*y")


def test_a_linear_term_that_is_no_multiple_of_the_factor_leaves_no_shift() -> None:
    factor, shift = tm.complete_square(terms_of("(m + a)*x'^2 + b*x'"), V)
    assert factor == terms_of("m + a")
    assert not shift


def test_constants_are_left_out_and_other_terms_are_kept() -> None:
    constants = {ex.Symbol("a"), ex.Symbol("b")}
    terms = terms_of("a + b^2 + 3 + a*x")
    assert tm.without_constants(terms, constants) == terms_of("a*x")
    assert tm.power_coefficient(terms, ex.Symbol("b"), 2) == {tm.EMPTY: Fraction(1)}


def test_a_sum_inside_nested_functions_is_expanded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    expand, found = tm._with_leading_plus, list[str]()

    def counted(function: str, argument: tm.Terms) -> tm.Terms:
        found.append(function)
        return expand(function, argument)

    monkeypatch.setattr(tm, "_with_leading_plus", counted)
    name = ex.Symbol("nested_once")
    tree, levels = name, 12
    for _ in range(levels):
        tree = ex.Apply("sin", ex.subtract(tree, name))
    # The derivative has a cosine of each argument beside the sines inside it.
    derivative = ex.multiply(*(ex.Apply("cos", node.argument) for node in _sines(tree)))
    assert len(tm.terms_of(ex.add(tree, derivative))) == 2
    assert len(found) == 2 * levels


def _sines(tree: ex.Expression) -> list[ex.Apply]:
    return [node for node in ex.walk(tree) if isinstance(node, ex.Apply)]


@pytest.mark.parametrize("degree", [900, 10**30])
def test_a_sum_that_is_too_large_to_be_factored_is_a_factor_as_it_is(degree: int) -> None:
    x, y = ex.Symbol("x"), ex.Symbol("y")
    base = tm.terms_of(ex.add(ex.power(x, ex.number(degree)), ex.multiply(x, y), ex.ONE))
    ((letters, factor),) = tm.power_of_factors(base, Fraction(-1)).items()
    ((letter, exponent),) = letters
    assert (tm.terms_of(letter), exponent, factor) == (base, -1, 1)
    (only,) = tm.irreducible_factors(tm.tree_of(base))
    assert tm.terms_of(only) == base


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("sqrt(2)/2", "1/sqrt(2)"),
        ("x*sqrt(3)/3", "x/sqrt(3)"),
        ("sqrt(3)/6", "1/(2*sqrt(3))"),
        ("3*sqrt(2)", "3*sqrt(2)"),
        ("sqrt(8)", "2*sqrt(2)"),
        ("sqrt(12)/3", "2/sqrt(3)"),
        ("sqrt(5)/2", "sqrt(5)/2"),
        ("3*sqrt(3)/2", "3*sqrt(3)/2"),
        ("x/sqrt(12)", "x/(2*sqrt(3))"),
        ("sqrt(9/8)*x", "3*x/(2*sqrt(2))"),
        ("2^(1/3)/2", "2^(1/3)/2"),
    ],
)
def test_a_root_of_a_number_stands_once_above_or_below_the_line(given: str, written: str) -> None:
    assert printing.to_text(tm.tree_of(terms_of(given))) == written


@pytest.mark.parametrize(
    ("text", "divisor", "digits"),
    [
        ("a*x^4 + b*x^2 + m", "x^2 + 1", ["a - b + m", "b - 2*a", "a"]),
        ("x^3", "2*x - 1", ["1/8", "3/8", "3/8", "1/8"]),
        ("a*y", "x^2 + 1", ["a*y"]),
        ("0", "x + 1", []),
    ],
)
def test_a_polynomial_is_written_in_powers_of_another(
    text: str, divisor: str, digits: list[str]
) -> None:
    found = tm.in_powers(terms_of(text), terms_of(divisor), ex.Symbol("x"))
    assert found == [terms_of(one) for one in digits]


@pytest.mark.parametrize(("text", "divisor"), [("1/x", "x + 1"), ("x", "a*x + 1"), ("x", "y")])
def test_there_are_no_powers_of_what_begins_with_a_letter_or_is_none(
    text: str, divisor: str
) -> None:
    assert tm.in_powers(terms_of(text), terms_of(divisor), ex.Symbol("x")) == []

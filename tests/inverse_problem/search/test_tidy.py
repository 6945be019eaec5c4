"""Lagrangians are written shorter without being changed."""

from __future__ import annotations

from fractions import Fraction

import pytest

from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Apply, Number, Power, multiply, walk
from inverse_service.inverse_problem.search.tidy import tidied
from inverse_service.mechanics.reading import read_system
from tests.inverse_problem.search.forty_digits import same_value
from tests.inverse_problem.search.given import tree

SYSTEM = read_system(["x", "y"], {"x": "-a*x", "y": "-b*y"}, ["a", "b", "c"], {"A": ["x"]})


@pytest.mark.parametrize(
    ("given", "most"),
    [
        ("x'^2/2 + y'^2/2 - a*x^2", 20),
        ("(1-t^2)*(x'^2/2 - a*x^2/(2*(1-t)*(1+t)))", 20),
        ("x'^2/(2*(1+x)) - (-1 - x)*a*y'^2/2 - (a*x - a*x^3)/(1+x)", 34),
        ("x'/((x' + x*y + y*x)^2 + 1)", 14),
        ("x'^2/2 - cos(x)^2*x'^2/2 + a*cos(x)^2*y'^2", 20),
    ],
)
def test_the_shorter_form_has_the_same_value(given: str, most: int) -> None:
    found = tidied(tree(given), SYSTEM)
    assert same_value(found, tree(given))
    assert sum(1 for _ in walk(found)) <= most, to_text(found)


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("(x'^2/2 + y'^2/2)/y^2", "(x'^2 + y'^2)/(2*y^2)"),
        ("c*t*(-x^2 - y^2)", "-c*t*(x^2 + y^2)"),
        ("x'^2/2 + x'^2*exp(y)/(2*(3*(y' + 2*x'/3) - 2*x'))", "x'^2*exp(y)/(6*y') + x'^2/2"),
        ("t*y'^2/2 - b*x^2/2 - b^2*x^2/2", "t*y'^2/2 - b*(b + 1)*x^2/2"),
        ("a*x'^2/2 - x*x'^2/2 + x/2", "(a - x)*x'^2/2 + x/2"),
        ("x'^2/2 - (a^4*x^2 - 2*a^2*t^2*x^2 + t^4*x^2)/(t^2 - a^2)", "x'^2/2 + x^2*(a^2 - t^2)"),
        ("x'^2/2 - b*x^2/2 + a*x^2*cos(2*t) - c*x", "x'^2/2 - b*x^2/2 + a*x^2*cos(2*t) - c*x"),
    ],
)
def test_a_lagrangian_is_written_as_a_reader_would(given: str, shown: str) -> None:
    found = tidied(tree(given), SYSTEM)
    assert to_text(found) == shown
    assert same_value(found, tree(given))


def test_a_square_of_a_parameter_in_all_terms_is_left_out() -> None:
    assert same_value(tidied(tree("x'^2/a^2 + b*y/a^2"), SYSTEM), tree("x'^2 + b*y"))


def test_the_square_of_a_root_is_its_radicand() -> None:
    rooted = Power(tree("sqrt((1-x^2)*(1-a^2*x^2))"), Number(Fraction(-2)))
    assert "sqrt" not in to_text(tidied(multiply(rooted, tree("x'^2/2")), SYSTEM))


@pytest.mark.parametrize("text", ["0", "1", "x'", "A(x)*x'^2", "sqrt(1-x'^2)", "x'*log(x')", "x'^2/y'"])
def test_what_is_short_stays(text: str) -> None:
    assert tidied(tree(text), SYSTEM) == tree(text)


def test_sums_of_velocities_in_which_the_momenta_are_solved_are_kept() -> None:
    given = tree("(5*x'+12*y')^4 + (12*x'-5*y')^4 + (5*x'+12*y')^2 + (12*x'-5*y')^2")
    assert tidied(given, SYSTEM) == given
    assert tidied(tree("(x'+y')^2 - (x'-y')^2"), SYSTEM) == tree("4*x'*y'")


@pytest.mark.parametrize("function", ["sin", "cos"])
@pytest.mark.parametrize("k", ["", "2*", "3*", "4*", "-2*", "-3*"])
def test_circular_functions_of_arctangents_are_algebraic(function: str, k: str) -> None:
    given = tree(f"x'^2/2 + {function}({k}atan(x*y))*y'^2")
    found = tidied(given, SYSTEM)
    assert same_value(found, given)
    assert not any(isinstance(node, Apply) for node in walk(found)), to_text(found)


@pytest.mark.parametrize("argument", ["5*atan(x)", "atan(x)/2", "a*atan(x)", "atan(x) + y"])
def test_other_arguments_with_arctangents_stay(argument: str) -> None:
    assert tidied(tree(f"cos({argument})*x'^2"), SYSTEM) == tree(f"cos({argument})*x'^2")

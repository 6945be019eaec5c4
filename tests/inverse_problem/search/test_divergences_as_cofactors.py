"""Cofactors that the divergence of f proposes."""

from __future__ import annotations

import pytest

from inverse_service.expressions.tree import subtract
from inverse_service.inverse_problem.decision.analysis import variables_of
from inverse_service.inverse_problem.hamiltonisation.identities import vanish
from inverse_service.inverse_problem.search.darboux.cofactors import divergences
from inverse_service.inverse_problem.search.terms import tree_of
from inverse_service.mechanics.reading import read_system
from tests.inverse_problem.search.given import material, tree


@pytest.mark.parametrize(
    ("equations", "expected"),
    [
        ({"x": "x'^2/(1+x)"}, ["2*x'/(1+x)", "2*x'/(1+x)+2*x'/(1+x)"]),
        ({"x": "a*x'", "y": "x'*y'"}, ["a+x'"]),
        ({"x": "-x", "y": "y"}, []),
        ({"x": "x'*y'/(x+y)", "y": "0"}, ["y'/(x+y)", "y'/(x+y)+2*(x'+y')/(x+y)"]),
    ],
)
def test_it_is_the_divergence_and_what_sums_add_to_it(equations: dict[str, str], expected: list[str]) -> None:
    """div_v f, and div_v f + 2 Gamma(log w) for each sum w in f."""
    found = [tree_of(terms) for terms in divergences(material(equations))]
    names = variables_of(read_system(list(equations), equations, ["a"]))
    assert len(found) == len(expected)
    assert vanish([subtract(one, tree(text)) for one, text in zip(found, expected, strict=True)], names) is True


def test_where_f_is_no_polynomial_in_the_velocities_there_is_none() -> None:
    assert divergences(material({"x": "exp(x')"})) == []

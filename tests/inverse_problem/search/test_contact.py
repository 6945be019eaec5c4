"""Equations that a contact transformation makes linear in the velocity, or quadratic (Legendre; the exchange t, y)."""

from __future__ import annotations

import pytest

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import ZERO
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.material import gather
from inverse_service.inverse_problem.search.one_coordinate.contact import kinetic_terms
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.euler_lagrange import hessian
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# Kamke 6.234 and siblings of it: dt/dy' is linear in t; f cubic in y', without constant term; Clairaut's t y' - y.
EQUATIONS = [
    "(1 + y'^2)/(a*sqrt(1 + y'^2) - t*y')",
    "1/(t + exp(y'))",
    "-y'^3*(a*t + y)",
    "1/((t*y' - y)*cosh(y'))",
]


def _system(f: str) -> SecondOrderSystem:
    return read_system(["y"], {"y": f}, ["a"])


@pytest.mark.parametrize("f", EQUATIONS)
def test_such_an_equation_gets_a_lagrangian(f: str) -> None:
    answer = solve(_system(f), SolveOptions()).with_time
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.checked == "valid"
    assert collect(hessian(answer.lagrangian.expression, ["y"])[0][0]) != ZERO


def test_terms_are_proposed_for_one_coordinate_alone() -> None:
    two = read_system(["x", "y"], {"x": "1/(t + exp(x'))", "y": "0"}, [])
    assert kinetic_terms(gather(analyze(two), with_time=True)) == []
    assert kinetic_terms(gather(analyze(_system(EQUATIONS[0])), with_time=True)) != []

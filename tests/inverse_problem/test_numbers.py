"""Numbers of any size get their Lagrangian or an honest word, never a fault."""

from __future__ import annotations

from typing import Any

import pytest
from mpmath import mpf

from inverse_service.algebra.real_point import real_sign
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Symbol
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.documents import solve_system
from tests.inverse_problem.all_over import assert_holds_all_over


def solved(equations: dict[str, str]) -> dict[str, Any]:
    return solve_system({"equations": equations}, SolveOptions(time_limit=900.0))


MEASURED = ["398600.4418", "0.123456789", "1.327e20", "6.674e-11*5.972e24", "3.986004418e14"]


@pytest.mark.parametrize("mu", MEASURED)
def test_a_measured_constant_does_not_cost_the_lagrangian(mu: str) -> None:
    plain = {"x": f"-{mu}*x/(x^2+y^2)^(3/2)", "y": f"-{mu}*y/(x^2+y^2)^(3/2)"}
    polar = {"r": f"r*a'^2 - {mu}/r^2", "a": "-2*r'*a'/r"}
    for equations in (plain, polar):
        result = solved(equations)
        assert result["lagrangian"] is not None
        assert result["checked"] == "valid"
        assert_holds_all_over(result)


@pytest.mark.parametrize("value", ["0.123456789", "7654321", "0.00001234567"])
def test_a_long_number_may_stand_beside_others(value: str) -> None:
    result = solved({"x": "y' - sin(x)", "y": f"-{value}*x' - 2*y"})
    assert result["lagrangian"] is not None
    assert_holds_all_over(result)


def test_huge_multiples_of_one_exponent_end_in_an_answer() -> None:
    many = "+".join(f"exp(x/{p})" for p in (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61))
    assert solved({"x": many})["verdict"] in ("variational", "undetermined")
    assert solved({"x": "exp(x)+exp(100000000000000000001*x)"})["verdict"] in ("variational", "undetermined")


def test_signs_of_tiny_numbers_are_told_and_those_of_rounding_are_not() -> None:
    x = Symbol("x")
    table = {x: mpf("0.3")}
    tiny = read_formula("1e-30 - 1e-25*x^2", Names(("x",), (), {}))
    assert real_sign(tiny, table) == -1
    with pytest.raises(IrreducibleAtoms):
        real_sign(read_formula("sin(x)^2 + cos(x)^2 - 1", Names(("x",), (), {})), table)

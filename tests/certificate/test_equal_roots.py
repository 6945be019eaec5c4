"""Roots of different degrees that are equal are one number to the checker, and others are not:
x'' = -c x has x'^2/2 - d x^2/2 exactly where mpmath says c = d.
"""

from __future__ import annotations

import pytest
from mpmath import mp

import inverse_service
from tests.doors.formulas import Point

PAIRS = [
    ("4^(1/4)", "sqrt(2)"), ("sqrt(2)", "8^(1/6)"), ("16^(1/8)", "4^(1/4)"), ("2/sqrt(2)", "sqrt(2)"),
    ("4^(1/6)", "2^(1/3)"), ("27^(1/6)", "9^(1/4)"),
    ("8^(1/4)*2^(1/4)", "2"), ("(1/4)^(1/4)", "1/sqrt(2)"), ("sqrt(6)/sqrt(3)", "4^(1/4)"),
    ("(4*t)^(1/4)", "sqrt(2)*t^(1/4)"), ("(t^3)^(1/6)", "sqrt(t)"), ("(27*t)^(1/6)", "sqrt(3)*t^(1/6)"),
    ("(9*t)^(1/4)", "sqrt(2)*t^(1/4)"), ("t^(1/4)*t^(1/6)", "t^(5/12)"),
    ("(2 + sqrt(3))^(1/2)", "(sqrt(6) + sqrt(2))/2"),
]  # fmt: skip


@pytest.mark.parametrize(("one", "other"), PAIRS)
def test_a_lagrangian_is_valid_exactly_where_its_root_is_that_of_the_equation(
    one: str, other: str
) -> None:
    with mp.workdps(30):
        left, right = (Point({"t": mp.mpf("0.7")}).value(text) for text in (one, other))
        equal = abs(left - right) < mp.mpf(10) ** -20
    found = inverse_service.check(
        {"system": {"equations": f"x'' = -{one}*x"}, "lagrangian": f"x'^2/2 - {other}*x^2/2"}
    )
    assert found["verdict"] == ("valid" if equal else "invalid"), found["reasons"]


@pytest.mark.parametrize("root", ["4^(1/4)", "8^(1/6)", "9^(1/4)"])
def test_a_root_that_is_one_of_a_lower_degree_is_solved_for(root: str) -> None:
    found = inverse_service.solve({"equations": f"x'' = -{root}*x"})
    assert found["verdict"] == "variational"
    assert inverse_service.check(found)["verdict"] == "valid"

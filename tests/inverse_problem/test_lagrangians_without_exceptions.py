"""Families of which every member has a Lagrangian, by a theorem."""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.solving import regularity

LETTERS = "abc"


def family(equations: dict[str, str]) -> SecondOrderSystem:
    names = [name for name in LETTERS if any(name in line for line in equations.values())]
    return read_system([*equations], equations, names, {})


# A or B is a number times 1; blocks; [A, B + A^2/4] is along B + A^2/4, which is b E_12 in the last.
EVERY_MEMBER = [
    {"x": "-a*x - b*x' + c"},
    {"x": "a*x*x'"},
    {"x": "a*x", "y": "b*y'"},
    {"x": "a*x' + b*y", "y": "a*y' + c*x"},
    {"x": "a*x' + b*y' - x", "y": "c*x' - y"},
    {"x": "a*x' + b*y' + c*z' - x", "y": "c*x' - y", "z": "b*y' - z"},
    {"x": "a*x' + b*y' - x", "y": "c*x' - y", "z": "a*z' - b*z^3"},
    {"x": "a*x' - a^2*x/4 + b*y", "y": "0"},
]
SOME = [
    {"x": "a*x' + b*y", "y": "0"},
    {"x": "a*x' - a^2*x/2 + b*y", "y": "0"},
    {"x": "a*x' + b*y' - x", "y": "c*x' - 2*y"},
    {"x": "a*x' + b*y' - x", "y": "c*x' - y", "z": "a*x' - 2*z"},
    {"x": "b*y'", "y": "a*x"},
    {"x": "a*x' + t*y", "y": "0"},
]


@pytest.mark.parametrize("equations", EVERY_MEMBER, ids=str)
def test_what_is_over_an_algebra_has_one_everywhere(equations: dict[str, str]) -> None:
    assert regularity.has_one_everywhere(family(equations))


@pytest.mark.parametrize("equations", SOME, ids=str)
def test_of_others_the_theorem_says_nothing(equations: dict[str, str]) -> None:
    assert not regularity.has_one_everywhere(family(equations))


@pytest.mark.parametrize(("equations", "exists"), [(EVERY_MEMBER[7], True), (SOME[1], False)])
def test_a_member_solved_alone_agrees(equations: dict[str, str], exists: bool) -> None:
    values = {"a": "2", "b": "3", "c": "-5"}
    asked: dict[str, Any] = {"equations": equations, "parameters": values}
    asked |= {"first_integrals": False, "time_dependent_lagrangian": False}
    found = inverse_service.solve(asked)
    assert (found["verdict"] == "variational") is exists

"""Arbitrary functions, limits, and systems that are undefined for some parameters."""

from __future__ import annotations

import pytest

from inverse_service.deadline import now
from inverse_service.inverse_problem.special_cases.case_tree import Node, SpecialCases, special_cases
from inverse_service.inverse_problem.special_cases.cases import condition_texts
from inverse_service.mechanics.reading import read_system


def tree(
    equations: dict[str, str], parameters: str = "", functions: dict[str, list[str]] | None = None
) -> SpecialCases:
    return special_cases(read_system(list(equations), equations, list(parameters), functions or {}), None)


def listed(node: Node) -> list[tuple[tuple[str, ...], str | None]]:
    found = [(tuple(condition_texts(node.case)), node.case.autonomous)]
    return found + [item for child in node.children for item in listed(child)]


def test_a_function_that_becomes_constant_is_a_case() -> None:
    first = {"r": "0", "s": "-A'(r)*A(r)/(1 + A(r)^2)*r'*s'", "z": "-A'(r)/(1 + A(r)^2)*r'*s'"}
    found = tree(first, functions={"A": ["r"]})
    assert ((), "not_variational") in listed(found.root)
    assert (("A(r) = A_0",), "variational") in listed(found.root)
    assert not found.complete  # where A solves a differential equation was not examined
    assert any("A''(r)" in reason for reason in found.reasons)


def test_names_of_constants_avoid_those_of_parameters() -> None:
    system = read_system(["x", "y"], {"x": "-A(x)*y'*A_0", "y": "x'^2"}, ["A_0"], {"A": ["x"]})
    names = [name for case in special_cases(system, None).examined for name in case.system.parameters]
    assert "A__0" in names


def test_a_case_at_which_the_equations_divide_by_zero_is_none() -> None:
    found = tree({"x": "x'*y'/a", "y": "b"}, "ab")
    assert not any("a = 0" in texts for texts, _ in listed(found.root))
    assert (("b = 0",), "variational") in listed(found.root)


def test_without_parameters_there_is_one_case() -> None:
    found = tree({"x": "x^2*y'", "y": "x'"})
    assert listed(found.root) == [((), "not_variational")]
    assert found.complete


def test_limits_end_the_search_and_are_named() -> None:
    equations = {"x": "-a*x' + b*y", "y": "-c*y' + d*x"}
    system = read_system(["x", "y"], equations, list("abcd"))
    few = special_cases(system, True, most=2)
    assert len(few.examined) == 2
    assert not few.complete
    assert "limit of 2 cases" in few.reasons[-1]
    late = special_cases(system, True, deadline=now())
    assert len(late.examined) == 1
    assert "time limit" in " ".join(late.reasons)


@pytest.mark.slow
def test_what_is_open_for_one_question_may_be_settled_for_the_other() -> None:
    """Where a = c there is L = exp(a t) (...), but no L(q, v) in closed form that shows all its values."""
    found = tree({"x": "-a*x' + b*y", "y": "-c*y' + d*x"}, "abcd")
    assert found.complete_with_time
    assert all(reason.startswith("for L(q, q') alone") for reason in found.reasons)
    assert (("a = c",), "variational") in listed(found.root)

"""Where the L of a set of members is none, the question for those members is offered."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.service.documents.special_members import special_members

RESULT: dict[str, Any] = {
    "system": {"coordinates": ["x", "y"], "time": "t"},
    "verdict": "variational",
}


def leaf(equations: dict[str, str], exceptions: list[str], **more: Any) -> dict[str, Any]:
    proof = {"equations": equations, "parameters": [*"abc"], "exceptions": exceptions}
    return {"nonzero": [], "proof": proof, **more}


@pytest.mark.parametrize(
    ("condition", "equations", "left"),
    [
        ("b = 0", {"x": "-a*x", "y": "c*x - y"}, ["a", "c"]),
        ("a = c", {"x": "-c*x + b*y", "y": "c*x - y"}, ["b", "c"]),
        ("2*c - b = 1", {"x": "-a*x + (2*c - 1)*y", "y": "c*x - y"}, ["a", "c"]),
    ],
)
def test_a_condition_is_put_into_the_equations(
    condition: str, equations: dict[str, str], left: list[str]
) -> None:
    ((said, document),) = special_members(
        leaf({"x": "-a*x + b*y", "y": "c*x - y"}, [condition]), RESULT
    )
    assert said == condition
    assert document["equations"] == equations
    assert sorted(document["parameters"]) == left
    assert document["coordinates"] == ["x", "y"]


@pytest.mark.parametrize(
    "exceptions",
    [[], ["a*b = 1"], ["a^2 = b^2"], ["single values of a"], ["special functions F"], ["a = ("]],
)
def test_what_no_constant_solves_is_not_offered(exceptions: list[str]) -> None:
    assert special_members(leaf({"x": "-a*x", "y": "b*y - c"}, exceptions), RESULT) == []


def test_what_is_apart_from_the_set_or_has_no_value_there_is_not_offered() -> None:
    apart = leaf({"x": "-x/b", "y": "-a*y"}, ["a = 0", "b = 0"], nonzero=["a"])
    assert special_members(apart, RESULT) == []
    assert special_members({"nonzero": [], "proof": None}, RESULT) == []


def test_functions_and_the_name_of_the_time_stay() -> None:
    one = leaf({"x": "-b*V(x) - a*x", "y": "-y"}, ["a = 0"])
    one["proof"]["functions"] = {"V": ["x"]}
    system = {"coordinates": ["x", "y"], "time": "tau"}
    ((_, document),) = special_members(one, {**RESULT, "system": system})
    assert document["functions"] == {"V": ["x"]}
    assert document["time"] == "tau"
    assert document["equations"]["x"] == "-b*V(x)"

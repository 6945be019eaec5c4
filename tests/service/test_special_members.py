"""Where the L of a set of members is none, the question for those members is offered."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.service.documents.special_members import singular_of, special_members

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


@pytest.mark.parametrize(
    ("inequation", "solved", "left"),
    [
        ("F'(x)", {"text": "F(x) = F_0*x", "new_constants": ["F_0"]}, []),
        ("F(x)", {"text": "F(x) = F_0*x", "new_constants": ["F_0"]}, []),
        ("F'(x) - 1", {"text": "F(x) = F_0*x", "new_constants": ["F_0"]}, ["F_0 = 0"]),
        ("F''(x)", {"text": "F(x) = F_0/x", "new_constants": ["F_0"]}, []),
        ("F'(x)", {"text": "F(x) = (", "new_constants": ["F_0"]}, ["F_0 = 0"]),
    ],
)
def test_what_an_inequation_between_derivatives_excludes_is_not_told(
    inequation: str, solved: dict[str, Any], left: list[str]
) -> None:
    """F_0 = 0 is no member of F(x) = F_0 x with F' != 0."""
    system = {"coordinates": ["x", "y"], "functions": {"F": ["x"]}, "parameters": []}
    one = leaf({}, ["F_0 = 0"], solved=[{**solved, "new_functions": []}])
    assert singular_of({**one, "nonzero": [inequation]}, {"system": system}) == left


def test_a_function_of_fewer_arguments_is_put_in_before() -> None:
    parts = [("F(x, y) = F(y)", [], ["F"]), ("F(y) = F_0*y", ["F_0"], [])]
    solved = [{"text": a, "new_constants": b, "new_functions": c} for a, b, c in parts]
    system = {"coordinates": ["x", "y"], "functions": {"F": ["x", "y"]}, "parameters": []}
    one = leaf({}, ["F_0 = 0"], solved=solved)
    apart = {**one, "nonzero": ["diff(F(x, y), y)"]}
    assert singular_of(apart, {"system": system}) == []
    assert singular_of(one, {"system": system}) == ["F_0 = 0"]

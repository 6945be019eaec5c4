"""The conditions on parameters for a Lagrangian agree with conditions derived by hand, on a grid of values."""

from __future__ import annotations

import copy
import itertools
import json
from collections.abc import Callable
from typing import Any

import pytest

from inverse_service import check, solve
from tests.doors import calls
from tests.doors.formulas import Point

Values = dict[str, int]
# Equations, whether L may contain t, where a Lagrangian exists (by hand).
FAMILIES: dict[str, tuple[dict[str, str], bool, Callable[[Values], bool]]] = {
    "damped coupled oscillators": (
        {"x": "-a*x' + b*y", "y": "-c*y' + d*x"}, True,
        lambda p: p["a"] in (p["c"], -p["c"]) or p["b"] == p["d"] == 0,
    ),
    "potentials of degree three (Henon, Heiles)": (
        {"x": "-x - 2*a*x*y", "y": "-y - b*x^2 + c*y^2"}, False,
        lambda p: p["a"] * p["b"] != 0 or (p["a"] == 0 and p["b"] * p["c"] == 0) or (p["b"] == 0 and p["a"] == -p["c"]),
    ),
    "coupled van der Pol oscillators": (
        {"x": "-x + m*(1 - x^2)*x' + a*y", "y": "-y + m*(1 - y^2)*y' + b*x"}, False,
        lambda p: p["m"] == 0 or p["a"] == p["b"] == 0,
    ),
    "gyroscopic forces and a potential": (
        {"x": "w*y' - k*x", "y": "-u*x' - m*y"}, True,
        lambda p: p["w"] * p["u"] != 0 or p["k"] == p["m"] or p["w"] == p["u"] == 0,
    ),
    "a force quadratic in one velocity": (
        {"x": "-a*y", "y": "-b*x'^2"}, False, lambda p: p["a"] * p["b"] == 0,
    ),
    "a magnetic field exponential in x": (
        {"x": "-a*exp(k*x)*y'", "y": "b*x'"}, True, lambda p: p["a"] * p["b"] * p["k"] == 0,
    ),
}  # fmt: skip


def document(equations: dict[str, str], timed: bool, **more: Any) -> dict[str, Any]:
    return {"equations": equations, "parameters": "guess", "time_dependent_lagrangian": timed, **more}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAMILIES)
def test_a_lagrangian_exists_exactly_where_the_conditions_hold(name: str) -> None:
    equations, timed, exists = FAMILIES[name]
    result = solve(document(equations, timed, special_cases=True))
    part, names = result["special_cases"], result["system"]["parameters"]
    generic = result["verdict_with_time" if timed else "verdict"] == "variational"
    for numbers in itertools.product((-1, 0, 1, 2), repeat=len(names)):
        values = dict(zip(names, numbers, strict=True))
        point = Point(dict.fromkeys(names, 0) | values)
        cases = [[point.holds(each["text"].replace(" = ", " == ")) for each in case["conditions"]]
                 for case in part["variational_when"]]  # fmt: skip
        assert generic or any(map(all, cases)) == exists(values), values


@pytest.mark.slow
def test_the_question_for_which_parameters_is_answered_at_the_command_line() -> None:
    given = document({"x": "-a*x' + b*y", "y": "-c*y' + d*x"}, True)
    code, out, err = calls.command("solve", "-", "--special-cases", given=json.dumps(given))
    assert code == 0, err
    result = json.loads(out)
    found = [
        [condition["text"] for condition in case["conditions"]] for case in result["special_cases"]["variational_when"]
    ]
    assert sorted(found) == [["a = -c"], ["a = c"], ["b = 0", "d = 0"]]
    assert result["special_cases"]["complete"]
    assert solve(given)["special_cases"] is None


def nodes(node: dict[str, Any], at: str = "/special_cases/tree") -> list[tuple[str, dict[str, Any]]]:
    inner = (nodes(child, f"{at}/children/{k}") for k, child in enumerate(node["children"]))
    return [(at, node), *itertools.chain.from_iterable(inner)]


@pytest.fixture(scope="module")
def henon_heiles() -> dict[str, Any]:
    equations, timed, _ = FAMILIES["potentials of degree three (Henon, Heiles)"]
    found: dict[str, Any] = json.loads(solve(document(equations, timed, special_cases=True)).to_json())
    return found


def test_a_special_case_that_is_variational_shows_a_proven_lagrangian(henon_heiles: dict[str, Any]) -> None:
    special = [(at, node) for at, node in nodes(henon_heiles["special_cases"]["tree"])[1:]
               if node["verdict"] == "variational"]  # fmt: skip
    report = check(henon_heiles)
    assert report["verdict"] == "valid"
    assert len(special) >= 3
    for at, node in special:
        assert node["checked"] == "valid"
        assert not {f"{at}/{key}" for key in ("lagrangian", "verdict", "equations")} & {*report["not_checked"]}
        assert f"{at}/conditions/0/latex" not in report["not_checked"]


def test_latex_of_a_condition_that_is_another_is_not_checked(henon_heiles: dict[str, Any]) -> None:
    forged = copy.deepcopy(henon_heiles)
    at, node = next(pair for pair in nodes(forged["special_cases"]["tree"]) if pair[1]["lagrangian"])
    node["conditions"][0]["latex"] += " + 1"
    assert f"{at}/conditions/0/latex" in check(forged)["not_checked"]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("lagrangian", {"text": "x'^2/2 + y'^2/2", "latex": "", "domain": []}),
        ("equations", {"x": "0", "y": "0"}),
        ("conditions", [{"text": "c = 0", "latex": "c = 0"}]),
        ("conditions", [{"text": "x = 0", "latex": "x = 0"}]),
        ("verdict", "not_variational"),
        ("checked", "incomplete"),
    ],
)
def test_a_false_field_of_a_special_case_is_a_contradiction(
    henon_heiles: dict[str, Any], field: str, value: Any
) -> None:
    forged = copy.deepcopy(henon_heiles)
    node = next(node for _, node in nodes(forged["special_cases"]["tree"]) if node["lagrangian"])
    node[field] = value
    assert check(forged)["verdict"] == "invalid"


@pytest.mark.slow
def test_the_lagrangian_of_a_special_case_is_in_the_text() -> None:
    given = document({"x": "-a*x'*y", "y": "-b*x"}, False, special_cases=True)
    found = solve(given)
    shown = [node["lagrangian"] for _, node in nodes(found["special_cases"]["tree"]) if node["lagrangian"]]
    text = calls.command("solve", "-", "--format", "text", given=json.dumps(given))[1]
    latex = calls.command("solve", "-", "--format", "latex", given=json.dumps(given))[1]
    assert shown
    assert all(one["text"] in text and one["latex"] in latex for one in shown)

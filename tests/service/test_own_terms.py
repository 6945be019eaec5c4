"""Own terms of a Lagrangian in a document: read with its names, tried first, refused with their place."""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.accepting import to_ansatz, to_schema, to_system
from inverse_service.service.documents.checking import check_document
from inverse_service.service.documents.documents import parse_document, solve_system

PARTICLE = {
    "coordinates": ["x", "y"],
    "equations": {"x": "0", "y": "-k*x*x'*y'/(1+x^2)"},
    "parameters": {"k": "1", "m": None},
    "ansatz": ["m*x'^2", "sqrt(k+x^2)*y'^2/x'"],
}


def ansatz(*terms: Any, **changes: Any) -> dict[str, Any]:
    return {**PARTICLE, "ansatz": list(terms), **changes}


@pytest.mark.slow
def test_own_terms_are_tried_first_and_shown_with_the_system() -> None:
    found = solve_system(PARTICLE, SolveOptions())
    assert found["lagrangian"]["family"] == "the given terms"
    assert found["checked"] == "valid"
    assert found["system"]["given"]["ansatz"] == PARTICLE["ansatz"]
    assert any("'the given terms' (2 candidate terms)" in step["text"] for step in found["explanation"])


@pytest.mark.slow
def test_a_result_with_own_terms_is_confirmed_by_the_checker() -> None:
    found = solve_system(PARTICLE, SolveOptions())
    assert check_document(json.dumps(found))["verdict"] == "valid"


def test_values_of_parameters_are_put_into_own_terms() -> None:
    schema = to_schema(PARTICLE)
    system = to_system(schema)
    plain = to_schema(ansatz("m*x'^2", "sqrt(1+x^2)*y'^2/x'"))
    assert to_ansatz(schema, system) == to_ansatz(plain, system)


def test_latex_is_read_too() -> None:
    schema = to_schema(ansatz(r"\frac{\dot{y}^2}{\dot{x}}", "y'^2/x'"))
    first, second = to_ansatz(schema, to_system(schema))
    assert first == second


@pytest.mark.parametrize(
    ("term", "column", "words"),
    [
        ("y'^2/", 6, "missing"), ("q'^2", 1, "not declared"), ("x' + y''", None, "acceleration"), ("", None, "empty"),
        ("x' = 1", 4, "one side"),
        ("__import__('os')", 1, "column 1"), ("floor(x')", 1, "floor"), ("x'/(k-1)", None, "no real value"),
    ],
)  # fmt: skip
def test_a_bad_term_is_refused_with_its_place(term: str, column: int | None, words: str) -> None:
    for use in (parse_document, lambda document: solve_system(document, SolveOptions())):
        with pytest.raises(InputError, match=words) as caught:
            use(ansatz("x'^2", term))
        assert caught.value.pointer == "/ansatz/1"
        assert caught.value.column == column


@pytest.mark.parametrize(
    ("changes", "pointer", "words"),
    [
        ({"ansatz": "x'^2"}, "/ansatz", "list"), ({"ansatz": [3]}, "/ansatz/0", "text"),
        ({"ansatz": ["x"] * 51}, "/ansatz", "50"), ({"series_order": 0}, "/series_order", "from 1 to 8"),
        ({"series_order": 9}, "/series_order", "from 1 to 8"), ({"series_order": "2"}, "/series_order", "from 1 to 8"),
        ({"series_order": True}, "/series_order", "from 1 to 8"),
    ],
)  # fmt: skip
def test_a_list_of_another_shape_is_refused(changes: dict[str, Any], pointer: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        to_schema({**PARTICLE, **changes})
    assert caught.value.pointer == pointer


@pytest.mark.slow
def test_the_order_of_the_series_reaches_the_certificate() -> None:
    document = {"coordinates": ["x"], "equations": {"x": "-x+(1-x^2)*x'"}, "time_dependent_lagrangian": False}
    found = solve_system({**document, "series_order": 4}, SolveOptions())
    assert found["certificate"]["series"]["order"] == 4

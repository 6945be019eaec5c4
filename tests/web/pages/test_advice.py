"""What a page says to try next fits what stayed open."""

from __future__ import annotations

import re
from typing import Any

import pytest

from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document
from inverse_service.web.pages.form_documents import document_of, fields_from, lean_fields
from inverse_service.web.pages.forms import Form
from inverse_service.web.pages.result_tasks import advice_for

OPEN: dict[str, Any] = {
    "verdict": "undetermined", "verdict_with_time": None, "question": "L(q, q')", "lagrangian": None,
    "reason": "The time limit of 3 s was reached before a verdict was proven.",
    "provenance": {"options": {"time_limit": 3.0}}, "system": {"parameters": [], "functions": {}},
}  # fmt: skip


def test_more_time_is_offered_only_where_the_service_has_more() -> None:
    assert advice_for(OPEN, 60.0)[0].longer == 60.0
    used_up = advice_for(OPEN, 3.0)
    assert all(advice.longer is None for advice in used_up)
    assert "--time-limit" in used_up[0].code


def test_time_is_no_remedy_for_another_reason() -> None:
    found = advice_for(OPEN | {"reason": "two random points gave two answers"}, 60.0)
    assert found
    assert all(advice.longer is None and not advice.code for advice in found)


def test_letters_and_functions_are_named_where_there_are_some() -> None:
    system = {"parameters": ["k"], "functions": {"A": ["x"]}}
    texts = " ".join(advice.text for advice in advice_for(OPEN | {"system": system}, 60.0))
    assert "arbitrary" in texts
    assert "parameters" in texts
    assert "arbitrary" not in " ".join(advice.text for advice in advice_for(OPEN, 60.0))


def test_terms_are_asked_for_where_a_lagrangian_exists_and_was_not_found() -> None:
    found = advice_for(OPEN | {"verdict": "variational", "reason": ""}, 60.0)
    assert "Terms to try first" in found[0].text


@pytest.mark.slow
@pytest.mark.parametrize("coordinates", [["u"], ["u", "v"], ["u", "v", "w"]])
def test_terms_that_are_advised_are_of_the_system(coordinates: list[str]) -> None:
    existence = OPEN | {"verdict": "variational", "reason": "", "system": {"coordinates": coordinates}}
    terms = advice_for(existence, 60.0)[-1].text.rpartition("for example ")[2].rstrip(".")
    document = {"coordinates": coordinates, "equations": dict.fromkeys(coordinates, "0"), "ansatz": terms.split(", ")}
    assert set(re.findall(r"[a-z]", terms.replace("log", ""))) <= set(coordinates)
    assert solve_document(document, SolveOptions())["verdict"] == "variational"


def test_a_search_that_ran_out_of_time_says_so() -> None:
    existence = OPEN | {"verdict": "variational", "reason": ""}
    hit = existence | {"provenance": {"time_limit": 1.0, "seconds": {"decision": 0.1, "search": 0.85}}}
    assert [advice.longer for advice in advice_for(hit, 60.0)] == [60.0, None]
    ended = existence | {"provenance": {"time_limit": 50.0, "seconds": {"decision": 0.1, "search": 3.0}}}
    assert [advice.longer for advice in advice_for(ended, 60.0)] == [None]


@pytest.mark.parametrize("closed", [{"verdict": "not_variational"}, {"verdict": "variational", "lagrangian": {}}])
def test_nothing_is_advised_where_nothing_is_open(closed: dict[str, Any]) -> None:
    assert advice_for(OPEN | closed, 60.0) == []


def test_terms_and_a_limit_go_through_the_form() -> None:
    typed = {"kind": ("equations",), "equations": ("x'' = -x",)}
    document = document_of(Form(typed | {"ansatz": ("y'^2/x', f(x, y)\nx*y'",), "time_limit": ("4",)}))
    assert document["ansatz"] == ["y'^2/x'", "f(x, y)", "x*y'"]
    assert document["options"] == {"time_limit": 4.0}
    assert fields_from(document)["ansatz"] == "y'^2/x', f(x, y), x*y'"
    assert lean_fields(document)["time_limit"] == "4"

"""A result contains the answer once, without the page that shows it."""

from __future__ import annotations

import json
from typing import Any

import pytest

import inverse_service
from inverse_service.service.documents import printed_pages, stated
from tests.values import slow

KNIFE_EDGE = {
    "coordinates": ["x", "y", "phi"],
    "lagrangian": "(x'^2 + y'^2 + phi'^2)/2",
    "constraints": ["y'*cos(phi) - x'*sin(phi)"],
}


@pytest.mark.parametrize(
    ("document", "most"),
    [
        slow({"coordinates": ["x"], "equations": {"x": "-x - c*x'"}, "parameters": ["c"]}, 10_000),
        ({"equations": "x'' = -k*x", "parameters": ["k"]}, 5_000),
        slow(KNIFE_EDGE, 38_500),
    ],
)
def test_an_answer_is_short(document: dict[str, Any], most: int) -> None:
    result = inverse_service.solve(document)
    assert result["lagrangian"]["text"]
    assert len(json.dumps(dict(result), ensure_ascii=False, separators=(",", ":")).encode()) <= most
    assert not [
        step for step in (result["with_time"] or {}).get("details", []) if step in result["details"]
    ]
    for step in result["explanation"]:
        assert step["text"]
    for step in result["details"]:
        assert len({"text", "parts"} & set(step)) == 1


@pytest.mark.parametrize(
    "equations", ["x'' = x^2 + y^2; y'' = 0", "x'' = -y'; y'' = y"]
)  # the first: Douglas 1941
def test_one_proof_of_a_no_answers_both_questions_at_every_door(equations: str) -> None:
    result = inverse_service.solve({"equations": equations})
    assert (result.verdict, result.verdict_with_time, result.with_time) == (
        "not_variational",
        "not_variational",
        None,
    )
    for page in (
        printed_pages.text_page(dict(result), False),
        printed_pages.latex_page(dict(result), False),
    ):
        assert page.count("do not come from any regular Lagrangian.") == 1
    answers = stated.main_statements(result)
    assert [(one.verdict, one.question.timed) for one in answers] == [
        ("not_variational", k) for k in (False, True)
    ]
    found = result.check()
    assert (found["verdict"], found["statement"]["question"]) == (
        "valid",
        "L(t, q, q')",
    )  # it covers L(q, q')

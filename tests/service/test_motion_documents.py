"""A motion on constraints that is given as it is, without a Lagrangian."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.documents.documents import parse_document, solve_document, understand_document

INCLINED = {
    "coordinates": ["phi", "x", "y"],
    "motion": {"phi": "0", "x": "-tan(phi)*phi'*x' + g*cos(phi)^2"},
    "constraints": ["y' = tan(phi)*x'"],
    "parameters": ["g"],
}


def test_the_accelerations_of_all_coordinates_are_understood() -> None:
    found = parse_document(INCLINED)
    assert set(found["equations"]) == {"phi", "x", "y"}
    assert understand_document(INCLINED)["given"] == INCLINED


def test_the_answer_is_about_the_motion_alone() -> None:
    found = solve_document(INCLINED, SolveOptions(time_limit=20))
    assert found["verdict"] == "undetermined"
    assert "any_associated" in found["reason"]
    assert found["nonholonomic"] is None
    assert found["any_associated"]["freedom"] == "1 function of 2 variables"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"motion": {"phi": "0"}}, "free velocities"),
        ({"motion": {"phi": "0", "q": "1"}}, "no coordinate"),
        ({"motion": {"phi": "0", "x": "y''"}}, "acceleration"),
        ({"motion": {"x": "0", "y": "0"}, "constraints": ["y' = tan(phi)*x'"]}, "do not fix"),
        ({"special_cases": True}, "special cases"),
    ],
)
def test_what_does_not_fit_together_is_refused_in_one_sentence(change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        solve_document(INCLINED | change, SolveOptions(time_limit=10))

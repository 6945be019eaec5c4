"""`check` verifies proofs by identities exactly over the rationals."""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service import solve
from inverse_service.explanation.proofs import proof_document
from inverse_service.service.documents.checking import check_document

Document = dict[str, Any]
# x = 0 and y x + z = 0 give z = 0, and z^2 w = 0 with nonzero w gives nothing new.
PROOF: Document = {
    "theorem": "z_is_zero",
    "relations": {"rel1": "x"},
    "equations": {"eq1": "2*w*y*x + 2*w*z"},
    "nonzero": ["w"],
    "steps": [
        {"name": "a", "gives": "z", "factor": "2*w", "cofactors": {"eq1": "1", "rel1": "-2*w*y"}},
        {"name": "b", "gives": "z^2 - x", "factor": "1", "cofactors": {"a": "z", "rel1": "-1"}},
    ],
}


def verdict(theorem: Document) -> str:
    return str(
        check_document(json.dumps({"theorems": [theorem], "domain": [], "reason": ""}))["verdict"]
    )


def with_step(number: int, **parts: object) -> Document:
    steps = [step | (parts if k == number else {}) for k, step in enumerate(PROOF["steps"])]
    return PROOF | {"steps": steps}


def test_a_proof_by_identities_is_valid() -> None:
    assert verdict(PROOF) == "valid"


@pytest.mark.parametrize(
    "theorem",
    [
        with_step(0, gives="z + 1"),
        with_step(0, gives="y"),
        with_step(0, factor="0"),
        with_step(0, factor="2*w*z"),
        with_step(0, cofactors={"eq1": "1"}),
        with_step(0, cofactors={"eq1": "1", "rel1": "-2*w*y", "b": "0"}),
        with_step(1, cofactors={"b": "1"}),
        with_step(1, name="a"),
        with_step(1, gives="z^2 - x +"),
        with_step(1, gives="z^2 - exp(x)"),
        with_step(1, gives=""),
        with_step(1, gives=3),
        PROOF | {"nonzero": []},
        PROOF | {"nonzero": ["0"]},
        PROOF | {"nonzero": ["z"]},
        PROOF | {"equations": {"eq1": "2*w*y*x + 2*w*z + 1"}},
        PROOF | {"relations": {}},
        PROOF | {"steps": []},
    ],
)
def test_an_altered_proof_is_invalid(theorem: Document) -> None:
    assert verdict(theorem) == "invalid"


@pytest.mark.slow
@pytest.mark.parametrize(
    "equations",
    [{"x": "-y'", "y": "-y"}, {"x": "sqrt(x)*y'", "y": "-y*exp(x)"}, {"x": "-tan(x)*x'^2/3"}],
)
def test_what_solve_writes_is_valid(equations: dict[str, str]) -> None:
    written = proof_document(dict(solve({"equations": equations})), "identities", 1)
    assert check_document(written)["verdict"] == "valid"


def test_where_there_are_no_identities_nothing_is_proven() -> None:
    assert (
        check_document(json.dumps({"theorems": [], "domain": [], "reason": "none"}))["verdict"]
        == "incomplete"
    )

"""A set of a family of motions is what the certificate beside it proves."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from inverse_service.service.documents import checking_sets, comparison

CERTIFICATE = {
    "question": "autonomous",
    "claim": "variational",
    "kind": "lagrangian",
    "lagrangian": "x'^2/2+y'^2*sqrt(x^2+1)/(2*x')",
    "system": {"equations": {"x": "0"}, "velocities": {"z": "-x*y'"}},
}
PROOF = {"certificate": CERTIFICATE, "equations": {"x": "0", "z": "-x*y'"}, "checked": "valid"}


def judged(leaf: dict[str, Any], proof: dict[str, Any]) -> list[str]:
    """The places of the leaf that do not agree, the certificate itself being proven."""
    wrong = list[str]()
    checked = mock.MagicMock(end=1e9)
    checked.proof.return_value = SimpleNamespace(verdict="valid", reasons=[], exceptions=[])
    checked.agree = lambda at, good, *_: good or wrong.append(at)
    same = SimpleNamespace(verdict="valid", reasons=[])
    with mock.patch.object(comparison, "compared_claim", return_value=same):
        checking_sets._leaf_of_motion(checked, "", leaf, proof, {})
    return wrong


LEAF = {
    "verdict": "variational",
    "verdict_with_time": "variational",
    "lagrangian": {"text": "x'^2/2 + y'^2*sqrt(x^2 + 1)/(2*x')"},
}


def test_an_honest_set_of_motions_agrees_with_its_certificate() -> None:
    assert judged(LEAF, PROOF) == []


@pytest.mark.parametrize(
    ("leaf", "proof", "place"),
    [
        ({"lagrangian": {"text": "x'^2/2"}}, {}, "/lagrangian/text"),
        ({}, {"equations": {"x": "0", "z": "x*y'"}}, "/proof/equations"),
        ({}, {"parameters": ["a"]}, "/proof/parameters"),
        ({}, {"functions": {"V": ["x"]}}, "/proof/functions"),
        ({}, {"checked": "incomplete"}, "/proof/checked"),
    ],
)
def test_a_forged_set_of_motions_does_not(
    leaf: dict[str, Any], proof: dict[str, Any], place: str
) -> None:
    assert judged(LEAF | leaf, PROOF | proof) == [place]

"""A result claims about kinds of Lagrangians only what its certificates prove."""

from __future__ import annotations

import pytest

from inverse_service.certificate import checker
from tests.certificate.documents import Document, check_result, known

SYSTEM = {"coordinates": ["x", "y"], "equations": {"x": "0", "y": "0"}, "parameters": ["a"]}
FLAT = known("kinds: riemannian") | {"system": SYSTEM, "lagrangian": "x'^2/2 + y'^2/2"}
NOT_SHIFTED = known("kinds: no invariant")
TWO: Document = {"among": {"natural": 1, "invariant": [{"x": "1"}]}}


def result_with(**parts: object) -> Document:
    proof = {key: part for key, part in FLAT.items() if key != "among"}
    return {
        "format": "inverse-service/result/1", "system": proof["system"], "verdict": "variational",
        "verdict_with_time": "variational", "certificate": proof, "lagrangian": {"text": "x'^2/2 + y'^2/2"}, **parts,
    }  # fmt: skip


SHOWN = {"verdict": "variational", "certificate": FLAT, "lagrangian": {"text": FLAT["lagrangian"]}}


def test_a_true_answer_about_a_kind_is_valid() -> None:
    assert check_result(result_with(kinds={"riemannian": SHOWN}), seed=1).verdict == "valid"


@pytest.mark.parametrize(
    ("kind", "part"),
    [
        ("natural", SHOWN),
        ("riemannian", SHOWN | {"verdict": "not_variational"}),
        ("riemannian", SHOWN | {"verdict": "undetermined"}),
        ("riemannian", SHOWN | {"certificate": None}),
        ("riemannian", SHOWN | {"lagrangian": {"text": "x'^2/2 - y'^2/2"}}),
        ("riemannian", SHOWN | {"dissipation": {"text": "x'^2"}}),
        ("riemannian", SHOWN | {"certificate": {**FLAT, "among": None}}),
        ("natural", SHOWN | {"certificate": FLAT | TWO}),
        ("natural", {"verdict": "not_variational", "certificate": NOT_SHIFTED | TWO}),
        ("invariant", {"verdict": "not_variational", "certificate": NOT_SHIFTED}),
    ],
)
def test_what_is_said_of_a_kind_is_what_its_certificate_proves(kind: str, part: Document) -> None:
    assert check_result(result_with(kinds={kind: part}), seed=1).verdict != "valid"


def test_a_claim_about_a_kind_proves_no_main_verdict() -> None:
    assert check_result(result_with(certificate=FLAT), seed=1).verdict != "valid"


@pytest.mark.parametrize(
    ("kind", "lagrangian", "verdict"),
    [
        ("natural", "x'^2/2 + y'^2/2", "valid"),
        ("natural", "(1+a^2)*x'^2 + x'*y' + y'^2", "valid"),
        ("natural", "x'^2/2 + y'^2/2 + x'^4", "invalid"),
        ("natural", "x'*y' + x'^2*y'", "invalid"),
        ("natural", "exp(x') + y'^2/2", "invalid"),
        ("riemannian", "(x'^2 + y'^2)^2", "invalid"),
    ],
)
def test_a_natural_lagrangian_is_quadratic_in_the_velocities(
    kind: str, lagrangian: str, verdict: str
) -> None:
    """All of these have the motion of a free particle."""
    claim = FLAT | {"among": kind, "lagrangian": lagrangian}
    plain = {key: part for key, part in claim.items() if key != "among"}
    assert checker.check_certificate(plain, seed=1).verdict == "valid"
    assert checker.check_certificate(claim, seed=1).verdict == verdict

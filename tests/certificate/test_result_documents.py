"""A result is valid only if its verdicts, its system and its Lagrangian are those of its
certificates.
"""

from __future__ import annotations

from typing import Any

import pytest

from tests.certificate.documents import (
    Document,
    changed,
    check_result,
    existence,
    lagrangian,
    nonexistence,
    result,
)

HENON_HEILES = "(x'^2+y'^2)/2 - (x^2+y^2)/2 - x^2*y + y^3/3"
DAMPED = f"exp(t)*({HENON_HEILES})"
TIMED = "time_dependent"


def variational(**content: Any) -> Document:
    content = {"verdict_with_time": "variational", **content}
    return result(
        "henon-heiles", "variational", lagrangian("henon-heiles", HENON_HEILES), **content
    )


def split() -> Document:
    """No L(q, q'), but an L(t, q, q')."""
    timed = {
        "verdict": "variational",
        "certificate": lagrangian("damped-henon-heiles", DAMPED, TIMED),
        "lagrangian": {"text": DAMPED},
    }
    proof = nonexistence("damped-henon-heiles", 2)
    return result(
        "damped-henon-heiles",
        "not_variational",
        proof,
        verdict_with_time="variational",
        with_time=timed,
    )


def refuted(question: str = TIMED) -> Document:
    proof = nonexistence("douglas-IIIb", 2, question)
    return result("douglas-IIIb", "not_variational", proof, verdict_with_time="not_variational")


def verdict(document: Any) -> str:
    found = check_result(document, seed=1)
    return found.verdict


@pytest.mark.slow
@pytest.mark.parametrize("document", [variational(), split(), refuted()])
def test_true_results_are_valid(document: Document) -> None:
    assert verdict(document) == "valid"


def test_existence_and_time_in_f_are_valid_results() -> None:
    proof = existence("van-der-pol", 2, [1, 2], [1, 1, 1])
    assert (
        verdict(result("van-der-pol", "variational", proof, verdict_with_time="variational"))
        == "valid"
    )
    text = "x'^2/2 + 2*x^3 + t*x"
    proof = lagrangian("painleve-I", text, TIMED)
    assert (
        verdict(result("painleve-I", "variational", proof, verdict_with_time="variational"))
        == "valid"
    )
    assert verdict(result("painleve-I", "variational", proof)) == "valid"


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("verdict", "not_variational"), ("verdict", ...), ("verdict", "yes"), ("verdict_with_time", "not_variational"),
        ("verdict_with_time", 1), ("lagrangian", None), ("lagrangian", {}), ("lagrangian", HENON_HEILES),
        ("lagrangian.text", f"2*({HENON_HEILES})"), ("lagrangian.text", "x'^2/2 + y'^2/2"), ("format", ...),
        ("format", "inverse-service/result/2"), ("system.equations.x", "-x-3*x*y"), ("system.parameters", ["a"]),
        ("system.coordinates", ["y", "x"]), ("system.functions", {"A": ["x"]}), ("system", None), ("system", ...),
        ("certificate.system.equations.y", "-y"), ("certificate.system.coordinates", ["y", "x"]),
        ("certificate.claim", "not_variational"), ("certificate.kind", "nonexistence"), ("certificate", []),
        ("certificate.kind", "existence"), ("certificate.lagrangian", ...), ("certificate.question", "both"),
        ("certificate.format", "inverse-service/certificate/3"), ("certificate.near", {"z": "1"}), ("question", "L"),
        ("certificate.near", {"x": "1e555"}), ("certificate.near", []), ("with_time", []),
        ("certificate.question", TIMED),
    ],
)  # fmt: skip
def test_a_change_anywhere_in_a_variational_result_is_invalid(path: str, value: Any) -> None:
    assert verdict(changed(variational(), path, value)) == "invalid"


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("verdict", "variational"), ("verdict_with_time", "not_variational"), ("with_time.verdict", "not_variational"),
        ("with_time.certificate.question", "autonomous"), ("with_time.lagrangian.text", HENON_HEILES),
        ("with_time.lagrangian", None), ("lagrangian", {"text": DAMPED}), ("certificate.question", TIMED),
        ("with_time.certificate.lagrangian", HENON_HEILES), ("question", "L(t, q, q')"), ("certificate.rows", []),
        ("with_time.certificate.system.equations.x", "-x-2*x*y"),
    ],
)  # fmt: skip
def test_a_change_anywhere_in_a_split_result_is_invalid(path: str, value: Any) -> None:
    assert verdict(changed(split(), path, value)) == "invalid"


def test_swapped_certificates_are_invalid() -> None:
    document = split()
    swapped = changed(document, "certificate", document["with_time"]["certificate"])
    assert verdict(swapped) == "invalid"
    assert (
        verdict(changed(refuted(), "certificate", nonexistence("damped-henon-heiles", 2)))
        == "invalid"
    )


def test_verdicts_without_proof_are_incomplete() -> None:
    assert verdict(changed(variational(), "certificate", None)) == "invalid"  # L without a proof
    assert verdict(changed(split(), "with_time", None)) == "incomplete"
    assert verdict(changed(split(), "with_time.certificate", ...)) == "invalid"
    assert verdict(refuted("autonomous")) == "incomplete"
    assert verdict(result("douglas-IIIb", "undetermined", None)) == "incomplete"
    assert verdict(changed(split(), "verdict_with_time", None)) == "invalid"


def test_one_certificate_covers_both_answers_only_one_way() -> None:
    """A yes without t is a yes with t, a no with t is a no without t, and never the other way
    round.
    """
    timed = result("henon-heiles", "variational", lagrangian("henon-heiles", HENON_HEILES, TIMED))
    assert verdict(timed) == "invalid"
    assert verdict({**timed, "question": "L(t, q, q')"}) == "valid"
    assert verdict(changed(refuted(), "verdict_with_time", None)) == "valid"


def test_an_undetermined_answer_hides_no_false_one() -> None:
    document = changed(split(), "certificate", None) | {"verdict": "undetermined"}
    assert verdict(document) == "incomplete"
    assert verdict(changed(document, "with_time.lagrangian.text", "x'^2")) == "invalid"
    wrong = changed(document, "with_time.certificate.lagrangian", HENON_HEILES)
    assert verdict(changed(wrong, "with_time.lagrangian.text", HENON_HEILES)) == "invalid"

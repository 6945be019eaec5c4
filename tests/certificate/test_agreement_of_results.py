"""Where the parts of a result disagree it is refused: for each condition a result that it alone refuses."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.certificate.checker import check_result
from tests.certificate.documents import Document, existence, lagrangian, nonexistence, result
from tests.certificate.test_forged_motions import ALL_FREE, FREE, SLEIGH, claim, no
from tests.certificate.test_known_attacks import of_lagrangian, result_of
from tests.certificate.test_result_documents import HENON_HEILES, split, variational

TIMED = "time_dependent"
FREE_L = "x'^2/2 + y'^2/2 + z'^2/2"
HEISENBERG = {"coordinates": ["x", "y", "z"], "equations": {"x": "0", "y": "0"}, "velocities": {"z": "y*x' - x*y'"}}
EXISTENCE: Document = {"kind": "existence", "bivectors": 10, "order": 1, "degree": 1, "dimensions": [6, 21],
                       "symbol": {"dimension": 15, "prolonged": 28, "characters": [6, 5, 4, 0]}}  # fmt: skip


def verdict(document: Document) -> str:
    return check_result(document, seed=1).verdict


# --- branches
def test_the_first_branch_says_what_the_main_fields_say() -> None:
    first = {"domain": ["x > 0"], "verdict": "variational"}
    assert verdict(variational(branches=[{"verdict": "variational"}])) == "valid"
    assert verdict(variational(branches=[first])) == "invalid"
    assert verdict(variational(branches=[{"verdict": "not_variational"}])) == "invalid"


@pytest.mark.parametrize("branch", [5, "x", None, [], [["verdict", "variational"]]])
def test_a_branch_that_is_no_object_is_refused(branch: Any) -> None:
    assert verdict(variational(branches=[{}, branch])) == "invalid"


# --- a certificate proves what its own kind of claim proves
def test_a_lagrangian_in_a_proof_of_existence_is_not_proven() -> None:
    proof = existence("van-der-pol", 2, [1, 2], [1, 1, 1])
    honest = result("van-der-pol", "variational", proof, verdict_with_time="variational")
    assert verdict(honest) == "valid"
    more = {"certificate": proof | {"lagrangian": "x'^2/2"}, "lagrangian": {"text": "x'^2/2"}}
    assert verdict(honest | more) == "invalid"


# --- domains
def domains(of_answer: object, of_lagrangian: object, *conditions: str) -> Document:
    proof = lagrangian("henon-heiles", HENON_HEILES, conditions=list(conditions))
    shown = {"text": HENON_HEILES} | ({} if of_lagrangian is None else {"domain": of_lagrangian})
    more = {} if of_answer is None else {"domain": of_answer}
    return result("henon-heiles", "variational", proof) | {"lagrangian": shown} | more


def test_each_domain_of_an_answer_is_that_of_its_certificate() -> None:
    there = ["x > 0"]
    assert verdict(domains(there, there, *there)) == "valid"
    assert verdict(domains(there, None, *there)) == "valid"
    assert verdict(domains(None, None)) == "valid"
    assert verdict(domains([], ["x != 0"])) == "valid"
    assert verdict(domains([], there)) == "invalid"
    assert verdict(domains(there, [], *there)) == "invalid"
    assert verdict(domains(there, there)) == "invalid"
    assert verdict(domains(None, there, *there)) == "invalid"
    assert verdict(domains(there, there, "x > 1")) == "invalid"


# --- what there is instead
def test_an_l_with_time_instead_is_about_time() -> None:
    later = split()["with_time"]
    instead = {"kind": "time", "lagrangian": later["lagrangian"], "certificate": later["certificate"]}
    assert verdict(split() | {"instead": instead}) == "valid"
    assert verdict(split() | {"instead": instead | {"lagrangian": {"text": "x'^2"}}}) == "invalid"
    asked = instead["certificate"] | {"question": "autonomous"}
    assert verdict(split() | {"instead": instead | {"certificate": asked}}) == "invalid"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["parameters", "reduced"])
def test_what_holds_instead_for_another_system_is_not_compared_with_this_one(kind: str) -> None:
    other = {"kind": kind, "lagrangian": {"text": "z'^2"}, "certificate": lagrangian("free", "x'^2")}
    assert verdict(split() | {"instead": other}) == "valid"
    assert verdict(split() | {"instead": other | {"kind": "time"}}) == "invalid"


# --- motions on constraints
def motion(proof: Document | None, later: Document | None = None, **more: Any) -> Document:
    """A result about the first of the associated systems, undetermined, and about all of them."""
    one, two = ((part or {}).get("claim", "undetermined") for part in (proof, later or proof))
    shown = {"lagrangian": {"text": (proof or {})["lagrangian"]}} if "lagrangian" in (proof or {}) else {}
    found = {"verdict": one, "verdict_with_time": two, "certificate": proof, "certificate_with_time": later, **shown}
    system = {"coordinates": ["x", "y"], "equations": {"x": "0", "y": "0"}, "given": {"motion": {}}}
    return {"format": "inverse-service/result/1", "system": system, "verdict": "undetermined",
            "any_associated": found, **more}  # fmt: skip


def among(document: Document, **more: Any) -> Document:
    return document | {"any_associated": document["any_associated"] | more}


def test_the_answer_about_a_motion_alone_makes_a_result_valid_where_only_it_was_asked_for() -> None:
    right = motion(claim(FREE, FREE_L))
    for later in ({}, {"verdict_with_time": "undetermined"}, {"verdict_with_time": None}):
        assert verdict(right | later) == "valid"
    for given in ({"motion": {}}, {"associated": "any"}, {"motion": {}, "associated": "any"}):
        assert verdict(right | {"system": right["system"] | {"given": given}}) == "valid"
    for given in ({}, {"associated": "first"}, "motion", None):
        assert verdict(right | {"system": right["system"] | {"given": given}}) == "incomplete"
    assert verdict(right | {"verdict_with_time": "variational"}) == "incomplete"
    assert verdict(right | {"any_associated": None}) == "incomplete"


def test_a_lagrangian_of_a_motion_is_that_of_its_certificate() -> None:
    right = motion(claim(FREE, FREE_L))
    assert verdict(among(right, lagrangian={"text": "x'^2/2"})) == "invalid"
    assert verdict(among(right, lagrangian=None)) == "invalid"
    there = claim(HEISENBERG, **EXISTENCE)
    assert verdict(motion(there)) == "valid"
    assert verdict(motion(there | {"lagrangian": FREE_L})) == "invalid"


def test_each_certificate_of_a_motion_proves_one_of_its_verdicts() -> None:
    yes, refused = claim(FREE, FREE_L), no(SLEIGH, 2, ALL_FREE)
    assert verdict(motion(yes, claim(FREE, FREE_L, question=TIMED))) == "valid"
    assert verdict(among(motion(yes), certificate_with_time=refused)) == "invalid"
    unused = among(motion(yes), verdict="undetermined", verdict_with_time="undetermined")
    assert verdict(unused) == "invalid"


def test_an_l_with_time_proves_a_motion_to_have_one_only_where_that_is_asked() -> None:
    timed = motion(claim(FREE, FREE_L, question=TIMED))
    assert verdict(timed) == "invalid"
    asked = {"given": {"motion": {}, "time_dependent_lagrangian": True}}
    assert verdict(timed | {"system": timed["system"] | asked}) == "valid"
    for other in (False, 1, "true", None):
        asked = {"given": {"motion": {}, "time_dependent_lagrangian": other}}
        assert verdict(timed | {"system": timed["system"] | asked}) == "invalid"
    assert verdict(timed | {"question": "L(t, q, q')"}) == "valid"


def test_a_motion_with_time_in_it_is_asked_about_l_with_time() -> None:
    system = {"coordinates": ["x", "y"], "equations": {"x": "0"}, "velocities": {"y": "t"}}
    proof = claim(system, "x'^2/2 + (y' - t)^2/2", question=TIMED)
    assert verdict(motion(proof)) == "valid"


def test_no_l_without_time_does_not_refuse_one_with_time() -> None:
    refused = nonexistence("damped-henon-heiles", 2)
    assert verdict(result("damped-henon-heiles", "not_variational", refused)) == "valid"
    both = {"verdict_with_time": "not_variational"}
    assert verdict(result("damped-henon-heiles", "not_variational", refused, **both)) == "incomplete"


def test_an_answer_about_a_kind_leaves_its_domain_to_the_one_around_it() -> None:
    natural = of_lagrangian("0", "0", "x'^2 + y'^2", among="natural", conditions=["x > 0"], near={"x": "1"})
    kinds = {"natural": {"verdict": "variational", "certificate": natural, "lagrangian": {"text": "x'^2 + y'^2"}}}
    for conditions, expected in (["x > 0"], "valid"), (["x > -1"], "invalid"), ([], "invalid"):
        main = of_lagrangian("0", "0", "x'^2 + y'^2", conditions=conditions, near={"x": "1"})
        whole = result_of(main) | {"verdict_with_time": "variational", "domain": conditions, "kinds": kinds}
        assert verdict(whole) == expected

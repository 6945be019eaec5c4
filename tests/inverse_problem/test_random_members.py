"""Each member of a family, decided alone, has the verdicts of the leaf that holds it."""

from __future__ import annotations

import functools
import json
from typing import Any

import pytest

import inverse_service
from benchmarks import random_members
from benchmarks.members_of_families import FAMILIES
from inverse_service.certificate import checker
from inverse_service.solving import members

QUICK = ["10b reduced particle, V(x)", "14 spring, A(x, y) y'"]
YES, NO = "variational", "not_variational"


@functools.cache
def text_of(key: str) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(members, "SEARCH_SECONDS", 0.0)
        asked = FAMILIES[key] | {"family": True, "first_integrals": False}
        return inverse_service.solve(asked).to_json()


def family_of(key: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(text_of(key))["family"]
    return found


def is_held(key: str, family: dict[str, Any], count: int) -> None:
    found = random_members.compared(FAMILIES[key], family, count)
    assert not found.wrong
    assert sum(found.on.values()) >= count
    assert set(found.on) & {*range(1, len(family["leaves"]))} or len(family["leaves"]) == 1


@pytest.mark.parametrize("key", QUICK)
def test_members_have_the_verdicts_of_their_leaf(key: str) -> None:
    family = family_of(key)
    assert family["covered"]
    is_held(key, family, 4)
    for _, false in false_claims(family):
        assert checker.check_certificate(false).verdict != "valid"


def test_a_wrong_leaf_is_found() -> None:
    """Leaves with the other verdict."""
    family = family_of(QUICK[0])
    for leaf in family["leaves"]:
        leaf["verdict"] = NO if leaf["verdict"] == YES else YES
    assert random_members.compared(FAMILIES[QUICK[0]], family, 3).wrong


def false_claims(family: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The certificate with each leaf left out, without one of its equations, or with another
    verdict, and without a proof; all of these are false or not proven.
    """
    found, text = list[tuple[str, dict[str, Any]]](), json.dumps(family["certificate"])
    root = family["certificate"]["leaves"][0]

    def twin(name: str) -> dict[str, Any]:
        found.append((name, json.loads(text)))
        return found[-1][1]

    for number, leaf in enumerate(family["certificate"]["leaves"]):
        for key in ("autonomous", "time_dependent"):
            if leaf[key] is not None:
                one = twin(f"another verdict of leaf {number}")["leaves"][number]
                one[key] = NO if leaf[key] == YES else YES
        if not number or leaf["autonomous"] == root["autonomous"] or leaf["nonzero"]:
            continue
        if not family["leaves"][number]["exceptions"]:
            twin(f"no leaf {number}")["leaves"].pop(number)
        for place in range(len(leaf["equations"])):
            twin(f"leaf {number} too large")["leaves"][number]["equations"].pop(place)
    twin("no proof")["cells"][0]["proofs"] = []
    return found


@pytest.mark.slow
@pytest.mark.parametrize("key", list(FAMILIES))
def test_members_of_all_families(key: str) -> None:
    family = family_of(key)
    is_held(key, family, 8)
    for name, false in false_claims(family) if family["covered"] else ():
        assert checker.check_certificate(false).verdict != "valid", name

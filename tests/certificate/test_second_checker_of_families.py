"""The second checker agrees with certificates about families, and refuses false claims whose members
it draws.
"""

from __future__ import annotations

import json
import random

import pytest

import inverse_service
from benchmarks.members_of_families import FAMILIES
from tests import second_checker_of_families as second
from tests.certificate.test_families import (
    Certificate,
    forgeries,
    oscillators,
    reduced_particle,
    springs,
)
from tests.certificate.test_families_of_motions import FORGED, tilted

# V = sqrt(1 + x^2) is never drawn, and of members in the same cells only the first three are asked.
NOT_DRAWN = {"no cell 3", "no leaf of V", "a sign in the equation", "V'' = 0 for V' = 0"}


@pytest.mark.parametrize("certificate", [springs(), oscillators(), reduced_particle()])
def test_it_agrees_with_conditions_derived_by_hand(certificate: Certificate) -> None:
    random.seed(1)
    verdict, said = second.check(certificate, 60)
    assert verdict == "agrees", said


@pytest.mark.parametrize(
    "name",
    ["verdict of leaf 1", "leaf 2 too large", "a slope that is wrong", "no proof", "no rows"],
)
def test_it_refuses_a_false_claim(name: str) -> None:
    random.seed(1)
    assert second.check(dict(forgeries())[name], 60)[0] != "agrees"


@pytest.mark.slow
def test_it_refuses_all_false_claims_whose_members_it_draws() -> None:
    random.seed(1)
    found = {name for name, certificate in forgeries() if second.check(certificate)[0] == "agrees"}
    assert found <= NOT_DRAWN


@pytest.mark.slow
@pytest.mark.parametrize(
    "key",
    ["2 springs and damping", "13 a(x) y', b(x) x'", "17 gains k, l, m", "24 Lienard, coupled"],
)
def test_it_agrees_with_certificates_of_the_solver(key: str) -> None:
    random.seed(1)
    result = inverse_service.solve(FAMILIES[key] | {"family": True, "first_integrals": False})
    certificate = json.loads(result.to_json())["family"]["certificate"]
    verdict, said = second.check(certificate)
    assert verdict == "agrees", said


@pytest.mark.slow
def test_it_agrees_about_motions_of_a_knife_edge() -> None:
    random.seed(1)
    verdict, said = second.check(tilted(), 12)
    assert verdict == "agrees", said
    assert "leaf 0: 3" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "no open set",
        "smaller open set",
        "a yes",
        "a yes in the leaf",
        "one row less",
        "a free edge",
    ],
)
def test_it_refuses_a_false_claim_about_motions(name: str) -> None:
    random.seed(1)
    assert second.check(dict(FORGED)[name], 30)[0] != "agrees"

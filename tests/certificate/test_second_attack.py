"""Forgeries of a second attack, each with a new method; none is valid."""

from __future__ import annotations

import pytest

from inverse_service import check
from tests.certificate.documents import Document, all_rows, check_result
from tests.certificate.test_known_attacks import certificate, of_lagrangian, result_of

FLAT = "x'^2/2+y'^2/2"


# --- results
FRICTION = {
    "x": "-x-2*x*y-x'",
    "y": "-y-x^2+y^2-y'",
}  # Henon and Heiles with friction: no L, but one with D
NONE = certificate(FRICTION, "nonexistence", order=2, rows=all_rows(2, 4, 2))


@pytest.mark.parametrize(
    "kind", ["rayleigh", "rayleigh_general", "time", "parameters", "spherical", ""]
)
def test_none_without_friction_says_nothing_of_friction_or_of_no_kind(kind: str) -> None:
    result = result_of(NONE) | {
        "kinds": {"natural": {"verdict": "not_variational", "certificate": NONE}}
    }
    assert check_result(result).verdict == "valid"
    forged = result | {"kinds": {kind: result["kinds"]["natural"]}}
    assert check_result(forged).verdict == "invalid"
    assert check(forged, {"equations": FRICTION, "kinds": ["rayleigh"]})["verdict"] == "invalid"


YES = of_lagrangian("0", "0", FLAT)
MAIN = result_of(YES) | {"verdict_with_time": "variational"}


@pytest.mark.parametrize(
    "branch",
    [
        {},
        {"verdict": "not_variational"},
        {"verdict": "not_variational", "certificate": NONE},
        {"verdict": "variational", "certificate": YES, "lagrangian": {"text": "x'^2"}},
        {"verdict": "undetermined"},
    ],
)
def test_every_branch_is_looked_at(branch: Document) -> None:
    first = {
        key: MAIN[key] for key in ("verdict", "certificate", "lagrangian", "verdict_with_time")
    }
    assert check_result(MAIN | {"branches": [first]}).verdict == "valid"
    assert (
        check_result(MAIN | {"branches": [first, branch | {"domain": ["x > 0"]}]}).verdict
        != "valid"
    )


@pytest.mark.slow
@pytest.mark.parametrize("border", ["10^9", "10^15", "1000^7"])
def test_a_border_far_away_is_part_of_the_domain(border: str) -> None:
    """On x < -border the system is not variational, so `domain` must include the border."""
    u = f"(x+{border})"
    forces = {"x": f"sqrt({u}^2)*y'-y^2", "y": f"-{u}*x'-2*x*y"}
    lagrangian = f"x'^2/2+y'^2/2-x*y^2+{u}^2*y'/2"
    root = {"root": f"sqrt({u}^2)", "is": f"x+{border}"}
    proof = of_lagrangian(forces["x"], forces["y"], lagrangian, roots=[root], near={"x": "1"})
    stated = proof | {"conditions": [f"x > -{border}"]}
    assert check_result(result_of(stated) | {"domain": stated["conditions"]}).verdict == "valid"
    for seed in range(4):
        assert check_result(result_of(proof) | {"domain": []}, seed=seed).verdict != "valid"


def test_an_inequality_hides_behind_no_other() -> None:
    assert check_result(MAIN | {"domain": ["x != 0"]}).verdict == "valid"
    assert check_result(MAIN | {"domain": ["x > 5 != 0"]}).verdict != "valid"

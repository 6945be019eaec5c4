"""Forgeries of a third attack, next to true documents: none of the forgeries is valid or makes the
checker raise.
"""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import Document, changed, check_result, claim, existence, motion
from tests.certificate.test_brackets_along_a_solution import HEAD, SLEIGH
from tests.certificate.test_forged_motions import AT_SOME_TIME, MAIN
from tests.certificate.test_known_attacks import of_lagrangian, result_of

FLAT = "x'^2/2 + y'^2/2"


@pytest.mark.parametrize(
    ("slope", "expected"),
    [("y'^2", "invalid"), ("0*y'", "invalid"), ("z'", "invalid"), ("t^2", "valid")],
)
def test_an_integral_of_a_dependent_velocity_is_not_a_function_of_time(
    slope: str, expected: str
) -> None:
    """With F' = y'^2 along y' = x'^2 there seems to be an L with 2 x'^2 y + F(t); F would depend on
    the solution.
    """
    integrals = {"F": {"arguments": ["t"], "derivatives": {"t": slope}}}
    if slope == "y'^2":
        system, lagrangian = (
            motion({"x": "-4*x'^3/(4*y + 1)"}, {"y": "x'^2"}),
            "x'^2/2 + 2*x'^2*y + (y' - x'^2)^2/2",
        )
    else:
        system, lagrangian = motion({"x": "0"}, {"y": "x'^2"}), "x'^2/2 + (y' - x'^2)^2/2"
    document = claim(system, f"{lagrangian} + F(t)", question="time_dependent", integrals=integrals)
    assert check_certificate(document, seed=1).verdict == expected


def with_series(document: Document, terms: list[Any], *names: str) -> Document:
    return document | {
        "series": {"order": 1, "point": dict.fromkeys(names, "3"), "prime": None, "terms": terms}
    }


@pytest.mark.parametrize("among", ["natural", "riemannian"])
def test_the_series_of_a_kind_solves_the_rows_of_the_kind(among: str) -> None:
    document = existence("free", 1, [1, 1], [0, 0], among=among)
    for terms, verdict in (([[[0, 2], "1"]], "valid"), ([[[0, 2], "1"], [[0, 3], "1"]], "invalid")):
        assert check_certificate(with_series(document, terms, "x", "x'"), seed=1).verdict == verdict


def test_the_series_of_a_definite_multiplier_is_at_its_own_point() -> None:
    """For x'' = x x': x' dg/dx + x x' dg/dx' + x g = 0 at first order, at x = 3, x' = 2, and not at
    `near`.
    """
    near = dict.fromkeys(("t", "x", "x'"), "1")
    definite = existence(
        "oscillator", 2, [1, 2], [1, 1, 1], among="positive_definite", near=near, multiplier=[["1"]]
    )
    document = changed(definite, "system.equations.x", "x*x'")
    for slope, verdict in (("-3/2", "valid"), ("-1", "invalid")):
        with_point = with_series(document, [[[0, 2], "1"], [[1, 2], slope]], "x", "x'")
        with_point["series"]["point"]["x'"] = "2"
        assert check_certificate(with_point, seed=1).verdict == verdict


def test_the_series_of_a_motion_is_not_compared() -> None:
    """A series cannot contain the multipliers lambda."""
    parts = {"dimension": 15, "prolonged": 28, "characters": [6, 5, 4]}
    system = motion({"x": "0", "y": "0"}, {"z": "y*x' - x*y'"})
    document = claim(
        system, kind="existence", bivectors=10, order=1, degree=1, dimensions=[6, 21], symbol=parts
    )
    found = check_certificate(
        with_series(document, [[[0, 0, 0, 2, 0], "1"]], "x", "y", "z", "x'", "y'"), seed=1
    )
    assert found.verdict == "valid"
    assert "was not compared" in found.reasons[0]


# --- results
YES = of_lagrangian("0", "0", FLAT)
WHOLE = result_of(YES) | {"verdict_with_time": "variational"}


def test_a_branch_is_about_the_system_of_the_result() -> None:
    other = of_lagrangian("-x", "-y", f"{FLAT} - x^2/2 - y^2/2")
    first = {
        key: WHOLE[key] for key in ("verdict", "certificate", "lagrangian", "verdict_with_time")
    }
    assert check_result(WHOLE | {"branches": [first]}, seed=1).verdict == "valid"
    branch = result_of(other) | {"verdict_with_time": "variational"}
    assert check_result(WHOLE | {"branches": [first, branch]}, seed=1).verdict == "invalid"


@pytest.mark.parametrize("shown", ["lagrangian", "dissipation"])
def test_what_is_undetermined_of_a_kind_shows_no_formula(shown: str) -> None:
    kinds: Document = {"natural": {"verdict": "undetermined"}}
    assert check_result(WHOLE | {"kinds": kinds}, seed=1).verdict == "valid"
    kinds["natural"][shown] = {"text": "x^9"}
    assert check_result(WHOLE | {"kinds": kinds}, seed=1).verdict == "invalid"


def test_the_two_answers_about_a_motion_are_about_one() -> None:
    none = HEAD | {"system": SLEIGH, "along": 6}
    other = {"verdict": "not_variational", "verdict_with_time": "variational", "certificate": none,
             "certificate_with_time": AT_SOME_TIME, "lagrangian": {"text": AT_SOME_TIME["lagrangian"]}}  # fmt: skip
    assert check_result(MAIN | {"any_associated": other}, seed=1).verdict == "invalid"
    same = other | {
        "verdict_with_time": "not_variational",
        "certificate_with_time": None,
        "lagrangian": None,
    }
    timed = none | {"question": "time_dependent"}
    assert (
        check_result(MAIN | {"any_associated": same | {"certificate": timed}}, seed=1).verdict
        == "valid"
    )


@pytest.mark.parametrize("part", [{"kinds": 10**30}, {"kinds": "natural"}, {"certificate": YES | {"conditions": 7}},
                                  {"certificate": YES | {"conditions": [1.5]}, "domain": ["x > 0"]}])  # fmt: skip
def test_a_result_of_another_shape_is_invalid_and_no_error(part: Document) -> None:
    assert check_result(WHOLE | part, seed=1).verdict == "invalid"

"""A result claims about a motion on constraints only what its certificates prove."""

from __future__ import annotations

import pytest

from inverse_service.service.documents import checking
from tests.certificate.documents import Document, check_result, known

BLADE, LATER = known("motions: the knife edge"), known("motions: time in the constraint")
FREE = known("motions: free particles on a plane")
YES = FREE | {"system": {"coordinates": ["x"], "equations": {"x": "0"}}, "lagrangian": "x'^2/2"}
MAIN = {
    "format": "inverse-service/result/1", "system": YES["system"], "verdict": "variational", "certificate": YES,
    "verdict_with_time": "variational", "lagrangian": {"text": "x'^2/2"},
}  # fmt: skip
SHOWN = {"verdict": "variational", "verdict_with_time": "variational", "certificate": BLADE,
         "lagrangian": {"text": BLADE["lagrangian"]}}  # fmt: skip
AT_SOME_TIME = FREE | {"question": "time_dependent"}


def test_a_true_answer_about_a_motion_is_valid() -> None:
    found = checking.check_plain(MAIN | {"any_associated": SHOWN})
    assert (found["verdict"], "that has this motion" in found["statement"]["text"]) == (
        "valid",
        True,
    )


@pytest.mark.parametrize(
    "part",
    [
        SHOWN | {"verdict": "not_variational"},
        SHOWN | {"verdict_with_time": "not_variational"},
        SHOWN | {"certificate": None},
        SHOWN | {"certificate": YES, "lagrangian": {"text": "x'^2/2"}},
        SHOWN | {"lagrangian": {"text": BLADE["lagrangian"] + " + x^2"}},
        SHOWN | {"lagrangian": {"text": 3}},
        SHOWN
        | {"certificate": AT_SOME_TIME, "verdict_with_time": "undetermined", "lagrangian": None},
        SHOWN | {"certificate": LATER | {"question": "autonomous"}, "lagrangian": None},
    ],
)
def test_what_is_said_of_a_motion_is_what_its_certificate_proves(part: Document) -> None:
    assert check_result(MAIN | {"any_associated": part}, seed=1).verdict != "valid"


def test_a_claim_about_a_motion_proves_no_main_verdict() -> None:
    whole = MAIN | {
        "system": BLADE["system"],
        "certificate": BLADE,
        "lagrangian": {"text": BLADE["lagrangian"]},
    }
    assert check_result(whole, seed=1).verdict != "valid"
    assert check_result(MAIN | {"certificate": BLADE}, seed=1).verdict != "valid"

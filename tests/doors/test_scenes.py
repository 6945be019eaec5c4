"""Scenes of the corpus: what means nothing is refused at its place, by Python and over HTTP; no method completes a hard
motion with a wrong trajectory."""

from __future__ import annotations

import json

import httpx
import pytest

import inverse_service
from tests.doors import calls
from tests.doors.rows import Row, rows
from tests.doors.test_readings import fault_of_refusal

SCENES = rows("scenes")


@pytest.mark.parametrize("row", SCENES, ids=lambda row: row["id"])
def test_a_scene_without_meaning_is_refused_at_its_place(row: Row) -> None:
    with pytest.raises(inverse_service.InputError) as refused:
        inverse_service.simulate(row["scene"])
    error = refused.value
    assert fault_of_refusal(row["refused"], calls.Refusal(error.detail, error.pointer, error.column, ())) is None


def test_the_service_refuses_the_same(service: str) -> None:
    for row in SCENES[::6]:
        answer = httpx.post(f"{service}/v1/simulate", content=json.dumps(row["scene"]), headers=calls.JSON, timeout=60)
        assert answer.status_code == 422, row["id"]
        assert fault_of_refusal(row["refused"], calls.refusal(answer)) is None, row["id"]


@pytest.mark.parametrize("scene", [None, [], "disk", 3, {}])
def test_what_is_no_scene_is_refused(scene: object) -> None:
    with pytest.raises(inverse_service.InputError):
        inverse_service.simulate(scene)  # type: ignore[arg-type]


@pytest.mark.parametrize("row", rows("motions"), ids=lambda row: row["id"])
def test_no_method_completes_a_hard_motion_with_a_wrong_trajectory(row: Row) -> None:
    """To the end without a doubt: within the error that is given, or a tenth of the motion's size."""
    right, final = dict(row.get("right", {})), row["final"]
    for method in inverse_service.simulate(row["scene"])["methods"]:
        if method["outcome"] == "completed" and not method.get("doubt"):
            assert final is not None, method["label"]
            apart = max(abs(method["final"]["positions"][name] - value) for name, value in final.items())
            assert apart <= row["size"] * right.pop(method["label"], 0.1), method["label"]
    assert not right  # these get to the end

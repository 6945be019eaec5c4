"""Scenes of the corpus are rejected or end as their rows say; no completed run has a wrong
trajectory.
"""

import json
from typing import Any

import httpx
import pytest

import inverse_service
from tests.doors import calls
from tests.doors.rows import Row, marks, rows
from tests.doors.test_readings import fault_of_refusal

SCENES = rows("scenes")


@pytest.mark.parametrize("row", SCENES, ids=lambda row: row["id"])
def test_a_scene_without_meaning_is_refused_at_its_place(row: Row) -> None:
    with pytest.raises(inverse_service.InputError) as refused:
        inverse_service.simulate(row["scene"])
    error = refused.value
    assert (
        fault_of_refusal(
            row["refused"], calls.Refusal(error.detail, error.pointer, error.column, ())
        )
        is None
    )


def test_the_service_refuses_the_same(service: str) -> None:
    for row in SCENES[::6]:
        answer = httpx.post(
            f"{service}/v1/simulate",
            content=json.dumps(row["scene"]),
            headers=calls.JSON,
            timeout=60,
        )
        assert answer.status_code == 422, row["id"]
        assert fault_of_refusal(row["refused"], calls.refusal(answer)) is None, row["id"]


@pytest.mark.parametrize("scene", [None, [], "disk", 3, {}])
def test_an_object_that_is_not_a_scene_is_rejected(scene: object) -> None:
    with pytest.raises(inverse_service.InputError):
        inverse_service.simulate(scene)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "row", [pytest.param(row, id=row["id"], marks=marks(row)) for row in rows("motions")]
)
def test_no_method_completes_a_hard_motion_with_a_wrong_trajectory(row: Row) -> None:
    """A run completed without a `doubt` is within the given error, or a tenth of the motion's
    size.
    """
    right, final = dict(row.get("right", {})), row["final"]
    for method in inverse_service.simulate(row["scene"])["methods"]:
        if method["outcome"] == "completed" and not method.get("doubt"):
            assert final is not None, method["label"]
            apart = max(
                abs(method["final"]["positions"][name] - value) for name, value in final.items()
            )
            assert apart <= row["size"] * right.pop(method["label"], 0.1), method["label"]
    assert not right  # these reach the end


@pytest.mark.parametrize(
    "row", [pytest.param(row, id=row["id"], marks=marks(row)) for row in rows("ends")]
)
def test_each_run_ends_as_its_row_says(row: Row) -> None:
    found = [
        one
        for one in inverse_service.simulate(row["scene"])["methods"]
        if one["outcome"] != "unavailable"
    ]
    for method in found:
        assert_end(row, method)


def assert_end(row: Row, method: dict[str, Any]) -> None:
    """Outcomes and words by the label of the method, or by * for all others; numbers as [value,
    tolerance].
    """
    label, outcome, stopped = method["label"], method["outcome"], method.get("stopped") or {}
    outcomes = row.get("outcomes", {})
    wanted = outcomes.get(label, outcomes.get("*", outcome))
    assert outcome in ([wanted] if isinstance(wanted, str) else wanted), label
    assert outcome != row.get("never"), label
    says = row.get("says", {})
    assert says.get(label, says.get("*", "")) in stopped.get("quantity", ""), label
    assert "silent" not in row or row["silent"] not in stopped["remedy"], label
    for key, bound in row.get("bounds", {}).items():
        assert method[key] < bound, (label, key)
    if "stopped" in row:
        assert abs(stopped["time"] - row["stopped"][0]) <= row["stopped"][1], label
    final = method.get("final") or {"t": 0}
    assert final["t"] < row.get("before", float("inf")), label
    for name, (value, tolerance) in row.get("final", {}).items() if outcome == "completed" else ():
        part = "velocities" if name.endswith("'") else "positions"
        assert abs(final[part][name.removesuffix("'")] - value) <= tolerance, (label, name)

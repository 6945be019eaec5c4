"""Scenes over HTTP."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

SCENES = Path(__file__).parents[2] / "docs" / "scenes"
PATIENT = {"Prefer": "wait=20"}


@pytest.fixture(scope="module")
def client(service: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=service, timeout=60) as client:
        yield client


def scene(**changes: Any) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((SCENES / "disk.json").read_text()) | changes
    return found


def answer(client: httpx.Client, call: str, document: dict[str, Any]) -> httpx.Response:
    """The answer, also where it took longer than the call waits."""
    response = client.post(call, json=document, headers=PATIENT)
    for _ in range(20):
        if response.status_code != 202:
            break
        response = client.post(call, json=document, headers=PATIENT)
    return response


def test_a_scene_is_simulated(client: httpx.Client) -> None:
    response = answer(client, "/v1/simulate", scene(steps=60, methods=["nonholonomic", "exact"]))
    assert response.status_code == 200, response.text
    methods = {method["label"]: method for method in response.json()["methods"]}
    assert methods["nonholonomic-0.5"]["outcome"] == "completed"
    assert len(methods["exact"]["points"]["columns"]["t"]) == 61


@pytest.mark.parametrize(("changes", "pointer"), [
    ({"steps": 0}, "/steps"), ({"colour": 1}, "/colour"), ({"parameters": {}}, "/parameters"),
    ({"step": "exp(1000)"}, "/step"), ({"system": {"catalogue": "none"}}, "/system/catalogue"),
])  # fmt: skip
def test_bad_scenes_are_problem_documents(client: httpx.Client, changes: dict[str, Any], pointer: str) -> None:
    response = answer(client, "/v1/simulate", scene(**changes))
    assert response.status_code == 422, response.text
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["errors"][0]["pointer"] == pointer


def test_work_precision_is_measured(client: httpx.Client) -> None:
    document = scene(steps=20, methods=["nonholonomic"], repeats=1)
    response = answer(client, "/v1/work-precision", document)
    assert response.status_code == 200, response.text
    assert response.json()["methods"][0]["measured_order"] == pytest.approx(2, abs=0.1)


def test_the_scene_is_described(client: httpx.Client) -> None:
    description = client.get("/openapi.json").json()
    assert "/v1/simulate" in description["paths"]
    assert "SceneDocument" in description["components"]["schemas"]

"""Scenes over HTTP."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.simulation.cards import CARDS, Card, judge

SCENES = Path(__file__).parents[2] / "docs" / "scenes"
PATIENT = {"Prefer": "wait=20"}


def scene(**changes: Any) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((SCENES / "disk.json").read_text()) | changes
    return found


def answer(client: httpx.Client, call: str, document: dict[str, Any]) -> httpx.Response:
    """The result, even if it takes longer than the call waits."""
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


def test_files_of_the_page_hold_every_recorded_step(client: httpx.Client) -> None:
    """The JSON has at most 2,001 points; CSV and NPZ have all, with velocities and momenta."""
    document = scene(steps=5000, methods=["exact", "nonholonomic"])
    response = answer(client, "/v1/simulate", document)
    (method,) = (one for one in response.json()["methods"] if one["label"] == "nonholonomic-0.5")
    assert method["points"]["every"] == 3
    later = client.post("/v1/simulate", json=document, headers={"Prefer": "respond-async"})
    address = later.headers["location"].replace("/v1/jobs", "/results")
    page = client.get(address).text
    assert "CSV and NPZ hold" in page
    # The page shows the cost of accuracy next to it.
    assert re.search(r'<td class="number">[\d.]+ (\u00b5s|ms|s)</td><td><a href="[^"]*csv"', page)
    assert client.get(f"{address}/table.csv").text.startswith("method,outcome,steps,")
    rows = client.get(f"{address}/data/nonholonomic-0.5.csv").text.splitlines()
    assert rows[0].startswith("t,phi,theta,x,y,v_phi,v_theta,v_x,v_y,p_phi")
    assert len(rows) == 5002
    t, x = (method["points"]["columns"][name][1] for name in ("t", "x"))
    assert (rows[4].split(",")[0], float(rows[4].split(",")[3])) == (f"{t:.15g}", x)
    with np.load(io.BytesIO(client.get(f"{address}/data/nonholonomic-0.5.npz").content)) as archive:
        assert archive["x"].shape == (5001,)
        assert json.loads(str(archive["metadata"]))["scene"]["steps"] == 5000
    assert client.get(f"{address}/data/nothing.csv").status_code == 404


@pytest.mark.parametrize(("changes", "pointer"), [
    ({"steps": 0}, "/steps"), ({"color": 1}, "/color"), ({"parameters": {}}, "/parameters"),
    ({"step": "exp(1000)"}, "/step"), ({"system": {"catalogue": "none"}}, "/system/catalogue"),
])  # fmt: skip
def test_bad_scenes_are_problem_documents(
    client: httpx.Client, changes: dict[str, Any], pointer: str
) -> None:
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


@pytest.mark.slow
@pytest.mark.parametrize("card", CARDS, ids=lambda card: card.name)
def test_a_scene_is_answered_as_its_card_says(client: httpx.Client, card: Card) -> None:
    """Difficult scenes give the outcome of their card, and no 5xx."""
    response = answer(client, "/v1/simulate", card.scene)
    if isinstance(card.answer, str):
        assert response.status_code == 422
        assert card.answer in response.text
        return
    assert response.status_code == 200
    judge(card, response.json()["methods"])

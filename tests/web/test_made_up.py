"""Documents made up at random make no fault of the service, no hang and no crash without a name."""

from __future__ import annotations

import json
from collections import Counter

import httpx
import pytest

from tests.web import made_up

VERDICTS = {"variational", "not_variational", "undetermined"}


def ask(service: str, count: int, seed: int) -> Counter[str]:
    """Send a batch; what came back, counted. Every line is a result or a refusal of the document."""
    with httpx.Client(base_url=service, timeout=None) as client:
        body = b"\n".join(made_up.lines(count, seed))
        headers = {"Content-Type": "application/x-ndjson"}
        response = client.post("/v1/batches?time_limit=3", content=body, headers=headers)
        assert response.status_code == 202, response.text
        answers = [json.loads(line) for line in client.get(response.headers["location"] + "/results").text.splitlines()]
    assert len({answer["line"] for answer in answers}) == len(answers) == count
    faults = [answer for answer in answers if "verdict" not in answer and answer["status"] != 422]
    assert faults == []
    return Counter(answer.get("verdict", "refused") for answer in answers)


def test_a_hundred_and_fifty_documents(service: str) -> None:
    found = ask(service, 150, seed=1)
    assert set(found) - {"refused"} <= VERDICTS
    assert found["refused"] > 50
    assert found.total() - found["refused"] > 5


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(2, 22))
def test_a_hundred_thousand_documents(service: str, seed: int) -> None:
    assert ask(service, 5_000, seed).total() == 5_000

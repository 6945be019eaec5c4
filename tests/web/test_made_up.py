"""Random documents cause no internal error, no hang, and no unnamed crash."""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import httpx
import pytest

from tests.web import made_up

VERDICTS = {"variational", "not_variational", "undetermined"}


def ask(service: str, lines: Iterable[bytes], kind: str = "solve") -> Counter[str]:
    """Send a batch and count the responses. Every line is a result or an error about the
    document.
    """
    sent = list(lines)
    count = len(sent)
    with httpx.Client(base_url=service, timeout=None) as client:
        headers = {"Content-Type": "application/x-ndjson"}
        response = client.post(
            f"/v1/batches?time_limit=3&kind={kind}", content=b"\n".join(sent), headers=headers
        )
        assert response.status_code == 202, response.text
        stream = client.get(response.headers["location"] + "/results").text.splitlines()
    answers = [json.loads(line) for line in stream if line]
    assert len({answer["line"] for answer in answers}) == len(answers) == count
    faults = [answer for answer in answers if answer.get("status", 422) != 422]
    assert [(answer["line"], sent[answer["line"] - 1]) for answer in faults] == []
    counts = Counter(
        "refused" if "error" in answer else answer.get("verdict", "done") for answer in answers
    )
    print(kind, dict(counts))
    return counts


def made(count: int, seed: int, make: Callable[[random.Random], Any]) -> list[bytes]:
    dice = random.Random(seed)
    return [json.dumps(make(dice)).encode() for _ in range(count)]


def test_seventy_five_documents(service: str) -> None:
    found = ask(service, made_up.lines(75, seed=1))
    assert set(found) - {"refused"} <= VERDICTS
    assert found["refused"] > 25
    assert found.total() - found["refused"] > 2


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(2, 22))
def test_a_hundred_thousand_documents(service: str, seed: int) -> None:
    assert ask(service, made_up.lines(5_000, seed)).total() == 5_000


@pytest.mark.slow
def test_numbers_of_all_sizes_are_an_answer_or_a_refusal(service: str) -> None:
    assert ask(service, made(15, 1, made_up.with_extreme_numbers))["undetermined"] < 15
    assert ask(service, made(15, 1, made_up.scene), "simulate")["done"] > 0


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(2, 12))
def test_five_thousand_documents_and_two_thousand_scenes_with_numbers_of_all_sizes(
    service: str, seed: int
) -> None:
    assert ask(service, made(500, seed, made_up.with_extreme_numbers)).total() == 500
    assert ask(service, made(200, seed, made_up.scene), "simulate").total() == 200


@pytest.mark.slow
@pytest.mark.parametrize(
    "document",
    [
        {"coordinates": ["x"], "equations": "x''=exp(x)+exp(100000000000000000001*x)"},
        {"coordinates": ["x", "y"], "equations": {"x": "exp(x')+y^200", "y": "y"}},
        {"coordinates": ["x", "y"], "equations": {"x": "atan(x')+y^300", "y": "y"}},
        {
            "coordinates": ["x", "y", "z"],
            "lagrangian": "x'^2/2+y'^2/2+z'^2/2",
            "constraints": ["z'=cosh(1e-39*x)*x'"],
        },
        {  # a polynomial of this degree cannot be factored
            "coordinates": ["x", "y", "z"],
            "lagrangian": "x'^2/2+y'^2/2+z'^2/2+-log(1/61+x^2)",
            "constraints": ["z'=(exp(10^40*x))*x'"],
        },
        {  # a sum that is 0
            "coordinates": ["x", "y"],
            "equations": {
                "x": "exp(10^20*x)+atan(1e-39*x')",
                "y": "sin(3.7e-8*x')+-sin(3.7e-8*x')",
            },
        },
        {  # a generator c + (u + w) x'^2 is not c + a x'^2
            "coordinates": ["x", "y", "z"],
            "lagrangian": "x'^2/2+y'^2/2+z'^2/2+-x/(10^40+y)",
            "constraints": ["z'=(-exp(x/1e-39))*x'"],
        },
    ],
)
def test_documents_that_were_a_fault_of_the_program_have_an_answer(
    service: str, document: dict[str, Any]
) -> None:
    answer = httpx.post(
        f"{service}/v1/solve?time_limit=3", json=document, headers={"Prefer": "wait=20"}, timeout=60
    )
    assert answer.status_code == 200, answer.text
    assert answer.json()["verdict"] in VERDICTS
    assert answer.json()["verdict"] != "undetermined" or answer.json()["reason"]

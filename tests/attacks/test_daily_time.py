"""The daily processor time includes runs that reached their limit and runs that were canceled."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.attacks.harness import attacked
from tests.serving import HARD, until


def long_question(number: int) -> dict[str, Any]:
    return HARD | {"name": f"long {number}"}


def answered(client: httpx.Client, address: str) -> dict[str, Any]:
    """The job after its end."""
    while (answer := client.get(address)).status_code == 202:
        time.sleep(0.1)
    found: dict[str, Any] = answer.json()
    return found


@pytest.mark.slow
def test_runs_at_their_limit_and_cancelled_ones_are_charged(tmp_path: Path) -> None:
    with attacked(tmp_path, client_daily_seconds="3") as service, service.client() as alice:
        for _ in range(2):  # computed, and from memory
            assert (
                alice.post("/v1/solve", json={"equations": "x'' = -x"})
                .headers["RateLimit"]
                .startswith('"day";r=3;')
            )
        first = alice.post(
            "/v1/solve?time_limit=1.5", json=long_question(1), headers={"Prefer": "respond-async"}
        )
        assert first.headers["RateLimit"].startswith('"day";r=3;t=')
        used = answered(alice, first.headers["Location"])["usage"]
        assert used["cpu"] > 0.5
        assert used["memory"] > 10
        running = alice.post(
            "/v1/solve", json=long_question(2), headers={"Prefer": "respond-async"}
        )
        address = running.headers["Location"]
        until(lambda: alice.get(address).json()["status"] == "running")
        time.sleep(4.0)
        assert alice.delete(address).status_code == 200
        end = time.monotonic() + 10
        while (
            again := alice.post("/v1/solve", json=long_question(3))
        ).status_code != 429 and time.monotonic() < end:
            alice.delete(again.headers["Location"])
            time.sleep(0.2)
        assert (again.status_code, again.json()["type"].rpartition(":")[2]) == (
            429,
            "quota-exceeded",
        )
        assert again.headers["RateLimit-Policy"] == '"day";q=3;w=86400'
        assert again.headers["RateLimit"].startswith('"day";r=0;t=')
        with service.other() as bob:
            assert bob.post("/v1/solve", json=long_question(4)).status_code == 202

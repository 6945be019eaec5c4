"""`inverse-service admin` with a running service: drain, resume, cancel, and erase, as an operator
types them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from inverse_service.settings import hash_of_key
from tests.serving import COMMAND, HARD, environment_of, serving, until
from tests.web.test_operations import ALICE, ASYNC, BOB, EASY

Admin = Callable[..., list[Any]]


@pytest.fixture(params=["sqlite", "postgres"])
def service(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[httpx.Client, Admin]]:
    """A client of a service with keys, and its operator's command."""
    database = str(tmp_path / "jobs.sqlite")
    if request.param == "postgres":
        database = request.getfixturevalue("postgres").database("admin")
    keys = f"alice:{hash_of_key('alice-key')}, bob:{hash_of_key('bob-key')}"
    settings = {"database": database, "api_keys": keys}
    environment = environment_of(settings)

    def admin(*words: str) -> list[Any]:
        command = [*COMMAND[:3], "admin", *words]
        done = subprocess.run(
            command, capture_output=True, text=True, check=True, env=environment, timeout=60
        )
        return [json.loads(line) for line in done.stdout.splitlines()]

    with (
        serving(stderr=subprocess.DEVNULL, **settings) as (_, address),
        httpx.Client(base_url=address, timeout=60) as client,
    ):
        until(lambda: client.get("/readyz").status_code == 200)
        yield client, admin


@pytest.mark.slow
def test_an_operator_drains_resumes_cancels_and_erases_while_the_service_runs(
    service: tuple[httpx.Client, Admin],
) -> None:
    client, admin = service
    assert (
        client.post("/v1/solve", json=EASY, headers=BOB | {"Prefer": "wait=20"}).status_code == 200
    )
    long = client.post("/v1/solve", json=HARD, headers=ALICE | ASYNC).json()
    place = f"/v1/jobs/{long['id']}"
    until(lambda: client.get(place, headers=ALICE).json()["status"] == "running")
    admin("drain")
    until(lambda: client.get("/readyz").status_code == 503)
    assert "operator" in client.get("/readyz").json()["detail"]
    waits = client.post("/v1/solve", json=EASY, headers=ALICE | ASYNC).json()
    assert client.get(place, headers=ALICE).json()["status"] == "running", "running work continues"
    alice, bob = admin("clients")
    assert (alice["client"], alice["waiting"], alice["running"]) == ("alice", 1, 1)
    assert (bob["client"], bob["stored"], bob["runs"]) == ("bob", 1, 1)
    assert admin("status")[0]["drained"]
    time.sleep(1.0)
    assert client.get(f"/v1/jobs/{waits['id']}", headers=ALICE).json()["status"] == "accepted"
    admin("resume")
    until(
        lambda: (
            client.get(f"/v1/jobs/{waits['id']}", headers=ALICE).json()["status"] == "successful"
        )
    )
    until(lambda: client.get("/readyz").status_code == 200)
    assert admin("cancel", "alice") == [{"jobs": 1}]
    assert client.get(place, headers=ALICE).json()["status"] == "dismissed"
    until(lambda: b"inverse_service_jobs_taken 0.0\n" in client.get("/metrics").content)
    assert admin("erase", "alice") == [{"jobs": 2}]
    assert client.get("/v1/jobs", headers=ALICE).json()["jobs"] == []
    assert len(client.get("/v1/jobs", headers=BOB).json()["jobs"]) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("status",), "There is no database"),
        (("priority", "--batch", "unknown", "first"), "no batch"),
        (("priority", "alice", "faster"), "faster"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence_and_makes_nothing(
    tmp_path: Path, words: tuple[str, ...], says: str
) -> None:
    path = tmp_path / "jobs.sqlite"
    if words[0] != "status":
        from inverse_service.service.jobs.stores import SqliteStore

        SqliteStore(path).close()
    command = [sys.executable, "-m", "inverse_service", "admin", *words]
    environment = os.environ | {"INVERSE_SERVICE_DATABASE": str(path)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
    assert (done.returncode, says in done.stderr, done.stdout) == (2, True, "")
    assert path.exists() == (words[0] != "status")

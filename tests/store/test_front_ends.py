"""Several services over one PostgreSQL store act as one service."""

from __future__ import annotations

import contextlib
import itertools
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from inverse_service.client import Client, JobDismissed
from inverse_service.errors import InputError
from inverse_service.service.jobs.model import StoreUnavailable
from inverse_service.service.jobs.opening import open_store
from inverse_service.service.jobs.postgres_store import PostgresStore
from tests.serving import HARD, serving
from tests.store.server import Server
from tests.store.test_job_store import request as job_request

COUNT = itertools.count()
Start = Callable[[], tuple["subprocess.Popen[str]", Client]]


def oscillator(k: int) -> dict[str, Any]:
    return {"coordinates": ["x"], "equations": {"x": f"-{k + 1}*x"}}


def lines(count: int) -> list[dict[str, Any]]:
    return [{"id": k, **oscillator(k)} for k in range(count)]


@pytest.fixture
def start(postgres: Server) -> Iterator[Start]:
    """Starts a front end over the store of this test."""
    address = postgres.database(f"front{next(COUNT)}")
    settings = {"database": address, "workers": "1", "log_level": "error", "time_limit": "30"}
    with contextlib.ExitStack() as stack:

        def front_end() -> tuple[subprocess.Popen[str], Client]:
            process, address = stack.enter_context(serving(**settings))
            stack.callback(process.kill)
            return process, stack.enter_context(Client(address))

        yield front_end


@pytest.mark.slow
def test_a_job_given_to_one_is_known_to_all(start: Start) -> None:
    (_, one), (_, two) = start(), start()
    job = one.submit(oscillator(0))
    assert list(two.stream(job))[-1].data["status"] == "successful"
    assert two.wait(job) == one.solve(oscillator(0))
    answers = list(two.batch(lines(12)))
    assert Counter(answer.id for answer in answers) == dict.fromkeys(range(12), 1)
    hard = one.submit(HARD)
    while two.call(f"/v1/jobs/{hard.id}").status == "accepted":
        time.sleep(0.05)
    two.cancel(hard)
    with pytest.raises(JobDismissed):
        one.wait(hard, timeout=60)
    assert one.solve(oscillator(50)).verdict == "variational", (
        "the canceled job still occupies the only process"
    )


@pytest.mark.slow
def test_what_a_killed_front_end_had_is_done_by_the_others_once(start: Start) -> None:
    (first, one), (_, two) = start(), start()
    batch = one.submit_batch(lines(300))
    while two.call(f"/v1/batches/{batch.id}").counts.get("successful", 0) < 60:
        time.sleep(0.02)
    first.kill()
    answers = list(two.batch_results(batch))
    assert Counter(answer.id for answer in answers) == dict.fromkeys(range(300), 1)
    assert two.call(f"/v1/batches/{batch.id}").counts == {"successful": 300}


@pytest.mark.slow
def test_a_server_that_is_started_again_is_waited_for(postgres: Server) -> None:
    store = PostgresStore(postgres.database(f"front{next(COUNT)}"))
    store.submit([job_request("a")])
    postgres.stop("immediate")
    postgres.start()
    assert [job.id for job in store.claim("o", 5)] == ["a"]
    assert store.submit([job_request("a")])[0].status == "running"
    store.close()
    with pytest.raises(StoreUnavailable):
        store.counts()


@pytest.mark.parametrize(
    "address",
    [
        "postgresql://127.0.0.1:1/x",
        "postgres://",
        "postgresql://[::1",
        "postgresql:///x?sslmode=purple",
    ],
)
def test_a_database_that_cannot_be_used_is_refused_in_one_sentence(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("PGHOST", "PGPORT", "PGSERVICE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PGHOST", "127.0.0.1")
    monkeypatch.setenv("PGPORT", "1")
    with pytest.raises(InputError, match="INVERSE_SERVICE_DATABASE cannot be used") as refused:
        open_store(address)
    assert "\n" not in refused.value.detail

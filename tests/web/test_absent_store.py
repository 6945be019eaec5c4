"""A store that does not respond blocks only the requests that need it."""

from __future__ import annotations

import asyncio
import json
import sqlite3
import threading
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from inverse_service.service.jobs.model import (
    Batch,
    BatchAnswer,
    Change,
    Event,
    Job,
    JobRequest,
    StoreUnavailable,
)
from inverse_service.settings import Settings
from inverse_service.web import engine as engine_module
from inverse_service.web.application import create_application
from inverse_service.web.asking import Hub
from inverse_service.web.together import Together
from tests.web.inline import Inline

SYSTEM = {"coordinates": ["x"], "equations": {"x": "0"}}
CALLS: tuple[tuple[str, str, Any], ...] = (
    ("POST", "/v1/solve", SYSTEM), ("GET", "/v1/jobs", None), ("GET", "/v1/jobs/a", None),
    ("DELETE", "/v1/jobs/a", None), ("GET", "/v1/jobs/a/events", None), ("POST", "/v1/batches", [SYSTEM]),
    ("GET", "/v1/batches/a", None), ("DELETE", "/v1/batches/a", None), ("GET", "/v1/batches/a/results", None),
    ("GET", "/metrics", None),
)  # fmt: skip


class AbsentStore:
    """Every call waits until the store is back, and fails then."""

    def __init__(self) -> None:
        self.back = threading.Event()
        self.asked = threading.Semaphore(0)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            self.asked.release()
            assert self.back.wait(60)
            raise StoreUnavailable("The database does not answer.")

        return call


Work = Callable[[httpx.AsyncClient], Awaitable[None]]


def with_store(store: Any, work: Work, quick: Any = None) -> None:
    application = create_application(Settings())
    engine = application.state.engine
    engine.is_open, engine.job_store, engine.quick_workers, engine.work_workers = (
        True,
        store,
        quick or Inline(),
        Inline(),
    )
    engine.supervisor = SimpleNamespace(is_working=lambda: True)

    async def run() -> None:
        engine.hub = Hub()
        engine.together = Together(lambda some: dict(store.submit_together(some)), 1)
        transport = httpx.ASGITransport(application, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            await work(client)

    asyncio.run(run())


def assert_told_to_come_back(response: httpx.Response) -> None:
    assert (response.status_code, response.headers["content-type"]) == (
        503,
        "application/problem+json",
    )
    assert response.json()["type"] == "urn:inverse-service:problem:store-unavailable"
    assert int(response.headers["retry-after"]) > 0


def test_the_service_lives_while_its_store_is_away() -> None:
    store = AbsentStore()

    async def work(client: httpx.AsyncClient) -> None:
        waiting = [
            asyncio.ensure_future(client.request(method, path, json=body))
            for method, path, body in CALLS
        ]
        for _ in CALLS:
            assert await asyncio.to_thread(store.asked.acquire, timeout=60)
        assert (await client.get("/livez")).status_code == 200
        assert not any(call.done() for call in waiting)
        store.back.set()
        for answer in await asyncio.gather(*waiting):
            assert_told_to_come_back(answer)

    with_store(store, work)


def test_a_store_that_hangs_is_not_waited_for_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine_module, "STORE_PATIENCE", 0.05)
    store = AbsentStore()

    async def work(client: httpx.AsyncClient) -> None:
        for method, path, body in (("GET", "/v1/jobs/a", None), ("POST", "/v1/solve", SYSTEM)):
            assert_told_to_come_back(await client.request(method, path, json=body))
        store.back.set()

    with_store(store, work)


def test_streams_go_on_when_the_store_is_back() -> None:
    class Away:
        """A store with a finished job and a batch of one line; reading answers fails `failures`
        times.
        """

        exclusive = True

        def __init__(self) -> None:
            self.failures = 1

        def job(self, id: str, largest: int = 0, client: str = "") -> Job:
            return Job(id, "solve", "{}", "{}", "successful")

        def events(self, id: str, after: int, limit: int = 1000) -> list[Event]:
            self._fail()
            return []

        def part(self, id: str, after: int, most: int) -> tuple[int, bytes]:
            return 0, b""

        def batch(self, id: str) -> Batch:
            return Batch(id, "solve", "", 0.0, 1, {"successful": 1})

        def batch_answers(self, id: str, after: int, limit: int, largest: int) -> list[BatchAnswer]:
            self._fail()
            return [BatchAnswer(1, '"a"', "successful", b'{"verdict": "variational"}', 1)]

        def _fail(self) -> None:
            self.failures -= 1
            if self.failures >= 0:
                raise StoreUnavailable("The database does not answer.")

    async def work(client: httpx.AsyncClient) -> None:
        assert '"successful"' in (await client.get("/v1/jobs/a/events")).text
        store.failures = 1
        assert json.loads((await client.get("/v1/batches/a/results")).text)["id"] == "a"

    store = Away()
    with_store(store, work)
    assert store.failures < 0


def test_a_full_disk_is_a_store_that_does_not_answer() -> None:
    class Full:
        def __getattr__(self, name: str) -> Callable[..., Any]:
            def call(*arguments: Any, **named: Any) -> Any:
                raise sqlite3.OperationalError("database or disk is full")

            return call

    async def work(client: httpx.AsyncClient) -> None:
        assert_told_to_come_back(await client.post("/v1/solve", json=SYSTEM))
        assert (await client.get("/readyz")).status_code == 503

    with_store(Full(), work)


def test_a_store_that_can_be_read_and_not_written_is_not_ready() -> None:
    class ReadOnly:
        written = 0

        def is_drained(self) -> bool:
            return False

        def counts(self) -> dict[str, int]:
            return {}

        def try_to_write(self) -> None:
            self.written += 1
            raise sqlite3.OperationalError("database or disk is full")

    async def work(client: httpx.AsyncClient) -> None:
        answers = await asyncio.gather(*(client.get("/readyz") for _ in range(20)))
        assert {answer.status_code for answer in answers} == {503}
        assert "cannot be written" in answers[0].json()["detail"]

    store = ReadOnly()
    with_store(store, work)
    assert store.written == 1


def test_a_stream_over_a_store_of_this_process_alone_waits_to_be_woken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(engine_module, "LOOK_AGAIN", 0.01)

    class Counting:
        """A job that runs."""

        exclusive = True

        def __init__(self) -> None:
            self.looks, self.status = 0, "running"

        def job(self, id: str, largest: int = 0, client: str = "") -> Any:
            return Job(id, "solve", "{}", "{}", self.status)  # type: ignore[arg-type]

        def events(self, id: str, after: int = 0, limit: int = 1000) -> list[Event]:
            self.looks += 1
            return []

        def part(self, id: str, after: int, most: int) -> tuple[int, bytes]:
            return 0, b""

    store = Counting()

    async def work(client: httpx.AsyncClient) -> None:
        stream = asyncio.ensure_future(client.get("/v1/jobs/a/events"))
        await asyncio.sleep(0.5)
        assert store.looks == 1
        store.status = "successful"
        engine = client._transport.app.state.engine  # type: ignore[attr-defined]
        engine.hub.tell(Change("a", "successful"))
        answer = await asyncio.wait_for(stream, 10)
        assert store.looks == 3  # the new parts, and whether parts were sent
        assert '"status": "successful"' in answer.text

    with_store(store, work)


def test_questions_are_taken_before_the_first_process_reads() -> None:
    class Loading(Inline):
        def __init__(self) -> None:
            super().__init__()
            self.first = Future()

    class Store:
        exclusive = True

        def is_drained(self) -> bool:
            return False

        def counts(self) -> dict[str, int]:
            return {}

        def try_to_write(self) -> None: ...

        def submit_together(self, some: Sequence[JobRequest]) -> dict[str, Job]:
            return {one.id: Job(one.id, "solve", one.document, "{}", "accepted") for one in some}

    async def work(client: httpx.AsyncClient) -> None:
        ready = await client.get("/readyz")
        assert (ready.status_code, ready.json()["workers"]) == (200, "loading")
        asked = await client.post(
            "/v1/solve",
            json=SYSTEM | {"equations": {"x": "-x"}},
            headers={"Prefer": "respond-async"},
        )
        assert (asked.status_code, asked.json()["status"]) == (202, "accepted")

    with_store(Store(), work, quick=Loading())

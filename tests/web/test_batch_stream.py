"""The stream of a batch sends regular signs of life, so readers can tell that the service is
alive.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any

import pytest

from inverse_service.service.jobs.model import Batch, BatchAnswer
from inverse_service.settings import Settings
from inverse_service.web import routes
from inverse_service.web.asking import Hub
from inverse_service.web.engine import Engine
from inverse_service.web.middleware import StreamCut


class SlowStore:
    """A store that returns nothing three times, then the only answer."""

    looks = 0
    forgotten = False
    exclusive = hears_others = False

    def batch(self, id: str) -> Batch | None:
        return None if self.forgotten else Batch(id, "solve", "", 0.0, 1, {"running": 1})

    def batch_answers(self, id: str, after: int, limit: int, largest: int) -> list[BatchAnswer]:
        self.looks += 1
        return (
            []
            if self.looks < 4
            else [BatchAnswer(1, '"a"', "successful", b'{"verdict": "variational"}', 7)]
        )


def streamed(store: SlowStore, total: int) -> tuple[Any, AsyncIterator[bytes]]:
    """The hub of a service with this store, and the stream of a batch of this many lines; on an
    event loop.
    """
    engine: Any = Engine(Settings())
    engine.job_store, engine.hub = store, Hub()
    return engine.hub, routes.answers_of(
        engine, Batch("b", "solve", "", 0.0, total, {"running": 1})
    )


def test_a_silent_stream_sends_empty_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inverse_service.web.engine.KEEP_ALIVE", 0.0)

    async def sent() -> list[bytes]:
        return [part async for part in streamed(SlowStore(), 1)[1]]

    parts = asyncio.run(sent())
    assert parts[:3] == [b"\n"] * 3
    assert json.loads(parts[3]) == {"id": "a", "line": 1, "verdict": "variational"}


def test_a_store_that_no_one_else_changes_is_not_polled() -> None:
    store = SlowStore()
    store.exclusive = True

    async def read() -> None:
        await anext(streamed(store, 1)[1])

    with pytest.raises(TimeoutError):
        asyncio.run(asyncio.wait_for(read(), 0.8))
    assert store.looks == 1


def test_a_stream_that_the_end_of_the_service_cuts_does_not_look_whole() -> None:
    """The connection breaks, so no reader mistakes the partial answers for all of them."""
    parts = []

    async def read() -> None:
        hub, stream = streamed(SlowStore(), 2)
        async for part in stream:
            parts.append(part)
            hub.closing = True

    with pytest.raises(StreamCut):
        asyncio.run(read())
    assert [json.loads(part)["id"] for part in parts] == ["a"]


def test_the_stream_of_a_batch_that_is_erased_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(routes, "KEEP_ALIVE", 0.0)
    store = SlowStore()

    async def read() -> None:
        async for part in streamed(store, 2)[1]:
            if part != b"\n":
                store.looks, store.forgotten = 0, True

    with pytest.raises(StreamCut):
        asyncio.run(asyncio.wait_for(read(), 30))

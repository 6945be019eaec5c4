"""What a request gets whose work is canceled."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from inverse_service.web.middleware import Entrance

REQUEST = {
    "type": "http", "method": "POST", "path": "/v1/solve", "query_string": b"", "http_version": "1.1",
    "headers": [(b"host", b"localhost")], "client": ("127.0.0.1", 1), "scheme": "http",
}  # fmt: skip


def canceled(starts_at_once: bool) -> list[dict[str, Any]]:
    """What is sent for a request that the server cancels."""
    sent = list[dict[str, Any]]()

    async def application(scope: Any, receive: Any, send: Any) -> None:
        if starts_at_once:
            await send({"type": "http.response.start", "status": 200, "headers": []})
        await asyncio.sleep(600)

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    async def run() -> None:
        entrance = Entrance(application, (), (), application)
        work = asyncio.ensure_future(entrance({**REQUEST}, receive, send))
        await asyncio.sleep(0.01)
        work.cancel()
        await work

    if starts_at_once:
        with pytest.raises(asyncio.CancelledError):
            asyncio.run(run())
    else:
        asyncio.run(run())
    return sent


def test_a_server_that_stops_asks_to_send_the_request_again() -> None:
    start, body = canceled(starts_at_once=False)
    assert start["status"] == 503
    assert (b"retry-after", b"5") in start["headers"]
    assert b"send the request again" in body["body"]


def test_an_answer_that_began_is_not_followed_by_another() -> None:
    assert [one["status"] for one in canceled(starts_at_once=True)] == [200]

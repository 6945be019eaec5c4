"""A service with scripted responses, and both clients connected to it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import httpx

from inverse_service.client import AsyncClient, Client


@dataclass
class Script:
    """Responses in order; a callable may raise, as a broken connection does. `requests` records the
    requests.
    """

    answers: list[httpx.Response | Exception]
    requests: list[httpx.Request] = field(default_factory=list)

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests.append(request)
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


def answer(status: int, value: Any = None, **headers: str) -> httpx.Response:
    """A JSON response; `retry_after="1"` is the header Retry-After."""
    return httpx.Response(
        status, json=value, headers={name.replace("_", "-"): text for name, text in headers.items()}
    )


class Broken(httpx.SyncByteStream, httpx.AsyncByteStream):
    """A body that ends with a broken connection after its pieces."""

    def __init__(self, *pieces: bytes) -> None:
        self.pieces = pieces

    def __iter__(self) -> Iterator[bytes]:
        yield from self.pieces
        raise httpx.ReadError("broken")

    async def __aiter__(self) -> AsyncIterator[bytes]:
        for piece in self.pieces:
            yield piece
        raise httpx.ReadError("broken")


def lines(*values: Any) -> bytes:
    """NDJSON."""
    return b"".join(json.dumps(value).encode() + b"\n" for value in values)


Ask = Callable[[Script, str, Any], Any]


def blocking(
    script: Script, method: str, *arguments: Any, patience: float = 5.0, **options: Any
) -> Any:
    """The value of a method of the blocking client, as a list if it is an iterator."""
    with Client(
        "http://service", patience=patience, transport=httpx.MockTransport(script)
    ) as client:
        found = getattr(client, method)(*arguments, **options)
        return list(found) if isinstance(found, Iterator) else found


def asynchronous(
    script: Script, method: str, *arguments: Any, patience: float = 5.0, **options: Any
) -> Any:
    """The same for the asynchronous client."""

    async def run() -> Any:
        async with AsyncClient(
            "http://service", patience=patience, transport=httpx.MockTransport(script)
        ) as client:
            found = getattr(client, method)(*arguments, **options)
            return (
                [item async for item in found] if isinstance(found, AsyncIterator) else await found
            )

    return asyncio.run(run())

"""The body of a request as bytes: bounded, counted while it is under way, of the right type. Workers read it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from starlette.requests import ClientDisconnect, Request

from inverse_service.web.clients import client_of
from inverse_service.web.problems import Refusal

if TYPE_CHECKING:
    from inverse_service.web.engine import Engine

# How many times MAX_BODY each may have: a scene may hold a result, a result many certificates, a batch many systems.
FACTORS = {"solve": 1, "simulate": 5, "work-precision": 5, "check": 10, "batch": 16}
LARGEST_FACTOR = max(FACTORS.values())


@asynccontextmanager
async def body_of(request: Request, limit: int) -> AsyncIterator[bytes]:
    """The body, which counts as under way to the end of the context; 413 for more than `limit` bytes, unread.

    415 where it is compressed: how large it becomes nobody says.
    """
    declared = request.headers.get("content-length", "0")
    if declared.isascii() and declared.isdigit() and (len(declared) > 15 or int(declared) > limit):
        raise too_large(limit)
    if request.headers.get("content-encoding", "identity").lower() != "identity":
        raise Refusal(415, "content-type", "A body is taken as it is; send it without 'Content-Encoding'.")
    engine: Engine = request.app.state.engine
    with engine.bytes.account(client_of(request)) as account:
        parts = []
        try:
            async for part in request.stream():
                parts.append(part)
                account.take(len(part))
                if account.held > limit:
                    raise too_large(limit)
        except ClientDisconnect:
            raise Refusal(400, "unreadable", "The connection was closed before the whole body had come.") from None
        yield b"".join(parts)


@asynccontextmanager
async def json_body_of(request: Request, limit: int) -> AsyncIterator[bytes]:
    """The same for a body that says it is JSON; 415 for another type."""
    if not is_json(content_type(request)):
        raise Refusal(415, "content-type", "Send JSON with the header 'Content-Type: application/json'.")
    async with body_of(request, limit) as body:
        yield body


def content_type(request: Request) -> str:
    """The media type of the body, without parameters."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def is_json(media_type: str) -> bool:
    """Whether a body of this type is one JSON value."""
    return media_type == "application/json" or media_type.endswith("+json")


def too_large(limit: int) -> Refusal:
    """The body is over the limit, which GET /v1/limits tells."""
    return Refusal(413, "too-large", f"The body has more than {limit} bytes; send a smaller document.")

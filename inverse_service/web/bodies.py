"""Reading the body of a request: bounded, of the right type, strict JSON."""

from __future__ import annotations

from typing import Any

from starlette.requests import ClientDisconnect, Request

from inverse_service.errors import InputError
from inverse_service.service.documents.reading import read_json
from inverse_service.service.jobs.outcome import faults_of
from inverse_service.web.problems import Refusal


async def read_body(request: Request, limit: int) -> bytes:
    """The body; refuses one of more than `limit` bytes (413) without reading all of it."""
    declared = request.headers.get("content-length", "0")
    if declared.isascii() and declared.isdigit() and (len(declared) > 15 or int(declared) > limit):
        raise too_large(limit)
    body = bytearray()
    try:
        async for chunk in request.stream():
            body += chunk
            if len(body) > limit:
                raise too_large(limit)
    except ClientDisconnect:
        raise Refusal(400, "unreadable", "The connection was closed before the whole body had come.") from None
    return bytes(body)


async def read_json_body(request: Request, limit: int) -> Any:
    """The JSON value of the body; refusals: 415 another type, 413 too large, 400 not JSON."""
    if not is_json(content_type(request)):
        raise Refusal(415, "content-type", "Send JSON with the header 'Content-Type: application/json'.")
    return as_json(await read_body(request, limit))


def content_type(request: Request) -> str:
    """The media type of the body, without parameters."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def is_json(media_type: str) -> bool:
    """Whether a body of this type is one JSON value."""
    return media_type == "application/json" or media_type.endswith("+json")


def as_json(body: bytes) -> Any:
    """Strict JSON; raises a Refusal with status 400."""
    try:
        return read_json(body)
    except InputError as error:
        raise Refusal(400, "unreadable", error.detail, faults_of(error)) from None


def too_large(limit: int) -> Refusal:
    """The body is over the limit, which GET /v1/limits tells."""
    return Refusal(413, "too-large", f"The body has more than {limit} bytes; send a smaller document.")

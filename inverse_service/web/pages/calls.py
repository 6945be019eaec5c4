"""The pages ask the service through its own calls, so that a page says what the API says."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import httpx
from starlette.requests import Request

from inverse_service.web.journal import REQUEST

# What says who asks; everything else of the browser's request is the page's own business.
PASSED_ON = ("authorization", "x-api-key", "cookie", "host")
ORIGIN = "http://pages.invalid"
# It would note every one of these calls, which the service counts itself.
logging.getLogger("httpx").setLevel(logging.WARNING)


@dataclass(frozen=True, slots=True)
class Answer:
    """What a call answered."""

    status: int
    headers: Mapping[str, str] = field(default_factory=dict)
    body: bytes = b""

    @property
    def value(self) -> Any:
        """The JSON value of the body."""
        return json.loads(self.body)

    @property
    def is_problem(self) -> bool:
        """Whether the call was refused."""
        return self.status >= 400


async def call(
    request: Request, method: str, path: str, document: Any = None, headers: Mapping[str, str] | None = None
) -> Answer:
    """One call of this service, made inside the process; `document` is sent as JSON, bytes as they are."""
    sent = {name: request.headers[name] for name in PASSED_ON if name in request.headers} | dict(headers or {})
    sent["X-Request-Id"] = REQUEST.get()
    content = document
    if document is not None and not isinstance(document, bytes):
        content = json.dumps(document, default=str).encode()
    if content is not None:
        sent.setdefault("Content-Type", "application/json")
    client = (request.client.host, request.client.port) if request.client else ("", 0)
    transport = httpx.ASGITransport(app=request.app, raise_app_exceptions=False, client=client)
    async with httpx.AsyncClient(transport=transport, base_url=ORIGIN, timeout=None) as http:
        found = await http.request(method, path, content=content, headers=as_sent(sent))
    return Answer(found.status_code, found.headers, found.content)


def as_sent(headers: Mapping[str, str]) -> dict[bytes, bytes]:
    """Headers as bytes: a cookie that another program on this host has set may hold any."""
    return {name.encode(): value.encode("latin-1") for name, value in headers.items()}

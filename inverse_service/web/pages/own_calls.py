"""The pages ask the service through its own calls, so that a page says what the API says.

Forms that browsers send: taken from our own pages only, and read by workers where they may be large.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import httpx
from starlette.requests import Request

from inverse_service.web import asking, clients, journal
from inverse_service.web.engine import QUICK_DEADLINE, Engine
from inverse_service.web.pages import forms
from inverse_service.web.problems import Refusal

T = TypeVar("T")
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
    sent["X-Request-Id"] = journal.REQUEST.get()
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


# A key, a button, a color: read where it stands.
SMALL_FORM = 10_000


async def read_form(request: Request, limit: int) -> forms.Form:
    """The sent form; refuses one of another site (403), too large (413), not written by a browser (400)."""
    return await read_sent(request, limit, forms.form_of)


async def read_sent(
    request: Request, limit: int, task: Callable[[bytes, str], T], seconds: float = QUICK_DEADLINE
) -> T:
    """What a task of `form_tasks` makes of the sent form; refuses as `read_form` does."""
    if not clients.is_of_own_page(request):
        raise Refusal(403, "cross-site", "Forms are taken from the pages of this service only.")
    engine: Engine = request.app.state.engine
    content_type = request.headers.get("content-type", "")
    async with asking.body_of(request, limit) as body:
        if limit <= SMALL_FORM:
            return task(body, content_type)
        return await engine.read_body(clients.client_of(request), task, body, content_type, seconds=seconds)

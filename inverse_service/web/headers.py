"""Headers that tell a browser to be strict with every answer."""

from __future__ import annotations

from collections.abc import Sequence

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from inverse_service.service.documents.problem_documents import as_bytes, problem_document

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'self'; img-src 'self'; form-action 'self'; "
        "base-uri 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}

LARGEST_HEADERS = 32_768


class SecurityHeaders:
    """Adds HEADERS to every response that does not set them itself.

    Refuses requests with too large ones (431), and those to another host than `hosts` (421): a page elsewhere may let
    its own name point to this machine. No `hosts`: any is taken.
    """

    def __init__(self, app: ASGIApp, hosts: Sequence[str] = ()) -> None:
        self.app = app
        self._hosts = frozenset(host.lower() for host in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        if sum(len(name) + len(value) for name, value in scope["headers"]) > LARGEST_HEADERS:
            detail = f"The headers have more than {LARGEST_HEADERS} bytes; send less."
            await _refuse(431, "headers-too-large", detail, (scope, receive, send))
            return
        if self._hosts and not self._hosts & {host_of(scope), "*"}:
            detail = "This service does not answer to this host name; its operator lists them in INVERSE_SERVICE_HOSTS."
            await _refuse(421, "host", detail, (scope, receive, send))
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await self.app(scope, receive, send_with_headers)


def host_of(scope: Scope) -> str:
    """The name in the Host header, in small letters and without its port."""
    text = Headers(scope=scope).get("host", "").lower()
    name, _, port = text.rpartition(":")
    return name if name and port.isdigit() else text


async def _refuse(status: int, kind: str, detail: str, call: tuple[Scope, Receive, Send]) -> None:
    content = as_bytes(problem_document(status, kind, detail))
    await Response(content, status, headers=HEADERS, media_type="application/problem+json")(*call)

"""Headers that tell a browser to be strict with every answer."""

from __future__ import annotations

from starlette.datastructures import MutableHeaders
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
    """Adds HEADERS to every response that does not set them itself; refuses requests with too large ones (431)."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        if sum(len(name) + len(value) for name, value in scope["headers"]) > LARGEST_HEADERS:
            await _too_large(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await self.app(scope, receive, send_with_headers)


async def _too_large(scope: Scope, receive: Receive, send: Send) -> None:
    detail = f"The headers have more than {LARGEST_HEADERS} bytes; send less."
    content = as_bytes(problem_document(431, "headers-too-large", detail))
    response = Response(content, 431, headers=HEADERS, media_type="application/problem+json")
    await response(scope, receive, send)

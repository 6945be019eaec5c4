"""Counts requests and measures how long their answers begin to take."""

from __future__ import annotations

import time

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from inverse_service.service.jobs.metrics import Counters


class Measured:
    """Middleware; requests are told apart by route (never by the path, which anybody can make up)."""

    def __init__(self, app: ASGIApp, counters: Counters) -> None:
        self.app = app
        self._counters = counters

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began = time.monotonic()

        async def send_measured(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._count(scope, message["status"], time.monotonic() - began)
            await send(message)

        await self.app(scope, receive, send_measured)

    def _count(self, scope: Scope, status: int, seconds: float) -> None:
        route = getattr(scope.get("route"), "path", "none")
        self._counters.add(
            "inverse_service_http_requests_total", "Requests by route and status.", route=route, status=str(status)
        )
        self._counters.observe("inverse_service_http_seconds", "Time until an answer begins.", seconds, route=route)

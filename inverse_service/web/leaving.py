"""A request whose client is gone is stopped: nobody waits for its answer, so nobody works for it."""

from __future__ import annotations

import asyncio
import contextlib

from starlette.types import ASGIApp, Message, Receive, Scope, Send

GONE: Message = {"type": "http.disconnect"}


class StopWhenLeft:
    """Middleware that cancels the work on a request when its client closes the connection before the answer is out.

    What was stored for it by then, such as a job, stays.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        visit = _Visit(receive)
        work = asyncio.ensure_future(self.app(scope, visit.receive, send))
        watch = asyncio.ensure_future(visit.left.wait())
        try:
            await asyncio.wait((work, watch), return_when=asyncio.FIRST_COMPLETED)
        finally:
            visit.close()
            watch.cancel()
            if not work.done():
                work.cancel()
        if visit.left.is_set() and not work.done():
            with contextlib.suppress(asyncio.CancelledError):
                await work
        else:
            await work


class _Visit:
    """The messages of one request; from the end of its body on the connection is watched."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._first: asyncio.Task[Message] | None = asyncio.ensure_future(self._begun())
        self._watch: asyncio.Task[None] | None = None
        self.left = asyncio.Event()

    async def receive(self) -> Message:
        """What the application asks for."""
        if self._first is not None:
            message, self._first = await self._first, None
            return message
        if self._watch is not None:
            await self.left.wait()
            return GONE
        return self._noted(await self._receive())

    def close(self) -> None:
        """The request is answered."""
        for task in (self._first, self._watch):
            if task is not None:
                task.cancel()

    async def _begun(self) -> Message:
        """The first part of the body, taken before anybody asks: most requests have no other."""
        return self._noted(await self._receive())

    def _noted(self, message: Message) -> Message:
        if message["type"] == GONE["type"]:
            self.left.set()
        elif not message.get("more_body", False):
            self._watch = asyncio.ensure_future(self._until_left())
        return message

    async def _until_left(self) -> None:
        while (await self._receive())["type"] != GONE["type"]:
            pass
        self.left.set()

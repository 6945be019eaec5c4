"""The worker processes behind the routes, and a bound on how many requests wait for them."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service import tasks
from inverse_service.service.answers import result_document, value_of
from inverse_service.service.submitting import submit_solve
from inverse_service.service.workers import Workers
from inverse_service.settings import Settings
from inverse_service.web.problems import Refusal

QUICK_DEADLINE = 10.0
PING_DEADLINE = 5.0


class Engine:
    """Two pools: one solves and checks, the other answers what takes milliseconds.

    A page that echoes what was understood must not wait behind a system of an hour.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self._solving = Workers(settings.workers, settings.memory_limit)
        self._quick = Workers(1, settings.memory_limit)
        self._waiting = 0

    def start(self) -> None:
        """Start the processes; call from the thread that lives as long as the service."""
        self._solving.start()
        self._quick.start()

    def stop(self) -> None:
        """Kill all processes."""
        self._solving.stop()
        self._quick.stop()

    async def solve(self, document: Any, time_limit: float) -> dict[str, Any]:
        """The result document; undetermined where a limit ended the work."""
        options = SolveOptions(time_limit=time_limit)
        with self._place_in_queue():
            outcome = await asyncio.wrap_future(submit_solve(self._solving, self._quick, document, options))
        return result_document(outcome, options, self.settings.memory_limit)

    async def check(self, text: str) -> dict[str, Any]:
        """The checker's verdict; incomplete where the check ran into a limit."""
        limit = self.settings.time_limit
        with self._place_in_queue():
            outcome = await asyncio.wrap_future(self._solving.submit(tasks.check_task, (text,), limit))
        if outcome.status in ("deadline", "memory"):
            return {"verdict": "incomplete", "reasons": [f"The check was stopped at its {outcome.status} limit."]}
        found: dict[str, Any] = value_of(outcome)
        return found

    async def parse(self, document: Any) -> dict[str, Any]:
        """What was understood of a document."""
        with self._place_in_queue():
            outcome = await asyncio.wrap_future(self._quick.submit(tasks.parse_task, (document,), QUICK_DEADLINE))
        if outcome.status in ("deadline", "memory"):
            raise Refusal(422, "limit", f"Reading this document ran into the {outcome.status} limit; make it smaller.")
        found: dict[str, Any] = value_of(outcome)
        return found

    async def is_ready(self) -> bool:
        """Whether a worker process answers."""
        answer = asyncio.wrap_future(self._quick.submit(tasks.ping_task, (), PING_DEADLINE))
        try:
            return (await asyncio.wait_for(answer, 2 * PING_DEADLINE)).status == "done"
        except TimeoutError:
            return False

    @contextmanager
    def _place_in_queue(self) -> Iterator[None]:
        if self._waiting >= self.settings.queue + self.settings.workers:
            detail = "Too many requests wait for a worker; try again in some seconds."
            raise Refusal(503, "busy", detail, headers={"Retry-After": "5"})
        self._waiting += 1
        try:
            yield
        finally:
            self._waiting -= 1

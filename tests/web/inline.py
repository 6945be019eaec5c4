"""Workers without processes: what is submitted runs at once, where it is submitted."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from inverse_service.service.jobs.tasks import Call, Outcome, guard
from inverse_service.service.jobs.workers import Running


class Inline:
    """An Executor of the web process itself, for tests of what happens around the work."""

    capacity = 1

    def __init__(self) -> None:
        self.first: Future[Outcome] = Future()
        self.first.set_result(Outcome("done"))

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def fault(self) -> str:
        return ""

    def lend(self, chore: object) -> bool:
        return False

    def submit(self, call: Call, report: Any = None) -> Running:
        running = Running(call, report)
        running.end(guard(call.task, *call.arguments))
        return running

"""Workers without processes: a submitted task runs immediately in the caller."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from inverse_service.service.jobs.tasks import Call, Outcome, guard
from inverse_service.service.jobs.workers import Running


class Inline:
    """An Executor within the web process, for tests of the code around the tasks."""

    capacity = 1

    def __init__(self) -> None:
        self.first: Future[Outcome] = Future()
        self.first.set_result(Outcome("done"))

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def fault(self) -> str:
        return ""

    def submit(self, call: Call, report: Any = None) -> Running:
        running = Running(call, report)
        running.end(guard(call.task, *call.arguments))
        return running

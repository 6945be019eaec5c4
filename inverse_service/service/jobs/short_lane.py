"""A lane for short questions: who has nothing running does not wait for the long jobs of others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from inverse_service.service.jobs.model import INTERACTIVE, Job
from inverse_service.service.jobs.outcome import Outcome
from inverse_service.service.jobs.workers import Executor, Running

# Longer questions wait for their turn like all others, s.
SHORT = 0.5
# Jobs that are claimed for clients with nothing running although no worker is free.
AHEAD = 32
ENDED = ("done", "refused")


@dataclass(slots=True)
class ShortLane:
    """Tries jobs that wait for a worker for a moment on processes of another pool; each once.

    A job that ends there is done, and its place among the others is given up; any other goes on waiting.
    """

    executor: Executor
    _tried: set[tuple[str, int]] = field(default_factory=set)

    def look(self, claimed: Iterable[tuple[Job, Running]], end: Callable[[Job, Outcome], None]) -> None:
        """Try what waits; `end` is called with each job that ended, from another thread."""
        claimed = list(claimed)
        busy = {job.client for job, task in claimed if task.has_begun}
        self._tried &= {(job.id, job.attempt) for job, _ in claimed}
        for job, task in claimed:
            key = (job.id, job.attempt)
            if job.priority == INTERACTIVE and job.client not in busy and key not in self._tried:
                self._tried.add(key)
                self._try(job, task, end)

    def _try(self, job: Job, task: Running, end: Callable[[Job, Outcome], None]) -> None:
        call = replace(task.call, deadline=min(SHORT, task.call.deadline))
        running = self.executor.submit(call, task.report)
        running.outcome.add_done_callback(lambda done: _ended(job, done.result(), end))


def _ended(job: Job, outcome: Outcome, end: Callable[[Job, Outcome], None]) -> None:
    if outcome.status in ENDED:
        end(job, outcome)

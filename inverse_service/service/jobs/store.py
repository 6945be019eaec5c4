"""What every job store does; the SQLite one is the default, the PostgreSQL one an extra.

All methods block, may be called from any thread, and return after their change is durable unless
they say otherwise. A store is the truth: whatever else dies, an accepted job is in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

from inverse_service.service.jobs.model import Batch, BatchAnswer, BatchLine, Bounds, Event, Job, JobRequest, Usage
from inverse_service.service.jobs.states import JobStatus


class JobStore(Protocol):
    """Jobs, their events, and batches of them."""

    @property
    def exclusive(self) -> bool:
        """Whether one process alone has the store; else claims need a heartbeat and are looked for by polling."""

    def submit(self, requests: Sequence[JobRequest], bounds: Bounds = ...) -> list[Job]:
        """The job of each request, in order; all are stored, or none is (TooManyJobs).

        A job that is open or answered already is returned as it is (with its `body`), unless the
        request is `fresh` and it is answered, or it was dismissed: then it is accepted again.
        """

    def claim(self, owner: str, limit: int, excluded_clients: Sequence[str] = ()) -> list[Job]:
        """Up to `limit` accepted jobs, by priority and age, now running and owned by `owner`.

        `attempt` is one higher than before. No two owners get the same job. Need not be durable:
        a claim that is lost leaves the job accepted.
        """

    def heartbeat(self, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
        """Keep the claims (id, attempt) alive; the ids among them that are no longer this owner's."""

    def finish(self, id: str, attempt: int, result: bytes, usage: Usage) -> bool:
        """running -> successful; False where the attempt is no longer the current one."""

    def fail(self, id: str, attempt: int, problem: bytes, usage: Usage) -> bool:
        """running -> failed; False where the attempt is no longer the current one."""

    def release(self, id: str, attempt: int, crashed: bool) -> Job | None:
        """running -> accepted after the worker died; counts a crash where `crashed`."""

    def dismiss(self, id: str) -> Job | None:
        """accepted or running -> dismissed; a final job is returned as it is, an unknown one is None."""

    def recover(self, owner: str | None = None, lease: float = 0.0) -> list[Job]:
        """Jobs running for `owner` (None: for anybody), without a heartbeat for `lease` s -> accepted.

        Each counts a restart. Returns them.
        """

    def job(self, id: str, with_body: bool = True) -> Job | None:
        """One job."""

    def jobs(
        self, *, status: JobStatus | None = None, kind: str | None = None, client: str | None = None,
        cursor: str | None = None, limit: int = 50,
    ) -> tuple[list[Job], str | None]:  # fmt: skip
        """One page, newest first, without bodies, and the cursor of the next one. ValueError: a bad cursor."""

    def add_events(self, events: Iterable[tuple[str, Event]]) -> None:
        """Append events (job id, event); need not be durable."""

    def events(self, id: str, after: int = 0, limit: int = 1000) -> list[Event]:
        """Events of a job with greater numbers than `after`, in order."""

    def create_batch(self, id: str, kind: str, client: str, lines: Sequence[BatchLine], bounds: Bounds = ...) -> Batch:
        """Store the batch and the jobs of its lines, all or nothing; one of this id stays as it is."""

    def batch(self, id: str) -> Batch | None:
        """One batch with its counts."""

    def batch_answers(self, id: str, after: int = 0, limit: int = 500) -> list[BatchAnswer]:
        """Answers with `order` above `after`, in that order: what is done so far."""

    def dismiss_batch(self, id: str) -> list[str]:
        """Dismiss what is open in the batch and what no other one waits for; the ids."""

    def counts(self) -> Mapping[JobStatus, int]:
        """Number of jobs in each status."""

    def running_by_client(self) -> Mapping[str, int]:
        """Number of running jobs of each client that has some."""

    def prune(self, oldest: float, largest: int) -> int:
        """Forget jobs and batches finished before the time `oldest`, then the oldest until the
        store has at most `largest` bytes; how many jobs were forgotten. Open ones always stay."""

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Call the listener with the id of each job whose status or events change in this process."""

    def close(self) -> None:
        """Give the store up; nothing that was acknowledged is lost."""

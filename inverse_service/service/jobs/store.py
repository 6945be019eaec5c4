"""What every job store does; the SQLite one is the default, the PostgreSQL one an extra.

All methods block, may be called from any thread, and return after their change is durable unless
they say otherwise. A store is the truth: whatever else dies, an accepted job is in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final, Protocol

from inverse_service.service.jobs.model import Batch, BatchAnswer, BatchLine, Bounds, Event, Job, JobRequest, Usage
from inverse_service.service.jobs.states import JobStatus

NO_BOUND: Final = 1_000_000


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

    def claim(self, owner: str, limit: int, client_running: int = ...) -> list[Job]:
        """Up to `limit` accepted jobs, now running and owned by `owner`; of one client at most `client_running` run.

        By priority, then those of the client that has the fewest running, then by age.
        `attempt` is one higher than before. No two owners get the same job. Need not be durable:
        a claim that is lost leaves the job accepted.
        """

    def heartbeat(self, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
        """Keep the claims (id, attempt) alive; the ids among them that are no longer this owner's."""

    def finish(self, id: str, attempt: int, result: bytes, usage: Usage, kept: float | None = None) -> bool:
        """running -> successful; False where the attempt is no longer the current one.

        After `kept` s (None: never) the question is computed again where it is asked again.
        """

    def fail(self, id: str, attempt: int, problem: bytes, usage: Usage, kept: float | None = None) -> bool:
        """running -> failed; False where the attempt is no longer the current one."""

    def release(self, id: str, attempt: int, crashed: bool) -> Job | None:
        """running -> accepted after the worker died; counts a crash where `crashed`."""

    def dismiss(self, id: str, client: str | None = None) -> tuple[Job | None, bool]:
        """The job, dismissed for a client and its batches (None: for all), and whether its work is to stop.

        The work stops when nobody waits for it any more: accepted or running -> dismissed, or to the earlier answer of
        a job that was computed again. A final job is returned as it is, an unknown one is None.
        """

    def recover(self, owner: str | None = None, lease: float = 0.0) -> list[Job]:
        """Jobs running for `owner` (None: for anybody), without a heartbeat for `lease` s (0: all) -> accepted.

        Each counts a restart. Returns them.
        """

    def job(self, id: str, with_body: bool = True, client: str | None = None) -> Job | None:
        """One job; while it is open, dismissed for a client who cancelled it."""

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

    def batch_answers(self, id: str, after: int = 0, limit: int = 500, largest: int = ...) -> list[BatchAnswer]:
        """Answers with `order` above `after`, in that order: what is done so far; bodies of at most `largest` bytes."""

    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        """The length of the body of a job's answer, 0 where there is none, and so many bytes of it."""

    @property
    def address(self) -> str:
        """Where `stored_answers` reads the same store from another process."""

    def dismiss_batch(self, id: str) -> list[str]:
        """Dismiss the open lines of the batch; the ids of their jobs that nobody else waits for, which stop."""

    def counts(self) -> Mapping[JobStatus, int]:
        """Number of jobs in each status."""

    def measure(self) -> tuple[float | None, int]:
        """When the job was accepted that waits longest (None where none waits), and the bytes in use."""

    def try_to_write(self) -> None:
        """Write something small and durable, and read every column; raises what the database says."""

    def prune(self, oldest: float, largest: int) -> int:
        """Forget jobs and batches finished before the time `oldest`, then the oldest until the
        store has at most `largest` bytes; how many jobs were forgotten. Open ones always stay.
        In small transactions, between which others are served; free space goes back to the disk."""

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Call the listener with the id of each job whose status or events change in this process."""

    def close(self) -> None:
        """Give the store up; nothing that was acknowledged is lost."""

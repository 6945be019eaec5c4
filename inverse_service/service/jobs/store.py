"""What every job store does; the SQLite one is the default, the PostgreSQL one an extra.

All methods block, may be called from any thread, and return after their change is durable unless
they say otherwise. A store is the truth: whatever else dies, an accepted job is in it.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import ClassVar, TypeVar

from inverse_service.service.jobs import model, statements, upkeep
from inverse_service.service.jobs.outcome import Usage

T = TypeVar("T")
Changed = Callable[[T], Iterable[str]]
NO_BOUNDS, NO_USE = model.Bounds(), Usage()
# Rows that are forgotten in one step, which takes some milliseconds; jobs that are looked at to find the oldest.
STEP, OLDEST = 50, 100


class JobStore(ABC):
    """Jobs, their events, and batches of them."""

    # Whether one process alone has the store; else claims are looked for by polling.
    exclusive: ClassVar[bool]
    # Where `stored_answer` reads the same store from another process.
    address: str

    def __init__(self) -> None:
        self._listeners: list[Callable[[str], None]] = []

    @abstractmethod
    def _read(self, function: Callable[[statements.Session], T]) -> T:
        """Look at the store."""

    @abstractmethod
    def _write(
        self, change: Callable[[statements.Session], T], changed: Changed[T] | None = None, durable: bool = True
    ) -> T:
        """Change it in one transaction, and tell of the jobs that changed ("": something did)."""

    @abstractmethod
    def _used_bytes(self) -> int:
        """Bytes that forgetting can make fewer."""

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Call the listener with the id of each job whose status or events change in this process."""
        self._listeners.append(listener)

    def tell(self, ids: Iterable[str]) -> None:
        """Call the listeners; an empty id says that something changed."""
        for id in ids:
            for listener in self._listeners:
                listener(id)

    @abstractmethod
    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        """The length of the body of a job's answer, 0 where there is none, and so many bytes of it."""

    @abstractmethod
    def size(self) -> int:
        """The bytes that the database takes."""

    @abstractmethod
    def try_to_write(self) -> None:
        """Write something small and durable, and read every column; raises what the database says."""

    @abstractmethod
    def close(self) -> None:
        """Give the store up; nothing that was acknowledged is lost."""

    def submit(self, requests: Sequence[model.JobRequest], bounds: model.Bounds = NO_BOUNDS) -> list[model.Job]:
        """The job of each request, in order; all are stored, or none is (TooManyJobs).

        A job that is open or answered already is returned as it is (with its `body`), unless the
        request is `fresh` and it is answered, or it was dismissed: then it is accepted again.
        """
        return self._write(lambda s: statements.submit(s, requests, bounds), lambda found: found[1])[0]

    def claim(self, owner: str, limit: int, client_running: int = model.NO_BOUND) -> list[model.Job]:
        """Up to `limit` accepted jobs, now running and owned by `owner`; of one client at most `client_running` run.

        Those of the client that has the fewest running, of these the smallest priority, then the oldest; an operator's
        rank goes before all of that. `attempt` is one higher than before. No two owners get the same job. Need not be
        durable: a claim that is lost leaves the job accepted. None while the store is drained.
        """
        return self._write(
            lambda s: statements.claim(s, owner, limit, client_running),
            lambda jobs: [j.id for j in jobs],
            durable=False,
        )

    def heartbeat(self, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
        """Keep the claims (id, attempt) alive; the ids among them that are no longer this owner's."""
        if not running:
            return []
        return self._write(lambda s: statements.heartbeat(s, owner, running), durable=False)

    def finish(
        self,
        id: str,
        attempt: int,
        result: bytes,
        usage: Usage,
        kept: float | None = None,
        events: Sequence[model.Event] = (),
    ) -> bool:
        """running -> successful, with the last events; False where the attempt is no longer the current one.

        After `kept` s (None: never) the question is computed again where it is asked again.
        """
        return self._end(id, attempt, "successful", result, usage, kept, events)

    def fail(
        self,
        id: str,
        attempt: int,
        problem: bytes,
        usage: Usage,
        kept: float | None = None,
        events: Sequence[model.Event] = (),
    ) -> bool:
        """running -> failed, with the last events; False where the attempt is no longer the current one."""
        return self._end(id, attempt, "failed", problem, usage, kept, events)

    def _end(
        self,
        id: str,
        attempt: int,
        status: model.JobStatus,
        body: bytes,
        usage: Usage,
        kept: float | None,
        events: Sequence[model.Event],
    ) -> bool:
        def end(session: statements.Session) -> bool:
            statements.add_events(session, [(id, event) for event in events])
            return statements.end(session, id, attempt, status, body, usage, kept)

        return self._write(end, lambda _: [id])

    def release(
        self, id: str, attempt: int, crashed: bool, usage: Usage = NO_USE, left: bytes | None = None
    ) -> model.Job | None:
        """running -> accepted after the worker died; counts a crash where `crashed`.

        A job that was dismissed meanwhile keeps as its result what is `left`: what was finished of it.
        """
        return self._write(lambda s: statements.release(s, id, attempt, crashed, usage, left), lambda _: [id])

    def dismiss(self, id: str, client: str | None = None) -> tuple[model.Job | None, bool]:
        """The job, dismissed for a client and its batches (None: for all), and whether its work is to stop.

        The work stops when nobody waits for it any more: accepted or running -> dismissed, or to the earlier answer of
        a job that was computed again. A final job is returned as it is, an unknown one is None.
        """
        return self._write(
            lambda s: statements.dismiss(s, id) if client is None else statements.leave(s, id, client),
            lambda found: [id] if found[0] is not None else [],
        )

    def recover(self, owner: str | None = None, lease: float = 0.0) -> list[model.Job]:
        """Jobs running for `owner` (None: for anybody), without a heartbeat for `lease` s (0: all) -> accepted.

        Each counts a restart. Returns them.
        """
        return self._write(lambda s: statements.recover(s, owner, lease), _ids)

    def job(self, id: str, with_body: bool = True, client: str | None = None) -> model.Job | None:
        """One job; while it is open, dismissed for a client who cancelled it."""
        return self._read(lambda s: statements.read_job(s, id, with_body, client))

    def jobs(
        self, *, status: model.JobStatus | None = None, kind: str | None = None, client: str | None = None,
        cursor: str | None = None, limit: int = 50,
    ) -> tuple[list[model.Job], str | None]:  # fmt: skip
        """One page, newest first, without bodies, and the cursor of the next one: the id of its last job.

        ValueError: a bad cursor.
        """
        last = None if cursor is None else self.job(cursor, with_body=False)
        if cursor is not None and (last is None or client not in (None, last.client)):
            raise ValueError("not a cursor of this list")
        wanted = {"status": status, "kind": kind, "client": client, "sequence": last and last.sequence}
        chosen = {name: value for name, value in wanted.items() if value is not None}
        where = " AND ".join(f"{name} {'<' if name == 'sequence' else '='} ?" for name in chosen) or "1 = 1"
        query = f"{statements.SELECT} FROM jobs WHERE {where} ORDER BY sequence DESC LIMIT ?"
        found = statements.jobs_of(self._read(lambda s: s.rows(query, *chosen.values(), limit + 1)))
        return found[:limit], found[limit - 1].id if len(found) > limit else None

    def add_events(self, events: Iterable[tuple[str, model.Event]]) -> None:
        """Append events (job id, event); need not be durable."""
        told = list(events)
        if told:
            self._write(lambda s: statements.add_events(s, told), lambda _: {id for id, _ in told}, durable=False)

    def events(self, id: str, after: int = 0, limit: int = 1000) -> list[model.Event]:
        """Events of a job with greater numbers than `after`, in order."""
        query = "SELECT number, kind, data FROM events WHERE id = ? AND number > ? ORDER BY number LIMIT ?"
        rows = self._read(lambda s: s.rows(query, id, after, limit))
        return [model.Event(row["number"], row["kind"], json.loads(row["data"])) for row in rows]

    def create_batch(
        self, id: str, kind: str, client: str, lines: Sequence[statements.BatchLine], bounds: model.Bounds = NO_BOUNDS
    ) -> statements.Batch:
        """Store the batch and the jobs of its lines, all or nothing; one of this id stays as it is.

        In small transactions, between which others are served. One that a death of the service left incomplete is
        unseen, and goes on where it is sent again.
        """
        if (found := self.batch(id)) is not None:
            return found
        asked = [line.request for line in lines if line.request is not None]
        self._read(lambda s: statements.refuse_without_room(s, asked, bounds))
        self._write(lambda s: statements.begin_batch(s, id, kind, client), durable=False)
        try:
            for place in range(0, len(lines), statements.STEP):
                add = partial(statements.add_lines, id=id, lines=lines[place : place + statements.STEP], bounds=bounds)
                self._write(add, lambda _: [""], durable=False)
        except model.TooManyJobs:  # others were faster
            self.dismiss_batch(id)
            self._write(lambda s: statements.forget_batch(s, id))
            raise
        return self._write(lambda s: statements.complete_batch(s, id, len(lines)), lambda _: [""])

    def used_today(self, client: str) -> float:
        """The processor seconds of a client's runs today (UTC)."""
        return self._read(lambda s: statements.used_today(s, client))

    def claim_key(self, client: str, key: str, digest: str) -> bool:
        """Whether a client's key for a batch is new, or came with the same lines before."""
        return self._write(lambda s: statements.claim_key(s, client, key, digest), durable=False)

    def batch(self, id: str) -> statements.Batch | None:
        """One batch with its counts."""
        return self._read(lambda s: statements.read_batch(s, id))

    def batch_answers(
        self, id: str, after: int = 0, limit: int = 500, largest: int = model.NO_BOUND
    ) -> list[statements.BatchAnswer]:
        """Answers with `order` above `after`, in that order: what is done so far; bodies of at most `largest` bytes."""
        return self._read(lambda s: statements.answers(s, id, after, limit, largest))

    def dismiss_batch(self, id: str) -> list[str]:
        """Dismiss the open lines of the batch; the ids of their jobs that nobody else waits for, which stop.

        In small transactions, as they are stored.
        """
        over, left = list[str](), 1
        while left:
            left, some = self._write(lambda s: statements.leave_some(s, id), lambda found: ["", *found[1]])
            over += some
        return over

    def counts(self) -> Mapping[model.JobStatus, int]:
        """Number of jobs in each status."""
        rows = self._read(lambda s: s.rows("SELECT status, count(*) AS jobs FROM jobs GROUP BY status"))
        return {row["status"]: row["jobs"] for row in rows}

    def oldest(self) -> float | None:
        """When the job was accepted that waits longest; None where none waits."""
        query = "SELECT min(created) AS oldest FROM jobs WHERE status = 'accepted'"
        found: float | None = self._read(lambda s: s.rows(query))[0]["oldest"]
        return found

    def prune(self, oldest: float, largest: int) -> int:
        """Forget jobs and batches finished before the time `oldest`, then the oldest until the
        store has at most `largest` bytes; how many jobs were forgotten. Open ones always stay.
        In small transactions, between which others are served; free space goes back to the disk."""
        forgotten = 0
        while (step := self._forget(oldest))[0]:
            forgotten += step[1]
        while self._used_bytes() > largest:
            moment = self._read(lambda s: upkeep.oldest_moment(s, OLDEST))
            step = (0, 0) if moment is None else self._forget(moment)
            if not step[0]:
                break
            forgotten += step[1]
        return forgotten

    def _forget(self, before: float) -> tuple[int, int]:
        return self._write(lambda s: upkeep.forget(s, before, STEP), durable=False)

    # What follows is for an operator; a service that runs over the same store hears of it within seconds.

    def is_drained(self) -> bool:
        """Whether no job begins."""
        return self._read(statements.is_drained)

    def drain(self, drained: bool) -> None:
        """Let no job begin any more, or let them begin again."""
        self._write(lambda s: upkeep.drain(s, drained), lambda _: [""])

    def clients(self) -> list[model.ClientUse]:
        """Who has something in the store, or a rank."""
        return self._read(upkeep.clients)

    def rank_client(self, client: str, rank: int) -> None:
        """The jobs of a client, also those to come, begin before (-1), with (0) or after (1) those of the others."""
        self._write(lambda s: upkeep.rank_client(s, client, rank))

    def prioritise_batch(self, id: str, priority: int) -> int:
        """Give the open jobs of a batch this priority; below 0 goes before all others, above 10 after them."""
        return self._write(lambda s: upkeep.prioritise_batch(s, id, priority))

    def dismiss_client(self, client: str) -> list[str]:
        """Dismiss whatever is open for a client; the ids of the jobs that nobody else waits for, which stop."""
        own = self._read(lambda s: s.rows("SELECT id FROM batches WHERE client = ? ORDER BY id", client))
        ended = [id for batch in own for id in self.dismiss_batch(batch["id"])]
        return ended + self._write(lambda s: upkeep.leave_all(s, client), lambda ids: [*ids, ""])

    def erase_client(self, client: str) -> int:
        """Forget all jobs, answers and batches of a client that no other one asked for; how many jobs."""
        self.dismiss_client(client)
        return self._write(lambda s: upkeep.erase(s, client), lambda _: [""])


def _ids(jobs: Iterable[model.Job]) -> list[str]:
    return [job.id for job in jobs]

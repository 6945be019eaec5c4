"""The job store in one SQLite file: write-ahead log, synchronous=FULL, one process, one writing thread."""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from inverse_service.service.jobs import sqlite_statements as statements
from inverse_service.service.jobs.lock import SupervisorLock
from inverse_service.service.jobs.model import Batch, BatchAnswer, BatchLine, Bounds, Event, Job, JobRequest, Usage
from inverse_service.service.jobs.pruning import pruned
from inverse_service.service.jobs.rows import answer_of, sequence_of
from inverse_service.service.jobs.shared_sql import ANSWERS, OLDEST, SELECT
from inverse_service.service.jobs.sqlite_schema import connect, prepare
from inverse_service.service.jobs.sqlite_writer import Writer
from inverse_service.service.jobs.states import JobStatus
from inverse_service.service.jobs.store import NO_BOUND

NO_BOUNDS = Bounds()
# Each time another value, or nothing would be written.
PROBE = "INSERT INTO counters VALUES ('probe', 1) ON CONFLICT (name) DO UPDATE SET value = value + 1"
PAGES_AT_ONCE, PAGES_KEPT = 256, 2048


class SqliteStore:
    """See `store.JobStore`. Raises DatabaseTaken where another process has this file.

    `durable=False` leaves out the fsync, for a store that is deleted at the end.
    """

    def __init__(self, path: Path, durable: bool = True) -> None:
        self._path = str(path)
        self._lock = SupervisorLock(path)
        try:
            connection = connect(self._path)
            try:
                prepare(connection)
            except BaseException:
                connection.close()
                raise
        except BaseException:
            self._lock.release()
            raise
        self._writer = Writer(connection, durable)
        self._local = threading.local()
        self._readers: list[sqlite3.Connection] = []
        self._guard = threading.Lock()
        self._listeners: list[Callable[[str], None]] = []

    @property
    def exclusive(self) -> bool:
        return True

    def submit(self, requests: Sequence[JobRequest], bounds: Bounds = NO_BOUNDS) -> list[Job]:
        jobs, accepted = self._writer.write(lambda c: statements.submit(c, requests, bounds))
        self._tell(accepted)
        return jobs

    def claim(self, owner: str, limit: int, client_running: int = NO_BOUND) -> list[Job]:
        jobs = self._writer.write(lambda c: statements.claim(c, owner, limit, client_running), durable=False)
        self._tell(job.id for job in jobs)
        return jobs

    def heartbeat(self, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
        query = "SELECT 1 FROM jobs WHERE id = ? AND attempt = ? AND status = 'running' AND owner = ?"
        reader = self._reader()
        # One process has the database, so its claims need no renewal.
        return [id for id, attempt in running if reader.execute(query, (id, attempt, owner)).fetchone() is None]

    def finish(self, id: str, attempt: int, result: bytes, usage: Usage, kept: float | None = None) -> bool:
        return self._end(id, attempt, "successful", result, usage, kept)

    def fail(self, id: str, attempt: int, problem: bytes, usage: Usage, kept: float | None = None) -> bool:
        return self._end(id, attempt, "failed", problem, usage, kept)

    def release(self, id: str, attempt: int, crashed: bool) -> Job | None:
        job = self._writer.write(lambda c: statements.release(c, id, attempt, crashed))
        self._tell([id])
        return job

    def dismiss(self, id: str, client: str | None = None) -> tuple[Job | None, bool]:
        job, changed = self._writer.write(
            lambda c: statements.dismiss(c, id) if client is None else statements.leave(c, id, client)
        )
        self._tell([id])
        return job, changed

    def recover(self, owner: str | None = None, lease: float = 0.0) -> list[Job]:
        return self._writer.write(lambda c: statements.recover(c, owner, lease))

    def job(self, id: str, with_body: bool = True, client: str | None = None) -> Job | None:
        return statements.read_job(self._reader(), id, with_body, client)

    def jobs(
        self, *, status: JobStatus | None = None, kind: str | None = None, client: str | None = None,
        cursor: str | None = None, limit: int = 50,
    ) -> tuple[list[Job], str | None]:  # fmt: skip
        wanted = {"status": status, "kind": kind, "client": client, "sequence": sequence_of(cursor)}
        chosen = {name: value for name, value in wanted.items() if value is not None}
        where = " AND ".join(f"{name} {'<' if name == 'sequence' else '='} ?" for name in chosen) or "1"
        query = f"{SELECT} FROM jobs WHERE {where} ORDER BY sequence DESC LIMIT ?"
        rows = self._reader().execute(query, (*chosen.values(), limit + 1)).fetchall()
        found = [statements.job_of(row) for row in rows[:limit]]
        return found, str(found[-1].sequence) if len(rows) > limit else None

    def add_events(self, events: Iterable[tuple[str, Event]]) -> None:
        rows = [(id, event.number, event.kind, json.dumps(dict(event.data))) for id, event in events]
        insert = "INSERT OR IGNORE INTO events VALUES (?, ?, ?, ?)"
        self._writer.write(lambda c: c.executemany(insert, rows).rowcount, durable=False)
        self._tell({row[0] for row in rows})

    def events(self, id: str, after: int = 0, limit: int = 1000) -> list[Event]:
        query = "SELECT number, kind, data FROM events WHERE id = ? AND number > ? ORDER BY number LIMIT ?"
        rows = self._reader().execute(query, (id, after, limit)).fetchall()
        return [Event(row["number"], row["kind"], json.loads(row["data"])) for row in rows]

    def create_batch(
        self, id: str, kind: str, client: str, lines: Sequence[BatchLine], bounds: Bounds = NO_BOUNDS
    ) -> Batch:
        batch = self._writer.write(lambda c: statements.create_batch(c, id, kind, client, lines, bounds))
        self._tell([""])
        return batch

    def batch(self, id: str) -> Batch | None:
        return statements.read_batch(self._reader(), id)

    def batch_answers(self, id: str, after: int = 0, limit: int = 500, largest: int = NO_BOUND) -> list[BatchAnswer]:
        return [answer_of(row) for row in self._reader().execute(ANSWERS, (largest, id, after, limit))]

    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        row = self._reader().execute("SELECT rowid, length(body) AS size FROM bodies WHERE id = ?", (id,)).fetchone()
        if row is None:
            return 0, b""
        with self._reader().blobopen("bodies", "body", row["rowid"], readonly=True) as blob:
            blob.seek(min(offset, len(blob)))
            return len(blob), blob.read(size)

    @property
    def address(self) -> str:
        return self._path

    def dismiss_batch(self, id: str) -> list[str]:
        dismissed = self._writer.write(lambda c: statements.leave_batch(c, id))
        self._tell(dismissed or [""])
        return dismissed

    def counts(self) -> Mapping[JobStatus, int]:
        rows = self._reader().execute("SELECT status, count(*) AS jobs FROM jobs GROUP BY status")
        return {row["status"]: row["jobs"] for row in rows}

    def measure(self) -> tuple[float | None, int]:
        return self._reader().execute(OLDEST).fetchone()[0], self._used_bytes()

    def try_to_write(self) -> None:
        self._reader().execute(f"{SELECT} FROM jobs LIMIT 0")
        self._writer.write(lambda c: c.execute(PROBE).rowcount)

    def prune(self, oldest: float, largest: int) -> int:
        forgotten = pruned(self._forget, self._oldest_moment, self._used_bytes, oldest, largest)
        while self._writer.write(_give_back, durable=False):
            pass
        return forgotten

    def on_change(self, listener: Callable[[str], None]) -> None:
        self._listeners.append(listener)

    def close(self) -> None:
        self._writer.close()
        with self._guard:
            for reader in self._readers:
                reader.close()
            self._readers.clear()
        self._lock.release()

    def _forget(self, before: float, most: int) -> tuple[int, int]:
        return self._writer.write(lambda c: statements.forget(c, before, most), durable=False)

    def _oldest_moment(self, count: int) -> float | None:
        return statements.oldest_moment(self._reader(), count)

    def _used_bytes(self) -> int:
        return statements.used_bytes(self._reader())

    def _end(self, id: str, attempt: int, status: JobStatus, body: bytes, usage: Usage, kept: float | None) -> bool:
        ended = self._writer.write(lambda c: statements.end(c, id, attempt, status, body, usage, kept))
        self._tell([id])
        return ended

    def _reader(self) -> sqlite3.Connection:
        """A connection for reading of this thread's own."""
        found: sqlite3.Connection | None = getattr(self._local, "connection", None)
        if found is None:
            found = self._local.connection = connect(self._path, read_only=True)
            with self._guard:
                self._readers.append(found)
        return found

    def _tell(self, ids: Iterable[str]) -> None:
        for id in ids:
            for listener in self._listeners:
                listener(id)


def _give_back(connection: sqlite3.Connection) -> bool:
    """Give some free pages back to the disk; whether many are left."""
    if statements.pragma(connection, "auto_vacuum") == 0:
        return False
    connection.execute(f"PRAGMA incremental_vacuum({PAGES_AT_ONCE})").fetchall()
    return statements.pragma(connection, "freelist_count") > PAGES_KEPT

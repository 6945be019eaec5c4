"""The job store in PostgreSQL: several front ends, each with its own supervisor, share one."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, TypeVar

import psycopg

from inverse_service.errors import InputError
from inverse_service.service.jobs import postgres_pruning as pruning
from inverse_service.service.jobs import postgres_statements as statements
from inverse_service.service.jobs.model import (
    Batch,
    BatchAnswer,
    BatchLine,
    Bounds,
    Event,
    Job,
    JobRequest,
    Usage,
    WrongVersion,
)
from inverse_service.service.jobs.postgres_changes import Changes
from inverse_service.service.jobs.postgres_connections import Connection, Connections, Row
from inverse_service.service.jobs.pruning import pruned
from inverse_service.service.jobs.rows import answer_of, sequence_of
from inverse_service.service.jobs.shared_sql import ANSWERS, OLDEST, SELECT
from inverse_service.service.jobs.states import JobStatus
from inverse_service.service.jobs.store import NO_BOUND

T = TypeVar("T")
PART_OF_BODY: Final = (
    "SELECT length(body) AS size, substring(body FROM %s::int FOR %s::int) AS part FROM bodies WHERE id = %s"
)
NO_BOUNDS = Bounds()


class PostgresStore:
    """See `store.JobStore`. Raises InputError where the database cannot be used, StoreUnavailable later."""

    def __init__(self, address: str) -> None:
        try:
            self._address = address
            self._connections = Connections(address)
        except psycopg.OperationalError as error:
            reason = str(error).strip().partition("\n")[0][:300]
            raise InputError(f"The PostgreSQL database of INVERSE_SERVICE_DATABASE cannot be used: {reason}") from None
        except (psycopg.Error, WrongVersion, UnicodeError) as error:
            reason = str(error) if isinstance(error, WrongVersion) else f"wrong address or rights ({_name(error)})"
            raise InputError(f"The PostgreSQL database of INVERSE_SERVICE_DATABASE cannot be used: {reason}.") from None
        self._changes = Changes(address)

    @property
    def exclusive(self) -> bool:
        return False

    def submit(self, requests: Sequence[JobRequest], bounds: Bounds = NO_BOUNDS) -> list[Job]:
        return self._write(lambda c: statements.submit(c, requests, bounds), lambda found: found[1])[0]

    def claim(self, owner: str, limit: int, client_running: int = NO_BOUND) -> list[Job]:
        def change(connection: Connection) -> list[Job]:
            return statements.claim(connection, owner, limit, client_running)

        return self._write(change, lambda jobs: [job.id for job in jobs], durable=False)

    def heartbeat(self, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
        if not running:
            return []
        return self._connections.write(lambda c: statements.heartbeat(c, owner, running), durable=False)

    def finish(self, id: str, attempt: int, result: bytes, usage: Usage, kept: float | None = None) -> bool:
        return self._end(id, attempt, "successful", result, usage, kept)

    def fail(self, id: str, attempt: int, problem: bytes, usage: Usage, kept: float | None = None) -> bool:
        return self._end(id, attempt, "failed", problem, usage, kept)

    def release(self, id: str, attempt: int, crashed: bool) -> Job | None:
        return self._write(lambda c: statements.release(c, id, attempt, crashed), lambda job: [id])

    def dismiss(self, id: str, client: str | None = None) -> tuple[Job | None, bool]:
        def change(connection: Connection) -> tuple[Job | None, bool]:
            return statements.dismiss(connection, id) if client is None else statements.leave(connection, id, client)

        return self._write(change, lambda found: [id] if found[0] is not None else [])

    def recover(self, owner: str | None = None, lease: float = 0.0) -> list[Job]:
        return self._write(lambda c: statements.recover(c, owner, lease), lambda jobs: [job.id for job in jobs])

    def job(self, id: str, with_body: bool = True, client: str | None = None) -> Job | None:
        return self._connections.read(lambda c: statements.read_job(c, id, with_body, client))

    def jobs(
        self, *, status: JobStatus | None = None, kind: str | None = None, client: str | None = None,
        cursor: str | None = None, limit: int = 50,
    ) -> tuple[list[Job], str | None]:  # fmt: skip
        wanted = {"status": status, "kind": kind, "client": client, "sequence": sequence_of(cursor)}
        chosen = {name: value for name, value in wanted.items() if value is not None}
        where = " AND ".join(f"{name} {'<' if name == 'sequence' else '='} %s" for name in chosen) or "true"
        query = f"{SELECT} FROM jobs WHERE {where} ORDER BY sequence DESC LIMIT %s"
        rows = self._rows(query, *chosen.values(), limit + 1)
        found = [statements.job_of(row) for row in rows[:limit]]
        return found, str(found[-1].sequence) if len(rows) > limit else None

    def add_events(self, events: Iterable[tuple[str, Event]]) -> None:
        rows = [(id, event.number, event.kind, json.dumps(dict(event.data))) for id, event in events]
        insert = "INSERT INTO events VALUES (%s, %s, %s, %s) ON CONFLICT DO NOTHING"

        def change(connection: Connection) -> None:
            with connection.cursor() as cursor:
                cursor.executemany(insert, rows)

        self._write(change, lambda _: sorted({row[0] for row in rows}), durable=False)

    def events(self, id: str, after: int = 0, limit: int = 1000) -> list[Event]:
        query = "SELECT number, kind, data FROM events WHERE id = %s AND number > %s ORDER BY number LIMIT %s"
        rows = self._rows(query, id, after, limit)
        return [Event(row["number"], row["kind"], json.loads(row["data"])) for row in rows]

    def create_batch(
        self, id: str, kind: str, client: str, lines: Sequence[BatchLine], bounds: Bounds = NO_BOUNDS
    ) -> Batch:
        return self._write(lambda c: statements.create_batch(c, id, kind, client, lines, bounds), lambda _: [""])

    def batch(self, id: str) -> Batch | None:
        return self._connections.read(lambda c: statements.read_batch(c, id))

    def batch_answers(self, id: str, after: int = 0, limit: int = 500, largest: int = NO_BOUND) -> list[BatchAnswer]:
        return [answer_of(row) for row in self._rows(statements.marked(ANSWERS), largest, id, after, limit)]

    def part(self, id: str, offset: int, size: int) -> tuple[int, bytes]:
        rows = self._rows(PART_OF_BODY, offset + 1, size, id)
        return (rows[0]["size"], bytes(rows[0]["part"])) if rows else (0, b"")

    @property
    def address(self) -> str:
        return self._address

    def dismiss_batch(self, id: str) -> list[str]:
        return self._write(lambda c: statements.leave_batch(c, id), lambda ids: ids or [""])

    def counts(self) -> Mapping[JobStatus, int]:
        rows = self._rows("SELECT status, count(*) AS jobs FROM jobs GROUP BY status")
        return {row["status"]: row["jobs"] for row in rows}

    def measure(self) -> tuple[float | None, int]:
        rows = self._rows(f"SELECT ({OLDEST}) AS oldest, pg_database_size(current_database()) AS size")
        return rows[0]["oldest"], int(rows[0]["size"])

    def try_to_write(self) -> None:
        self._rows(f"{SELECT} FROM jobs LIMIT 0")
        # With a number of its own a transaction is written to the log of the server.
        self._connections.write(lambda c: c.execute("SELECT pg_current_xact_id()").rowcount)

    def prune(self, oldest: float, largest: int) -> int:
        connections = self._connections
        return pruned(
            lambda before, most: connections.write(lambda c: pruning.forget(c, before, most)),
            lambda count: connections.read(lambda c: pruning.oldest_moment(c, count)),
            lambda: connections.read(pruning.used_bytes),
            oldest,
            largest,
        )

    def on_change(self, listener: Callable[[str], None]) -> None:
        self._changes.on_change(listener)

    def close(self) -> None:
        self._changes.close()
        self._connections.close()

    def _end(self, id: str, attempt: int, status: JobStatus, body: bytes, usage: Usage, kept: float | None) -> bool:
        return self._write(lambda c: statements.end(c, id, attempt, status, body, usage, kept), lambda _: [id])

    def _write(
        self, change: Callable[[Connection], T], changed: Callable[[T], Sequence[str]], durable: bool = True
    ) -> T:
        """Make a change, and tell here and elsewhere which jobs it was about."""

        def announced(connection: Connection) -> T:
            value = change(connection)
            self._changes.announce(connection, changed(value))
            return value

        value = self._connections.write(announced, durable)
        self._changes.tell(changed(value))
        return value

    def _rows(self, query: str, *arguments: Any) -> list[Row]:
        return self._connections.read(lambda c: c.execute(query, arguments).fetchall())


def _name(error: Exception) -> str:
    return type(error).__name__

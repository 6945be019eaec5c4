"""What the SQLite store does inside a transaction, as functions of its connection."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Sequence
from typing import Any

from inverse_service.service.jobs.model import Batch, BatchLine, Bounds, Job, JobRequest, TooManyJobs, Usage
from inverse_service.service.jobs.states import FINAL, JobStatus

COLUMNS = (
    "id", "kind", "document", "options", "status", "client", "priority", "created", "started", "finished",
    "attempt", "crashes", "restarts", "revision", "sequence", "wall", "cpu", "memory",
)  # fmt: skip
SELECT = f"SELECT {', '.join('jobs.' + name for name in COLUMNS)}"
AGAIN = (
    "UPDATE jobs SET status = 'accepted', client = ?, priority = ?, created = ?, started = NULL, finished = NULL, "
    "attempt = attempt + 1, crashes = 0, restarts = 0, owner = NULL WHERE id = ?"
)
INSERT = (
    "INSERT INTO jobs (id, kind, document, options, status, client, priority, created) "
    "VALUES (?, ?, ?, ?, 'accepted', ?, ?, ?)"
)


def job_of(row: sqlite3.Row) -> Job:
    """A row of SELECT, with a `body` if the query has one."""
    return Job(**dict(row))


def read_job(connection: sqlite3.Connection, id: str, with_body: bool = True) -> Job | None:
    """One job; the body only where it is that of the present status."""
    body = ", bodies.body" if with_body else ""
    join = " LEFT JOIN bodies ON bodies.id = jobs.id AND bodies.status = jobs.status" if with_body else ""
    row = connection.execute(f"{SELECT}{body} FROM jobs{join} WHERE jobs.id = ?", (id,)).fetchone()
    return None if row is None else job_of(row)


def submit(
    connection: sqlite3.Connection, requests: Sequence[JobRequest], bounds: Bounds, with_bodies: bool = True
) -> tuple[list[Job], list[str]]:
    """The jobs, and the ids of those accepted by this call."""
    room = _room(connection, requests, bounds)
    jobs: list[Job] = []
    accepted: list[str] = []
    for request in requests:
        job = read_job(connection, request.id, with_bodies)
        if job is None or job.status == "dismissed" or (request.fresh and job.is_final):
            if len(accepted) >= room:
                raise TooManyJobs("Too many jobs wait already; let some of them end and try again.")
            _accept(connection, request, is_known=job is not None)
            accepted.append(request.id)
            job = read_job(connection, request.id, with_body=False)
        assert job is not None
        jobs.append(job)
    return jobs, accepted


def _room(connection: sqlite3.Connection, requests: Sequence[JobRequest], bounds: Bounds) -> int:
    count = "SELECT count(*) FROM jobs WHERE status IN ('accepted', 'running')"
    room: int = bounds.total - connection.execute(count).fetchone()[0]
    for client in {request.client for request in requests}:
        room = min(room, bounds.client - connection.execute(count + " AND client = ?", (client,)).fetchone()[0])
    return room


def _accept(connection: sqlite3.Connection, request: JobRequest, is_known: bool) -> None:
    now = time.time()
    if is_known:
        connection.execute(AGAIN, (request.client, request.priority, now, request.id))
        connection.execute("DELETE FROM events WHERE id = ?", (request.id,))
        return
    values = (request.id, request.kind, request.document, request.options, request.client, request.priority, now)
    connection.execute(INSERT, values)


def claim(connection: sqlite3.Connection, owner: str, limit: int, excluded: Sequence[str]) -> list[Job]:
    """The next jobs, now running."""
    marks = ", ".join("?" * len(excluded))
    where = f" AND client NOT IN ({marks})" if excluded else ""
    query = f"SELECT id FROM jobs WHERE status = 'accepted'{where} ORDER BY priority, sequence LIMIT ?"
    ids = [row["id"] for row in connection.execute(query, (*excluded, limit)).fetchall()]
    now = time.time()
    for id in ids:
        connection.execute(
            "UPDATE jobs SET status = 'running', owner = ?, heartbeat = ?, started = ?, attempt = attempt + 1 "
            "WHERE id = ?",
            (owner, now, now, id),
        )
    found = [read_job(connection, id, with_body=False) for id in ids]
    return [job for job in found if job is not None]


def end(connection: sqlite3.Connection, id: str, attempt: int, status: JobStatus, body: bytes, usage: Usage) -> bool:
    """running -> successful or failed, for the current attempt only."""
    changed = connection.execute(
        "UPDATE jobs SET status = ?, finished = ?, revision = revision + 1, wall = ?, cpu = ?, memory = ?, "
        "owner = NULL WHERE id = ? AND attempt = ? AND status = 'running'",
        (status, time.time(), usage.wall, usage.cpu, usage.memory, id, attempt),
    ).rowcount
    if changed:
        connection.execute("INSERT OR REPLACE INTO bodies (id, status, body) VALUES (?, ?, ?)", (id, status, body))
        _answer_lines(connection, id)
    return bool(changed)


def release(connection: sqlite3.Connection, id: str, attempt: int, crashed: bool) -> Job | None:
    """running -> accepted."""
    connection.execute(
        "UPDATE jobs SET status = 'accepted', owner = NULL, crashes = crashes + ? "
        "WHERE id = ? AND attempt = ? AND status = 'running'",
        (int(crashed), id, attempt),
    )
    return read_job(connection, id, with_body=False)


def dismiss(connection: sqlite3.Connection, id: str) -> tuple[Job | None, bool]:
    """The job, and whether this call dismissed it."""
    changed = connection.execute(
        "UPDATE jobs SET status = 'dismissed', finished = ?, owner = NULL "
        "WHERE id = ? AND status IN ('accepted', 'running')",
        (time.time(), id),
    ).rowcount
    if changed:
        connection.execute("DELETE FROM bodies WHERE id = ?", (id,))
        _answer_lines(connection, id)
    return read_job(connection, id), bool(changed)


def recover(connection: sqlite3.Connection, owner: str | None, lease: float) -> list[Job]:
    """Running jobs whose owner is gone are accepted again."""
    where = "status = 'running' AND heartbeat <= ?" + ("" if owner is None else " AND owner = ?")
    arguments: tuple[Any, ...] = (time.time() - lease, *(() if owner is None else (owner,)))
    ids = [row["id"] for row in connection.execute(f"SELECT id FROM jobs WHERE {where}", arguments).fetchall()]
    for id in ids:
        connection.execute(
            "UPDATE jobs SET status = 'accepted', owner = NULL, restarts = restarts + 1 WHERE id = ?", (id,)
        )
    found = [read_job(connection, id, with_body=False) for id in ids]
    return [job for job in found if job is not None]


def create_batch(
    connection: sqlite3.Connection, id: str, kind: str, client: str, lines: Sequence[BatchLine], bounds: Bounds
) -> Batch:
    """The batch, its lines, the jobs that are new; the batch as it is where it is there already."""
    if (found := read_batch(connection, id)) is not None:
        return found
    requests = [line.request for line in lines if line.request is not None]
    jobs, _ = submit(connection, requests, bounds, with_bodies=False)
    answered = {job.id for job in jobs if job.status in FINAL}
    now = time.time()
    connection.execute("INSERT INTO batches VALUES (?, ?, ?, ?, ?)", (id, kind, client, now, len(lines)))
    for line in lines:
        job = None if line.request is None else line.request.id
        order = _next_order(connection) if job is None or job in answered else None
        values = (id, line.number, line.identifier, job, line.problem, order)
        connection.execute("INSERT INTO lines VALUES (?, ?, ?, ?, ?, ?)", values)
    return read_batch(connection, id) or Batch(id, kind, client, now, 0, {})


def read_batch(connection: sqlite3.Connection, id: str) -> Batch | None:
    """A batch with its counts by status."""
    row = connection.execute("SELECT * FROM batches WHERE id = ?", (id,)).fetchone()
    if row is None:
        return None
    counts = connection.execute(
        "SELECT coalesce(jobs.status, 'failed') AS status, count(*) AS lines FROM lines "
        "LEFT JOIN jobs ON jobs.id = lines.job WHERE batch = ? GROUP BY 1",
        (id,),
    ).fetchall()
    by_status = {c["status"]: c["lines"] for c in counts}
    return Batch(id, row["kind"], row["client"], row["created"], row["total"], by_status)


def prune(connection: sqlite3.Connection, oldest: float, largest: int) -> int:
    """Forget what is old, then what makes the store too large; the number of jobs forgotten."""
    forgotten = _forget(connection, "finished < ?", (oldest,), before=oldest)
    while _size(connection) > largest:
        row = connection.execute(
            "SELECT max(finished) AS newest FROM (SELECT finished FROM jobs "
            "WHERE status NOT IN ('accepted', 'running') ORDER BY finished LIMIT 100)"
        ).fetchone()
        found = 0 if row["newest"] is None else _forget(connection, "finished <= ?", (row["newest"],), row["newest"])
        if not found:
            break
        forgotten += found
    return forgotten


def _forget(connection: sqlite3.Connection, where: str, arguments: tuple[Any, ...], before: float) -> int:
    """Finished jobs, and first the batches from before that have nothing open any more."""
    open_lines = (
        "SELECT 1 FROM lines JOIN jobs ON jobs.id = lines.job WHERE lines.batch = batches.id "
        "AND jobs.status IN ('accepted', 'running')"
    )
    connection.execute(f"DELETE FROM batches WHERE created <= ? AND NOT EXISTS ({open_lines})", (before,))
    connection.execute("DELETE FROM lines WHERE batch NOT IN (SELECT id FROM batches)")
    chosen = (
        f"SELECT id FROM jobs WHERE status NOT IN ('accepted', 'running') AND {where} "
        "AND id NOT IN (SELECT job FROM lines WHERE job IS NOT NULL)"
    )
    connection.execute(f"DELETE FROM bodies WHERE id IN ({chosen})", arguments)
    connection.execute(f"DELETE FROM events WHERE id IN ({chosen})", arguments)
    return connection.execute(f"DELETE FROM jobs WHERE id IN ({chosen})", arguments).rowcount


def _size(connection: sqlite3.Connection) -> int:
    """Bytes in use; pages set free are used again and do not count."""
    value: Callable[[str], int] = lambda name: connection.execute(f"PRAGMA {name}").fetchone()[0]  # noqa: E731
    return (value("page_count") - value("freelist_count")) * value("page_size")


def _answer_lines(connection: sqlite3.Connection, id: str) -> None:
    """Number the lines that wait for this job, in the order in which answers come."""
    waiting = connection.execute(
        "SELECT batch, number FROM lines WHERE job = ? AND order_number IS NULL ORDER BY batch, number", (id,)
    ).fetchall()
    for row in waiting:
        order = _next_order(connection)
        connection.execute(
            "UPDATE lines SET order_number = ? WHERE batch = ? AND number = ?", (order, row["batch"], row["number"])
        )


def _next_order(connection: sqlite3.Connection) -> int:
    row = connection.execute("UPDATE counters SET value = value + 1 WHERE name = 'order' RETURNING value").fetchone()
    return int(row["value"])

"""What the SQLite store does inside a transaction, as functions of its connection."""

from __future__ import annotations

import itertools
import sqlite3
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from inverse_service.service.jobs.model import Batch, BatchLine, Bounds, Job, JobRequest, TooManyJobs, Usage
from inverse_service.service.jobs.shared_sql import BODY, COUNTS, NEXT, OPEN, SELECT, WAITED_FOR
from inverse_service.service.jobs.states import FINAL, JobStatus

AGAIN = (
    "UPDATE jobs SET status = 'accepted', client = ?, priority = ?, created = ?, started = NULL, finished = NULL, "
    "attempt = attempt + 1, crashes = 0, restarts = 0, owner = NULL WHERE id = ?"
)
# So many bytes of answers are forgotten at once, and one answer however large.
FORGOTTEN_BYTES = 8 * 2**20
INSERT = (
    "INSERT INTO jobs (id, kind, document, options, status, client, priority, created) "
    "VALUES (?, ?, ?, ?, 'accepted', ?, ?, ?)"
)


def job_of(row: sqlite3.Row) -> Job:
    """A row of SELECT, with a `body` if the query has one."""
    return Job(**dict(row))


def read_job(connection: sqlite3.Connection, id: str, with_body: bool = True, client: str | None = None) -> Job | None:
    """One job; the body only where it is that of the present status. Open, it is dismissed for who has left it."""
    body, join = (", bodies.body", BODY) if with_body else ("", "")
    row = connection.execute(f"{SELECT}{body} FROM jobs {join} WHERE jobs.id = ?", (id,)).fetchone()
    job = None if row is None else job_of(row)
    if job is None or client is None or not job.is_open:
        return job
    left = connection.execute("SELECT 1 FROM askers WHERE job = ? AND client = ? AND gone = 1", (id, client)).fetchone()
    return job if left is None else replace(job, status="dismissed")


def submit(
    connection: sqlite3.Connection, requests: Sequence[JobRequest], bounds: Bounds, of_batch: bool = False
) -> tuple[list[Job], list[str]]:
    """The jobs, and the ids of those accepted by this call; those of a batch without bodies, for its lines wait."""
    room = _room(connection, requests, bounds)
    now = time.time()
    jobs: list[Job] = []
    accepted: list[str] = []
    for request in requests:
        job = read_job(connection, request.id, not of_batch)
        if job is None or job.is_to_be_asked(request.fresh, now):
            if len(accepted) >= room:
                raise TooManyJobs("Too many jobs wait already; let some of them end and try again.")
            _accept(connection, request, is_known=job is not None)
            accepted.append(request.id)
            job = read_job(connection, request.id, with_body=False)
        assert job is not None
        if job.is_open and not of_batch:
            connection.execute("INSERT OR REPLACE INTO askers VALUES (?, ?, 0)", (job.id, request.client))
        jobs.append(job)
    return jobs, accepted


def _room(connection: sqlite3.Connection, requests: Sequence[JobRequest], bounds: Bounds) -> int:
    count = f"SELECT count(*) FROM jobs WHERE {OPEN}"
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


def claim(connection: sqlite3.Connection, owner: str, limit: int, client_running: int) -> list[Job]:
    """The next jobs, now running; at most `client_running` of one client."""
    ids = [row["id"] for row in connection.execute(NEXT, (limit, client_running, limit)).fetchall()]
    now = time.time()
    for id in ids:
        connection.execute(
            "UPDATE jobs SET status = 'running', owner = ?, heartbeat = ?, started = ?, attempt = attempt + 1 "
            "WHERE id = ?",
            (owner, now, now, id),
        )
    found = [read_job(connection, id, with_body=False) for id in ids]
    return [job for job in found if job is not None]


def end(
    connection: sqlite3.Connection, id: str, attempt: int, status: JobStatus, body: bytes, usage: Usage,
    kept: float | None,
) -> bool:  # fmt: skip
    """running -> successful or failed, for the current attempt only; kept for so many seconds, None: always."""
    now = time.time()
    expires = None if kept is None else now + kept
    changed = connection.execute(
        "UPDATE jobs SET status = ?, finished = ?, expires = ?, revision = revision + 1, wall = ?, cpu = ?, "
        "memory = ?, owner = NULL WHERE id = ? AND attempt = ? AND status = 'running'",
        (status, now, expires, usage.wall, usage.cpu, usage.memory, id, attempt),
    ).rowcount
    if changed:
        connection.execute("DELETE FROM askers WHERE job = ?", (id,))
        connection.execute("INSERT OR REPLACE INTO bodies (id, status, body) VALUES (?, ?, ?)", (id, status, body))
        _number_lines(connection, "job = ?", (id,))
    return bool(changed)


def release(connection: sqlite3.Connection, id: str, attempt: int, crashed: bool) -> Job | None:
    """running -> accepted."""
    connection.execute(
        "UPDATE jobs SET status = 'accepted', owner = NULL, crashes = crashes + ? "
        "WHERE id = ? AND attempt = ? AND status = 'running'",
        (int(crashed), id, attempt),
    )
    return read_job(connection, id, with_body=False)


def leave(connection: sqlite3.Connection, id: str, client: str) -> tuple[Job | None, bool]:
    """The job, dismissed for this client and its batches, and whether it was dismissed because nobody else waits."""
    job = read_job(connection, id)
    if job is None or not job.is_open:
        return job, False
    connection.execute("INSERT OR REPLACE INTO askers VALUES (?, ?, 1)", (id, client))
    _dismiss_lines(connection, "job = ? AND batch IN (SELECT id FROM batches WHERE client = ?)", (id, client))
    return (replace(job, status="dismissed"), False) if _is_waited_for(connection, id) else dismiss(connection, id)


def leave_batch(connection: sqlite3.Connection, batch: str) -> list[str]:
    """Dismiss the open lines of a batch, and those of their jobs that nobody else waits for: their ids."""
    query = "SELECT DISTINCT job FROM lines WHERE batch = ? AND order_number IS NULL"
    ids = [row["job"] for row in connection.execute(query, (batch,)).fetchall()]
    _dismiss_lines(connection, "batch = ?", (batch,))
    return [id for id in ids if not _is_waited_for(connection, id) and dismiss(connection, id)[1]]


def dismiss(connection: sqlite3.Connection, id: str) -> tuple[Job | None, bool]:
    """The job, and whether this call ended it; one that was computed again has its earlier answer back."""
    earlier = "coalesce((SELECT bodies.status FROM bodies WHERE bodies.id = jobs.id), 'dismissed')"
    changed = connection.execute(
        f"UPDATE jobs SET status = {earlier}, finished = ?, owner = NULL WHERE id = ? AND {OPEN}", (time.time(), id)
    ).rowcount
    if changed:
        connection.execute("DELETE FROM askers WHERE job = ?", (id,))
        _dismiss_lines(connection, "job = ?", (id,))
    return read_job(connection, id), bool(changed)


def recover(connection: sqlite3.Connection, owner: str | None, lease: float) -> list[Job]:
    """Running jobs whose owner is gone are accepted again; without a lease all, whatever the clock says."""
    where, arguments = "status = 'running'", list[Any]()
    if lease > 0:  # a claim from the future is of a clock that was set back
        where += " AND (heartbeat <= ? OR heartbeat > ?)"
        arguments += [time.time() - lease, time.time() + lease]
    if owner is not None:
        where += " AND owner = ?"
        arguments.append(owner)
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
    jobs, _ = submit(connection, requests, bounds, of_batch=True)
    answered = {job.id for job in jobs if job.status in FINAL}
    now = time.time()
    connection.execute("INSERT INTO batches VALUES (?, ?, ?, ?, ?)", (id, kind, client, now, len(lines)))
    for line in lines:
        job = None if line.request is None else line.request.id
        order = _next_order(connection) if job is None or job in answered else None
        values = (id, line.number, line.identifier, job, line.problem, order)
        connection.execute("INSERT INTO lines VALUES (?, ?, ?, ?, ?, ?, 0)", values)
    return read_batch(connection, id) or Batch(id, kind, client, now, 0, {})


def read_batch(connection: sqlite3.Connection, id: str) -> Batch | None:
    """A batch with its counts by status."""
    row = connection.execute("SELECT * FROM batches WHERE id = ?", (id,)).fetchone()
    if row is None:
        return None
    counts = connection.execute(COUNTS, (id,)).fetchall()
    by_status = {c["status"]: c["lines"] for c in counts}
    return Batch(id, row["kind"], row["client"], row["created"], row["total"], by_status)


def forget(connection: sqlite3.Connection, before: float, most: int) -> tuple[int, int]:
    """Forget a little: lines of a batch from before with nothing open, or where there is none, finished jobs.

    How many rows were forgotten, and how many of them are jobs. Those that a kept batch names stay.
    """
    batch = connection.execute(
        "SELECT id FROM batches WHERE created <= ? AND NOT EXISTS (SELECT 1 FROM lines WHERE batch = batches.id "
        "AND order_number IS NULL) ORDER BY created LIMIT 1",
        (before,),
    ).fetchone()
    if batch is not None:
        numbers = "SELECT number FROM lines WHERE batch = ? LIMIT ?"
        some = (batch["id"], batch["id"], most)
        lines = connection.execute(f"DELETE FROM lines WHERE batch = ? AND number IN ({numbers})", some).rowcount
        if lines < most:
            connection.execute("DELETE FROM batches WHERE id = ?", (batch["id"],))
        return max(1, lines), 0
    rows = connection.execute(
        "SELECT jobs.id, coalesce(length(bodies.body), 0) AS size FROM jobs LEFT JOIN bodies ON bodies.id = jobs.id "
        "WHERE jobs.status NOT IN ('accepted', 'running') AND finished <= ? "
        "AND NOT EXISTS (SELECT 1 FROM lines WHERE lines.job = jobs.id) ORDER BY finished LIMIT ?",
        (before, most),
    ).fetchall()
    sizes = itertools.accumulate(row["size"] for row in rows)
    ids = [(row["id"],) for row, size in zip(rows, sizes, strict=True) if row is rows[0] or size <= FORGOTTEN_BYTES]
    for table, key in (("bodies", "id"), ("events", "id"), ("jobs", "id")):
        connection.executemany(f"DELETE FROM {table} WHERE {key} = ?", ids)
    return len(ids), len(ids)


def oldest_moment(connection: sqlite3.Connection, count: int) -> float | None:
    """When the last of the `count` finished jobs ended that are the first to be forgotten."""
    row = connection.execute(
        "SELECT max(finished) AS moment FROM (SELECT finished FROM jobs "
        "WHERE status NOT IN ('accepted', 'running') ORDER BY finished LIMIT ?)",
        (count,),
    ).fetchone()
    moment: float | None = row["moment"]
    return moment


def used_bytes(connection: sqlite3.Connection) -> int:
    """Bytes in use; pages set free are used again, or given back, and do not count."""
    return (pragma(connection, "page_count") - pragma(connection, "freelist_count")) * pragma(connection, "page_size")


def pragma(connection: sqlite3.Connection, name: str) -> int:
    """A number that SQLite tells of its file."""
    return int(connection.execute(f"PRAGMA {name}").fetchone()[0])


def _is_waited_for(connection: sqlite3.Connection, id: str) -> bool:
    return bool(connection.execute(WAITED_FOR, (id, id)).fetchone()["waited"])


def _dismiss_lines(connection: sqlite3.Connection, where: str, arguments: tuple[str, ...]) -> None:
    connection.execute(f"UPDATE lines SET dismissed = 1 WHERE {where} AND order_number IS NULL", arguments)
    _number_lines(connection, f"{where} AND dismissed = 1", arguments)


def _number_lines(connection: sqlite3.Connection, where: str, arguments: tuple[str, ...]) -> None:
    """Number lines that have an answer now, in the order in which answers come."""
    waiting = connection.execute(
        f"SELECT batch, number FROM lines WHERE {where} AND order_number IS NULL ORDER BY batch, number", arguments
    ).fetchall()
    for row in waiting:
        order = _next_order(connection)
        connection.execute(
            "UPDATE lines SET order_number = ? WHERE batch = ? AND number = ?", (order, row["batch"], row["number"])
        )


def _next_order(connection: sqlite3.Connection) -> int:
    row = connection.execute("UPDATE counters SET value = value + 1 WHERE name = 'order' RETURNING value").fetchone()
    return int(row["value"])

"""What the PostgreSQL store does inside a transaction, as functions of its connection.

Locks are always taken in the order jobs (by id), then batches (by id), so that no two wait for each
other. Times are those of the database server, whose clock all front ends share.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from inverse_service.service.jobs.model import Batch, BatchLine, Bounds, Job, JobRequest, TooManyJobs, Usage
from inverse_service.service.jobs.postgres_connections import Connection, Row
from inverse_service.service.jobs.shared_sql import BODY, COUNTS, LISTED, NEXT, OPEN, SELECT, WAITED_FOR
from inverse_service.service.jobs.states import JobStatus
from inverse_service.service.jobs.store import NO_BOUND

NOW = "extract(epoch FROM clock_timestamp())::double precision"
# Near the bounds on open jobs front ends accept one after the other, so that they hold for all together.
ACCEPT_LOCK = 7_204_021_102
CLAIM_LOCK = 7_204_021_104
FAR, FAR_AT_LEAST = 10, 1000


def job_of(row: Row) -> Job:
    """A row of SELECT, with a `body` if the query has one."""
    return Job(**row)


def read_job(connection: Connection, id: str, with_body: bool = True, client: str | None = None) -> Job | None:
    """One job; the body only where it is that of the present status. Open, it is dismissed for who has left it."""
    body, join = (", bodies.body", BODY) if with_body else ("", "")
    row = connection.execute(f"{SELECT}{body} FROM jobs {join} WHERE jobs.id = %s", (id,)).fetchone()
    job = None if row is None else job_of(row)
    if job is None or client is None or not job.is_open:
        return job
    left = connection.execute("SELECT 1 FROM askers WHERE job = %s AND client = %s AND gone = 1", (id, client))
    return job if left.fetchone() is None else replace(job, status="dismissed")


def submit(
    connection: Connection, requests: Sequence[JobRequest], bounds: Bounds, of_batch: bool = False
) -> tuple[list[Job], list[str]]:
    """The jobs, and the ids of those accepted by this call. The jobs stay locked until the commit.

    Those of a batch come without bodies, for its lines wait.
    """
    wanted = {request.id: request for request in requests}
    known = _locked(connection, wanted)
    now = time.time()
    new = [r for r in wanted.values() if r.id not in known or known[r.id].is_to_be_asked(r.fresh, now)]
    if new:
        _refuse_too_many(connection, new, bounds)
        _accept(connection, new)
        if again := [request.id for request in new if request.id in known]:
            connection.execute("DELETE FROM events WHERE id = ANY(%s)", (again,))
    found = _read(connection, list(wanted), not of_batch)
    if not of_batch:
        _note_askers(connection, [(r.id, r.client) for r in requests if found[r.id].is_open])
    accepted = [request.id for request in new]
    return [found[request.id] for request in requests], accepted


def _note_askers(connection: Connection, pairs: list[tuple[str, str]]) -> None:
    with connection.cursor() as cursor:
        cursor.executemany(
            "INSERT INTO askers VALUES (%s, %s, 0) ON CONFLICT (job, client) DO UPDATE SET gone = 0", pairs
        )


def _locked(connection: Connection, ids: Any) -> dict[str, Job]:
    rows = connection.execute(f"{SELECT} FROM jobs WHERE id = ANY(%s) ORDER BY id FOR UPDATE", (list(ids),)).fetchall()
    return {row["id"]: job_of(row) for row in rows}


def _read(connection: Connection, ids: list[str], with_bodies: bool) -> dict[str, Job]:
    body, join = (", bodies.body", BODY) if with_bodies else ("", "")
    rows = connection.execute(f"{SELECT}{body} FROM jobs {join} WHERE jobs.id = ANY(%s)", (ids,)).fetchall()
    return {row["id"]: job_of(row) for row in rows}


def _refuse_too_many(connection: Connection, new: Sequence[JobRequest], bounds: Bounds) -> None:
    """Raises TooManyJobs. Far from the bounds nobody waits for another one: the lock costs most of the rate."""
    clients = {request.client for request in new}
    if _room(connection, clients, bounds) > FAR * len(new) + FAR_AT_LEAST:
        return
    connection.execute("SELECT pg_advisory_xact_lock(%s)", (ACCEPT_LOCK,))
    if len(new) > _room(connection, clients, bounds):
        raise TooManyJobs("Too many jobs wait already; let some of them end and try again.")


def _room(connection: Connection, clients: set[str], bounds: Bounds) -> int:
    """How many more jobs may be open, of each of these clients and in all."""
    query = f"SELECT count(*) AS jobs, client = ANY(%s) AS ours, client FROM jobs WHERE {OPEN} GROUP BY client"
    rows = connection.execute(query, (list(clients),)).fetchall()
    most = max((row["jobs"] for row in rows if row["ours"]), default=0)
    room: int = min(bounds.total - sum(row["jobs"] for row in rows), bounds.client - most)
    return room


def _number(connection: Connection, query: str, *arguments: Any) -> int:
    row = connection.execute(query, arguments).fetchone()
    return 0 if row is None else int(next(iter(row.values())))


def _accept(connection: Connection, requests: Sequence[JobRequest]) -> None:
    """Insert, or accept again; two front ends that insert the same job at once make one."""
    with connection.cursor() as cursor:
        cursor.executemany(
            f"INSERT INTO jobs (id, kind, document, options, status, client, priority, created) "
            f"VALUES (%s, %s, %s, %s, 'accepted', %s, %s, {NOW}) ON CONFLICT (id) DO UPDATE SET "
            "status = 'accepted', client = excluded.client, priority = excluded.priority, "
            "created = excluded.created, started = NULL, finished = NULL, attempt = jobs.attempt + 1, "
            "crashes = 0, restarts = 0, owner = NULL "
            f"WHERE jobs.status NOT IN ('accepted', 'running') AND (jobs.status = 'dismissed' OR %s "
            f"OR jobs.expires <= {NOW})",
            [(r.id, r.kind, r.document, r.options, r.client, r.priority, r.fresh) for r in requests],
        )


def claim(connection: Connection, owner: str, limit: int, client_running: int) -> list[Job]:
    """The next jobs, now running; those that another front end takes at this moment are passed over.

    Where running jobs of a client are bounded, front ends claim one after the other, so that it holds for all together.
    """
    if client_running < NO_BOUND:
        connection.execute("SELECT pg_advisory_xact_lock(%s)", (CLAIM_LOCK,))
    rows = connection.execute(
        f"WITH next AS (SELECT id, row_number() OVER () AS turn FROM ({marked(NEXT)}) AS ordered), "
        "chosen AS (SELECT jobs.id, turn FROM jobs JOIN next ON next.id = jobs.id WHERE jobs.status = 'accepted' "
        "FOR UPDATE OF jobs SKIP LOCKED) "
        f"UPDATE jobs SET status = 'running', owner = %s, heartbeat = {NOW}, started = {NOW}, "
        f"attempt = jobs.attempt + 1 FROM chosen WHERE jobs.id = chosen.id RETURNING chosen.turn, {LISTED}",
        (limit, client_running, limit, owner),
    ).fetchall()
    return [job_of(row) for row in sorted(rows, key=lambda row: row.pop("turn"))]


def heartbeat(connection: Connection, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
    """Renew the claims that are still this owner's; the ids of the others."""
    ids = sorted({id for id, _ in running})
    _locked(connection, ids)
    rows = connection.execute(
        f"UPDATE jobs SET heartbeat = {NOW} WHERE id = ANY(%s) AND owner = %s AND status = 'running' "
        "RETURNING id, attempt",
        (ids, owner),
    ).fetchall()
    kept = {(row["id"], row["attempt"]) for row in rows}
    return [id for id, attempt in running if (id, attempt) not in kept]


def end(
    connection: Connection, id: str, attempt: int, status: JobStatus, body: bytes, usage: Usage, kept: float | None
) -> bool:
    """running -> successful or failed, for the current attempt only; kept for so many seconds, None: always."""
    changed = connection.execute(
        f"UPDATE jobs SET status = %s, finished = {NOW}, expires = {NOW} + %s::double precision, "
        "revision = revision + 1, wall = %s, cpu = %s, memory = %s, owner = NULL "
        "WHERE id = %s AND attempt = %s AND status = 'running' RETURNING id",
        (status, kept, usage.wall, usage.cpu, usage.memory, id, attempt),
    ).fetchone()
    if changed is not None:
        connection.execute("DELETE FROM askers WHERE job = %s", (id,))
        connection.execute(
            "INSERT INTO bodies (id, status, body) VALUES (%s, %s, %s) "
            "ON CONFLICT (id) DO UPDATE SET status = excluded.status, body = excluded.body",
            (id, status, body),
        )
        _number_lines(connection, "job = %s", (id,))
    return changed is not None


def release(connection: Connection, id: str, attempt: int, crashed: bool) -> Job | None:
    """running -> accepted."""
    connection.execute(
        "UPDATE jobs SET status = 'accepted', owner = NULL, crashes = crashes + %s "
        "WHERE id = %s AND attempt = %s AND status = 'running'",
        (int(crashed), id, attempt),
    )
    return read_job(connection, id, with_body=False)


def leave(connection: Connection, id: str, client: str) -> tuple[Job | None, bool]:
    """The job, dismissed for this client and its batches, and whether it was dismissed because nobody else waits."""
    _locked(connection, [id])
    job = read_job(connection, id)
    if job is None or not job.is_open:
        return job, False
    connection.execute(
        "INSERT INTO askers VALUES (%s, %s, 1) ON CONFLICT (job, client) DO UPDATE SET gone = 1", (id, client)
    )
    _dismiss_lines(connection, "job = %s AND batch IN (SELECT id FROM batches WHERE client = %s)", (id, client))
    return (replace(job, status="dismissed"), False) if _is_waited_for(connection, id) else dismiss(connection, id)


def leave_batch(connection: Connection, batch: str) -> list[str]:
    """Dismiss the open lines of a batch, and those of their jobs that nobody else waits for: their ids."""
    query = "SELECT DISTINCT job FROM lines WHERE batch = %s AND order_number IS NULL"
    ids = sorted(row["job"] for row in connection.execute(query, (batch,)).fetchall())
    _locked(connection, ids)
    _dismiss_lines(connection, "batch = %s", (batch,))
    return [id for id in ids if not _is_waited_for(connection, id) and dismiss(connection, id)[1]]


def dismiss(connection: Connection, id: str) -> tuple[Job | None, bool]:
    """The job, and whether this call ended it; one that was computed again has its earlier answer back."""
    earlier = "coalesce((SELECT bodies.status FROM bodies WHERE bodies.id = jobs.id), 'dismissed')"
    changed = connection.execute(
        f"UPDATE jobs SET status = {earlier}, finished = {NOW}, owner = NULL WHERE id = %s AND {OPEN} RETURNING id",
        (id,),
    ).fetchone()
    if changed is not None:
        connection.execute("DELETE FROM askers WHERE job = %s", (id,))
        _dismiss_lines(connection, "job = %s", (id,))
    return read_job(connection, id), changed is not None


def recover(connection: Connection, owner: str | None, lease: float) -> list[Job]:
    """Running jobs whose owner is gone are accepted again; whoever comes second finds none.

    A claim from the future is of a clock that was set back.
    """
    where, arguments = "status = 'running'", list[Any]()
    if lease > 0:
        where += f" AND (heartbeat <= {NOW} - %s OR heartbeat > {NOW} + %s)"
        arguments += [lease, lease]
    if owner is not None:
        where += " AND owner = %s"
        arguments.append(owner)
    rows = connection.execute(
        f"WITH lost AS (SELECT id FROM jobs WHERE {where} FOR UPDATE SKIP LOCKED) "
        "UPDATE jobs SET status = 'accepted', owner = NULL, restarts = restarts + 1 "
        f"FROM lost WHERE jobs.id = lost.id RETURNING {LISTED}",
        arguments,
    ).fetchall()
    return [job_of(row) for row in rows]


def create_batch(
    connection: Connection, id: str, kind: str, client: str, lines: Sequence[BatchLine], bounds: Bounds
) -> Batch:
    """The batch, its lines, the jobs that are new; the batch as it is where it is there already."""
    if (found := read_batch(connection, id)) is not None:
        return found
    requests = [line.request for line in lines if line.request is not None]
    jobs, _ = submit(connection, requests, bounds, of_batch=True)
    answered = {job.id for job in jobs if job.is_final}
    rows, order = [], 0
    for line in lines:
        job = None if line.request is None else line.request.id
        has_answer = job is None or job in answered
        order += has_answer
        rows.append((id, line.number, line.identifier, job, line.problem, order if has_answer else None))
    is_new = connection.execute(
        f"INSERT INTO batches (id, kind, client, created, total, answers) VALUES (%s, %s, %s, {NOW}, %s, %s) "
        "ON CONFLICT DO NOTHING RETURNING id",
        (id, kind, client, len(lines), order),
    ).fetchone()
    if is_new is not None:  # else another front end stored it at the same moment
        with connection.cursor() as cursor:
            cursor.executemany("INSERT INTO lines VALUES (%s, %s, %s, %s, %s, %s, 0)", rows)
    batch = read_batch(connection, id)
    assert batch is not None
    return batch


def read_batch(connection: Connection, id: str) -> Batch | None:
    """A batch with its counts by status."""
    row = connection.execute("SELECT * FROM batches WHERE id = %s", (id,)).fetchone()
    if row is None:
        return None
    counts = connection.execute(marked(COUNTS), (id,)).fetchall()
    by_status = {c["status"]: c["lines"] for c in counts}
    return Batch(id, row["kind"], row["client"], row["created"], row["total"], by_status)


def marked(query: str) -> str:
    """A shared statement with the marks that psycopg takes."""
    return query.replace("?", "%s")


def _is_waited_for(connection: Connection, id: str) -> bool:
    row = connection.execute(marked(WAITED_FOR), (id, id)).fetchone()
    return row is not None and bool(row["waited"])


def _dismiss_lines(connection: Connection, where: str, arguments: tuple[str, ...]) -> None:
    connection.execute(f"UPDATE lines SET dismissed = 1 WHERE {where} AND order_number IS NULL", arguments)
    _number_lines(connection, f"{where} AND dismissed = 1", arguments)


def _number_lines(connection: Connection, where: str, arguments: tuple[str, ...]) -> None:
    """Number lines that have an answer now, in the order in which answers come."""
    waiting = connection.execute(
        "SELECT batch, array_agg(number ORDER BY number) AS numbers FROM lines "
        f"WHERE {where} AND order_number IS NULL GROUP BY batch ORDER BY batch",
        arguments,
    ).fetchall()
    for row in waiting:
        numbers: list[int] = row["numbers"]
        last = _number(
            connection,
            "UPDATE batches SET answers = answers + %s WHERE id = %s RETURNING answers",
            len(numbers),
            row["batch"],
        )
        connection.execute(
            "UPDATE lines SET order_number = %s + place "
            "FROM unnest(%s::integer[]) WITH ORDINALITY AS due (line, place) WHERE batch = %s AND number = due.line",
            (last - len(numbers), numbers, row["batch"]),
        )

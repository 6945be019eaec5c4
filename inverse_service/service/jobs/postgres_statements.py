"""What the PostgreSQL store does inside a transaction, as functions of its connection.

Locks are always taken in the order jobs (by id), then batches (by id), so that no two wait for each
other. Times are those of the database server, whose clock all front ends share.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from inverse_service.service.jobs.model import Batch, BatchLine, Bounds, Job, JobRequest, TooManyJobs, Usage
from inverse_service.service.jobs.postgres_connections import Connection, Row
from inverse_service.service.jobs.states import FINAL, JobStatus

COLUMNS = (
    "id", "kind", "document", "options", "status", "client", "priority", "created", "started", "finished",
    "attempt", "crashes", "restarts", "revision", "sequence", "wall", "cpu", "memory",
)  # fmt: skip
LISTED = ", ".join(f"jobs.{name}" for name in COLUMNS)
SELECT = f"SELECT {LISTED}"
NOW = "extract(epoch FROM clock_timestamp())::double precision"
OPEN = "status IN ('accepted', 'running')"
BODY = "LEFT JOIN bodies ON bodies.id = jobs.id AND bodies.status = jobs.status"
# Near the bounds on open jobs front ends accept one after the other, so that they hold for all together.
ACCEPT_LOCK = 7_204_021_102
FAR, FAR_AT_LEAST = 10, 1000


def job_of(row: Row) -> Job:
    """A row of SELECT, with a `body` if the query has one."""
    return Job(**row)


def read_job(connection: Connection, id: str, with_body: bool = True) -> Job | None:
    """One job; the body only where it is that of the present status."""
    query = f"{SELECT}, bodies.body FROM jobs {BODY} WHERE jobs.id = %s" if with_body else (
        f"{SELECT} FROM jobs WHERE id = %s"
    )  # fmt: skip
    row = connection.execute(query, (id,)).fetchone()
    return None if row is None else job_of(row)


def submit(
    connection: Connection, requests: Sequence[JobRequest], bounds: Bounds, with_bodies: bool = True
) -> tuple[list[Job], list[str]]:
    """The jobs, and the ids of those accepted by this call. The jobs stay locked until the commit."""
    wanted = {request.id: request for request in requests}
    known = _locked(connection, wanted)
    new = [request for request in wanted.values() if _is_to_be_accepted(request, known.get(request.id))]
    if new:
        _refuse_too_many(connection, new, bounds)
        _accept(connection, new)
        if again := [request.id for request in new if request.id in known]:
            connection.execute("DELETE FROM events WHERE id = ANY(%s)", (again,))
    found = _read(connection, list(wanted), with_bodies)
    accepted = [request.id for request in new]
    return [found[request.id] for request in requests], accepted


def _is_to_be_accepted(request: JobRequest, status: JobStatus | None) -> bool:
    return status is None or status == "dismissed" or (request.fresh and status in FINAL)


def _locked(connection: Connection, ids: Any) -> dict[str, JobStatus]:
    rows = connection.execute(
        "SELECT id, status FROM jobs WHERE id = ANY(%s) ORDER BY id FOR UPDATE", (list(ids),)
    ).fetchall()
    return {row["id"]: row["status"] for row in rows}


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
            "WHERE jobs.status NOT IN ('accepted', 'running') AND (jobs.status = 'dismissed' OR %s)",
            [(r.id, r.kind, r.document, r.options, r.client, r.priority, r.fresh) for r in requests],
        )


def claim(connection: Connection, owner: str, limit: int, excluded: Sequence[str]) -> list[Job]:
    """The next jobs, now running; those that another front end takes at this moment are passed over."""
    rows = connection.execute(
        f"WITH chosen AS (SELECT id FROM jobs WHERE status = 'accepted' AND client <> ALL(%s) "
        f"ORDER BY priority, sequence LIMIT %s FOR UPDATE SKIP LOCKED) "
        f"UPDATE jobs SET status = 'running', owner = %s, heartbeat = {NOW}, started = {NOW}, "
        f"attempt = jobs.attempt + 1 FROM chosen WHERE jobs.id = chosen.id RETURNING {LISTED}",
        (list(excluded), limit, owner),
    ).fetchall()
    return sorted((job_of(row) for row in rows), key=lambda job: (job.priority, job.sequence))


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


def end(connection: Connection, id: str, attempt: int, status: JobStatus, body: bytes, usage: Usage) -> bool:
    """running -> successful or failed, for the current attempt only."""
    changed = connection.execute(
        f"UPDATE jobs SET status = %s, finished = {NOW}, revision = revision + 1, wall = %s, cpu = %s, memory = %s, "
        "owner = NULL WHERE id = %s AND attempt = %s AND status = 'running' RETURNING id",
        (status, usage.wall, usage.cpu, usage.memory, id, attempt),
    ).fetchone()
    if changed is not None:
        connection.execute(
            "INSERT INTO bodies (id, status, body) VALUES (%s, %s, %s) "
            "ON CONFLICT (id) DO UPDATE SET status = excluded.status, body = excluded.body",
            (id, status, body),
        )
        _answer_lines(connection, id)
    return changed is not None


def release(connection: Connection, id: str, attempt: int, crashed: bool) -> Job | None:
    """running -> accepted."""
    connection.execute(
        "UPDATE jobs SET status = 'accepted', owner = NULL, crashes = crashes + %s "
        "WHERE id = %s AND attempt = %s AND status = 'running'",
        (int(crashed), id, attempt),
    )
    return read_job(connection, id, with_body=False)


def dismiss(connection: Connection, id: str) -> tuple[Job | None, bool]:
    """The job, and whether this call dismissed it."""
    changed = connection.execute(
        f"UPDATE jobs SET status = 'dismissed', finished = {NOW}, owner = NULL WHERE id = %s AND {OPEN} RETURNING id",
        (id,),
    ).fetchone()
    if changed is not None:
        connection.execute("DELETE FROM bodies WHERE id = %s", (id,))
        _answer_lines(connection, id)
    return read_job(connection, id), changed is not None


def recover(connection: Connection, owner: str | None, lease: float) -> list[Job]:
    """Running jobs whose owner is gone are accepted again; whoever comes second finds none."""
    where, arguments = ("", ()) if owner is None else (" AND owner = %s", (owner,))
    rows = connection.execute(
        f"WITH lost AS (SELECT id FROM jobs WHERE status = 'running' AND heartbeat <= {NOW} - %s{where} "
        "FOR UPDATE SKIP LOCKED) UPDATE jobs SET status = 'accepted', owner = NULL, restarts = restarts + 1 "
        f"FROM lost WHERE jobs.id = lost.id RETURNING {LISTED}",
        (lease, *arguments),
    ).fetchall()
    return [job_of(row) for row in rows]


def create_batch(
    connection: Connection, id: str, kind: str, client: str, lines: Sequence[BatchLine], bounds: Bounds
) -> Batch:
    """The batch, its lines, the jobs that are new; the batch as it is where it is there already."""
    if (found := read_batch(connection, id)) is not None:
        return found
    requests = [line.request for line in lines if line.request is not None]
    jobs, _ = submit(connection, requests, bounds, with_bodies=False)
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
            cursor.executemany("INSERT INTO lines VALUES (%s, %s, %s, %s, %s, %s)", rows)
    batch = read_batch(connection, id)
    assert batch is not None
    return batch


def read_batch(connection: Connection, id: str) -> Batch | None:
    """A batch with its counts by status."""
    row = connection.execute("SELECT * FROM batches WHERE id = %s", (id,)).fetchone()
    if row is None:
        return None
    counts = connection.execute(
        "SELECT coalesce(jobs.status, 'failed') AS status, count(*) AS lines FROM lines "
        "LEFT JOIN jobs ON jobs.id = lines.job WHERE batch = %s GROUP BY 1",
        (id,),
    ).fetchall()
    by_status = {c["status"]: c["lines"] for c in counts}
    return Batch(id, row["kind"], row["client"], row["created"], row["total"], by_status)


def _answer_lines(connection: Connection, id: str) -> None:
    """Number the lines that wait for this job, in the order in which answers come."""
    waiting = connection.execute(
        "SELECT batch, array_agg(number ORDER BY number) AS numbers FROM lines "
        "WHERE job = %s AND order_number IS NULL GROUP BY batch ORDER BY batch",
        (id,),
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

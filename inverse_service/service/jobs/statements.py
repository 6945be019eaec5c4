"""What a store does inside a transaction, the same for each database.

Statements have ? for an argument and AMONG (?) for one that is a list; moment() is the time of the database, today()
its day in UTC, counted from 1970. Locks, which only mean something where transactions run at the same time, are always
taken in the order jobs (by id), then batches (by id), so that no two wait for each other.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Final, Protocol

from inverse_service.errors import LimitError
from inverse_service.service.jobs import model
from inverse_service.service.jobs.outcome import Usage

# As the table has them; the body has one of its own.
LISTED: Final = ", ".join(f"jobs.{field.name}" for field in fields(model.Job) if field.name != "body")
SELECT: Final = f"SELECT {LISTED}"
OPEN: Final = "status IN ('accepted', 'running')"
FINISHED: Final = "status NOT IN ('accepted', 'running')"
BODY: Final = "LEFT JOIN bodies ON bodies.id = jobs.id AND bodies.status = jobs.status"
# Which jobs are next: by the operator's rank of the client and of the job, then the client with the fewest running
# ones, then by priority and age. Each client is found by one step in the index (client, priority, sequence), however
# many jobs it has waiting. Arguments: limit (of each client), most running ones of a client, limit.
NEXT: Final = (
    "WITH RECURSIVE waiting (client) AS (SELECT min(client) FROM jobs WHERE status = 'accepted' UNION ALL "
    "SELECT (SELECT min(client) FROM jobs WHERE status = 'accepted' AND client > waiting.client) FROM waiting "
    "WHERE waiting.client IS NOT NULL), "
    "busy AS (SELECT client, count(*) AS jobs FROM jobs WHERE status = 'running' GROUP BY client), "
    "candidates AS (SELECT id, priority, sequence, coalesce(ranks.rank, 0) "
    "+ CASE WHEN priority < 0 THEN -1 WHEN priority > 10 THEN 1 ELSE 0 END AS rank, coalesce(busy.jobs, 0) "
    "+ row_number() OVER (PARTITION BY jobs.client ORDER BY priority, sequence) AS place "
    "FROM waiting JOIN jobs ON jobs.sequence IN (SELECT own.sequence FROM jobs AS own WHERE own.status = 'accepted' "
    "AND own.client = waiting.client ORDER BY own.priority, own.sequence LIMIT ?) "
    "LEFT JOIN busy ON busy.client = jobs.client LEFT JOIN ranks ON ranks.client = jobs.client) "
    "SELECT id FROM candidates WHERE place <= ? ORDER BY rank, place, priority, sequence LIMIT ?"
)
# Nobody waits for a job: neither somebody who asked for it, nor a batch.
UNWANTED: Final = (
    "NOT EXISTS (SELECT 1 FROM askers WHERE job = jobs.id AND gone = 0) "
    "AND NOT EXISTS (SELECT 1 FROM lines WHERE job = jobs.id AND order_number IS NULL)"
)
ACCEPT: Final = (
    "INSERT INTO jobs (id, kind, document, options, status, client, priority, created) "
    "VALUES (?, ?, ?, ?, 'accepted', ?, ?, moment()) ON CONFLICT (id) DO UPDATE SET status = 'accepted', "
    "client = excluded.client, priority = excluded.priority, created = excluded.created, started = NULL, "
    "finished = NULL, attempt = jobs.attempt + 1, crashes = 0, restarts = 0, owner = NULL "
    f"WHERE jobs.{FINISHED} AND (jobs.status = 'dismissed' OR ? OR jobs.expires <= moment())"
)
DRAINED: Final = "SELECT value FROM counters WHERE name = 'drained'"
ACCEPT_LOCK, CLAIM_LOCK = 7_204_021_102, 7_204_021_104
# Near the bounds on open jobs front ends accept one after the other, so that they hold for all together.
FAR, FAR_AT_LEAST = 10, 1000


class Session(Protocol):
    """The connection of one transaction."""

    def rows(self, query: str, *arguments: Any) -> list[Any]:
        """All rows, each a mapping by column."""

    def run(self, query: str, *arguments: Any) -> None:
        """A statement whose rows nobody waits for."""

    def many(self, query: str, arguments: Sequence[tuple[Any, ...]]) -> None:
        """The statement for each of the arguments."""

    def lock(self, name: int) -> None:
        """Wait until no other transaction holds this lock; held to the end."""


def first(session: Session, query: str, *arguments: Any) -> Any:
    """The first row, None where there is none."""
    rows = session.rows(query, *arguments)
    return rows[0] if rows else None


def jobs_of(rows: Iterable[Mapping[str, Any]]) -> list[model.Job]:
    """Rows of SELECT, with a `body` if the query has one."""
    return [model.Job(**dict(row)) for row in rows]


def read_job(session: Session, id: str, with_body: bool = True, client: str | None = None) -> model.Job | None:
    """One job; the body only where it is that of the present status. Open, it is dismissed for who has left it."""
    job = _read(session, [id], with_body).get(id)
    if job is None or client is None or not job.is_open:
        return job
    left = session.rows("SELECT 1 FROM askers WHERE job = ? AND client = ? AND gone = 1", id, client)
    return replace(job, status="dismissed") if left else job


def submit(
    session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds, of_batch: bool = False
) -> tuple[list[model.Job], list[str]]:
    """The jobs, and the ids of those accepted by this call. The jobs stay locked until the commit.

    Those of a batch come without bodies, for its lines wait.
    """
    wanted = {request.id: request for request in reversed(requests)}
    known = lock_jobs(session, list(wanted))
    now = first(session, "SELECT moment() AS now")["now"]
    new = [r for r in wanted.values() if r.id not in known or known[r.id].is_to_be_asked(r.fresh, now)][::-1]
    if new:
        refuse_too_many(session, new, bounds)
        asked = [(r.id, r.kind, r.document, r.options, r.client, r.priority, r.fresh) for r in new]
        session.many(ACCEPT, asked)  # two front ends that insert the same job at once make one
        if again := [request.id for request in new if request.id in known]:
            session.run("DELETE FROM events WHERE id AMONG (?)", again)
    found = _read(session, list(wanted), not of_batch)
    if not of_batch:
        waiting = [(request.id, request.client) for request in requests if found[request.id].is_open]
        session.many("INSERT INTO askers VALUES (?, ?, 0) ON CONFLICT (job, client) DO UPDATE SET gone = 0", waiting)
    return [found[request.id] for request in requests], [request.id for request in new]


def refuse_without_room(session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds) -> None:
    """Raises TooManyJobs or LimitError where not all of these questions can be accepted now."""
    wanted = {request.id: request for request in requests}
    rows = session.rows("SELECT id, status, expires, moment() AS now FROM jobs WHERE id AMONG (?)", list(wanted))
    for row in rows:
        job = model.Job(row["id"], "", "", "", row["status"], expires=row["expires"])
        if not job.is_to_be_asked(wanted[job.id].fresh, row["now"]):
            del wanted[job.id]
    if wanted:
        refuse_too_many(session, list(wanted.values()), bounds)


def lock_jobs(session: Session, ids: list[str]) -> dict[str, model.Job]:
    """These jobs, locked until the commit."""
    rows = session.rows(f"{SELECT} FROM jobs WHERE id AMONG (?) ORDER BY id FOR UPDATE", ids)
    return {job.id: job for job in jobs_of(rows)}


def _read(session: Session, ids: list[str], with_bodies: bool) -> dict[str, model.Job]:
    body, join = (", bodies.body", BODY) if with_bodies else ("", "")
    rows = session.rows(f"{SELECT}{body} FROM jobs {join} WHERE jobs.id AMONG (?)", ids)
    return {job.id: job for job in jobs_of(rows)}


def refuse_too_many(session: Session, new: Sequence[model.JobRequest], bounds: model.Bounds) -> None:
    """Raises TooManyJobs, LimitError for a batch that would never have room. Well below the limits no lock is taken: it
    dominates the rate."""
    if len(new) > (most := min(bounds.total, bounds.client)):
        raise LimitError(f"The batch asks {len(new)} new questions, and at most {most} may be open; send it in parts.")
    clients = {request.client for request in new}
    if bounds.daily < model.NO_BOUND:
        used = "SELECT client FROM uses WHERE client AMONG (?) AND day = today() AND cpu >= ?"
        if session.rows(used, list(clients), float(bounds.daily)):
            detail = "The processor time of this client for today (UTC) is used; ask again tomorrow."
            raise model.TooManyJobs(detail, model.until_tomorrow(), bounds.daily)
    if _room(session, clients, bounds) > FAR * len(new) + FAR_AT_LEAST:
        return
    session.lock(ACCEPT_LOCK)
    if len(new) > _room(session, clients, bounds):
        raise model.TooManyJobs("Too many jobs wait already; let some of them end and try again.")


def _room(session: Session, clients: set[str], bounds: model.Bounds) -> int:
    """How many more jobs may be open, of each of these clients and in all."""
    rows = session.rows(f"SELECT client, count(*) AS jobs FROM jobs WHERE {OPEN} GROUP BY client")
    most = max((row["jobs"] for row in rows if row["client"] in clients), default=0)
    room: int = min(bounds.total - sum(row["jobs"] for row in rows), bounds.client - most)
    return room


def claim(session: Session, owner: str, limit: int, client_running: int) -> list[model.Job]:
    """The next jobs, now running; those that another front end takes at this moment are passed over.

    Where running jobs of a client are bounded, front ends claim one after the other, so that it holds for all together.
    """
    if client_running < model.NO_BOUND:
        session.lock(CLAIM_LOCK)
    if is_drained(session):
        return []
    ids = [row["id"] for row in session.rows(NEXT, limit, client_running, limit)]
    rows = session.rows(
        "UPDATE jobs SET status = 'running', owner = ?, heartbeat = moment(), started = moment(), "
        "attempt = attempt + 1 WHERE id IN (SELECT id FROM jobs WHERE id AMONG (?) AND status = 'accepted' "
        f"FOR UPDATE SKIP LOCKED) RETURNING {LISTED}",
        owner, ids,
    ) if ids else []  # fmt: skip
    return sorted(jobs_of(rows), key=lambda job: ids.index(job.id))


def heartbeat(session: Session, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
    """Renew the claims that are still this owner's; the ids of the others."""
    ids = sorted({id for id, _ in running})
    lock_jobs(session, ids)
    rows = session.rows(
        "UPDATE jobs SET heartbeat = moment() WHERE id AMONG (?) AND owner = ? AND status = 'running' "
        "RETURNING id, attempt",
        ids, owner,
    )  # fmt: skip
    kept = {(row["id"], row["attempt"]) for row in rows}
    return [id for id, attempt in running if (id, attempt) not in kept]


def end(
    session: Session,
    id: str,
    attempt: int,
    status: model.JobStatus,
    body: bytes,
    usage: Usage,
    kept: float | None,
) -> bool:
    """running -> successful or failed, for the current attempt only; kept for so many seconds, None: always."""
    changed = first(
        session,
        "UPDATE jobs SET status = ?, finished = moment(), expires = moment() + CAST(? AS DOUBLE PRECISION), "
        "revision = revision + 1, wall = ?, cpu = ?, memory = ?, owner = NULL "
        "WHERE id = ? AND attempt = ? AND status = 'running' RETURNING client",
        status, kept, usage.wall, usage.cpu, usage.memory, id, attempt,
    )  # fmt: skip
    if changed is None:
        return False
    session.run("DELETE FROM askers WHERE job = ?", id)
    session.run(
        "INSERT INTO bodies (id, status, body) VALUES (?, ?, ?) "
        "ON CONFLICT (id) DO UPDATE SET status = excluded.status, body = excluded.body",
        id, status, body,
    )  # fmt: skip
    count_use(session, changed["client"], usage)
    number_lines(session, "job = ?", (id,))
    return True


def add_events(session: Session, events: Sequence[tuple[str, model.Event]]) -> None:
    """Append events of jobs; those that are there already stay."""
    rows = [(id, event.number, event.kind, json.dumps(dict(event.data))) for id, event in events]
    session.many("INSERT INTO events VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING", rows)


def release(
    session: Session, id: str, attempt: int, crashed: bool, usage: Usage, left: bytes | None
) -> model.Job | None:
    """running -> accepted; what the run took is counted also where the job was dismissed meanwhile."""
    session.run(
        "UPDATE jobs SET status = 'accepted', owner = NULL, crashes = crashes + ? "
        "WHERE id = ? AND attempt = ? AND status = 'running'",
        int(crashed), id, attempt,
    )  # fmt: skip
    job = read_job(session, id, with_body=False)
    if job is not None:
        count_use(session, job.client, usage)
    if left is not None and job is not None and (job.status, job.attempt) == ("dismissed", attempt):
        session.run(
            "INSERT INTO bodies (id, status, body) VALUES (?, ?, ?) ON CONFLICT DO NOTHING", id, job.status, left
        )
    return job


def count_use(session: Session, client: str, usage: Usage) -> None:
    """Add a run to what the client used today."""
    session.run(
        "INSERT INTO uses (client, day, runs, cpu) VALUES (?, today(), 1, ?) "
        "ON CONFLICT (client, day) DO UPDATE SET runs = uses.runs + 1, cpu = uses.cpu + excluded.cpu",
        client, float(usage.cpu),
    )  # fmt: skip


def used_today(session: Session, client: str) -> float:
    """The processor seconds of a client's runs today (UTC)."""
    found = first(session, "SELECT cpu FROM uses WHERE client = ? AND day = today()", client)
    return 0.0 if found is None else float(found["cpu"])


def leave(session: Session, id: str, client: str) -> tuple[model.Job | None, bool]:
    """The job, dismissed for this client and its batches, and whether it was dismissed because nobody else waits."""
    lock_jobs(session, [id])
    job = read_job(session, id)
    if job is None or not job.is_open:
        return job, False
    session.run("INSERT INTO askers VALUES (?, ?, 1) ON CONFLICT (job, client) DO UPDATE SET gone = 1", id, client)
    dismiss_lines(session, "job = ? AND batch IN (SELECT id FROM batches WHERE client = ?)", (id, client))
    is_over = bool(dismiss_unwanted(session, [id]))
    return (read_job(session, id) if is_over else replace(job, status="dismissed")), is_over


def dismiss(session: Session, id: str) -> tuple[model.Job | None, bool]:
    """The job, and whether this call ended it, whoever waits for it."""
    is_over = bool(dismiss_unwanted(session, [id], "1 = 1"))
    return read_job(session, id), is_over


def dismiss_unwanted(session: Session, ids: list[str], where: str = UNWANTED) -> list[str]:
    """Those of these open jobs that nobody waits for, dismissed; one computed again has its earlier answer back."""
    earlier = "coalesce((SELECT bodies.status FROM bodies WHERE bodies.id = jobs.id), 'dismissed')"
    changed = session.rows(
        f"UPDATE jobs SET status = {earlier}, finished = moment(), owner = NULL "
        f"WHERE id AMONG (?) AND {OPEN} AND {where} RETURNING id",
        ids,
    )
    over = [row["id"] for row in changed]
    if over:
        session.run("DELETE FROM askers WHERE job AMONG (?)", over)
        dismiss_lines(session, "job AMONG (?)", (over,))
    return over


def recover(session: Session, owner: str | None, lease: float) -> list[model.Job]:
    """Running jobs whose owner is gone are accepted again; without a lease all, whatever the clock says.

    Whoever comes second finds none. A claim from the future is of a clock that was set back.
    """
    where, arguments = "status = 'running'", list[Any]()
    if lease > 0:
        where += " AND (heartbeat <= moment() - ? OR heartbeat > moment() + ?)"
        arguments += [lease, lease]
    if owner is not None:
        where += " AND owner = ?"
        arguments.append(owner)
    rows = session.rows(
        "UPDATE jobs SET status = 'accepted', owner = NULL, restarts = restarts + 1 "
        f"WHERE id IN (SELECT id FROM jobs WHERE {where} FOR UPDATE SKIP LOCKED) RETURNING {LISTED}",
        *arguments,
    )
    return jobs_of(rows)


def is_drained(session: Session) -> bool:
    """Whether an operator lets no job begin."""
    found = first(session, DRAINED)
    return found is not None and bool(found["value"])


def dismiss_lines(session: Session, where: str, arguments: tuple[Any, ...]) -> None:
    """Cancel the lines of batches that have no answer yet."""
    session.run(f"UPDATE lines SET dismissed = 1 WHERE {where} AND order_number IS NULL", *arguments)
    number_lines(session, f"{where} AND dismissed = 1", arguments)


def number_lines(session: Session, where: str, arguments: tuple[Any, ...]) -> None:
    """Number lines that have an answer now, in the order in which answers come.

    Whoever takes numbers of a batch holds its row until the commit, so they become visible in their order.
    """
    due = f"FROM lines WHERE {where} AND order_number IS NULL"
    for row in session.rows(f"SELECT batch, count(*) AS due {due} GROUP BY batch ORDER BY batch", *arguments):
        taken = "UPDATE batches SET answers = answers + ? WHERE id = ? RETURNING answers"
        before = first(session, taken, row["due"], row["batch"])["answers"] - row["due"]
        places = f"SELECT number AS line, row_number() OVER (ORDER BY number) AS place {due} AND batch = ?"
        session.run(
            f"UPDATE lines SET order_number = ? + place FROM ({places}) AS due WHERE batch = ? AND number = due.line",
            before, *arguments, row["batch"], row["batch"],
        )  # fmt: skip

"""What a store does inside a transaction, the same for each database.

Statements have ? for an argument and AMONG (?) for one that is a list; moment() is the time of the database, today()
its day in UTC, counted from 1970. Locks, which only mean something where transactions run at the same time, are always
taken in the order jobs (by id), then batches (by id), so that no two wait for each other.

Tables of the store, and how those of older versions become these.

`answers` of a batch numbers its answers: `order_number` of its lines. `askers` says which clients wait for an open job
besides batches; one that is `gone` cancelled it for itself. `keys` says with which lines a client sent
an Idempotency-Key. `ranks` are an operator's, `uses` what a client used on a
day (since 1970, UTC). `counters` holds single numbers by name.

Batches: their data, their identity, and what a store does with them and their lines, the same for each database.
"""

import functools
import hashlib
import itertools
import json
import secrets
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

from inverse_service import errors
from inverse_service.service.jobs import model
from inverse_service.service.jobs.outcome import Usage

NO_BOUNDS, NO_USE = model.Bounds(), Usage()
VERSION: Final = 3
_SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    sequence {serial},
    id TEXT NOT NULL UNIQUE,
    kind TEXT NOT NULL,
    document TEXT NOT NULL,
    options TEXT NOT NULL,
    status TEXT NOT NULL,
    client TEXT NOT NULL,
    priority INTEGER NOT NULL,
    created {real} NOT NULL,
    started {real},
    finished {real},
    attempt INTEGER NOT NULL DEFAULT 0,
    crashes INTEGER NOT NULL DEFAULT 0,
    restarts INTEGER NOT NULL DEFAULT 0,
    revision INTEGER NOT NULL DEFAULT 0,
    owner TEXT,
    heartbeat {real},
    expires {real},
    wall {real} NOT NULL DEFAULT 0,
    cpu {real} NOT NULL DEFAULT 0,
    memory {real} NOT NULL DEFAULT 0
){table};
CREATE INDEX IF NOT EXISTS jobs_next ON jobs (client, priority, sequence) WHERE status = 'accepted';
CREATE INDEX IF NOT EXISTS jobs_open ON jobs (client, status) WHERE status IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_finished ON jobs (finished) WHERE status NOT IN ('accepted', 'running');
CREATE INDEX IF NOT EXISTS jobs_status ON jobs (status, sequence);
CREATE TABLE IF NOT EXISTS bodies (id TEXT PRIMARY KEY, status TEXT NOT NULL, body {bytes} NOT NULL){table};
CREATE TABLE IF NOT EXISTS events (
    id TEXT NOT NULL, number {long} NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL, PRIMARY KEY (id, number)
){keyed};
CREATE TABLE IF NOT EXISTS batches (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, client TEXT NOT NULL, created {real} NOT NULL,
    total INTEGER NOT NULL, answers INTEGER NOT NULL DEFAULT 0
){table};
CREATE TABLE IF NOT EXISTS lines (
    batch TEXT NOT NULL, number INTEGER NOT NULL, identifier TEXT NOT NULL, job TEXT, problem {bytes},
    order_number INTEGER, dismissed INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (batch, number)
){keyed};
CREATE INDEX IF NOT EXISTS lines_of_job ON lines (job, order_number);
CREATE INDEX IF NOT EXISTS lines_in_order ON lines (batch, order_number);
CREATE INDEX IF NOT EXISTS batches_created ON batches (created);
CREATE TABLE IF NOT EXISTS askers (
    job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
){keyed};
CREATE TABLE IF NOT EXISTS ranks (client TEXT PRIMARY KEY, rank INTEGER NOT NULL){table};
CREATE TABLE IF NOT EXISTS uses (
    client TEXT NOT NULL, day INTEGER NOT NULL, runs INTEGER NOT NULL, cpu {real} NOT NULL, PRIMARY KEY (client, day)
){keyed};
CREATE TABLE IF NOT EXISTS keys (
    client TEXT NOT NULL, key TEXT NOT NULL, digest TEXT NOT NULL, created {real} NOT NULL, PRIMARY KEY (client, key)
){keyed};
CREATE TABLE IF NOT EXISTS counters (name TEXT PRIMARY KEY, value {long} NOT NULL){table};
"""
# What makes the tables of one version those of the next; tables that are new are made in any case.
_MIGRATIONS = {
    1: """
    ALTER TABLE jobs ADD COLUMN expires {real};
    ALTER TABLE lines ADD COLUMN dismissed INTEGER NOT NULL DEFAULT 0;
    DROP INDEX jobs_waiting;
    CREATE TABLE askers (
        job TEXT NOT NULL, client TEXT NOT NULL, gone INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, client)
    ){keyed};
    INSERT INTO askers SELECT id, client, 0 FROM jobs WHERE status IN ('accepted', 'running') AND priority < 10;
    UPDATE lines SET dismissed = 1 WHERE job IN (SELECT id FROM jobs WHERE status = 'dismissed');
    """,
    2: "{number_answers}",
}


@dataclass(frozen=True, eq=False)
class Dialect:
    """Of a database: the words of its schema, what its queries have instead of ours, what takes a lock."""

    words: Mapping[str, str]
    instead: Mapping[str, str]
    lock: str = ""

    @functools.cache  # noqa: B019 - there are two, for all time
    def translated(self, query: str) -> str:
        """The query as this database takes it."""
        for ours, theirs in self.instead.items():
            query = query.replace(ours, theirs)
        return query


# There is one writer, so that nothing needs a lock.
SQLITE: Final = Dialect(
    {
        "serial": "INTEGER PRIMARY KEY AUTOINCREMENT", "real": "REAL", "bytes": "BLOB", "long": "INTEGER",
        "table": " STRICT", "keyed": " STRICT, WITHOUT ROWID",
        # All batches had one number until version 2.
        "number_answers": "ALTER TABLE batches ADD COLUMN answers INTEGER NOT NULL DEFAULT 0; UPDATE batches SET "
        "answers = (SELECT coalesce(max(order_number), 0) FROM lines WHERE lines.batch = batches.id);",
    },
    {"AMONG (?)": "IN (SELECT value FROM json_each(?))", " FOR UPDATE": "", " SKIP LOCKED": ""},
)  # fmt: skip
POSTGRES: Final = Dialect(
    {
        "serial": "BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY", "real": "DOUBLE PRECISION", "bytes": "BYTEA",
        "long": "BIGINT", "table": "", "keyed": "", "number_answers": "",
    },
    {
        "AMONG (?)": "= ANY(%s)", "?": "%s", "moment()": "extract(epoch FROM clock_timestamp())::double precision",
        "today()": "(extract(epoch FROM clock_timestamp())::bigint / 86400)::integer",
    },
    lock="SELECT pg_advisory_xact_lock(?)",
)  # fmt: skip


def script(found: int, dialect: Dialect) -> str:
    """What makes the tables of version `found` (0: none) those of this one. Raises WrongVersion for a newer one."""
    if not 0 <= found <= VERSION:
        raise model.WrongVersion(found, VERSION)
    steps = [_MIGRATIONS[version] for version in range(found or VERSION, VERSION)]
    return "".join((*steps, _SCHEMA)).format(**dialect.words)


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
DRAINED: Final = "EXISTS (SELECT 1 FROM counters WHERE name = 'drained' AND value <> 0)"
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
ACCEPT_LOCK, CLAIM_LOCK = 7_204_021_102, 7_204_021_104
# Near the bounds on open jobs front ends accept one after the other, so that they hold for all together.
FAR, FAR_AT_LEAST = 10, 1000


@dataclass(frozen=True, slots=True)
class Session:
    """The connection of one transaction, and what it changed; queries are put into the words of its database."""

    connection: Any
    told: list[model.Change]
    dialect: Dialect

    def rows(self, query: str, *arguments: Any) -> list[Any]:
        """All rows, each a mapping by column."""
        found: list[Any] = self._execute(query, arguments).fetchall()
        return found

    def run(self, query: str, *arguments: Any) -> None:
        """A statement whose rows nobody waits for."""
        self._execute(query, arguments)

    def many(self, query: str, arguments: Sequence[tuple[Any, ...]]) -> None:
        """The statement for each of the arguments."""
        self.connection.cursor().executemany(self.dialect.translated(query), arguments)

    def lock(self, name: int) -> None:
        """Wait until no other transaction holds this lock; held to the end."""
        if self.dialect.lock:
            self.run(self.dialect.lock, name)

    def _execute(self, query: str, arguments: Sequence[Any]) -> Any:
        return self.connection.execute(self.dialect.translated(query), arguments)


def first(session: Session, query: str, *arguments: Any) -> Any:
    """The first row, None where there is none."""
    rows = session.rows(query, *arguments)
    return rows[0] if rows else None


def jobs_of(rows: Iterable[Mapping[str, Any]]) -> list[model.Job]:
    """Rows of SELECT, with a `body` if the query has one."""
    return [model.Job(**dict(row)) for row in rows]


def read_job(
    session: Session, id: str, largest: int = model.LARGEST_BODY, client: str | None = None
) -> model.Job | None:
    """One job; the body only where it is that of the present status, and has at most `largest` bytes.

    Open, it is dismissed for who has left it.
    """
    job = _read(session, [id], largest).get(id)
    if job is None or client is None or not job.is_open:
        return job
    left = session.rows("SELECT 1 FROM askers WHERE job = ? AND client = ? AND gone = 1", id, client)
    return replace(job, status="dismissed") if left else job


def submit(
    session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds = NO_BOUNDS, of_batch: bool = False
) -> list[model.Job]:
    """The job of each request, in order; all are stored, or none is (TooManyJobs).

    A job that is open or answered already is returned as it is, without its body, unless the request is `fresh` and it
    is answered, or it was dismissed: then it is accepted again. `of_batch`: its lines wait for the jobs. The jobs stay
    locked until the commit.
    """
    _accept(session, requests, bounds, of_batch)
    found = _read(session, [request.id for request in requests])
    return [found[request.id] for request in requests]


def _accept(session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds, of_batch: bool) -> None:
    wanted = {request.id: request for request in reversed(requests)}
    known = lock_jobs(session, list(wanted))
    if new := _to_be_asked(session, wanted, known)[::-1]:
        refuse_too_many(session, new, bounds)
        asked = [(r.id, r.kind, r.document, r.options, r.client, r.priority, r.fresh) for r in new]
        session.many(ACCEPT, asked)  # two front ends that insert the same job at once make one
        if again := [request.id for request in new if request.id in known]:
            session.run("DELETE FROM events WHERE id AMONG (?)", again)
    if not of_batch:
        answered = wanted.keys() - {request.id for request in new} - {id for id, job in known.items() if job.is_open}
        waiting = [(request.id, request.client) for request in requests if request.id not in answered]
        session.many("INSERT INTO askers VALUES (?, ?, 0) ON CONFLICT (job, client) DO UPDATE SET gone = 0", waiting)
        session.told.extend(model.Change(request.id, "accepted") for request in new)


def refuse_without_room(session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds) -> None:
    """Raises TooManyJobs or LimitError where not all of these questions can be accepted now."""
    wanted = {request.id: request for request in requests}
    if new := _to_be_asked(session, wanted, _read(session, list(wanted))):
        refuse_too_many(session, new, bounds)


def _to_be_asked(
    session: Session, wanted: Mapping[str, model.JobRequest], known: Mapping[str, model.Job]
) -> list[model.JobRequest]:
    """Those that have to be computed."""
    now = first(session, "SELECT moment() AS now")["now"] if known else 0.0
    return [r for r in wanted.values() if r.id not in known or known[r.id].is_to_be_asked(r.fresh, now)]


def lock_jobs(session: Session, ids: list[str]) -> dict[str, model.Job]:
    """These jobs, locked until the commit."""
    rows = session.rows(f"{SELECT} FROM jobs WHERE id AMONG (?) ORDER BY id FOR UPDATE", ids)
    return {job.id: job for job in jobs_of(rows)}


def _read(session: Session, ids: list[str], largest: int = 0) -> dict[str, model.Job]:
    if largest:
        body = "CASE WHEN length(bodies.body) <= ? THEN bodies.body END AS body"
        rows = session.rows(f"{SELECT}, {body} FROM jobs {BODY} WHERE jobs.id AMONG (?)", largest, ids)
    else:
        rows = session.rows(f"{SELECT} FROM jobs WHERE id AMONG (?)", ids)
    return {job.id: job for job in jobs_of(rows)}


def refuse_too_many(session: Session, new: Sequence[model.JobRequest], bounds: model.Bounds) -> None:
    """Raises TooManyJobs, LimitError for a batch that would never have room. Well below the limits no lock is taken: it
    dominates the rate."""
    if len(new) > (most := min(bounds.total, bounds.client)):
        detail = f"The batch asks {len(new)} new questions, and at most {most} may be open; send it in parts."
        raise errors.LimitError(detail)
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


def claim(session: Session, owner: str, limit: int, client_running: int = model.NO_BOUND) -> list[model.Job]:
    """Up to `limit` accepted jobs, now running and owned by `owner`; of one client at most `client_running` run.

    Those of the client that has the fewest running, of these the smallest priority, then the oldest; an operator's rank
    goes before all of that. `attempt` is one higher than before. Those that another front end takes at this moment are
    passed over; none while the store is drained. A claim that is lost leaves the job accepted.
    Where running jobs of a client are bounded, front ends claim one after the other, so that it holds for all together.
    """
    if client_running < model.NO_BOUND:
        session.lock(CLAIM_LOCK)
    waiting = session.rows(f"SELECT id FROM jobs WHERE status = 'accepted' AND NOT {DRAINED} LIMIT 2")
    if len(waiting) > 1 or (waiting and client_running < model.NO_BOUND):  # whose turn it is takes longer to find out
        waiting = session.rows(NEXT, limit, client_running, limit)
    ids = [row["id"] for row in waiting]
    rows = session.rows(
        "UPDATE jobs SET status = 'running', owner = ?, heartbeat = moment(), started = moment(), "
        "attempt = attempt + 1 WHERE id IN (SELECT id FROM jobs WHERE id AMONG (?) AND status = 'accepted' "
        f"FOR UPDATE SKIP LOCKED) RETURNING {LISTED}",
        owner, ids,
    ) if ids else []  # fmt: skip
    session.told.extend(model.Change(id, "running") for id in ids)
    return sorted(jobs_of(rows), key=lambda job: ids.index(job.id))


def submit_and_claim(
    session: Session, request: model.JobRequest, bounds: model.Bounds, owner: str, limit: int, client_running: int
) -> tuple[model.Job, list[model.Job]]:
    """`submit` of one question, and in the same transaction `claim`: its job as it was accepted, and those claimed."""
    _accept(session, [request], bounds, of_batch=False)
    claimed = {job.id: job for job in claim(session, owner, limit, client_running)} if limit > 0 else {}
    session.told[:] = [change for change in session.told if change.what != "accepted" or change.id not in claimed]
    begun = claimed.get(request.id)
    job = replace(begun, status="accepted") if begun else _read(session, [request.id])[request.id]
    return job, [*claimed.values()]


def heartbeat(session: Session, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
    """Renew those of these claims (id, attempt) that are still this owner's; the ids of the others."""
    ids = sorted({id for id, _ in running})
    lock_jobs(session, ids)
    rows = session.rows(
        "UPDATE jobs SET heartbeat = moment() WHERE id AMONG (?) AND owner = ? AND status = 'running' "
        "RETURNING id, attempt",
        ids, owner,
    )  # fmt: skip
    kept = {(row["id"], row["attempt"]) for row in rows}
    return [id for id, attempt in running if (id, attempt) not in kept]


def finish(
    session: Session, id: str, attempt: int, body: bytes, usage: Usage,
    kept: float | None = None, status: model.JobStatus = "successful",
) -> bool:  # fmt: skip
    """running -> successful or failed; False where the attempt is no longer the current one.

    After `kept` s (None: never) the question is computed again where it is asked again.
    """
    row = first(
        session,
        "UPDATE jobs SET status = ?, finished = moment(), expires = moment() + CAST(? AS DOUBLE PRECISION), "
        "revision = revision + 1, wall = ?, cpu = ?, memory = ?, owner = NULL "
        f"WHERE id = ? AND attempt = ? AND status = 'running' RETURNING {LISTED}",
        status, kept, usage.wall, usage.cpu, usage.memory, id, attempt,
    )  # fmt: skip
    if row is None:
        return False
    job = model.Job(**dict(row), body=body)
    session.told.append(model.Change(id, status, job))
    session.run("DELETE FROM askers WHERE job = ?", id)
    session.run(
        "INSERT INTO bodies (id, status, body) VALUES (?, ?, ?) "
        "ON CONFLICT (id) DO UPDATE SET status = excluded.status, body = excluded.body",
        id, status, body,
    )  # fmt: skip
    count_use(session, job.client, usage)
    number_lines(session, "job = ?", (id,))
    return True


def add_events(session: Session, events: Sequence[tuple[str, model.Event]]) -> None:
    """Append events (job id, event); those that are there already stay."""
    session.told.extend(model.Change(id, "event") for id in {id for id, _ in events})
    rows = [(id, event.number, event.kind, json.dumps(dict(event.data))) for id, event in events]
    session.many("INSERT INTO events VALUES (?, ?, ?, ?) ON CONFLICT DO NOTHING", rows)


def read_events(session: Session, id: str, after: int = 0, limit: int = 1000) -> list[model.Event]:
    """Events of a job with greater numbers than `after`, in order."""
    query = "SELECT number, kind, data FROM events WHERE id = ? AND number > ? ORDER BY number LIMIT ?"
    rows = session.rows(query, id, after, limit)
    return [model.Event(row["number"], row["kind"], json.loads(row["data"])) for row in rows]


def list_jobs(
    session: Session, *, status: model.JobStatus | None = None, kind: str | None = None, client: str | None = None,
    cursor: str | None = None, limit: int = 50,
) -> tuple[list[model.Job], str | None]:  # fmt: skip
    """One page, newest first, without bodies, and the cursor of the next one: the id of its last job.

    ValueError: a bad cursor.
    """
    last = None if cursor is None else read_job(session, cursor, 0)
    if cursor is not None and (last is None or client not in (None, last.client)):
        raise ValueError("not a cursor of this list")
    wanted = {"status": status, "kind": kind, "client": client, "sequence": last and last.sequence}
    chosen = {name: value for name, value in wanted.items() if value is not None}
    where = " AND ".join(f"{name} {'<' if name == 'sequence' else '='} ?" for name in chosen) or "1 = 1"
    query = f"{SELECT} FROM jobs WHERE {where} ORDER BY sequence DESC LIMIT ?"
    found = jobs_of(session.rows(query, *chosen.values(), limit + 1))
    return found[:limit], found[limit - 1].id if len(found) > limit else None


def counts(session: Session) -> dict[model.JobStatus, int]:
    """Number of jobs in each status."""
    rows = session.rows("SELECT status, count(*) AS jobs FROM jobs GROUP BY status")
    return {row["status"]: row["jobs"] for row in rows}


def is_waiting(session: Session) -> bool:
    """Whether any job waits for a worker."""
    return bool(session.rows("SELECT 1 FROM jobs WHERE status = 'accepted' LIMIT 1"))


def oldest(session: Session) -> float | None:
    """When the job was accepted that waits longest; None where none waits."""
    found: float | None = first(session, "SELECT min(created) AS oldest FROM jobs WHERE status = 'accepted'")["oldest"]
    return found


def release(
    session: Session, id: str, attempt: int, crashed: bool, usage: Usage = NO_USE, left: bytes | None = None
) -> model.Job | None:
    """running -> accepted after the worker died; counts a crash where `crashed`.

    What the run took is counted also where the job was dismissed meanwhile; that one keeps as its result what is
    `left`: what was finished of it.
    """
    session.told.append(model.Change(id, "accepted"))
    session.run(
        "UPDATE jobs SET status = 'accepted', owner = NULL, crashes = crashes + ? "
        "WHERE id = ? AND attempt = ? AND status = 'running'",
        int(crashed), id, attempt,
    )  # fmt: skip
    job = read_job(session, id, 0)
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


def dismiss(session: Session, id: str, client: str | None = None) -> tuple[model.Job | None, bool]:
    """The job, dismissed for a client and its batches (None: for all), and whether its work is to stop.

    The work stops when nobody waits for it any more: accepted or running -> dismissed, or to the earlier answer of
    a job that was computed again. A final job is returned as it is, an unknown one is None.
    """
    lock_jobs(session, [id])
    job = read_job(session, id)
    if job is None or not job.is_open:
        return job, False
    session.told.append(model.Change(id, "dismissed"))
    if client is None:
        is_over = bool(dismiss_unwanted(session, [id], "1 = 1"))
        return read_job(session, id), is_over
    session.run("INSERT INTO askers VALUES (?, ?, 1) ON CONFLICT (job, client) DO UPDATE SET gone = 1", id, client)
    dismiss_lines(session, "job = ? AND batch IN (SELECT id FROM batches WHERE client = ?)", (id, client))
    is_over = bool(dismiss_unwanted(session, [id]))
    return (read_job(session, id) if is_over else replace(job, status="dismissed")), is_over


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


def recover(session: Session, lease: float = 0.0) -> list[model.Job]:
    """Jobs running without a heartbeat for `lease` s (0: all) -> accepted.

    Each counts a restart. Whoever comes second finds none. A claim from the future is of a clock that was set back.
    """
    where, arguments = "status = 'running'", list[Any]()
    if lease > 0:
        where += " AND (heartbeat <= moment() - ? OR heartbeat > moment() + ?)"
        arguments += [lease, lease]
    rows = session.rows(
        "UPDATE jobs SET status = 'accepted', owner = NULL, restarts = restarts + 1 "
        f"WHERE id IN (SELECT id FROM jobs WHERE {where} FOR UPDATE SKIP LOCKED) RETURNING {LISTED}",
        *arguments,
    )
    found = jobs_of(rows)
    session.told.extend(model.Change(job.id, "accepted") for job in found)
    return found


def is_drained(session: Session) -> bool:
    """Whether an operator lets no job begin."""
    return bool(session.rows(f"SELECT 1 WHERE {DRAINED}"))


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


@dataclass(frozen=True, slots=True)
class BatchLine:
    """One line of a batch: a question, or the problem document (JSON) of a line that is none.

    `identifier` is the JSON of the line's own id.
    """

    number: int
    identifier: str
    request: model.JobRequest | None = None
    problem: bytes | None = None


@dataclass(frozen=True, slots=True)
class Batch:
    """A stored batch with the number of its lines in each status; a bad line counts as failed."""

    id: str
    kind: str
    client: str
    created: float
    total: int
    counts: Mapping[model.JobStatus, int]

    @property
    def status(self) -> model.JobStatus:
        """accepted before anything is done, successful when every line has its answer."""
        unfinished = self.counts.get("accepted", 0) + self.counts.get("running", 0)
        if unfinished == 0:
            return "successful"
        return "accepted" if unfinished == self.counts.get("accepted", 0) == self.total else "running"


@dataclass(frozen=True, slots=True)
class BatchAnswer:
    """The answer to one line; `order` grows in the order in which answers came.

    `size` is that of the body in the store, which is None here where more was not asked for; `job` has it.
    """

    number: int
    identifier: str
    status: model.JobStatus
    body: bytes | None
    order: int = 0
    job: str = ""
    size: int = 0


def batch_id(kind: str, client: str, lines: Sequence[BatchLine], key: str, generation: int) -> str:
    """The id of a client's batch, so that one that is sent again after a lost answer is not stored twice.

    `key` tells batches of the same lines apart; `generation` counts those with cancelled lines before it.
    """
    digest = hashlib.sha256("\x00".join(("batch", kind, client, key, str(generation))).encode())
    for line in lines:
        question = line.problem or b"" if line.request is None else line.request.id.encode()
        digest.update(f"\n{line.number}\x00{line.identifier}\x00".encode() + question)
    return digest.hexdigest()[: model.DIGITS]


# The total of a batch of which lines are missing still.
INCOMPLETE: Final = -1
COUNTS: Final = (
    "SELECT CASE WHEN lines.dismissed = 1 THEN 'dismissed' ELSE coalesce(jobs.status, 'failed') END AS status, "
    "count(*) AS lines FROM lines LEFT JOIN jobs ON jobs.id = lines.job WHERE batch = ? GROUP BY 1"
)
# Arguments: the largest result that comes with its line, the batch, the last order that is known, how many.
ANSWERS: Final = (
    "SELECT lines.number, lines.identifier, lines.problem, lines.order_number, lines.dismissed, lines.job, "
    "bodies.status, length(bodies.body) AS size, "
    "CASE WHEN bodies.status <> 'successful' OR length(bodies.body) <= ? THEN bodies.body END AS body "
    "FROM lines LEFT JOIN bodies ON bodies.id = lines.job "
    "WHERE lines.batch = ? AND lines.order_number > ? ORDER BY lines.order_number LIMIT ?"
)


def read_batch(session: Session, id: str) -> Batch | None:
    """A batch with its counts by status."""
    row = first(session, "SELECT * FROM batches WHERE id = ?", id)
    if row is None or row["total"] == INCOMPLETE:
        return None
    by_status = {found["status"]: found["lines"] for found in session.rows(COUNTS, id)}
    return Batch(id, row["kind"], row["client"], row["created"], row["total"], by_status)


def answers(
    session: Session, batch: str, after: int = 0, limit: int = 500, largest: int = model.NO_BOUND
) -> list[BatchAnswer]:
    """Answers with `order` above `after`, in that order: what is done so far; bodies of at most `largest` bytes.

    They are of a bad line, of one that was cancelled, or of a job.
    """
    return [_answer_of(row) for row in session.rows(ANSWERS, largest, batch, after, limit)]


def _answer_of(row: Any) -> BatchAnswer:
    if row["problem"] is not None:
        return BatchAnswer(row["number"], row["identifier"], "failed", row["problem"], row["order_number"])
    status: model.JobStatus = "dismissed" if row["dismissed"] else row["status"] or "dismissed"
    body = None if status == "dismissed" else row["body"]
    job, size = row["job"] or "", row["size"] or 0
    return BatchAnswer(row["number"], row["identifier"], status, body, row["order_number"], job=job, size=size)


def repeated(session: Session, batch: str) -> int:
    """How many lines of a batch ask what another one asks."""
    found = first(session, "SELECT count(job) - count(DISTINCT job) AS lines FROM lines WHERE batch = ?", batch)
    return int(found["lines"])


# Lines that are stored, or dismissed, in one transaction; others write between two of them.
STEP: Final = 200


def begin_batch(session: Session, id: str, kind: str, client: str) -> None:
    """The row of a batch whose lines come in steps; nobody sees it before `complete_batch`."""
    session.run(
        "INSERT INTO batches (id, kind, client, created, total) VALUES (?, ?, ?, moment(), ?) ON CONFLICT DO NOTHING",
        id, kind, client, INCOMPLETE,
    )  # fmt: skip


def claim_key(session: Session, client: str, key: str, digest: str) -> bool:
    """Note that a client sends these lines with this key; False where it sent others with it."""
    session.run("INSERT INTO keys VALUES (?, ?, ?, moment()) ON CONFLICT DO NOTHING", client, key, digest)
    found = first(session, "SELECT digest FROM keys WHERE client = ? AND key = ?", client, key)
    return bool(found["digest"] == digest)


def add_lines(session: Session, id: str, lines: Sequence[BatchLine], bounds: model.Bounds) -> None:
    """Some lines and the jobs that are new; lines that are there already stay as they are."""
    submit(session, [line.request for line in lines if line.request is not None], bounds, of_batch=True)
    session.told.append(model.Change("", "accepted"))
    rows = [(id, x.number, x.identifier, None if x.request is None else x.request.id, x.problem) for x in lines]
    session.many("INSERT INTO lines VALUES (?, ?, ?, ?, ?, NULL, 0) ON CONFLICT DO NOTHING", rows)
    answered = f"(job IS NULL OR job IN (SELECT id FROM jobs WHERE {FINISHED}))"
    numbers = (id, lines[0].number, lines[-1].number)
    number_lines(session, f"batch = ? AND number BETWEEN ? AND ? AND {answered}", numbers)


def complete_batch(session: Session, id: str, total: int) -> Batch:
    """The batch, all of whose lines are stored."""
    session.run("UPDATE batches SET total = ? WHERE id = ?", total, id)
    batch = read_batch(session, id)
    assert batch is not None
    return batch


def forget_batch(session: Session, id: str) -> None:
    """Nothing of a batch that was refused stays."""
    session.run("DELETE FROM lines WHERE batch = ?", id)
    session.run("DELETE FROM batches WHERE id = ?", id)


def leave_some(session: Session, batch: str) -> tuple[int, list[str]]:
    """Dismiss some open lines of a batch: how many jobs they have, and which of these nobody else waits for."""
    rows = session.rows("SELECT DISTINCT job FROM lines WHERE batch = ? AND order_number IS NULL LIMIT ?", batch, STEP)
    ids = sorted(row["job"] for row in rows)
    lock_jobs(session, ids)
    dismiss_lines(session, "batch = ? AND job AMONG (?)", (batch, ids))
    over = dismiss_unwanted(session, ids)
    session.told.extend(model.Change(id, "dismissed") for id in ["", *over])
    return len(ids), over


# What keeps a store in order: old answers are forgotten; what an operator asks for.
PRUNE_LOCK: Final = 7_204_021_103
# So many bytes of answers are forgotten at once, and one answer however large.
FORGOTTEN_BYTES: Final = 8 * 2**20


def forget(session: Session, before: float, most: int) -> tuple[int, int]:
    """Forget a little: lines of a batch from before with nothing open, or where there is none, finished jobs.

    How many rows were forgotten, and how many of them are jobs. Those that a kept batch names stay, and so do those
    that a batch has locked which is made at this moment.
    """
    session.lock(PRUNE_LOCK)
    session.run("DELETE FROM keys WHERE created <= ?", before)
    batch = first(
        session,
        "SELECT id FROM batches WHERE created <= ? AND NOT EXISTS (SELECT 1 FROM lines WHERE batch = batches.id "
        "AND order_number IS NULL) ORDER BY created LIMIT 1",
        before,
    )
    if batch is not None:
        some = "number IN (SELECT number FROM lines WHERE batch = ? LIMIT ?)"
        lines = session.rows(
            f"DELETE FROM lines WHERE batch = ? AND {some} RETURNING number", batch["id"], batch["id"], most
        )
        if len(lines) < most:
            session.run("DELETE FROM batches WHERE id = ?", batch["id"])
        return max(1, len(lines)), 0
    rows = session.rows(
        "SELECT id, coalesce((SELECT length(body) FROM bodies WHERE bodies.id = jobs.id), 0) AS size FROM jobs "
        f"WHERE {FINISHED} AND finished <= ? AND NOT EXISTS (SELECT 1 FROM lines WHERE lines.job = jobs.id) "
        "ORDER BY finished LIMIT ? FOR UPDATE SKIP LOCKED",
        before, most,
    )  # fmt: skip
    sizes = itertools.accumulate(row["size"] for row in rows)
    ids = [row["id"] for row, size in zip(rows, sizes, strict=True) if row is rows[0] or size <= FORGOTTEN_BYTES]
    return len(ids), _delete(session, ids)


def _delete(session: Session, ids: list[str]) -> int:
    for table in ("bodies", "events", "jobs"):
        session.run(f"DELETE FROM {table} WHERE id AMONG (?)", ids)
    return len(ids)


def oldest_moment(session: Session, count: int) -> float | None:
    """When the last of the `count` finished jobs ended that are the first to be forgotten."""
    finished = f"SELECT finished FROM jobs WHERE {FINISHED} ORDER BY finished LIMIT ?"
    moment: float | None = first(session, f"SELECT max(finished) AS moment FROM ({finished}) AS oldest", count)[
        "moment"
    ]
    return moment


def drain(session: Session, drained: bool) -> None:
    """Let no job begin any more, or let them begin again."""
    session.told.append(model.Change("", "accepted"))
    session.run(
        "INSERT INTO counters VALUES ('drained', ?) ON CONFLICT (name) DO UPDATE SET value = excluded.value",
        int(drained),
    )


def secret(session: Session) -> int:
    """A random number of this store, drawn when it is first asked for."""
    session.run("INSERT INTO counters VALUES ('secret', ?) ON CONFLICT (name) DO NOTHING", secrets.randbits(63))
    return int(first(session, "SELECT value FROM counters WHERE name = 'secret'")["value"])


def clients(session: Session) -> list[model.ClientUse]:
    """Who has something in the store or a rank, with what each used today."""
    count = "(SELECT count(*) FROM jobs WHERE jobs.client = known.client AND status = '{}') AS {}"
    return [
        model.ClientUse(**dict(row))
        for row in session.rows(
            f"SELECT known.client, {count.format('accepted', 'waiting')}, {count.format('running', 'running')}, "
            "(SELECT count(*) FROM jobs WHERE jobs.client = known.client) AS stored, "
            "coalesce(ranks.rank, 0) AS rank, coalesce(uses.runs, 0) AS runs, coalesce(uses.cpu, 0) AS cpu "
            "FROM (SELECT client FROM jobs UNION SELECT client FROM batches UNION SELECT client FROM ranks) AS known "
            "LEFT JOIN ranks ON ranks.client = known.client "
            f"LEFT JOIN uses ON uses.client = known.client AND uses.day = today() ORDER BY known.client"
        )
    ]


def rank_client(session: Session, client: str, rank: int) -> None:
    """The client's jobs, also those to come, begin before (-1), with (0) or after (1) those of the others."""
    session.run("DELETE FROM ranks WHERE client = ?", client)
    if rank:
        session.run("INSERT INTO ranks VALUES (?, ?)", client, rank)


def prioritise_batch(session: Session, batch: str, priority: int) -> int:
    """Give the waiting jobs of a batch this priority; how many there are."""
    lines = "SELECT job FROM lines WHERE batch = ? AND order_number IS NULL"
    found = session.rows(f"SELECT id FROM jobs WHERE {OPEN} AND id IN ({lines}) ORDER BY id FOR UPDATE", batch)
    session.run("UPDATE jobs SET priority = ? WHERE id AMONG (?)", priority, [row["id"] for row in found])
    return len(found)


def leave_all(session: Session, client: str) -> list[str]:
    """Dismiss the single jobs that are open for a client; the ids of those that nobody else waits for, which stop."""
    asked = session.rows(
        f"SELECT id FROM jobs WHERE {OPEN} AND (client = ? OR id IN (SELECT job FROM askers WHERE client = ?)) "
        "ORDER BY id",
        client, client,
    )  # fmt: skip
    return [row["id"] for row in asked if dismiss(session, row["id"], client)[1]]


def erase_client(session: Session, client: str) -> int:
    """Forget a client that has nothing open: its batches, its jobs with their answers, what it used; how many jobs.

    Jobs that others wait for, or that a batch of another client names, lose its name instead.
    """
    session.run("DELETE FROM lines WHERE batch IN (SELECT id FROM batches WHERE client = ?)", client)
    for table in ("batches", "askers", "keys", "ranks", "uses"):
        session.run(f"DELETE FROM {table} WHERE client = ?", client)
    rows = session.rows(
        f"SELECT id FROM jobs WHERE client = ? AND {FINISHED} AND NOT EXISTS (SELECT 1 FROM lines WHERE job = jobs.id) "
        "ORDER BY id FOR UPDATE",
        client,
    )
    forgotten = _delete(session, [row["id"] for row in rows])
    session.run("UPDATE jobs SET client = '' WHERE client = ?", client)
    return forgotten

"""What a store does inside a transaction, the same for each database.

The SQL is in `schema.sql` (tables, and how those of older versions become these) and
`statements.sql`, by name. Then batches: their identity, and what a store does with them and their
lines.
"""

import functools
import hashlib
import itertools
import json
import re
import secrets
from collections.abc import Iterable, Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any, Final, NamedTuple

from inverse_service import errors
from inverse_service.service.jobs import model, tasks

NO_BOUNDS, NO_USE = model.Bounds(), tasks.Usage()
VERSION: Final = 5
ACCEPT_LOCK, CLAIM_LOCK, PRUNE_LOCK = 7_204_021_102, 7_204_021_104, 7_204_021_103
# Near the bounds on open jobs front ends accept one after the other, so that they hold for all
# together.
FAR, FEW = 10, 1000
# The total of a batch of which lines are missing still.
INCOMPLETE: Final = -1
# Lines that are stored, or dismissed, in one transaction; others write between two of them.
STEP: Final = 200
# What keeps a store in order: old answers are forgotten; what an operator asks for.
# So many bytes of answers are forgotten at once, and one answer however large.
FORGOTTEN_BYTES: Final = 8 * 2**20


def _by_name(file: str) -> dict[str, str]:
    """The statements of a file, each after a line with its name."""
    text = resources.files(__package__).joinpath(file).read_text(encoding="utf-8")
    _, *parts = re.split(r"^-- name: (\w+)\n", text, flags=re.MULTILINE)
    return {
        name: statement.strip() for name, statement in zip(parts[::2], parts[1::2], strict=True)
    }


SQL: Final = _by_name("schema.sql") | _by_name("statements.sql")


@dataclass(frozen=True, eq=False)
class Dialect:
    """Of a database: what its statements have instead of ours, whether transactions run at the same
    time, and whether a statement takes many rows as an array for each column, which saves as many
    ways over the network.
    """

    instead: Mapping[str, str]
    has_locks: bool
    has_arrays: bool

    @functools.cache  # noqa: B019 - there are two, for all time
    def translated(self, name: str, is_single: bool = False, **parts: str) -> str:
        """The statement of this name as this database takes it, with these parts; `is_single`: for
        lists of one.
        """
        query = SQL[name]
        while "{" in query:
            query = query.format(**SQL, **parts)
        for ours, theirs in {**self.instead, **({"AMONG (?)": "= ?"} if is_single else {})}.items():
            query = query.replace(ours, theirs)
        return query


# There is one writer, so that nothing needs a lock.
SQLITE: Final = Dialect(
    {
        "BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY": "INTEGER PRIMARY KEY", "BIGINT": "INTEGER",
        "DOUBLE PRECISION": "REAL", "BYTEA": "BLOB", "AMONG (?)": "IN (SELECT value FROM json_each(?))",
        " FOR UPDATE": "", " SKIP LOCKED": "", " FIRST (": " IN (", ") LAST": ")",
    },
    has_locks=False,
    has_arrays=False,
)  # fmt: skip
POSTGRES: Final = Dialect(
    {
        " STRICT, WITHOUT ROWID": "", " STRICT": "", "ADD COLUMN": "ADD COLUMN IF NOT EXISTS",
        # PostgreSQL looks through all jobs for what is IN a list that depends on the row, and goes
        # to each of an array.
        " FIRST (": " = ANY(ARRAY(", ") LAST": "))", "AMONG (?)": "= ANY(%s)", "?": "%s",
        "moment()": "extract(epoch FROM clock_timestamp())::double precision",
        # The time of the statement is one for all its rows, so an index finds the day.
        "today()": "(extract(epoch FROM statement_timestamp())::bigint / 86400)::integer",
    },
    has_locks=True,
    has_arrays=True,
)  # fmt: skip


def script(found: int, dialect: Dialect) -> str:
    """What makes the tables of version `found` (0: none) those of this one. Raises WrongVersion for
    a newer one.
    """
    if not 0 <= found <= VERSION:
        raise model.WrongVersion(found, VERSION)
    steps = [f"from_{version}" for version in range(found or VERSION, VERSION)]
    return "\n".join(dialect.translated(name) for name in (*steps, "schema"))


@dataclass(frozen=True, slots=True)
class Session:
    """The connection of one transaction, and what it changed; statements by name, in the words of
    its database.
    """

    connection: Any
    told: list[model.Change]
    dialect: Dialect

    def rows(self, name: str, *arguments: Any, **parts: str) -> list[Any]:
        """All rows, each a mapping by column."""
        found: list[Any] = self._execute(name, arguments, parts).fetchall()
        return found

    def first(self, name: str, *arguments: Any) -> Any:
        """The first row, None where there is none."""
        return next(iter(self.rows(name, *arguments)), None)

    def run(self, name: str, *arguments: Any, **parts: str) -> None:
        """A statement whose rows nobody waits for."""
        self._execute(name, arguments, parts)

    def many(self, name: str, arguments: Sequence[tuple[Any, ...]]) -> None:
        """The statement for each of the arguments."""
        self.connection.cursor().executemany(self.dialect.translated(name), arguments)

    def table(self, name: str, arguments: Sequence[tuple[Any, ...]]) -> None:
        """`many`, in one statement of columns where the database takes arrays."""
        if not self.dialect.has_arrays:
            self.many(name, arguments)
        elif arguments:
            self.run(f"{name}_table", *map(list, zip(*arguments, strict=True)))

    def lock(self, number: int) -> None:
        """Wait until no other transaction holds this lock; held to the end."""
        if self.dialect.has_locks:
            self.run("lock", number)

    def _execute(self, name: str, arguments: Sequence[Any], parts: Mapping[str, str]) -> Any:
        # Where transactions wait for no network, to unpack a list takes as long as all else.
        lengths = {len(each) for each in arguments if isinstance(each, list)}
        if is_single := lengths == {1} and not self.dialect.has_locks:
            arguments = [each[0] if isinstance(each, list) else each for each in arguments]
        return self.connection.execute(self.dialect.translated(name, is_single, **parts), arguments)


def jobs_of(rows: Iterable[Mapping[str, Any]]) -> list[model.Job]:
    """Rows with the columns of a job, and its `body` if the statement has it."""
    return [model.Job(**dict(row)) for row in rows]


def read_job(
    session: Session, id: str, largest: int = model.LARGEST_BODY, client: str | None = None
) -> model.Job | None:
    """One job; the body only where it is that of the present status, and has at most `largest`
    bytes.

    Open, it is dismissed for who has left it.
    """
    job = _read(session, [id], largest).get(id)
    if job is None or client is None or not job.is_open:
        return job
    left = session.rows("has_left", id, client)
    return replace(job, status="dismissed") if left else job


def submit(
    session: Session,
    requests: Sequence[model.JobRequest],
    bounds: model.Bounds = NO_BOUNDS,
) -> list[model.Job]:
    """The job of each request, in order; all are stored, or none is (TooManyJobs).

    A job that is open or answered already is returned as it is, without its body, unless the
    request is `fresh` and it is answered, or it was dismissed: then it is accepted again.
    The jobs stay locked until the commit.
    """
    _accept_for_clients(session, requests, bounds)
    found = _read(session, [request.id for request in requests])
    return [found[request.id] for request in requests]


class _Accepted(NamedTuple):
    """What was stored to be computed, and the ids of what is answered already."""

    new: Sequence[model.JobRequest]
    answered: AbstractSet[str]


def _accept(
    session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds
) -> _Accepted:
    """Store what is asked."""
    wanted = {request.id: request for request in reversed(requests)}
    known = lock_jobs(session, list(wanted))
    if new := _to_be_asked(session, wanted, known)[::-1]:
        refuse_too_many(session, new, bounds)
        asked = [(r.id, r.kind, r.document, r.options, r.client, r.priority, r.fresh) for r in new]
        if session.dialect.has_arrays:  # two front ends that insert the same job at once make one
            *columns, _ = map(list, zip(*asked, strict=True))
            session.run("accept_table", *columns, [r.id for r in new if r.fresh])
        else:
            session.many("accept", asked)
        if again := [request.id for request in new if request.id in known]:
            session.run("forget", again, table="events")
    is_open = {id for id, job in known.items() if job.is_open}
    return _Accepted(new, wanted.keys() - {request.id for request in new} - is_open)


def _accept_for_clients(
    session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds
) -> bool:
    """Store what is asked, and who waits for it; whether any of it is to be computed that was
    not.
    """
    new, answered = _accept(session, requests, bounds)
    waiting = [(request.id, request.client) for request in requests if request.id not in answered]
    session.many("ask", waiting)
    session.told.extend(model.Change(request.id, "accepted") for request in new)
    return bool(new)


def refuse_without_room(
    session: Session, requests: Sequence[model.JobRequest], bounds: model.Bounds
) -> None:
    """Raises TooManyJobs or LimitError where not all of these questions can be accepted now."""
    wanted = {request.id: request for request in requests}
    if new := _to_be_asked(session, wanted, _read(session, list(wanted))):
        refuse_too_many(session, new, bounds)


def _to_be_asked(
    session: Session, wanted: Mapping[str, model.JobRequest], known: Mapping[str, model.Job]
) -> list[model.JobRequest]:
    """Those that have to be computed."""
    now = session.first("now")["now"] if known else 0.0
    return [
        r for r in wanted.values() if r.id not in known or known[r.id].is_to_be_asked(r.fresh, now)
    ]


def lock_jobs(session: Session, ids: list[str]) -> dict[str, model.Job]:
    """These jobs, locked until the commit."""
    return {job.id: job for job in jobs_of(session.rows("lock_jobs", ids))}


def _read(session: Session, ids: list[str], largest: int = 0) -> dict[str, model.Job]:
    return {job.id: job for job in jobs_of(session.rows("read_jobs", largest, ids))}


def refuse_too_many(
    session: Session, new: Sequence[model.JobRequest], bounds: model.Bounds
) -> None:
    """Raises TooManyJobs, LimitError for a batch that would never have room. Well below the limits
    no lock is taken: it dominates the rate.
    """
    if len(new) > (most := min(bounds.total, bounds.client)):
        detail = f"The batch asks {len(new)} new questions, and at most {most} may be open; send it in parts."
        raise errors.LimitError(detail)
    clients = {request.client for request in new}
    if bounds.daily < model.NO_BOUND and over_quota(session, [*clients], float(bounds.daily)):
        detail = "The processor time of this client for today (UTC) is used; ask again tomorrow."
        raise model.TooManyJobs(detail, model.until_tomorrow(), bounds.daily)
    if _room(session, clients, bounds) > FAR * len(new) + FEW:
        return
    session.lock(ACCEPT_LOCK)
    if len(new) > _room(session, clients, bounds):
        raise model.TooManyJobs("Too many jobs wait already; let some of them end and try again.")


def _room(session: Session, clients: set[str], bounds: model.Bounds) -> int:
    """How many more jobs may be open, of each of these clients and in all."""
    return bounds.room(open_by_client(session), clients)


def claim(
    session: Session, owner: str, limit: int, client_running: int = model.NO_BOUND
) -> list[model.Job]:
    """Up to `limit` accepted jobs, now running and owned by `owner`; of one client at most
    `client_running` run.

    Those of the client that has the fewest running, of these the smallest priority, then the
    oldest; an operator's rank goes before all of that. `attempt` is one higher than before. Those
    that another front end takes at this moment are passed over; none while the store is drained. A
    claim that is lost leaves the job accepted. Where running jobs of a client are bounded, front
    ends claim one after the other, so that it holds for all together.
    """
    if client_running < model.NO_BOUND:
        session.lock(CLAIM_LOCK)
    ids = [row["id"] for row in session.rows("next", limit, client_running, limit)]
    rows = session.rows("claim", owner, ids) if ids else []
    session.told.extend(model.Change(id, "running") for id in ids)
    return sorted(jobs_of(rows), key=lambda job: ids.index(job.id))


class Submitted(NamedTuple):
    """The stored job, and whether it is new."""

    job: model.Job
    is_new: bool


def submit_one(
    session: Session, request: model.JobRequest, bounds: model.Bounds, largest: int = 0
) -> Submitted:
    """`submit` of one question: its job, with an answer that has at most so many bytes, and whether
    it is new.
    """
    is_new = _accept_for_clients(session, [request], bounds)
    return Submitted(_read(session, [request.id], largest)[request.id], is_new)


def submit_together(
    session: Session, requests: Sequence[model.JobRequest], owner: str, begin: int
) -> list[model.Job]:
    """Store those of these questions that are new, where none waits the first `begin` as running.

    Bounds are not looked at. In the order of ids, or two front ends might wait for each other.
    """
    wanted = sorted({request.id: request for request in requests}.values(), key=lambda r: r.id)
    rows = [(r.id, r.kind, r.document, r.options, r.client, r.priority) for r in wanted]
    if session.dialect.has_arrays:
        columns = map(list, zip(*rows, strict=True))
        found = session.rows("begin_or_wait_all", owner, begin, *columns)
    else:
        found = []
        for row in rows:
            found += session.rows("begin_or_wait", *row, int(len(found) < begin), owner)
        session.many("ask", [(row["id"], row["client"]) for row in found])
    jobs = jobs_of(found)
    session.told.extend(model.Change(j.id, "accepted") for j in jobs if j.status == "accepted")
    return jobs


def open_by_client(session: Session) -> dict[str, int]:
    """How many jobs of each client are open."""
    return {row["client"]: row["jobs"] for row in session.rows("open_of_clients")}


def over_quota(session: Session, clients: Sequence[str], daily: float) -> set[str]:
    """Those of these clients that have used their processor seconds of today (UTC)."""
    return {row["client"] for row in session.rows("used_up", list(clients), daily)}


def heartbeat(session: Session, owner: str, running: Sequence[tuple[str, int]]) -> list[str]:
    """Renew those of these claims (id, attempt) that are still this owner's; the ids of the
    others.
    """
    ids = sorted({id for id, _ in running})
    lock_jobs(session, ids)
    rows = session.rows("heartbeat", ids, owner)
    kept = {(row["id"], row["attempt"]) for row in rows}
    return [id for id, attempt in running if (id, attempt) not in kept]


def finish(
    session: Session, id: str, attempt: int, body: bytes, usage: tasks.Usage,
    kept: float | None = None, status: model.JobStatus = "successful",
) -> bool:  # fmt: skip
    """running -> successful or failed; False where the attempt is no longer the current one.

    After `kept` s (None: never) the question is computed again where it is asked again.
    """
    row = session.first("finish", status, kept, usage.wall, usage.cpu, usage.memory, id, attempt)
    if row is None:
        return False
    job = model.Job(**dict(row), body=body)
    session.told.append(model.Change(id, status, job))
    session.run("forget_askers", [id])
    session.run("keep_body", id, status, body)
    count_use(session, job.client, usage)
    number_lines(session, "job = ?", (id,))
    return True


def add_events(session: Session, events: Sequence[tuple[str, model.Event]]) -> None:
    """Append events (job id, event); those that are there already stay."""
    session.told.extend(model.Change(id, "event") for id in {id for id, _ in events})
    rows = [(id, event.number, event.kind, json.dumps(dict(event.data))) for id, event in events]
    session.many("add_event", rows)


def read_events(session: Session, id: str, after: int = 0, limit: int = 1000) -> list[model.Event]:
    """Events of a job with greater numbers than `after`, in order."""
    rows = session.rows("read_events", id, after, limit)
    return [model.Event(row["number"], row["kind"], json.loads(row["data"])) for row in rows]


class JobsListed(NamedTuple):
    """Some jobs, and the id to go on after, None at the end."""

    jobs: list[model.Job]
    last: str | None


def list_jobs(
    session: Session, *, status: model.JobStatus | None = None, kind: str | None = None, client: str | None = None,
    cursor: str | None = None, limit: int = 50,
) -> JobsListed:  # fmt: skip
    """One page, newest first, without bodies, and the cursor of the next one: the id of its last
    job.

    ValueError: a bad cursor.
    """
    last = None if cursor is None else read_job(session, cursor, 0)
    if cursor is not None and (last is None or client not in (None, last.client)):
        raise ValueError("not a cursor of this list")
    wanted = {"status": status, "kind": kind, "client": client, "sequence": last and last.sequence}
    chosen = {name: value for name, value in wanted.items() if value is not None}
    where = (
        " AND ".join(f"{name} {'<' if name == 'sequence' else '='} ?" for name in chosen) or "1 = 1"
    )
    if status is not None:
        where += " AND {open}" if status in model.OPEN else " AND {finished}"
    found = jobs_of(session.rows("list_jobs", *chosen.values(), limit + 1, where=where))
    return JobsListed(found[:limit], found[limit - 1].id if len(found) > limit else None)


def counts(session: Session) -> dict[model.JobStatus, int]:
    """Number of jobs in each status."""
    return {row["status"]: row["jobs"] for row in session.rows("counts")}


def is_waiting(session: Session) -> bool:
    """Whether any job waits for a worker."""
    return bool(session.rows("is_waiting"))


def oldest(session: Session) -> float | None:
    """When the job was accepted that waits longest; None where none waits."""
    found: float | None = session.first("oldest")["oldest"]
    return found


def release(
    session: Session,
    id: str,
    attempt: int,
    usage: tasks.Usage = NO_USE,
    left: bytes | None = None,
) -> model.Job | None:
    """running -> accepted after the worker was ended.

    What the run took is counted also where the job was dismissed meanwhile; that one keeps as its
    result what is `left`: what was finished of it.
    """
    job = _release(session, id, attempt, usage, crashes=0)
    if left is not None and job is not None and (job.status, job.attempt) == ("dismissed", attempt):
        session.run("keep_first_body", id, job.status, left)
    return job


def release_crashed(
    session: Session, id: str, attempt: int, usage: tasks.Usage = NO_USE
) -> model.Job | None:
    """running -> accepted after the worker died of the job, which counts a crash."""
    return _release(session, id, attempt, usage, crashes=1)


def _release(
    session: Session, id: str, attempt: int, usage: tasks.Usage, crashes: int
) -> model.Job | None:
    session.told.append(model.Change(id, "accepted"))
    session.run("release", crashes, id, attempt)
    job = read_job(session, id, 0)
    if job is not None:
        count_use(session, job.client, usage)
    return job


def count_use(session: Session, client: str, usage: tasks.Usage) -> None:
    """Add a run to what the client used today."""
    session.run("count_use", client, float(usage.cpu))


def used_today(session: Session, client: str) -> float:
    """The processor seconds of a client's runs today (UTC)."""
    found = session.first("used_today", client)
    return 0.0 if found is None else float(found["cpu"])


class Dismissed(NamedTuple):
    """A dismissed job, None if it is not known, and whether its work is to stop."""

    job: model.Job | None
    stops: bool


def dismiss(session: Session, id: str, client: str | None = None) -> Dismissed:
    """The job, dismissed for a client and its batches (None: for all), and whether its work is to
    stop.

    The work stops when nobody waits for it any more: accepted or running -> dismissed, or to the
    earlier answer of a job that was computed again. A final job is returned as it is, an unknown
    one is None.
    """
    lock_jobs(session, [id])
    job = read_job(session, id)
    if job is None or not job.is_open:
        return Dismissed(job, False)
    session.told.append(model.Change(id, "dismissed"))
    if client is None:
        is_over = bool(dismiss_unwanted(session, [id], "1 = 1"))
        return Dismissed(read_job(session, id), is_over)
    session.run("leave", id, client)
    dismiss_lines(
        session, "job = ? AND batch IN (SELECT id FROM batches WHERE client = ?)", (id, client)
    )
    is_over = bool(dismiss_unwanted(session, [id]))
    return Dismissed(
        (read_job(session, id) if is_over else replace(job, status="dismissed")), is_over
    )


def dismiss_unwanted(session: Session, ids: list[str], where: str = "{unwanted}") -> list[str]:
    """Those of these open jobs that nobody waits for, dismissed; one computed again has its earlier
    answer back.
    """
    over = [row["id"] for row in session.rows("dismiss", ids, where=where)]
    if over:
        session.run("forget_askers", over)
        dismiss_lines(session, "job AMONG (?)", (over,))
    return over


def recover(session: Session, lease: float = 0.0) -> list[model.Job]:
    """Jobs running without a heartbeat for `lease` s (0: all) -> accepted.

    Each counts a restart. Whoever comes second finds none.
    """
    found = jobs_of(session.rows("recover", lease <= 0, lease, lease))
    session.told.extend(model.Change(job.id, "accepted") for job in found)
    return found


def is_drained(session: Session) -> bool:
    """Whether an operator lets no job begin."""
    return bool(session.rows("is_drained"))


def dismiss_lines(session: Session, where: str, arguments: tuple[Any, ...]) -> None:
    """Cancel the lines of batches that have no answer yet."""
    session.run("dismiss_lines", *arguments, where=where)
    number_lines(session, f"{where} AND dismissed = 1", arguments)


def number_lines(session: Session, where: str, arguments: tuple[Any, ...]) -> None:
    """Number lines that have an answer now, in the order in which answers come.

    Whoever takes numbers of a batch holds its row until the commit, so they become visible in their
    order.
    """
    for row in session.rows("due_lines", *arguments, where=where):
        batch, due = row["batch"], row["due"]
        before = session.first("take_numbers", due, batch)["answers"] - due
        session.run("number_lines", before, *arguments, batch, batch, where=where)


def batch_id(
    kind: str, client: str, lines: Sequence[model.BatchLine], key: str, generation: int
) -> str:
    """The id of a client's batch, so that one that is sent again after a lost answer is not stored
    twice.

    `key` tells batches of the same lines apart; `generation` counts those with cancelled lines
    before it.
    """
    digest = hashlib.sha256("\x00".join(("batch", kind, client, key, str(generation))).encode())
    for line in lines:
        question = line.problem or b"" if line.request is None else line.request.id.encode()
        digest.update(f"\n{line.number}\x00{line.identifier}\x00".encode() + question)
    return digest.hexdigest()[: model.DIGITS]


def sent_id(batch: model.SentBatch, key: str, generation: int) -> str:
    """The id of a batch whose lines are read later, by its body; see `batch_id`."""
    words = ("sent", batch.client, key, str(generation), json.dumps(batch.terms, sort_keys=True))
    digest = hashlib.sha256("\x00".join(words).encode())
    digest.update(batch.body)
    return digest.hexdigest()[: model.DIGITS]


def read_batch(session: Session, id: str) -> model.Batch | None:
    """A batch with its counts by status."""
    row = session.first("read_batch", id)
    if row is None or row["total"] == INCOMPLETE:
        return None
    by_status = {found["status"]: found["lines"] for found in session.rows("count_lines", id)}
    if (sent := session.first("sent", id)) is not None and (
        left := row["total"] - sum(by_status.values())
    ):
        status = "dismissed" if sent["gone"] else "accepted"
        by_status[status] = by_status.get(status, 0) + left
    return model.Batch(id, row["kind"], row["client"], row["created"], row["total"], by_status)


class BatchesListed(NamedTuple):
    """Some batches, and the id to go on after, None at the end."""

    batches: list[model.Batch]
    last: str | None


def list_batches(
    session: Session, client: str | None = None, cursor: str | None = None, limit: int = 20
) -> BatchesListed:
    """One page, the newest first, and the cursor of the next one: the id of its last batch.

    ValueError: a bad cursor.
    """
    where, chosen = "1 = 1", list[Any]()
    if cursor is not None:
        last = session.first("read_batch", cursor)
        if last is None or client not in (None, last["client"]):
            raise ValueError("not a cursor of this list")
        where += " AND (created < ? OR created = ? AND id < ?)"
        chosen += [last["created"], last["created"], cursor]
    if client is not None:
        where += " AND client = ?"
        chosen.append(client)
    ids = [row["id"] for row in session.rows("list_batches", *chosen, limit + 1, where=where)]
    found = [batch for id in ids[:limit] if (batch := read_batch(session, id)) is not None]
    return BatchesListed(found, ids[limit - 1] if len(ids) > limit else None)


def answers(
    session: Session, batch: str, after: int = 0, limit: int = 500, largest: int = model.NO_BOUND
) -> list[model.BatchAnswer]:
    """Answers with `order` above `after`, in that order: what is done so far; bodies of at most
    `largest` bytes.

    They are of a bad line, of one that was cancelled, or of a job.
    """
    return [_answer_of(row) for row in session.rows("answers", largest, batch, after, limit)]


def _answer_of(row: Any) -> model.BatchAnswer:
    if row["problem"] is not None:
        return model.BatchAnswer(
            row["number"], row["identifier"], "failed", row["problem"], row["order_number"]
        )
    status: model.JobStatus = "dismissed" if row["dismissed"] else row["status"] or "dismissed"
    body = None if status == "dismissed" else row["body"]
    job, size = row["job"] or "", row["size"] or 0
    return model.BatchAnswer(
        row["number"], row["identifier"], status, body, row["order_number"], job=job, size=size
    )


def repeated(session: Session, batch: str) -> int:
    """How many lines of a batch ask what another one asks."""
    return int(session.first("repeated", batch)["lines"])


def begin_batch(session: Session, id: str, kind: str, client: str) -> None:
    """The row of a batch whose lines come in steps; nobody sees it before `complete_batch`."""
    session.rows("begin_batch", id, kind, client, INCOMPLETE)


def claim_key(session: Session, client: str, key: str, digest: str) -> bool:
    """Note that a client sends these lines with this key; False where it sent others with it."""
    session.run("claim_key", client, key, digest)
    return bool(session.first("key", client, key)["digest"] == digest)


def add_lines(
    session: Session, id: str, lines: Sequence[model.BatchLine], bounds: model.Bounds
) -> None:
    """Some lines and the jobs that are new, for which the batch waits; lines that are there already
    stay as they are.
    """
    _accept(session, [line.request for line in lines if line.request is not None], bounds)
    session.told.append(model.Change("", "accepted"))
    rows = [
        (id, x.number, x.identifier, None if x.request is None else x.request.id, x.problem)
        for x in lines
    ]
    session.table("add_line", rows)
    numbers = (id, lines[0].number, lines[-1].number)
    number_lines(session, "batch = ? AND number BETWEEN ? AND ? AND {answered}", numbers)


def complete_batch(session: Session, id: str, total: int) -> model.Batch:
    """The batch, all of whose lines are stored."""
    session.run("complete_batch", total, id)
    batch = read_batch(session, id)
    assert batch is not None
    return batch


def send_batch(
    session: Session, batch: model.SentBatch, total: int, bounds: model.Bounds
) -> model.Batch | None:
    """Store the body of a batch whose lines are read later; None where there is one of this id, or
    so many may not have room.

    They count as open from now on.
    """
    session.lock(ACCEPT_LOCK)
    is_over = bounds.daily < model.NO_BOUND and over_quota(session, [batch.client], bounds.daily)
    if is_over or total > _room(session, {batch.client}, bounds):
        return None
    kind, client = batch.terms["kind"], batch.client
    if (row := session.first("begin_batch", batch.id, kind, client, total)) is None:
        return None
    session.run("keep_sent", batch.id, client, total, json.dumps(dict(batch.terms)), batch.body)
    session.told.append(model.Change("", "sent"))
    return model.Batch(batch.id, kind, client, row["created"], total, {"accepted": total})


def take_sent(session: Session, lease: float) -> model.SentBatch | None:
    """A body that is to be read, which nobody has read in for `lease` s; None where there is none."""
    row = session.first("take_sent", lease, lease)
    if row is None:
        return None
    terms = json.loads(row["terms"])
    return model.SentBatch(row["batch"], row["client"], terms, bytes(row["body"]))


def free_sent(session: Session) -> None:
    """Whoever read bodies is dead."""
    session.run("free_sent")


def add_sent_lines(session: Session, id: str, lines: Sequence[model.BatchLine], left: int) -> bool:
    """`add_lines` of a body; `left` are still to be read. False where the batch was erased.

    Those of a batch that was cancelled meanwhile are so, too. There was room when it was sent.
    """
    if (row := session.first("count_sent", left, id)) is None:
        return False
    if row["gone"]:
        session.table("add_line", [(id, x.number, x.identifier, None, x.problem) for x in lines])
        numbers = (id, lines[0].number, lines[-1].number)
        dismiss_lines(session, "batch = ? AND number BETWEEN ? AND ?", numbers)
        session.told.append(model.Change("", "dismissed"))
    else:
        add_lines(session, id, lines, NO_BOUNDS)
        session.told.append(model.Change("", "successful"))  # some may be answered already
    if not left:
        session.run("end_sent", id)
    return True


def leave_sent(session: Session, id: str) -> None:
    """Lines of this batch that are read later are cancelled."""
    session.run("leave_sent", id)


def forget_batch(session: Session, id: str) -> None:
    """Nothing of a batch that was refused stays."""
    session.run("forget_lines", id)
    session.run("forget_batch", id)


def leave_some(session: Session, batch: str) -> tuple[int, list[str]]:
    """Dismiss some open lines of a batch: how many jobs they have, and which of these nobody else
    waits for.
    """
    rows = session.rows("open_jobs_of_batch", batch, STEP)
    ids = sorted(row["job"] for row in rows)
    lock_jobs(session, ids)
    dismiss_lines(session, "batch = ? AND job AMONG (?)", (batch, ids))
    over = dismiss_unwanted(session, ids)
    session.told.extend(model.Change(id, "dismissed") for id in ["", *over])
    return len(ids), over


class Forgotten(NamedTuple):
    """How many rows were forgotten, and how many of them are jobs."""

    rows: int
    jobs: int


def forget(session: Session, before: float, most: int) -> Forgotten:
    """Forget a little: lines of a batch from before with nothing open, or where there is none,
    finished jobs.

    How many rows were forgotten, and how many of them are jobs. Those that a kept batch names stay,
    and so do those that a batch has locked which is made at this moment.
    """
    session.lock(PRUNE_LOCK)
    session.run("forget_keys", before)
    session.run("forget_uses")
    if (batch := session.first("old_batch", before)) is not None:
        lines = session.rows("forget_some_lines", batch["id"], batch["id"], most)
        if len(lines) < most:
            session.run("forget_batch", batch["id"])
        return Forgotten(max(1, len(lines)), 0)
    rows = session.rows("old_jobs", before, most)
    sizes = itertools.accumulate(row["size"] for row in rows)
    ids = [
        row["id"]
        for row, size in zip(rows, sizes, strict=True)
        if row is rows[0] or size <= FORGOTTEN_BYTES
    ]
    return Forgotten(len(ids), _delete(session, ids))


def _delete(session: Session, ids: list[str]) -> int:
    for table in ("bodies", "events", "jobs"):
        session.run("forget", ids, table=table)
    return len(ids)


def oldest_moment(session: Session, count: int) -> float | None:
    """When the last of the `count` finished jobs ended that are the first to be forgotten."""
    moment: float | None = session.first("oldest_moment", count)["moment"]
    return moment


def drain(session: Session, drained: bool) -> None:
    """Let no job begin any more, or let them begin again."""
    session.told.append(model.Change("", "accepted"))
    session.run("drain", int(drained))


def secret(session: Session) -> int:
    """A random number of this store, drawn when it is first asked for."""
    session.run("draw_secret", secrets.randbits(63))
    return int(session.first("secret")["value"])


def clients(session: Session) -> list[model.ClientUse]:
    """Who has something in the store or a rank, with what each used today."""
    return [model.ClientUse(**dict(row)) for row in session.rows("clients")]


def rank_client(session: Session, client: str, rank: int) -> None:
    """The client's jobs, also those to come, begin before (-1), with (0) or after (1) those of the
    others.
    """
    session.run("forget_of_client", client, table="ranks")
    if rank:
        session.run("rank", client, rank)


def prioritise_batch(session: Session, batch: str, priority: int) -> int:
    """Give the waiting jobs of a batch this priority; how many there are."""
    found = session.rows("waiting_of_batch", batch)
    session.run("prioritize", priority, [row["id"] for row in found])
    return len(found)


def leave_all(session: Session, client: str) -> list[str]:
    """Dismiss the single jobs that are open for a client; the ids of those that nobody else waits
    for, which stop.
    """
    asked = session.rows("open_of_client", client, client)
    return [row["id"] for row in asked if dismiss(session, row["id"], client)[1]]


def erase_client(session: Session, client: str) -> int:
    """Forget a client that has nothing open: its batches, its jobs with their answers, what it
    used; how many jobs.

    Jobs that others wait for, or that a batch of another client names, lose its name instead.
    """
    session.run("forget_lines_of_client", client)
    for table in ("batches", "askers", "keys", "ranks", "sent", "uses"):
        session.run("forget_of_client", client, table=table)
    forgotten = _delete(
        session, [row["id"] for row in session.rows("forgettable_of_client", client)]
    )
    session.run("disown", client)
    return forgotten

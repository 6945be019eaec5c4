"""Batches: their data, their identity, and what a store does with them and their lines, the same for each database."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from inverse_service.service.jobs import statements
from inverse_service.service.jobs.model import DIGITS, Bounds, JobRequest, JobStatus
from inverse_service.service.jobs.statements import Session, first


@dataclass(frozen=True, slots=True)
class BatchLine:
    """One line of a batch: a question, or the problem document (JSON) of a line that is none.

    `identifier` is the JSON of the line's own id.
    """

    number: int
    identifier: str
    request: JobRequest | None = None
    problem: bytes | None = None


@dataclass(frozen=True, slots=True)
class Batch:
    """A stored batch with the number of its lines in each status; a bad line counts as failed."""

    id: str
    kind: str
    client: str
    created: float
    total: int
    counts: Mapping[JobStatus, int]

    @property
    def status(self) -> JobStatus:
        """accepted before anything is done, successful when every line has its answer."""
        unfinished = self.counts.get("accepted", 0) + self.counts.get("running", 0)
        if unfinished == 0:
            return "successful"
        return "accepted" if unfinished == self.counts.get("accepted", 0) == self.total else "running"


@dataclass(frozen=True, slots=True)
class BatchAnswer:
    """The answer to one line; `order` grows in the order in which answers came, `digest` is that of the question.

    `size` is that of the body in the store, which is None here where more was not asked for; `job` has it.
    """

    number: int
    identifier: str
    status: JobStatus
    body: bytes | None
    order: int = 0
    digest: str = ""
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
    return digest.hexdigest()[:DIGITS]


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


def answers(session: Session, batch: str, after: int, limit: int, largest: int) -> list[BatchAnswer]:
    """Answers of a batch in their order: of a bad line, of one that was cancelled, or of a job."""
    return [_answer_of(row) for row in session.rows(ANSWERS, largest, batch, after, limit)]


def _answer_of(row: Any) -> BatchAnswer:
    if row["problem"] is not None:
        return BatchAnswer(row["number"], row["identifier"], "failed", row["problem"], row["order_number"])
    status: JobStatus = "dismissed" if row["dismissed"] else row["status"] or "dismissed"
    body = None if status == "dismissed" else row["body"]
    job, size = row["job"] or "", row["size"] or 0
    return BatchAnswer(row["number"], row["identifier"], status, body, row["order_number"], job=job, size=size)


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


def add_lines(session: Session, id: str, lines: Sequence[BatchLine], bounds: Bounds) -> None:
    """Some lines and the jobs that are new; lines that are there already stay as they are."""
    statements.submit(session, [line.request for line in lines if line.request is not None], bounds, of_batch=True)
    rows = [(id, x.number, x.identifier, None if x.request is None else x.request.id, x.problem) for x in lines]
    session.many("INSERT INTO lines VALUES (?, ?, ?, ?, ?, NULL, 0) ON CONFLICT DO NOTHING", rows)
    answered = f"(job IS NULL OR job IN (SELECT id FROM jobs WHERE {statements.FINISHED}))"
    numbers = (id, lines[0].number, lines[-1].number)
    statements.number_lines(session, f"batch = ? AND number BETWEEN ? AND ? AND {answered}", numbers)


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
    statements.lock_jobs(session, ids)
    statements.dismiss_lines(session, "batch = ? AND job AMONG (?)", (batch, ids))
    return len(ids), statements.dismiss_unwanted(session, ids)

"""What the queries of every store have in common, and those about the lines of batches.

Statements have ? for an argument and AMONG (?) for one that is a list; moment() is the time of the database, today()
its day in UTC, counted from 1970.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

from inverse_service.service.jobs.model import Batch, BatchAnswer, Job, JobStatus

COLUMNS: Final = (
    "id", "kind", "document", "options", "status", "client", "priority", "created", "started", "finished",
    "attempt", "crashes", "restarts", "revision", "sequence", "wall", "cpu", "memory", "expires",
)  # fmt: skip
LISTED: Final = ", ".join(f"jobs.{name}" for name in COLUMNS)
SELECT: Final = f"SELECT {LISTED}"
OPEN: Final = "status IN ('accepted', 'running')"
FINISHED: Final = "status NOT IN ('accepted', 'running')"
BODY: Final = "LEFT JOIN bodies ON bodies.id = jobs.id AND bodies.status = jobs.status"
COUNTS: Final = (
    "SELECT CASE WHEN lines.dismissed = 1 THEN 'dismissed' ELSE coalesce(jobs.status, 'failed') END AS status, "
    "count(*) AS lines FROM lines LEFT JOIN jobs ON jobs.id = lines.job WHERE batch = ? GROUP BY 1"
)
# Arguments: the largest body that comes with its line, the batch, the last order that is known, how many.
ANSWERS: Final = (
    "SELECT lines.number, lines.identifier, lines.problem, lines.order_number, lines.dismissed, lines.job, "
    "bodies.status, length(bodies.body) AS size, CASE WHEN length(bodies.body) <= ? THEN bodies.body END AS body "
    "FROM lines LEFT JOIN bodies ON bodies.id = lines.job "
    "WHERE lines.batch = ? AND lines.order_number > ? ORDER BY lines.order_number LIMIT ?"
)


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


def jobs_of(rows: Iterable[Mapping[str, Any]]) -> list[Job]:
    """Rows of SELECT, with a `body` if the query has one."""
    return [Job(**dict(row)) for row in rows]


def read_batch(session: Session, id: str) -> Batch | None:
    """A batch with its counts by status."""
    row = first(session, "SELECT * FROM batches WHERE id = ?", id)
    if row is None:
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


def dismiss_lines(session: Session, where: str, arguments: tuple[str, ...]) -> None:
    session.run(f"UPDATE lines SET dismissed = 1 WHERE {where} AND order_number IS NULL", *arguments)
    number_lines(session, f"{where} AND dismissed = 1", arguments)


def number_lines(session: Session, where: str, arguments: tuple[str, ...]) -> None:
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

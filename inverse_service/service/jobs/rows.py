"""Rows of both stores as the data that leaves them."""

from __future__ import annotations

from typing import Any

from inverse_service.service.jobs.model import BatchAnswer
from inverse_service.service.jobs.states import JobStatus


def answer_of(row: Any) -> BatchAnswer:
    """A row of `shared_sql.ANSWERS`: a bad line, one that was cancelled, or that of a job."""
    if row["problem"] is not None:
        return BatchAnswer(row["number"], row["identifier"], "failed", row["problem"], row["order_number"])
    status: JobStatus = "dismissed" if row["dismissed"] else row["status"] or "dismissed"
    body = None if status == "dismissed" else row["body"]
    job, size = row["job"] or "", row["size"] or 0
    return BatchAnswer(row["number"], row["identifier"], status, body, row["order_number"], job=job, size=size)


def sequence_of(cursor: str | None) -> int | None:
    """The place of a cursor in the list; raises ValueError."""
    if cursor is None:
        return None
    if not (cursor.isascii() and cursor.isdigit() and len(cursor) < 16):
        raise ValueError("not a cursor of this list")
    return int(cursor)

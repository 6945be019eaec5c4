"""Forgetting in the PostgreSQL store, a little in each transaction."""

from __future__ import annotations

from typing import Any

from inverse_service.service.jobs.postgres_connections import Connection

# Rows have their share of tables and indexes besides their contents.
ROW_BYTES = 300


def forget(connection: Connection, before: float, most: int) -> tuple[int, int]:
    """Forget a little: lines of a batch from before with nothing open, or where there is none, finished jobs.

    How many rows were forgotten, and how many of them are jobs. Those that a kept batch names stay, and so do those
    that a batch has locked which is made at this moment.
    """
    connection.execute("SELECT pg_advisory_xact_lock(7204021103)")
    batch = connection.execute(
        "SELECT id FROM batches WHERE created <= %s AND NOT EXISTS (SELECT 1 FROM lines WHERE batch = batches.id "
        "AND order_number IS NULL) ORDER BY created LIMIT 1",
        (before,),
    ).fetchone()
    if batch is not None:
        numbers = "SELECT number FROM lines WHERE batch = %s LIMIT %s"
        some = (batch["id"], batch["id"], most)
        lines = connection.execute(f"DELETE FROM lines WHERE batch = %s AND number IN ({numbers})", some).rowcount
        if lines < most:
            connection.execute("DELETE FROM batches WHERE id = %s", (batch["id"],))
        return max(1, lines), 0
    rows = connection.execute(
        "SELECT id FROM jobs WHERE status NOT IN ('accepted', 'running') AND finished <= %s "
        "AND NOT EXISTS (SELECT 1 FROM lines WHERE lines.job = jobs.id) ORDER BY finished LIMIT %s "
        "FOR UPDATE SKIP LOCKED",
        (before, most),
    ).fetchall()
    ids: list[Any] = [row["id"] for row in rows]
    for table in ("bodies", "events", "jobs"):
        connection.execute(f"DELETE FROM {table} WHERE id = ANY(%s)", (ids,))
    return len(ids), len(ids)


def oldest_moment(connection: Connection, count: int) -> float | None:
    """When the last of the `count` finished jobs ended that are the first to be forgotten."""
    row = connection.execute(
        "SELECT max(finished) AS moment FROM (SELECT finished FROM jobs "
        "WHERE status NOT IN ('accepted', 'running') ORDER BY finished LIMIT %s) AS next",
        (count,),
    ).fetchone()
    return None if row is None else row["moment"]


def used_bytes(connection: Connection) -> int:
    """Bytes of what is stored, compressed as it is; the files themselves only shrink when vacuumed."""
    row = connection.execute(
        "SELECT (SELECT coalesce(sum(pg_column_size(body) + %(row)s), 0) FROM bodies) "
        "+ (SELECT coalesce(sum(pg_column_size(document) + pg_column_size(options) + %(row)s), 0) FROM jobs) "
        "+ (SELECT coalesce(sum(pg_column_size(data) + 100), 0) FROM events) AS size",
        {"row": ROW_BYTES},
    ).fetchone()
    return 0 if row is None else int(row["size"])

"""Forgetting in the PostgreSQL store: what is old, then what makes it too large."""

from __future__ import annotations

from typing import Any

from inverse_service.service.jobs.postgres_connections import Connection

STEP = 100
# Rows have their share of tables and indexes besides their contents.
ROW_BYTES = 300


def prune(connection: Connection, oldest: float, largest: int) -> int:
    """The number of jobs forgotten; open ones stay, and so do those that a kept batch names."""
    connection.execute("SELECT pg_advisory_xact_lock(7204021103)")
    forgotten = _forget(connection, "finished < %s", oldest, before=oldest)
    while _size(connection) > largest:
        row = connection.execute(
            "SELECT max(finished) AS newest FROM (SELECT finished FROM jobs "
            "WHERE status NOT IN ('accepted', 'running') ORDER BY finished LIMIT %s) AS next",
            (STEP,),
        ).fetchone()
        newest = None if row is None else row["newest"]
        found = 0 if newest is None else _forget(connection, "finished <= %s", newest, before=newest)
        if not found:
            break
        forgotten += found
    return forgotten


def _forget(connection: Connection, where: str, moment: float, before: float) -> int:
    """Finished jobs, and first the batches from before that have nothing open any more."""
    connection.execute(
        "DELETE FROM batches WHERE created <= %s AND NOT EXISTS (SELECT 1 FROM lines JOIN jobs ON jobs.id = lines.job "
        "WHERE lines.batch = batches.id AND jobs.status IN ('accepted', 'running'))",
        (before,),
    )
    connection.execute("DELETE FROM lines WHERE NOT EXISTS (SELECT 1 FROM batches WHERE batches.id = lines.batch)")
    # A batch that is made at this moment has locked its jobs: they are passed over.
    rows = connection.execute(
        f"SELECT id FROM jobs WHERE status NOT IN ('accepted', 'running') AND {where} "
        "AND NOT EXISTS (SELECT 1 FROM lines WHERE lines.job = jobs.id) ORDER BY id FOR UPDATE SKIP LOCKED",
        (moment,),
    ).fetchall()
    ids: list[Any] = [row["id"] for row in rows]
    for table in ("bodies", "events", "jobs"):
        connection.execute(f"DELETE FROM {table} WHERE id = ANY(%s)", (ids,))
    return len(ids)


def _size(connection: Connection) -> int:
    """Bytes of what is stored, compressed as it is; the files themselves only shrink when vacuumed."""
    row = connection.execute(
        "SELECT (SELECT coalesce(sum(pg_column_size(body) + %(row)s), 0) FROM bodies) "
        "+ (SELECT coalesce(sum(pg_column_size(document) + pg_column_size(options) + %(row)s), 0) FROM jobs) "
        "+ (SELECT coalesce(sum(pg_column_size(data) + 100), 0) FROM events) AS size",
        {"row": ROW_BYTES},
    ).fetchone()
    return 0 if row is None else int(row["size"])

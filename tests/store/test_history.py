"""Nothing that is asked for a job grows with the jobs that ended before it.

The work of a statement is counted, not timed: the blocks that PostgreSQL touches for it
(auto_explain), the steps of SQLite's machine by fives. Each call of a job's life does the same work
in an empty store and in one with a history.
"""

from __future__ import annotations

import contextlib
import json
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import psycopg
import pytest

from inverse_service.service.jobs import postgres_store, stores as sqlite_store
from inverse_service.service.jobs.model import (
    BatchLine,
    Bounds,
    Event,
    JobRequest,
    SentBatch,
)
from inverse_service.service.jobs.stores import JobStore
from inverse_service.service.jobs.tasks import Usage

Stores = Callable[[], JobStore]
USAGE, BOUNDS = Usage(0.5, 0.25, 64.0), Bounds(10_000, 5_000)
DEFAULT, LARGE = 1_000, 100_000
# A deeper index has two or three more blocks for each step of a statement, and a step more for each
# column.
MORE = 3.0, 100

# Ended jobs of two clients with their answers, and a finished batch that names them; `%s` are
# numbers.
HISTORY = """
WITH RECURSIVE n (k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n WHERE k < {count})
INSERT INTO jobs (id, kind, document, options, status, client, priority, created, started, finished, attempt)
SELECT 'old' || k, 'solve', '{{"name": ' || k || '}}', '{{}}', 'successful', 'c' || k % 2, k % 2, k, k, k, 1 FROM n;
INSERT INTO bodies SELECT id, status, {body} FROM jobs WHERE finished IS NOT NULL;
INSERT INTO batches VALUES ('oldbatch', 'solve', 'c1', 1.0, {count}, {count});
INSERT INTO lines SELECT 'oldbatch', sequence, '1', id, NULL, sequence, 0 FROM jobs;
INSERT INTO events SELECT id, 10000, 'status', '{{}}' FROM jobs;
INSERT INTO uses SELECT client, sequence, 1, 1.0 FROM jobs;
INSERT INTO keys SELECT client, id, id, finished FROM jobs;
"""


TABLES = ("jobs", "bodies", "batches", "lines", "events", "uses", "keys", "askers", "sent")
connect_postgres, connect_sqlite = postgres_store.connect, sqlite_store.connect


def remember(store: JobStore, count: int) -> None:
    """Replace what a store has by a history; the planner of the database knows how large it is."""
    is_postgres = isinstance(store, postgres_store.PostgresStore)
    body = "convert_to('{}', 'UTF8')" if is_postgres else "CAST('{}' AS BLOB)"
    connection: Any = (connect_postgres if is_postgres else connect_sqlite)(store.address)
    with contextlib.closing(connection):
        connection.execute("BEGIN")
        for statement in (
            *(f"DELETE FROM {table}" for table in TABLES),
            *HISTORY.format(count=count, body=body).split(";"),
        ):
            if statement.strip():
                connection.execute(statement)
        connection.execute("COMMIT")
        connection.execute("ANALYZE")


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """The work of all statements: blocks of PostgreSQL under their statements, steps of SQLite."""
    work = Counter[str]()

    def hear(notice: psycopg.errors.Diagnostic) -> None:
        text = notice.message_primary or ""
        if "plan:" in text:
            found = json.loads(text[text.index("{") :])
            work[found["Query Text"]] += (
                found["Plan"]["Shared Hit Blocks"] + found["Plan"]["Shared Read Blocks"]
            )

    def postgres(address: str) -> postgres_store.Connection:
        connection = connect_postgres(address)
        connection.add_notice_handler(hear)
        connection.execute("LOAD 'auto_explain'")
        for setting in (
            "log_min_duration = 0",
            "log_analyze = 1",
            "log_buffers = 1",
            "log_format = 'json'",
        ):
            connection.execute(f"SET auto_explain.{setting}".encode())
        connection.execute("SET client_min_messages = log")
        return connection

    def sqlite(path: str) -> Any:
        connection = connect_sqlite(path)
        connection.set_progress_handler(lambda: work.update(["steps"]), 5)
        return connection

    monkeypatch.setattr(postgres_store, "connect", postgres)
    monkeypatch.setattr(sqlite_store, "connect", sqlite)
    return work


def life(store: JobStore, counted: Counter[str]) -> Iterator[tuple[str, int]]:
    """(what is done, its work) for all that is asked while jobs are accepted, run, and answered."""

    @contextlib.contextmanager
    def doing(name: str) -> Iterator[None]:
        counted.clear()
        yield
        done.append((name, sum(counted.values())))

    done = list[tuple[str, int]]()
    ask = [
        JobRequest(f"new{k}", "solve", json.dumps({"name": k}), client=f"c{k % 2}")
        for k in range(8)
    ]
    for request in (ask[0], ask[1]):
        with doing("submit_together"):
            (job,) = store.submit_together([request], "me", 1)
        with doing("events"):
            store.add_events([(job.id, Event(10_001, "status", {"status": "running"}))])
            store.events(job.id)
        with doing("heartbeat"):
            store.heartbeat("me", [(job.id, job.attempt)])
        with doing("finish"):
            store.finish(job.id, job.attempt, b"{}", USAGE)
    with doing("submit"):
        store.submit(ask[2:6], BOUNDS)
    with doing("bounded submit"):
        store.submit_one(ask[6], Bounds(1_000, 1_000, 100.0))
    with doing("is_waiting"):
        store.is_waiting()
        store.oldest()
        store.is_drained()
        store.used_today("c1")
    with doing("claim"):
        first, second, third = store.claim("me", 3, 100)
    with doing("release"):
        store.release_crashed(first.id, first.attempt, USAGE)
    with doing("dismiss"):
        store.dismiss(second.id, second.client)
        store.dismiss(third.id)
    with doing("recover"):
        store.recover(30.0)
    with doing("known"):
        store.submit([ask[0]], BOUNDS)
        store.job(ask[0].id)
        store.part(ask[0].id, 0, 10)
    with doing("list"):
        store.jobs(limit=5)
        store.jobs(status="successful", limit=5)
        store.jobs(status="accepted", limit=5)
    lines = [
        BatchLine(k, str(k), JobRequest(f"line{k}", "solve", str(k), client="c1", priority=10))
        for k in range(5)
    ]
    with doing("batch"):
        store.claim_key("c1", "key", "digest")
        store.create_batch("batch", "solve", "c1", lines, BOUNDS)
    with doing("lines"):
        for job in store.claim("me", 20):
            store.finish(job.id, job.attempt, b"{}", USAGE)
    with doing("answers"):
        store.batch("batch")
        store.batch_answers("batch", 2)
        store.repeated("batch")
    with doing("sent"):
        sent = SentBatch("sent", "c1", {"kind": "solve"}, b"{}")
        store.send_batch(sent, 5, BOUNDS)
        store.take_sent(60.0)
        store.add_sent_lines("sent", lines, 0)
        store.dismiss_batch("sent")
    with doing("dismiss_batch"):
        store.dismiss_batch("batch")
    yield from done


@pytest.mark.parametrize("count", [DEFAULT, pytest.param(LARGE, marks=pytest.mark.slow)])
def test_no_call_of_a_job_does_more_work_after_many_jobs_than_after_none(
    counted: Counter[str], stores: Stores, count: int
) -> None:
    store = stores()
    empty = list(life(store, counted))
    remember(store, count)
    later = list(life(store, counted))
    factor, constant = MORE
    grown = [
        (name, before, after)
        for (name, before), (_, after) in zip(empty, later, strict=True)
        if after > factor * before + constant
    ]
    assert not grown
    assert all(before for _, before in empty)


def test_only_what_clients_used_today_is_kept(store: JobStore) -> None:
    (job,) = store.submit_together([JobRequest("a", "solve", "{}", client="c0")], "me", 1)
    store.finish(job.id, job.attempt, b"{}", USAGE)
    store.write_change(
        lambda s: s.connection.execute(
            "INSERT INTO uses VALUES ('c0', 7, 1, 1.0), ('c9', 8, 1, 1.0)"
        )
    )
    store.prune(0.0, 10**9)
    rows = store.write_change(
        lambda s: s.connection.execute("SELECT client, cpu FROM uses").fetchall()
    )
    assert [tuple(dict(row).values()) for row in rows] == [("c0", USAGE.cpu)]
    assert store.used_today("c0") == USAGE.cpu

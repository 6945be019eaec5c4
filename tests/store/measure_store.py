"""Measure the throughput of both stores: `python -m tests.store.measure_store
[docs/records/reliability.md]` prints a table.

No engine runs: jobs are accepted, claimed, and answered as fast as the store allows.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.measured import conditions, put
from benchmarks.tables import table
from inverse_service.service.jobs.model import BULK, BatchLine, JobRequest
from inverse_service.service.jobs.stores import JobStore, SqliteStore
from inverse_service.service.jobs.tasks import Usage
from tests.store.server import programs, server

JOBS = 2000
LINES = 10_000
THREADS = 16
DOCUMENT = json.dumps(
    {"coordinates": ["x", "y"], "equations": {"x": "-x - y^3", "y": "-2*y - 3*x*y^2"}}
)
# A result of n = 2 with its certificate has about this size.
BODY = os.urandom(4_000) + bytes(16_000)


def request(name: str) -> JobRequest:
    return JobRequest(name, "solve", DOCUMENT, priority=BULK)


def rate(count: int, work: Callable[[], object]) -> float:
    """Per second."""
    began = time.perf_counter()
    work()
    return count / (time.perf_counter() - began)


def in_threads(work: Callable[[int], None]) -> None:
    threads = [threading.Thread(target=work, args=(k,)) for k in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def submit(store: JobStore, thread: int) -> None:
    for k in range(JOBS // THREADS):
        store.submit([request(f"{thread}-{k}")])


def drain(store: JobStore, thread: int) -> None:
    while jobs := store.claim(f"o{thread}", 8):
        for job in jobs:
            store.finish(job.id, job.attempt, BODY, Usage())


def look(store: JobStore, thread: int) -> None:
    for k in range(JOBS // THREADS):
        store.job(f"{thread}-{k}")


def measure(name: str, store: JobStore) -> list[str]:
    lines = [BatchLine(k, str(k), request(f"line {k}")) for k in range(LINES)]
    found = [
        rate(200, lambda: [store.submit([request(f"alone {k}")]) for k in range(200)]),
        rate(JOBS, lambda: in_threads(lambda k: submit(store, k))),
        rate(LINES, lambda: store.create_batch("B", "solve", "", lines)),
        rate(LINES + JOBS + 200, lambda: in_threads(lambda k: drain(store, k))),
        rate(JOBS, lambda: in_threads(lambda k: look(store, k))),
    ]
    store.close()
    return [name, *(f"{value:.0f}" for value in found)]


def main(pages: list[str]) -> None:
    head = [
        "changes a second",
        "accepted, one caller",
        f"accepted, {THREADS} callers",
        "lines of a batch",
        "answered",
    ]
    with tempfile.TemporaryDirectory() as folder:
        rows = [measure("SQLite", SqliteStore(Path(folder) / "jobs.sqlite"))]
    if programs() is not None:
        from inverse_service.service.jobs.postgres_store import PostgresStore

        with server(durable=True) as started:
            rows.append(measure("PostgreSQL", PostgresStore(started.database("measured"))))
    text = f"{conditions()}.\n\n{table([*head, 'looked up'], rows)}"
    print(text)
    for page in pages:
        put(Path(page), "store", text)


if __name__ == "__main__":
    main(sys.argv[1:])

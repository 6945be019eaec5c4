"""The store keeps acknowledged jobs, gives each job out once, and admits one supervisor."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from inverse_service.service.jobs.model import (
    BatchLine,
    DatabaseTaken,
    Job,
    JobRequest,
    document_digest,
    job_id,
)
from inverse_service.service.jobs.stores import SqliteStore
from inverse_service.service.jobs.tasks import Usage

USAGE = Usage(1.0, 0.5, 100.0)


def request(name: str = "a", **changes: object) -> JobRequest:
    return replace(JobRequest(name, "solve", "{}", client="c"), **changes)  # type: ignore[arg-type]


def claimed(store: SqliteStore, name: str = "a") -> Job:
    store.submit([request(name)])
    (job,) = store.claim("me", 1)
    return job


def lines(*names: str) -> list[BatchLine]:
    return [BatchLine(k, f'"{name}"', request(name)) for k, name in enumerate(names, 1)]


def test_one_supervisor_for_a_database(tmp_path: Path) -> None:
    path = tmp_path / "jobs.sqlite"
    first = SqliteStore(path)
    with pytest.raises(DatabaseTaken, match="INVERSE_SERVICE_DATABASE"):
        SqliteStore(path)
    first.close()
    SqliteStore(path).close()


KILLED = """
import sys
from pathlib import Path
from inverse_service.service.jobs.model import JobRequest
from inverse_service.service.jobs.stores import SqliteStore
store = SqliteStore(Path(sys.argv[1]))
for k in range(10**6):
    store.submit([JobRequest(f"{sys.argv[2]}-{k}", "solve", "{}")])
    print(f"{sys.argv[2]}-{k}", flush=True)
"""


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_by_kill_nine(tmp_path: Path) -> None:
    path, told = tmp_path / "jobs.sqlite", []
    for name in range(3):
        command = [sys.executable, "-c", KILLED, str(path), str(name)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            told.append(process.stdout.readline())
            time.sleep(0.05 * (name + 1))
            os.kill(process.pid, signal.SIGKILL)
            told += process.stdout.readlines()
    store = SqliteStore(path)
    names = [line.strip() for line in told if line.endswith("\n")]
    assert len(names) > 3
    assert [name for name in names if store.job(name) is None] == []
    store.close()


def test_the_order_of_keys_is_no_part_of_a_question_and_that_of_equations_is() -> None:
    equations = {"x": "-x", "y": "-2*y"}
    asked = {"equations": equations, "parameters": [], "options": {"seed": 1, "order": 2}}
    turned = {"options": {"order": 2, "seed": 1}, "parameters": [], "equations": equations}
    other = asked | {"equations": dict(reversed(equations.items()))}
    first, same, another = (job_id("solve", one, "{}") for one in (asked, turned, other))
    assert first == same != another
    assert document_digest(asked) == document_digest(turned) != document_digest(other)

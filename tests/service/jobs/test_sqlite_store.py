"""The store keeps what it acknowledged, hands each job out once, and lets one supervisor in."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from inverse_service.service.jobs.batches import BatchLine
from inverse_service.service.jobs.model import Bounds, DatabaseTaken, Event, Job, JobRequest, TooManyJobs
from inverse_service.service.jobs.outcome import Usage
from inverse_service.service.jobs.sqlite_store import SqliteStore

USAGE = Usage(1.0, 0.5, 100.0)


def request(name: str = "a", **changes: object) -> JobRequest:
    return replace(JobRequest(name, "solve", "{}", client="c"), **changes)  # type: ignore[arg-type]


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    store = SqliteStore(tmp_path / "jobs.sqlite")
    yield store
    store.close()


def claimed(store: SqliteStore, name: str = "a") -> Job:
    store.submit([request(name)])
    (job,) = store.claim("me", 1)
    return job


def test_a_job_goes_from_accepted_over_running_to_successful(store: SqliteStore) -> None:
    (job,) = store.submit([request()])
    assert (job.status, job.attempt, job.body) == ("accepted", 0, None)
    (job,) = store.claim("me", 5)
    assert (job.status, job.attempt) == ("running", 1)
    assert store.finish("a", 1, b'{"x": 1}', USAGE)
    found = store.job("a")
    assert found is not None
    assert (found.status, found.body, found.revision) == ("successful", b'{"x": 1}', 1)


def test_the_same_question_is_one_job_and_is_answered_from_the_store(store: SqliteStore) -> None:
    job = claimed(store)
    assert [j.status for j in store.submit([request(), request()])] == ["running", "running"]
    store.finish("a", job.attempt, b"1", USAGE)
    assert store.submit([request()])[0].body == b"1"
    assert store.claim("me", 5) == []


def test_a_failure_is_stored_like_a_result(store: SqliteStore) -> None:
    job = claimed(store)
    assert store.fail("a", job.attempt, b'{"status": 422}', USAGE)
    assert [(j.status, j.body) for j in store.submit([request()])] == [("failed", b'{"status": 422}')]


def test_asked_anew_it_is_computed_again_and_the_old_answer_is_not_shown(store: SqliteStore) -> None:
    job = claimed(store)
    store.finish("a", job.attempt, b"1", USAGE)
    (again,) = store.submit([request(fresh=True)])
    assert (again.status, again.body) == ("accepted", None)
    (job,) = store.claim("me", 1)
    store.finish("a", job.attempt, b"2", USAGE)
    found = store.job("a")
    assert found is not None
    assert (found.body, found.revision) == (b"2", 2)


def test_asked_anew_while_open_nothing_is_started_twice(store: SqliteStore) -> None:
    claimed(store)
    assert store.submit([request(fresh=True)])[0].status == "running"
    assert store.claim("me", 5) == []


@pytest.mark.parametrize("ending", ["finish", "fail"])
def test_an_answer_of_an_earlier_attempt_is_dropped(store: SqliteStore, ending: str) -> None:
    first = claimed(store)
    store.release("a", first.attempt, crashed=True)
    (second,) = store.claim("me", 1)
    assert not getattr(store, ending)("a", first.attempt, b"old", USAGE)
    assert store.finish("a", second.attempt, b"new", USAGE)
    assert not getattr(store, ending)("a", second.attempt, b"twice", USAGE)
    found = store.job("a")
    assert found is not None
    assert (found.body, found.crashes) == (b"new", 1)


def test_a_dismissed_job_takes_no_answer_and_can_be_asked_again(store: SqliteStore) -> None:
    job = claimed(store)
    dismissed, _ = store.dismiss("a")
    assert dismissed is not None
    assert dismissed.status == "dismissed"
    assert not store.finish("a", job.attempt, b"1", USAGE)
    assert store.submit([request()])[0].status == "accepted"
    assert store.dismiss("unknown") == (None, False)


def test_a_final_job_is_not_dismissed(store: SqliteStore) -> None:
    store.finish("a", claimed(store).attempt, b"1", USAGE)
    found, _ = store.dismiss("a")
    assert found is not None
    assert (found.status, found.body) == ("successful", b"1")


def test_no_job_is_claimed_twice_by_many_threads(store: SqliteStore) -> None:
    store.submit([request(str(k)) for k in range(200)])
    found: list[str] = []

    def claim() -> None:
        while jobs := store.claim(threading.current_thread().name, 3):
            found.extend(job.id for job in jobs)

    threads = [threading.Thread(target=claim) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(found) == sorted(str(k) for k in range(200))


def test_running_jobs_of_a_dead_service_run_again(store: SqliteStore) -> None:
    claimed(store)
    assert [(job.id, job.restarts) for job in store.recover()] == [("a", 1)]
    (job,) = store.claim("other", 1)
    assert (job.attempt, job.restarts, job.crashes) == (2, 1, 0)
    assert store.heartbeat("me", [("a", 1)]) == ["a"]
    assert store.heartbeat("other", [("a", 2)]) == []


def test_over_a_bound_nothing_is_stored(store: SqliteStore) -> None:
    bounds = Bounds(total=3, client=2)
    store.submit([request("a"), request("b")], bounds)
    with pytest.raises(TooManyJobs):
        store.submit([request("c")], bounds)
    store.submit([request("d", client="e")], bounds)
    with pytest.raises(TooManyJobs):
        store.submit([request("f", client="g"), request("a")], bounds)
    assert store.counts() == {"accepted": 3}
    assert store.submit([request("a")], bounds)[0].status == "accepted"


def test_the_list_is_paged_newest_first(store: SqliteStore) -> None:
    store.submit([request(str(k)) for k in range(5)])
    first, cursor = store.jobs(limit=2)
    second, cursor = store.jobs(limit=2, cursor=cursor)
    third, last = store.jobs(limit=2, cursor=cursor)
    assert [job.id for job in (*first, *second, *third)] == ["4", "3", "2", "1", "0"]
    assert last is None
    assert store.jobs(status="running") == ([], None)
    assert len(store.jobs(client="c", kind="solve", limit=50)[0]) == 5
    for bad in ("x", "-1", "9" * 99, ""):
        with pytest.raises(ValueError, match="cursor"):
            store.jobs(cursor=bad)


def test_events_are_read_after_a_number(store: SqliteStore) -> None:
    store.add_events([("a", Event(k, "progress", {"order": k})) for k in (1, 2, 3)])
    assert [event.number for event in store.events("a", after=1)] == [2, 3]
    assert store.events("a")[0].data == {"order": 1}


def lines(*names: str) -> list[BatchLine]:
    return [BatchLine(k, f'"{name}"', request(name)) for k, name in enumerate(names, 1)]


def test_every_line_of_a_batch_is_answered_once_in_the_order_of_answers(store: SqliteStore) -> None:
    store.finish("known", claimed(store, "known").attempt, b"0", USAGE)
    bad = BatchLine(9, "null", problem=b'{"status": 422}')
    batch = store.create_batch("b", "solve", "c", [*lines("x", "known", "x", "y"), bad])
    assert (batch.total, batch.counts, batch.status) == (5, {"accepted": 3, "successful": 1, "failed": 1}, "running")
    assert [answer.number for answer in store.batch_answers("b")] == [2, 9]
    x, y = store.claim("me", 5)
    store.finish(y.id, y.attempt, b"1", USAGE)
    store.fail(x.id, x.attempt, b"2", USAGE)
    answers = store.batch_answers("b")
    assert [(a.number, a.status) for a in answers[2:]] == [(4, "successful"), (1, "failed"), (3, "failed")]
    assert [a.number for a in store.batch_answers("b", after=answers[2].order)] == [1, 3]
    found = store.batch("b")
    assert found is not None
    assert found.status == "successful"


def test_dismissing_a_batch_spares_what_others_wait_for(store: SqliteStore) -> None:
    store.create_batch("b", "solve", "c", lines("x", "y"))
    store.create_batch("d", "solve", "c", lines("y"))
    assert store.dismiss_batch("b") == ["x"]
    assert store.counts() == {"accepted": 1, "dismissed": 1}
    assert [(a.status, a.body) for a in store.batch_answers("b")] == [("dismissed", None)] * 2
    assert store.batch_answers("d") == []


def test_old_answers_are_forgotten_and_open_jobs_stay(store: SqliteStore) -> None:
    store.create_batch("b", "solve", "c", lines("x"))
    store.finish("x", store.claim("me", 1)[0].attempt, b"1", USAGE)
    store.submit([request("open")])
    assert store.prune(time.time() - 60, 10**12) == 0
    assert store.prune(time.time() + 60, 10**12) == 1
    assert store.job("x") is None
    assert store.batch("b") is None
    assert store.counts() == {"accepted": 1}


@pytest.mark.slow
def test_a_store_that_is_too_large_forgets_the_oldest(store: SqliteStore) -> None:
    for k in range(300):
        store.finish(str(k), claimed(store, str(k)).attempt, b"x" * 10_000, USAGE)
    forgotten = store.prune(0.0, 1_500_000)
    assert 100 <= forgotten < 300
    assert store.job("0") is None
    assert store.job("299") is not None


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
from inverse_service.service.jobs.sqlite_store import SqliteStore
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

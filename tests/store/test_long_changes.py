"""A batch of 10,000 lines is stored and dismissed in steps, between which other clients write."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

from inverse_service.service.jobs.model import BatchLine, Bounds, JobRequest, TooManyJobs
from inverse_service.service.jobs.stores import JobStore
from tests.values import present

LINES = [
    BatchLine(k, str(k), JobRequest(f"job {k}", "solve", "{}", client="alice"))
    for k in range(1, 4_001)
]


def writes_beside(store: JobStore, change: Callable[[], object]) -> int:
    """The number of small changes by another client stored during a long one."""
    thread = threading.Thread(target=change)
    thread.start()
    number = 0
    while thread.is_alive():
        store.submit([JobRequest(f"other {time.monotonic_ns()}", "solve", "{}", client="bob")])
        number += 1
    thread.join()
    return number


def test_others_write_while_a_batch_is_stored_and_while_it_is_dismissed(store: JobStore) -> None:
    assert writes_beside(store, lambda: store.create_batch("batch", "solve", "alice", LINES)) > 1
    assert present(store.batch("batch")).counts == {"accepted": 4_000}
    began = time.thread_time()
    assert len(store.claim("o", 1)) == 1
    assert time.thread_time() - began < 0.05, "regardless of other waiting jobs"
    dismissed: list[str] = []
    assert writes_beside(store, lambda: dismissed.extend(store.dismiss_batch("batch"))) > 1
    assert len(dismissed) == 4_000
    assert present(store.batch("batch")).counts == {"dismissed": 4_000}
    assert [answer.order for answer in store.batch_answers("batch", limit=5_000)] == list(
        range(1, 4_001)
    )


def test_nothing_stays_of_a_batch_that_runs_out_of_room(
    store: JobStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.submit([JobRequest(f"bob {k}", "solve", "{}", client="bob") for k in range(100)])
    # Others were faster: a job that was free at the first look is taken.
    monkeypatch.setattr(
        "inverse_service.service.jobs.statements.refuse_without_room", lambda *_: None
    )
    monkeypatch.setattr(type(store), "step", 200)
    with pytest.raises(TooManyJobs):
        store.create_batch("batch", "solve", "alice", LINES[:1_000], Bounds(total=1_000))
    assert (store.batch("batch"), store.batch_answers("batch")) == (None, [])
    assert store.counts() == {"accepted": 100, "dismissed": 800}


def test_an_interrupted_batch_is_hidden_and_resumes_when_sent_again(
    store: JobStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    add, calls = JobStore.add_lines, list[int]()

    def dies(*arguments: object, **named: object) -> None:
        calls.append(1)
        if len(calls) == 3:
            raise OSError("the service is killed")
        add(*arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(JobStore, "add_lines", dies)
    monkeypatch.setattr(type(store), "step", 200)
    with pytest.raises(OSError, match="killed"):
        store.create_batch("batch", "solve", "alice", LINES[:1_000])
    assert store.batch("batch") is None
    batch = store.create_batch("batch", "solve", "alice", LINES[:1_000])
    assert (batch.total, batch.counts) == (1_000, {"accepted": 1_000})

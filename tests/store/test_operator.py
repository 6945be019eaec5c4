"""Operator actions on a store: order, drain, ranks, quotas, and canceling and erasing a client's
work.
"""

from __future__ import annotations

import time

import pytest

from inverse_service.service.jobs.model import BULK, BatchLine, Bounds, JobRequest, TooManyJobs
from inverse_service.service.jobs.stores import JobStore
from inverse_service.service.jobs.tasks import Usage
from tests.store.test_job_store import Stores, ids, request


def batch(store: JobStore, id: str, client: str, names: str) -> None:
    lines = [
        BatchLine(k, str(k), JobRequest(name, "solve", "{}", client=client, priority=BULK))
        for k, name in enumerate(names.split(), 1)
    ]
    store.create_batch(id, "solve", client, lines)


@pytest.mark.slow
def test_no_client_starves_another_by_single_questions_which_go_before_its_own_batches_only(
    store: JobStore,
) -> None:
    batch(store, "b", "bob", "b1 b2 b3")
    store.submit([request(f"a{k}", client="alice") for k in range(50)])
    store.submit([request("bob asks", client="bob")])
    assert ids(store.claim("o", 8)) == ["a0", "bob asks", "a1", "b1", "a2", "b2", "a3", "b3"]


def test_a_rank_of_the_operator_goes_before_the_turns_and_holds_for_jobs_to_come(
    store: JobStore,
) -> None:
    store.rank_client("late", 1)
    store.rank_client("early", -1)
    for client in ("late", "plain", "early"):
        store.submit([request(f"{client}{k}", client=client) for k in range(2)])
    assert ids(store.claim("o", 9)) == ["early0", "early1", "plain0", "plain1", "late0", "late1"]
    store.rank_client("late", 0)
    store.submit([request("x", client="late"), request("y", client="plain")])
    assert ids(store.claim("o", 9)) == ["x", "y"]


def test_a_batch_can_be_put_before_or_after_all_others(store: JobStore) -> None:
    batch(store, "early", "a", "e1 e2")
    batch(store, "late", "b", "l1 l2")
    store.submit([request("single", client="c")])
    assert (store.prioritise_batch("early", -1), store.prioritise_batch("late", 11)) == (2, 2)
    assert ids(store.claim("o", 9)) == ["e1", "e2", "single", "l1", "l2"]
    assert store.prioritise_batch("unknown", -1) == 0


def test_nothing_begins_in_a_drained_store_what_runs_ends_and_nothing_is_lost(
    stores: Stores,
) -> None:
    store = stores()
    store.submit([request("running")])
    (running,) = store.claim("o", 1)
    store.drain(True)
    store.submit([request("waiting")])
    assert store.is_drained()
    assert store.claim("o", 9) == []
    assert store.finish("running", running.attempt, b"{}", Usage())
    store.close()
    store = stores()
    assert store.is_drained(), "also after a restart"
    store.drain(False)
    assert ids(store.claim("o", 9)) == ["waiting"]


def test_clients_are_listed_with_what_they_have_and_used_today(store: JobStore) -> None:
    assert store.clients() == []
    store.submit([request(f"a{k}", client="alice") for k in range(3)])
    first, second = store.claim("o", 2)
    store.finish(first.id, first.attempt, b"{}", Usage(cpu=1.5))
    store.release(second.id, second.attempt, usage=Usage(cpu=2.0))
    store.rank_client("bob", -1)
    alice, bob = store.clients()
    assert (alice.client, alice.waiting, alice.running, alice.stored, alice.runs, alice.cpu) == (
        "alice",
        2,
        0,
        3,
        2,
        3.5,
    )
    assert (bob.client, bob.rank, bob.stored) == ("bob", -1, 0)


def test_a_client_without_daily_time_is_refused_only_new_work(store: JobStore) -> None:
    bounds = Bounds(daily=10.0)
    store.submit([request("a", client="alice")], bounds)
    (job,) = store.claim("o", 1)
    store.dismiss("a", "alice")
    store.release("a", job.attempt, usage=Usage(cpu=10.0))
    with pytest.raises(TooManyJobs, match="today") as refused:
        store.submit([request("b", client="alice")], bounds)
    midnight = (time.time() + refused.value.seconds) % 86_400
    assert min(midnight, 86_400 - midnight) < 2, "until midnight (UTC), which Retry-After says"
    with pytest.raises(TooManyJobs, match="today"):
        store.create_batch(
            "c", "solve", "alice", [BatchLine(1, "1", request("b", client="alice"))], bounds
        )
    assert store.job("b") is None
    store.submit([request("b", client="bob")], bounds)
    assert ids(store.submit([request("b", client="alice")], bounds)) == ["b"], (
        "stored answers cost nothing"
    )


def test_all_work_of_a_client_is_canceled_and_that_of_others_continues(store: JobStore) -> None:
    batch(store, "of alice", "alice", "line shared")
    batch(store, "of bob", "bob", "shared")
    store.submit([request("single", client="alice")])
    store.submit([request("both", client="bob")])
    store.submit([request("both", client="alice")])
    assert sorted(store.dismiss_client("alice")) == ["line", "single"]
    assert ids(sorted(store.claim("o", 9), key=lambda job: job.id)) == ["both", "shared"]
    assert dict((store.batch("of alice") or pytest.fail("gone")).counts) == {"dismissed": 2}


def test_an_erased_client_leaves_only_what_others_asked_too(store: JobStore) -> None:
    batch(store, "of alice", "alice", "line shared")
    batch(store, "of bob", "bob", "shared")
    store.submit([request("single", client="alice")])
    for job in store.claim("o", 9):
        store.finish(job.id, job.attempt, b"{}", Usage(cpu=1.0))
    store.submit([request("open", client="alice")])
    assert store.erase_client("alice") == 3
    assert [store.job(id) for id in ("line", "single", "open")] == [None, None, None]
    assert store.batch("of alice") is None
    assert [answer.status for answer in store.batch_answers("of bob")] == ["successful"]
    assert [use.client for use in store.clients()] == ["", "bob"]

"""The guarantees of `stores.JobStore`, tested for every job store."""

from __future__ import annotations

import json
import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import pytest

from inverse_service.errors import LimitError
from inverse_service.service.jobs.model import (
    BatchLine,
    Bounds,
    Event,
    JobRequest,
    SentBatch,
    TooManyJobs,
)
from inverse_service.service.jobs.opening import stored_answer
from inverse_service.service.jobs.stores import JobStore
from inverse_service.service.jobs.tasks import Usage
from tests.values import present

Stores = Callable[[], JobStore]
USAGE = Usage(0.5, 0.25, 64.0)


def request(id: str, **more: Any) -> JobRequest:
    return JobRequest(id, "solve", json.dumps({"name": id}), **more)


def ids(jobs: Sequence[Any]) -> list[str]:
    return [job.id for job in jobs]


def run(store: JobStore, id: str, body: bytes = b"{}") -> None:
    """Accept, claim, and finish one job, and no other waiting job."""
    store.submit([request(id)])
    (job,) = [job for job in store.claim("o", 100) if job.id == id]
    assert store.finish(id, job.attempt, body, USAGE)


@pytest.mark.slow
def test_an_empty_store_has_nothing(store: JobStore) -> None:
    assert store.job("a") is None
    assert store.jobs() == ([], None)
    assert store.claim("o", 5) == []
    assert store.events("a") == []
    assert store.batch("b") is None
    assert store.batch_answers("b") == []
    assert store.dismiss("a") == (None, False)
    assert store.release_crashed("a", 1) is None
    assert not store.finish("a", 1, b"{}", USAGE)
    assert dict(store.counts()) == {}
    assert store.recover() == []
    assert store.heartbeat("o", []) == []
    assert store.prune(time.time(), 0) == 0
    assert store.submit([]) == []


@pytest.mark.slow
def test_the_life_of_a_job(store: JobStore) -> None:
    (job,) = store.submit([request("a", client="c", options='{"seed":1}')])
    assert (job.status, job.attempt, job.body, job.client) == ("accepted", 0, None, "c")
    assert abs(job.created - time.time()) < 60
    (job,) = store.claim("o", 5)
    assert (job.status, job.attempt, json.loads(job.document), job.options) == (
        "running", 1, {"name": "a"}, '{"seed":1}',
    )  # fmt: skip
    assert store.claim("p", 5) == []
    assert store.finish("a", 1, b'{"verdict": 1}', USAGE)
    found = present(store.job("a"))
    assert (found.status, found.body, found.revision) == ("successful", b'{"verdict": 1}', 1)
    assert (found.wall, found.cpu, found.memory) == (USAGE.wall, USAGE.cpu, USAGE.memory)
    assert found.created <= (found.started or 0) <= (found.finished or 0)
    assert present(store.job("a", 0)).body is None


@pytest.mark.slow
def test_the_same_question_is_answered_from_the_store_until_it_is_renewed(store: JobStore) -> None:
    run(store, "a", b"1")
    (job,) = store.submit([request("a")])
    assert (job.status, job.body) == ("successful", None), "a large answer is read separately"
    (job,) = store.submit([request("a", fresh=True)])
    assert (job.status, job.body) == ("accepted", None)
    (job,) = store.submit([request("a", fresh=True)])
    assert (job.status, store.counts()) == ("accepted", {"accepted": 1})
    (job,) = store.claim("o", 1)
    assert store.finish("a", job.attempt, b"2", USAGE)
    found = present(store.job("a"))
    assert (found.body, found.revision) == (b"2", 2)


@pytest.mark.slow
def test_failures_are_kept_and_a_dismissed_job_is_accepted_again(store: JobStore) -> None:
    store.submit([request("a"), request("b")])
    a, b = store.claim("o", 2)
    assert store.finish("a", a.attempt, b'{"detail": "x"}', USAGE, status="failed")
    assert store.submit([request("a")])[0].status == "failed"
    assert store.job("a").body == b'{"detail": "x"}'  # type: ignore[union-attr]
    dismissed, is_over = store.dismiss("b")
    assert dismissed is not None
    assert (dismissed.status, is_over) == ("dismissed", True)
    assert not store.finish("b", b.attempt, b"{}", USAGE), "a dismissed job got a result"
    (job,) = store.submit([request("b")])
    assert job.status == "accepted"
    final, is_over = store.dismiss("a")
    assert final is not None
    assert (final.status, is_over) == ("failed", False)


def test_a_result_of_an_earlier_attempt_is_dropped(store: JobStore) -> None:
    store.submit([request("a")])
    (first,) = store.claim("o", 1)
    released = present(store.release_crashed("a", first.attempt))
    assert (released.status, released.crashes) == ("accepted", 1)
    (second,) = store.claim("o", 1)
    assert second.attempt > first.attempt
    assert not store.finish("a", first.attempt, b"old", USAGE)
    assert not store.finish("a", first.attempt, b"old", USAGE, status="failed")
    again = present(store.release_crashed("a", first.attempt))
    assert (again.status, again.crashes) == ("running", 1)
    assert store.finish("a", second.attempt, b"new", USAGE)
    assert not store.finish("a", second.attempt, b"twice", USAGE)
    assert present(store.job("a")).body == b"new"


def test_claims_go_by_turns_of_the_clients_then_by_priority_then_by_age(store: JobStore) -> None:
    store.submit([request("bulk", priority=10, client="y")])
    store.submit([request(f"x{k}", client="x") for k in range(4)])
    store.submit([request(f"y{k}", client="y") for k in range(2)])
    assert ids(store.claim("o", 4)) == ["x0", "y0", "x1", "y1"]
    assert ids(store.claim("o", 9)) == ["x2", "bulk", "x3"], (
        "bulk jobs of one client run last; two clients alternate"
    )


def test_what_is_urgent_is_next_however_much_waits_before_it(store: JobStore) -> None:
    """A claim looks at as many jobs of each client as it takes."""
    store.submit([request(f"bulk{k}", priority=10, client="x") for k in range(3)])
    store.submit([request("own", client="x")])
    assert ids(store.claim("o", 1)) == ["own"]
    assert ids(store.claim("o", 1)) == ["bulk0"]


def test_a_client_never_has_more_running_than_the_bound(store: JobStore) -> None:
    store.submit([request(f"x{k}", client="x") for k in range(9)] + [request("y", client="y")])
    assert ids(store.claim("o", 8, 2)) == ["x0", "y", "x1"]
    assert store.claim("p", 8, 2) == []
    assert store.finish("x0", 1, b"{}", USAGE)
    assert ids(store.claim("o", 8, 2)) == ["x2"]


def test_work_stops_when_its_last_asker_has_left(store: JobStore) -> None:
    for client in ("alice", "bob"):
        store.submit([request("a", client=client)])
    job, is_over = store.dismiss("a", "bob")
    assert job is not None
    assert (job.status, is_over) == ("dismissed", False)
    seen = [
        found.status
        for c in ("alice", "bob", None)
        if (found := store.job("a", client=c)) is not None
    ]
    assert seen == ["accepted", "dismissed", "accepted"]
    (again,) = store.submit([request("a", client="bob")])
    assert again.status == "accepted"
    assert not store.dismiss("a", "carol")[1], "a client who did not submit the job stopped it"
    assert not store.dismiss("a", "alice")[1]
    job, is_over = store.dismiss("a", "bob")
    assert job is not None
    assert (job.status, is_over, store.claim("o", 5)) == ("dismissed", True, [])


def test_a_batch_and_a_single_question_do_not_cancel_each_other(store: JobStore) -> None:
    store.submit([request("a", client="alice")])
    store.create_batch("B", "solve", "bob", [BatchLine(1, "1", request("a", client="bob"))])
    assert store.dismiss_batch("B") == []
    assert [answer.status for answer in store.batch_answers("B")] == ["dismissed"]
    store.create_batch("C", "solve", "bob", [BatchLine(1, "1", request("a", client="bob"))])
    assert not store.dismiss("a", "alice")[1]
    (job,) = store.claim("o", 5)
    store.finish("a", job.attempt, b"1", USAGE)
    assert [answer.body for answer in store.batch_answers("C")] == [b"1"]
    found = present(store.batch("B"))
    assert found.counts == {"dismissed": 1}, "a late answer must not belong to a canceled line"


def test_cancelling_a_job_cancels_the_lines_of_ones_own_batches(store: JobStore) -> None:
    for client in ("alice", "bob"):
        store.create_batch(
            f"of {client}", "solve", client, [BatchLine(1, "1", request("a", client=client))]
        )
    assert not store.dismiss("a", "bob")[1]
    assert [store.batch_answers(f"of {c}") != [] for c in ("alice", "bob")] == [False, True]
    assert store.dismiss("a", "alice")[1]


def test_a_job_that_is_cancelled_while_it_is_computed_again_has_its_answer_back(
    store: JobStore,
) -> None:
    run(store, "a", b"1")
    store.submit([request("a", fresh=True, client="bob")])
    store.claim("o", 1)
    job, is_over = store.dismiss("a", "bob")
    assert is_over
    assert job is not None
    assert (job.status, job.body) == ("successful", b"1")


def test_an_answer_that_is_not_to_last_is_computed_again_after_its_time(store: JobStore) -> None:
    for id, kept in (("a", 0.0), ("b", 60.0), ("c", None)):
        store.submit([request(id)])
        (job,) = store.claim("o", 1)
        assert store.finish(id, job.attempt, b"1", USAGE, kept)
    assert [store.submit([request(id)])[0].status for id in "abc"] == [
        "accepted",
        "successful",
        "successful",
    ]
    store.create_batch("B", "solve", "", [BatchLine(1, "1", request("a"))])
    assert store.batch_answers("B") == []


def test_what_ran_when_the_service_died_is_accepted_again(stores: Stores) -> None:
    store = stores()
    store.submit([request("a"), request("b")])
    store.claim("dead", 1)
    if store.exclusive:
        store.close()
        store = stores()
    assert store.recover(60.0) == [], "a new claim was taken away"
    (job,) = store.recover(0.0)
    assert (job.id, job.status, job.restarts) == ("a", "accepted", 1)
    assert store.recover(0.0) == []
    assert sorted(ids(store.claim("o", 5))) == ["a", "b"]


def test_a_heartbeat_returns_the_lost_jobs(store: JobStore) -> None:
    store.submit([request(id) for id in "abc"])
    claimed = {job.id: job.attempt for job in store.claim("o", 3)}
    store.dismiss("b")
    store.release("c", claimed["c"])
    store.claim("p", 1)
    assert sorted(store.heartbeat("o", list(claimed.items()))) == ["b", "c"]
    assert store.heartbeat("q", [("a", claimed["a"])]) == ["a"], (
        "it is not the claim of another one"
    )


def test_an_earlier_attempt_of_the_same_owner_is_lost(store: JobStore) -> None:
    store.submit([request("a")])
    (first,) = store.claim("o", 1)
    store.release("a", first.attempt)
    (second,) = store.claim("o", 1)
    assert second.attempt > first.attempt
    assert store.heartbeat("o", [("a", first.attempt)]) == ["a"]
    assert store.heartbeat("o", [("a", second.attempt)]) == []


def test_bounds_hold_and_nothing_is_stored_beyond_them(store: JobStore) -> None:
    store.submit([request("a", client="x")], Bounds(2, 2))
    with pytest.raises(TooManyJobs):
        store.submit([request("b"), request("c")], Bounds(2, 2))
    with pytest.raises(TooManyJobs):
        store.submit([request("b", client="x")], Bounds(9, 1))
    assert store.counts() == {"accepted": 1}
    assert ids(store.submit([request("a", client="x"), request("b")], Bounds(2, 2))) == ["a", "b"]
    with pytest.raises(TooManyJobs):
        store.create_batch("B", "solve", "", [BatchLine(1, '"1"', request("c"))], Bounds(2, 2))
    assert store.batch("B") is None


def test_a_batch_beyond_the_capacity_must_be_sent_in_parts(store: JobStore) -> None:
    """Waiting and retrying would not help."""
    lines = [BatchLine(k, str(k), request(str(k))) for k in range(3)]
    for bounds in (Bounds(2, 9), Bounds(9, 2)):
        with pytest.raises(LimitError, match="at most 2 may"):
            store.create_batch("B", "solve", "", lines, bounds)
    assert store.create_batch("B", "solve", "", lines, Bounds(3, 3)).total == 3


def test_the_list_is_newest_first_in_pages(store: JobStore) -> None:
    store.submit([request(id, client="x" if id < "c" else "y") for id in "abcde"])
    store.claim("o", 2)
    first, cursor = store.jobs(limit=3)
    second, end = store.jobs(limit=3, cursor=cursor)
    assert (ids(first), ids(second), end) == (["e", "d", "c"], ["b", "a"], None)
    assert ids(store.jobs(status="running")[0]) == ["c", "a"]
    assert ids(store.jobs(client="x", kind="solve")[0]) == ["b", "a"]
    assert store.jobs(kind="check")[0] == []
    for cursor in ("x", "-1", "1" * 20, "\u0663"):
        with pytest.raises(ValueError, match="cursor"):
            store.jobs(cursor=cursor)
    assert ids(store.jobs(client="x", cursor="b")[0]) == ["a"]
    with pytest.raises(ValueError, match="cursor"):  # nobody goes on where another client was
        store.jobs(client="x", cursor="d")


def test_events_are_kept_in_order_once(store: JobStore) -> None:
    store.submit([request("a")])
    store.add_events(
        [("a", Event(2, "progress", {"stage": "decision\u2028\x00"})), ("a", Event(1, "status"))]
    )
    store.add_events([("a", Event(2, "progress", {"stage": "another"})), ("b", Event(1, "status"))])
    store.add_events([])
    assert store.events("a") == [
        Event(1, "status"),
        Event(2, "progress", {"stage": "decision\u2028\x00"}),
    ]
    assert [event.number for event in store.events("a", after=1)] == [2]
    assert [event.number for event in store.events("a", limit=1)] == [1]


def test_a_batch_counts_its_lines_and_answers_them_in_the_order_of_their_ends(
    store: JobStore,
) -> None:
    run(store, "old", b"old")
    lines = [
        BatchLine(1, '"one"', request("x")),
        BatchLine(2, '"two"', request("y")),
        BatchLine(3, "null", problem=b"bad"),
        BatchLine(4, '"four"', request("x")),
        BatchLine(5, "5", request("old")),
    ]
    batch = store.create_batch("B", "solve", "c", lines)
    assert (batch.total, batch.counts) == (5, {"accepted": 3, "failed": 1, "successful": 1})
    assert [(a.number, a.body) for a in store.batch_answers("B")] == [(3, b"bad"), (5, b"old")]
    attempts = {job.id: job.attempt for job in store.claim("o", 5)}
    assert sorted(attempts) == ["x", "y"], "the same question is computed once"
    store.finish("y", attempts["y"], b"no", USAGE, status="failed")
    store.finish("x", attempts["x"], b"yes", USAGE)
    answers = store.batch_answers("B")
    assert [(a.number, a.status, a.body) for a in answers] == [
        (3, "failed", b"bad"), (5, "successful", b"old"), (2, "failed", b"no"),
        (1, "successful", b"yes"), (4, "successful", b"yes"),
    ]  # fmt: skip
    orders = [answer.order for answer in answers]
    assert orders == sorted(set(orders))
    assert store.batch_answers("B", after=orders[1], limit=2) == answers[2:4]
    found = present(store.batch("B"))
    assert (found.status, found.counts) == ("successful", {"successful": 3, "failed": 2})


def test_a_batch_is_stored_once_under_its_id(store: JobStore) -> None:
    lines = [BatchLine(k, str(k), request(id)) for k, id in enumerate("xy", 1)]
    store.create_batch("B", "solve", "", lines)
    run(store, "x")
    again = store.create_batch("B", "solve", "", lines, Bounds(0, 0))
    assert (again.total, dict(again.counts)) == (2, {"successful": 1, "running": 1})
    with ThreadPoolExecutor(4) as pool:
        batches = list(pool.map(lambda _: store.create_batch("C", "solve", "", lines), range(8)))
    assert {(batch.id, batch.total, sum(batch.counts.values())) for batch in batches} == {
        ("C", 2, 2)
    }
    assert [answer.number for answer in store.batch_answers("C")] == [1]


def test_dismissing_a_batch_leaves_what_another_one_wants(store: JobStore) -> None:
    store.create_batch(
        "A", "solve", "", [BatchLine(k, str(k), request(id)) for k, id in enumerate("xyz", 1)]
    )
    store.create_batch("B", "solve", "", [BatchLine(1, "1", request("z"))])
    assert sorted(store.dismiss_batch("A")) == ["x", "y"]
    assert store.counts() == {"dismissed": 2, "accepted": 1}
    assert [answer.status for answer in store.batch_answers("A")] == ["dismissed"] * 3


def test_a_batch_that_is_stored_after_a_cancelled_one_can_be_cancelled(store: JobStore) -> None:
    for batch in ("A", "B"):
        store.create_batch(batch, "solve", "", [BatchLine(1, "1", request("x"))])
        assert store.dismiss_batch(batch) == ["x"]


def test_pruning_forgets_what_is_old_and_never_what_is_open(store: JobStore) -> None:
    for id in "ab":
        run(store, id, b"x" * 1000)
    store.add_events([("a", Event(1, "status"))])
    store.create_batch("B", "solve", "", [BatchLine(1, "1", request("open"))])
    assert store.prune(0.0, 10**9) == 0
    assert store.prune(time.time() + 60, 10**9) == 2
    assert (store.job("a"), store.events("a")) == (None, [])
    assert store.job("open") is not None
    assert store.batch("B") is not None


def test_an_old_answer_stays_for_a_later_batch_that_has_it(store: JobStore) -> None:
    run(store, "a", b"1")
    batch = store.create_batch("B", "solve", "", [BatchLine(1, "1", request("a"))])
    between = ((present(store.job("a")).finished or 0.0) + batch.created) / 2
    assert store.prune(between, 10**9) == 0
    assert [answer.body for answer in store.batch_answers("B")] == [b"1"]


def test_a_job_that_runs_is_not_claimed_again_by_who_chose_it_as_it_waited(store: JobStore) -> None:
    store.submit([request("a"), request("b")])
    (first,) = store.claim("o", 1)
    taken = store.write_change(lambda session: session.rows("claim", "p", ["a", "b"]))
    assert ids(store.claim("q", 5)) == []
    assert [row["id"] for row in taken] == [{"a": "b", "b": "a"}[first.id]]
    assert present(store.job(first.id)).attempt == 1


@pytest.mark.slow
def test_pruning_by_size_forgets_the_oldest_first(store: JobStore) -> None:
    noise = random.Random(1)
    store.submit([request(f"j{k}") for k in range(120)])
    for job in store.claim("o", 120):
        store.finish(job.id, job.attempt, noise.randbytes(25_000), USAGE)
    forgotten = store.prune(0.0, 1_500_000)
    assert 0 < forgotten < 120
    assert store.job("j0") is None
    assert store.job("j119") is not None


def test_listeners_hear_of_every_change(store: JobStore) -> None:
    heard: list[tuple[str, str]] = []
    store.on_change(lambda change: heard.append((change.id, change.what)))
    store.submit([request("a")])
    (job,) = store.claim("o", 1)
    store.add_events([("a", Event(1, "status"))])
    store.finish("a", job.attempt, b"{}", USAGE)
    own = [
        what for id, what in heard if id
    ]  # without a notification, for a front end that starts to listen
    assert own == ["accepted", "running", "event", "successful"]


def test_what_is_stored_is_there_after_closing(stores: Stores) -> None:
    store = stores()
    run(store, "a", b"\x00\xff")
    store.create_batch("B", "solve", "", [BatchLine(1, '"\\u0000"', request("a"))])
    store.close()
    again = stores()
    assert present(again.job("a")).body == b"\x00\xff"
    assert len(again.batch_answers("B")) == 1


@pytest.mark.slow
def test_threads_claim_and_finish_each_job_once(store: JobStore) -> None:
    total = 120
    store.create_batch(
        "B", "solve", "", [BatchLine(k, str(k), request(f"j{k}")) for k in range(total)]
    )
    finished: list[str] = []

    def work(owner: str) -> None:
        while jobs := store.claim(owner, 3):
            for job in jobs:
                if store.finish(job.id, job.attempt, owner.encode(), USAGE):
                    finished.append(job.id)

    threads = [threading.Thread(target=work, args=(f"o{k}",)) for k in range(6)]
    seen: list[int] = []
    after = 0
    for thread in threads:
        thread.start()
    end = time.monotonic() + 60
    while len(seen) < total and time.monotonic() < end:
        for answer in store.batch_answers("B", after):
            seen.append(answer.number)
            after = answer.order
    for thread in threads:
        thread.join()
    assert Counter(finished) == {f"j{k}": 1 for k in range(total)}
    assert sorted(seen) == list(range(total)), "a reader missed an answer, or had one twice"


def test_what_an_operator_asks_and_a_reader_of_parts(store: JobStore) -> None:
    oldest, size = store.oldest(), store.size()
    assert oldest is None
    assert size > 0
    for _ in range(2):
        store.try_to_write()
    assert store.part("a", 0, 10) == (0, b"")
    (job,) = store.submit([request("a")])
    assert store.oldest() == pytest.approx(job.created)
    run(store, "a", b"0123456789")
    parts = [store.part("a", *place) for place in ((0, 4), (4, 100), (10, 1))]
    assert parts == [(10, b"0123"), (10, b"456789"), (10, b"")]
    assert stored_answer(store.address, "a")[1] == b"0123456789"


def test_batches_are_listed_in_pages_the_newest_first(store: JobStore) -> None:
    assert store.batches() == ([], None)
    for k in range(5):
        client = "alice" if k % 2 else "bob"
        store.create_batch(
            f"b{k}", "solve", client, [BatchLine(1, "1", request(f"a{k}", client=client))]
        )
    store.begin_batch("incomplete", "solve", "alice")
    first, cursor = store.batches(limit=3)
    assert (ids(first), cursor) == (["b4", "b3", "b2"], "b2")
    assert [batch.counts for batch in first] == [{"accepted": 1}] * 3
    assert [ids(store.batches(None, cursor, limit)[0]) for limit in (3, 1)] == [
        ["b1", "b0"],
        ["b1"],
    ]
    assert ids(store.batches("alice")[0]) == ["b3", "b1"]
    for wrong in ("nothing", "b4"):
        with pytest.raises(ValueError, match="cursor"):
            store.batches("alice", wrong)


@pytest.mark.slow
def test_questions_are_stored_together_and_the_first_begin(store: JobStore) -> None:
    asked = [request(name, client=f"of {name}") for name in "cadb"]
    jobs = {job.id: job for job in store.submit_together(asked, "me", 2)}
    assert [jobs[name].status for name in "abcd"] == ["running", "running", "accepted", "accepted"]
    assert {name: present(store.job(name)) for name in jobs} == jobs
    assert ids(store.claim("other", 9)) == ["c", "d"]
    assert store.finish("a", 1, b"{}", USAGE)
    # Whoever asked is who is waited for: nobody else may end it.
    assert not store.dismiss("b", "of a")[1]
    assert store.dismiss("b", "of b")[1]


@pytest.mark.slow
def test_of_questions_that_are_known_none_is_stored_again(store: JobStore) -> None:
    run(store, "a", b"1")
    store.submit([request("b")])
    heard = list[str]()
    store.on_change(lambda change: heard.append(change.id))
    assert ids(store.submit_together([request("a"), request("b")], "me", 2)) == []
    assert ids(store.submit_together([request("c"), request("c")], "me", 2)) == ["c"]
    assert present(store.job("c")).status == "accepted", "b waits already"
    assert heard == ["c"]
    assert (present(store.job("a")).body, present(store.job("b")).status) == (b"1", "accepted")


@pytest.mark.slow
def test_where_the_operator_lets_none_begin_questions_stored_together_wait(store: JobStore) -> None:
    store.drain(True)
    assert [job.status for job in store.submit_together([request("a")], "me", 5)] == ["accepted"]


TERMS = {"kind": "solve"}
SENT = SentBatch("sent", "c", TERMS, b"\x00\xff {}")
SENT_LINES = [
    BatchLine(1, '"a"', request("a", client="c", priority=10)),
    BatchLine(2, "null", problem=b"{}"),
    BatchLine(4, '"b"', request("b", client="c", priority=10)),
]


def test_a_batch_that_is_read_later_is_whole_at_once_and_outlives_its_reader(
    stores: Stores,
) -> None:
    store = stores()
    assert store.send_batch(SENT, 3, Bounds(3, 3))
    batch = present(store.batch("sent"))
    assert (batch.total, batch.status, batch.counts) == (3, "accepted", {"accepted": 3})
    assert store.take_sent(60.0) == SENT
    assert store.take_sent(60.0) is None, "nobody else reads it meanwhile"
    assert store.add_sent_lines("sent", SENT_LINES[:2], 1)
    assert present(store.batch("sent")).counts == {"accepted": 2, "failed": 1}
    store.close()  # and the reader is gone
    store = stores()
    store.free_sent()
    assert store.take_sent(60.0) == SENT
    for lines, left in ((SENT_LINES[:2], 1), (SENT_LINES[2:], 0)):
        assert store.add_sent_lines("sent", lines, left)
    assert store.take_sent(0.0) is None
    for job in store.claim("o", 9):
        assert store.finish(job.id, job.attempt, b"{}", USAGE)
    answers = store.batch_answers("sent")
    assert sorted((one.number, one.status) for one in answers) == [
        (1, "successful"), (2, "failed"), (4, "successful"),
    ]  # fmt: skip
    assert not store.add_sent_lines("sent", SENT_LINES, 0), "it is over"


def test_lines_that_are_still_to_be_read_take_room(store: JobStore) -> None:
    assert store.send_batch(SENT, 3, Bounds(4, 4))
    assert not store.send_batch(replace(SENT, id="more"), 3, Bounds(4, 4))
    assert store.batch("more") is None
    with pytest.raises(TooManyJobs):
        store.submit([request("x", client="c"), request("y", client="c")], Bounds(4, 4))
    store.add_sent_lines("sent", SENT_LINES, 0)
    store.submit([request("x", client="c"), request("y", client="c")], Bounds(4, 4))


def test_what_is_cancelled_before_it_is_read_is_never_computed(store: JobStore) -> None:
    store.send_batch(SENT, 3, Bounds())
    assert store.take_sent(60.0) == SENT
    store.add_sent_lines("sent", SENT_LINES[:1], 2)
    assert store.dismiss_batch("sent") == ["a"]
    assert present(store.batch("sent")).counts == {"dismissed": 3}
    assert store.add_sent_lines("sent", SENT_LINES[1:], 0)
    assert store.claim("o", 9) == []
    answers = sorted(store.batch_answers("sent"), key=lambda one: one.number)
    assert [(one.number, one.identifier) for one in answers] == [(1, '"a"'), (2, "null"), (4, '"b"')]  # fmt: skip
    assert (answers[0].status, answers[2].status) == ("dismissed", "dismissed")


def test_a_batch_of_a_client_that_is_erased_is_not_read(store: JobStore) -> None:
    store.send_batch(SENT, 3, Bounds())
    store.erase_client("c")
    assert store.batch("sent") is None
    assert store.take_sent(0.0) is None
    assert not store.add_sent_lines("sent", SENT_LINES, 0)


@pytest.mark.parametrize("limit", [1, 2, 4, 5, 6])
def test_a_page_says_that_there_is_more_exactly_where_there_is(store: JobStore, limit: int) -> None:
    names = [f"a{k}" for k in range(5)]
    for name in names:
        store.submit([request(name)])
        store.create_batch(f"b {name}", "solve", "", [BatchLine(1, "1", request(name))])
    for page, kept in ((store.jobs, names), (store.batches, [f"b {name}" for name in names])):
        found, cursor = page(limit=limit)
        listed = ids(found)
        assert (cursor is not None) == (limit < len(kept))
        while cursor is not None:
            found, cursor = page(cursor=cursor, limit=limit)
            assert found
            listed += ids(found)
        assert sorted(listed) == kept

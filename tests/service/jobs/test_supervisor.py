"""The outcome of a job for each possible end of its task, and when the service dies."""

from __future__ import annotations

import json
import sqlite3
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from inverse_service import errors
from inverse_service.service.documents import growing
from inverse_service.service.jobs import model, supervisor, tasks, workers
from inverse_service.service.jobs.stores import SqliteStore
from inverse_service.service.jobs.supervisor import HEARTBEAT, TICK, Supervisor, described
from inverse_service.service.jobs.tasks import Call, Outcome, Usage
from inverse_service.statements.stages import Stage
from tests.serving import until
from tests.values import present

DONE = Outcome("done", tasks.Answer(b'{"verdict": "variational"}', "variational"))
SYSTEM = {"coordinates": ["x"], "equations": {"x": "-x"}}


class Scripted:
    """An executor with scripted ends of tasks; with None a task runs until it is canceled."""

    capacity = 2

    def __init__(self, ends: Callable[[Call], Outcome | None]) -> None:
        self.calls: list[Call] = []
        self._ends = ends

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def submit(self, call: Call, report: workers.Report | None = None) -> workers.Running:
        self.calls.append(call)
        running = Hanging(call, report)
        outcome = self._ends(call)
        if outcome is not None:
            running.end(outcome)
        return running


class Hanging(workers.Running):
    """A task that ends only when it is canceled."""

    def cancel(self) -> None:
        super().cancel()
        if not self.outcome.done():
            self.end(Outcome("crash"))


def request(name: str = "") -> model.JobRequest:
    return tasks.request_of("solve", SYSTEM | {"name": name}, model.JobOptions())


def final(store: SqliteStore, id: str) -> model.Job:
    until(lambda: (job := store.job(id)) is not None and not job.is_open)
    return present(store.job(id))


@contextmanager
def supervised(
    store: SqliteStore, executor: Scripted, quick: Scripted | None = None
) -> Iterator[Supervisor]:
    """A running supervisor; it is stopped at the end."""
    supervisor = Supervisor(store, executor, quick=quick)
    supervisor.start()
    try:
        yield supervisor
    finally:
        supervisor.stop()


def run(
    store: SqliteStore, *outcomes: Outcome, understood: Outcome | None = None
) -> tuple[model.Job, dict[str, Any]]:
    """Run the job with these successive ends; return the job and its body."""
    left = list(outcomes)

    def end_of(call: Call) -> Outcome:
        return (
            understood or Outcome("crash")
            if call.task is tasks.understand_job_task
            else left.pop(0)
        )

    with supervised(store, Scripted(end_of)):
        (job,) = store.submit([request()])
        job = final(store, job.id)
    assert left == []
    return job, json.loads(job.body or b"null")


def test_a_result_is_stored_as_the_worker_wrote_it(store: SqliteStore) -> None:
    job, body = run(store, DONE)
    assert (job.status, body) == ("successful", {"verdict": "variational"})


def test_a_new_question_takes_two_commits(
    store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    commits = list[int]()
    write = store.write_change
    heard = list[model.Change]()
    store.on_change(heard.append)
    with supervised(store, Scripted(lambda call: DONE)) as supervisor:
        monkeypatch.setattr(
            store, "write_change", lambda *given: (commits.append(1), write(*given))[1]
        )
        asked = [[request(str(k))] for k in range(3)]
        jobs = [supervisor.submit_together(one, model.Bounds())[one[0].id] for one in asked]
        assert {final(store, job.id).status for job in jobs} == {"successful"}
    assert sum(commits) == 2 * 3, "one commit when the job is accepted and starts, one when it ends"
    ended = [change.job for change in heard if change.what == "successful"]
    assert [job.body for job in ended if job is not None] == [DONE.value.body] * 3


def test_questions_that_come_together_are_stored_and_begun_in_one_commit(
    store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    commits = Counter[int]()  # by thread: the supervisor's own may claim and renew meanwhile
    write = store.write_change
    with supervised(store, Scripted(lambda call: None)) as supervisor:

        def counted(*given: Any) -> Any:
            commits[threading.get_ident()] += 1
            return write(*given)

        monkeypatch.setattr(store, "write_change", counted)
        asked = [request(str(k)) for k in range(5)]
        found = supervisor.submit_together(asked, model.Bounds())
        assert commits[threading.get_ident()] == 1
        assert {job.id for job in asked} == {*found}
        assert supervisor.running >= 2 * Scripted.capacity


def test_as_many_again_are_claimed_as_can_run(store: SqliteStore) -> None:
    """No worker waits for the disk; a third that a worker would not reach stays for others."""
    supervisor = Supervisor(store, Scripted(lambda call: None))
    store.submit([request(str(k)) for k in range(3 * Scripted.capacity)])
    supervisor._claim()
    assert supervisor.running == 2 * Scripted.capacity
    supervisor._claim()
    assert supervisor.running == 2 * Scripted.capacity


@pytest.mark.parametrize("bounds", [
    model.Bounds(total=5), model.Bounds(client=5), model.Bounds(total=9_000), model.Bounds(daily=0.0),
])  # fmt: skip
def test_near_the_bounds_each_question_is_counted_as_it_is_stored(
    store: SqliteStore, bounds: model.Bounds
) -> None:
    store.submit([request("spent")])
    (job,) = store.claim("o", 1)
    assert store.finish(job.id, 1, b"{}", Usage(1.0, 1.0, 1.0))
    with supervised(store, Scripted(lambda call: DONE)) as supervisor:
        assert supervisor.submit_together([request("a")], bounds) == {}
        assert store.job(request("a").id) is None


def test_a_refusal_is_a_failed_job_with_its_places(store: SqliteStore) -> None:
    job, body = run(store, Outcome("refused", places=(errors.Place("No.", "/equations/x", 3),)))
    assert (job.status, body["status"], body["errors"][0]["column"]) == ("failed", 422, 3)


@pytest.mark.parametrize("status", ["deadline", "memory"])
def test_a_limit_makes_a_system_undetermined_and_names_itself(
    store: SqliteStore, status: Any
) -> None:
    job, body = run(store, Outcome(status))
    assert (job.status, body["verdict"]) == ("successful", "undetermined")
    assert {"deadline": "time limit of 60 s", "memory": "memory limit of 4096 MiB"}[status] in body[
        "reason"
    ]


@pytest.mark.parametrize("status", ["crash", "killed"])
def test_a_worker_that_dies_is_tried_again_until_it_died_three_times(
    store: SqliteStore, status: Any
) -> None:
    job, _ = run(store, Outcome(status), Outcome(status), DONE)
    assert (job.status, job.crashes) == ("successful", 2)


@pytest.mark.parametrize(("status", "code"), [("crash", 500), ("killed", 422)])
def test_three_deaths_fail_a_job_with_the_reason(
    store: SqliteStore, status: Any, code: int
) -> None:
    job, body = run(store, *[Outcome(status, detail="a secret of the inside")] * model.MAX_CRASHES)
    assert (job.status, body["status"]) == ("failed", code)
    assert "repeatedly" in body["detail"]
    assert "secret" not in str(body)


SO_FAR: dict[str, Any] = {
    "parts": ["motion", "existence"],
    "seconds": {"motion": 0.5},
    "value": {
        "format": "inverse-service/result/1", "verdict": "not_variational", "provenance": {}, "system": None,
        "question": "L(q, q')",
        "incomplete": [{"part": "any_associated", "reason": "", "more_time": "A longer time limit allows this."}],
    },
}  # fmt: skip
OPEN = [*SO_FAR["value"]["incomplete"], {"part": "existence", "reason": "", "more_time": ""}]
LESS = SO_FAR | {"value": SO_FAR["value"] | {"verdict": "undetermined", "incomplete": OPEN}}


def test_an_undetermined_answer_is_kept_unless_it_took_its_time(store: SqliteStore) -> None:
    answer = tasks.Answer(b'{"verdict": "undetermined"}', "undetermined")
    ended, _ = run(store, Outcome("done", answer, spent=Usage(cpu=59.0)))
    assert ended.expires is not None, "it is computed again where the machine was busy"
    with supervised(store, Scripted(lambda _: Outcome("done", answer, spent=Usage(cpu=1.0)))):
        (job,) = store.submit([request("early")])
        assert final(store, job.id).expires is None


@pytest.mark.parametrize(
    ("ends", "reason", "code"),
    [
        (["deadline"], "The time limit of 60 s was reached.", "time"),
        (["memory"], "The memory limit of 4096 MiB was reached.", "size"),
        (["crash"] * 3, "The worker process died repeatedly.", "stopped"),
        (["killed", "killed", "deadline"], "The time limit of 60 s was reached.", "time"),
    ],
)
def test_however_a_run_ends_its_result_is_what_was_finished(
    store: SqliteStore, ends: list[Any], reason: str, code: str
) -> None:
    """This includes parts of the first attempt if a later one got less far."""
    left = list(ends)

    class Telling(Scripted):
        def submit(self, call: Call, report: workers.Report | None = None) -> workers.Running:
            if report is not None and left:
                report(SO_FAR if len(left) == len(ends) else LESS)
            return super().submit(call, report)

    with supervised(store, Telling(lambda call: Outcome(left.pop(0), spent=Usage(wall=2.0)))):
        (job,) = store.submit([request()])
        job = final(store, job.id)
    body = json.loads(job.body or b"null")
    assert (job.status, body["verdict"], left) == ("successful", "not_variational", [])
    assert body["incomplete"] == [
        {
            "part": "any_associated",
            "reason": reason,
            "reason_code": code,
            "more_time": "A longer time limit allows this.",
        }
    ]
    assert body["provenance"]["seconds"] == {"motion": 0.5, "any_associated": 1.5}


def test_what_was_finished_outlives_the_service(store: SqliteStore) -> None:
    (job,) = store.submit([request()])
    store.claim("a service that was killed", 1)
    event = growing.events(SO_FAR)
    store.add_events(
        [(job.id, model.Event(10_001 + k, "part", each)) for k, each in enumerate(event)]
    )
    with supervised(store, Scripted(lambda call: Outcome("deadline"))):
        body = json.loads(final(store, job.id).body or b"null")
    assert (body["verdict"], body["incomplete"][0]["part"]) == ("not_variational", "any_associated")


def test_a_job_that_is_cancelled_keeps_what_was_finished(store: SqliteStore) -> None:
    reports: list[workers.Report] = []

    class Telling(Scripted):
        def submit(self, call: Call, report: workers.Report | None = None) -> workers.Running:
            assert report is not None
            reports.append(report)
            return super().submit(call, report)

    with supervised(store, Telling(lambda call: None)) as supervisor:
        (job,) = store.submit([request()])
        until(lambda: reports)
        reports[0](SO_FAR)
        store.dismiss(job.id)
        supervisor.cancel(job.id)
    found = present(store.job(job.id))
    body = json.loads(found.body or b"null")
    assert (found.status, body["verdict"]) == ("dismissed", "not_variational")
    assert body["incomplete"][0]["reason"] == "The job was dismissed."


def test_a_job_for_which_no_process_starts_waits_and_is_not_to_blame(store: SqliteStore) -> None:
    job, _ = run(store, *[Outcome("unstarted")] * 10, Outcome("crash"), DONE)
    assert (job.status, job.crashes) == ("successful", 1)


def test_a_job_for_which_no_process_ever_starts_ends(store: SqliteStore) -> None:
    job, body = run(store, *[Outcome("unstarted")] * model.MAX_UNSTARTED)
    assert (job.status, job.crashes, body["status"]) == ("failed", 0, 503)


def test_a_fault_of_ours_is_not_tried_again(store: SqliteStore) -> None:
    job, body = run(store, Outcome("fault", "KeyError", detail="a secret of the inside"))
    assert (job.status, body["status"], body["type"].rpartition(":")[2]) == ("failed", 500, "fault")
    assert "secret" not in str(body)


def test_jobs_that_run_when_the_service_stops_run_later(store: SqliteStore) -> None:
    (job,) = store.submit([request()])
    with supervised(store, Scripted(lambda call: None)) as supervisor:
        until(lambda: supervisor.running)
    found = present(store.job(job.id))
    assert (found.status, found.crashes, found.restarts) == ("accepted", 0, 0)
    assert run(store, DONE)[0].status == "successful"


def test_jobs_of_a_service_that_died_run_again_but_not_for_ever(store: SqliteStore) -> None:
    (job,) = store.submit([request()])
    for _ in range(model.MAX_RESTARTS - 1):
        store.claim("dead", 1)
        store.recover()
    assert present(store.job(job.id)).restarts == model.MAX_RESTARTS - 1
    store.claim("dead", 1)
    with supervised(store, Scripted(lambda call: DONE)):
        ended = final(store, job.id)
    assert ended.status == "failed"
    assert "died" in json.loads(ended.body or b"")["detail"]


def test_the_short_lane_gives_no_answer_to_what_a_limit_stopped(store: SqliteStore) -> None:
    """The parsed system waits for a worker and is not the result of the job."""
    waiting: list[workers.Running] = []

    class Waiting(Scripted):
        def submit(self, call: Call, report: workers.Report | None = None) -> workers.Running:
            running = super().submit(call, report)
            if call.task is tasks.understand_job_task:
                waiting.append(running)
            return running

    def of_worker(call: Call) -> Outcome | None:
        return None if call.task is tasks.understand_job_task else Outcome("deadline")

    quick = Scripted(lambda call: Outcome("done", {"coordinates": ["x"]}))
    with supervised(store, Waiting(of_worker), quick):
        (job,) = store.submit([request()])
        until(lambda: waiting)
        time.sleep(5 * TICK)  # in which the quick pool looks for waiting jobs
        waiting[0].cancel()
        found = final(store, job.id)
    assert [call.task for call in quick.calls] == [], found.priority
    assert (found.status, json.loads(found.body or b"")["verdict"]) == (
        "successful",
        "undetermined",
    )


def test_a_cancelled_job_frees_its_worker(store: SqliteStore) -> None:
    with supervised(store, Scripted(lambda call: None)) as supervisor:
        (job,) = store.submit([request()])
        until(lambda: supervisor.running)
        store.dismiss(job.id)
        supervisor.cancel(job.id)
        until(lambda: supervisor.running == 0)
        assert final(store, job.id).status == "dismissed"


def test_the_options_of_a_job_reach_its_worker(store: SqliteStore) -> None:
    executor = Scripted(lambda call: DONE)
    document, given = model.split_options(
        SYSTEM | {"options": {"time_limit": 3, "memory_limit": 2000, "seed": 5}}
    )
    with supervised(store, executor):
        (job,) = store.submit(
            [tasks.request_of("solve", document, model.read_options(given, model.JobOptions()))]
        )
        final(store, job.id)
    (call,) = executor.calls
    assert (call.deadline, call.memory_limit) == (3.0, 2000)
    assert json.loads(call.arguments[2])["seed"] == 5


def test_reports_become_progress() -> None:
    asked = {"question": "L(t, q, q')"}
    progress = described(Stage("decision", timed=True), {})
    assert progress == asked | {"stage": "decision"}
    for report, told in (
        (Stage("prolongation", order=0), {"stage": "prolongation", "order": 0}),
        (Stage("ansatz", "linear"), {"stage": "ansatz", "family": "linear"}),
        (Stage("check"), {"stage": "check"}),
        (Stage("prolongation", order=2, about="any"), {"stage": "any: prolongation to order 2"}),
        (Stage("decision", timed=True, about="first"), {"stage": "first: decision with time"}),
    ):
        progress = described(report, progress)
        assert progress == asked | told
    assert described({"stage": "steps", "done": 3}, {}) == {"stage": "steps", "done": 3}


class Refusing(SqliteStore):
    """A store that rejects answers with `error` while `away` holds."""

    away = True
    error: Exception = sqlite3.OperationalError("database or disk is full")

    def finish(self, *arguments: Any, **named: Any) -> bool:  # type: ignore[override]
        if self.away and "failed" not in arguments:
            self.refused.set()
            raise self.error
        return super().finish(*arguments, **named)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.refused = threading.Event()


@pytest.fixture
def refusing(tmp_path: Path) -> Iterator[Refusing]:
    store = Refusing(tmp_path / "refusing.sqlite")
    yield store
    store.close()


def test_an_answer_waits_for_a_store_that_is_away(refusing: Refusing) -> None:
    with supervised(refusing, Scripted(lambda call: DONE)):
        (job,) = refusing.submit([request()])
        assert refusing.refused.wait(10)
        assert present(refusing.job(job.id)).status == "running"
        refusing.away = False
        assert final(refusing, job.id).status == "successful"


def test_an_answer_that_waits_when_the_service_stops_is_computed_again(refusing: Refusing) -> None:
    with supervised(refusing, Scripted(lambda call: DONE)):
        (job,) = refusing.submit([request()])
        assert refusing.refused.wait(10)
    refusing.away = False
    with supervised(refusing, Scripted(lambda call: DONE)):
        assert final(refusing, job.id).status == "successful"


def test_an_answer_lost_by_a_fault_ends_its_job(refusing: Refusing) -> None:
    refusing.error = sqlite3.DataError("string or blob too big")
    with supervised(refusing, Scripted(lambda call: DONE)):
        (job,) = refusing.submit([request()])
        ended = final(refusing, job.id)
    assert ended.status == "failed"
    assert b"could not be stored" in (ended.body or b"")


def test_a_short_question_is_answered_while_the_workers_have_long_ones(store: SqliteStore) -> None:
    class Busy(Hanging):
        """A task that a process works on."""

        @property
        def has_begun(self) -> bool:
            return self.call.client == "alice"

    class Long(Scripted):
        def submit(self, call: Call, report: workers.Report | None = None) -> workers.Running:
            return Busy(call, report)

    quick = Scripted(lambda call: DONE if "short" in call.arguments[1] else Outcome("deadline"))
    with supervised(store, Long(lambda call: None), quick):
        for k in range(10):
            store.submit([replace(request(f"long {k}"), client="alice")])
        (long,) = store.submit([replace(request("another long"), client="bob")])
        (short,) = store.submit([replace(request("short"), client="carol")])
        assert final(store, short.id).status == "successful"
        time.sleep(0.3)
    # Each is tried once for a moment; a client with a running job waits for its turn.
    assert sorted(call.client for call in quick.calls) == ["bob", "carol"]
    assert {call.deadline for call in quick.calls} == {0.5}
    found = present(store.job(long.id))
    assert (found.status, found.attempt) == ("accepted", 1)


def test_of_two_ends_of_a_run_the_first_counts(
    store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The quick process answers; the worker, stopped then, says that its task died."""
    ended, finish = list[str](), supervisor.finish

    def noted(*given: Any) -> str:
        ended.append(given[2].status)
        return finish(*given)

    class Waits(Hanging):
        """A task that no process has begun."""

        @property
        def has_begun(self) -> bool:
            return False

    class Late(Scripted):
        def submit(self, call: Call, report: workers.Report | None = None) -> workers.Running:
            return Waits(call, report)

    monkeypatch.setattr(supervisor, "finish", noted)
    with supervised(store, Late(lambda call: None), Scripted(lambda call: DONE)):
        (job,) = store.submit([request()])
        found = final(store, job.id)
    assert (found.status, found.attempt, ended) == ("successful", 1, ["done"])


@pytest.mark.parametrize(("silent", "is_taken"), [(0.0, False), (20.0, False), (60.0, True)])
def test_a_front_end_loses_its_jobs_after_many_missed_heartbeats_and_not_after_a_pause(
    store: SqliteStore, monkeypatch: pytest.MonkeyPatch, silent: float, is_taken: bool
) -> None:
    monkeypatch.setattr(SqliteStore, "exclusive", False)
    (job,) = store.submit([request()])
    store.claim("another front end", 1)
    store.write_change(
        lambda s: s.connection.execute("UPDATE jobs SET heartbeat = heartbeat - ?", (silent,))
    )
    with supervised(
        store, Scripted(lambda call: None)
    ):  # it looks as it starts, and at each heartbeat
        assert present(store.job(job.id)).restarts == int(is_taken)
    assert 10 * HEARTBEAT < 20.0


def test_what_was_dismissed_elsewhere_stops_without_a_heartbeat(
    store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "HEARTBEAT", 3600.0)
    (job,) = store.submit([request()])
    with supervised(store, Scripted(lambda call: None)) as running:
        until(lambda: running.running == 1)
        store.dismiss(job.id)  # nobody calls `cancel` here
        until(lambda: running.running == 0)
    assert present(store.job(job.id)).status == "dismissed"

"""Takes accepted jobs from the store, has them run, stores what came of them.

One thread claims and keeps watch, a few store answers (so that a worker never waits for the disk),
and the pool has its own. The store is the truth: what this process forgets when it dies is claimed
again. `EventLog` has the progress of running jobs, `finish` says what becomes of a job when its
task ended: stored, tried again, or released.
"""

import contextlib
import functools
import json
import logging
import math
import sqlite3
import threading
import time
import uuid
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

from inverse_service import errors
from inverse_service.service.documents import answers, growing
from inverse_service.service.jobs import model, monitoring, stores, tasks, workers
from inverse_service.service.jobs.tasks import LIMITS, Call, Outcome, Usage
from inverse_service.statements.stages import ANSATZ, DECISION, METHOD, Stage

log = logging.getLogger(__name__)
# Progress of running jobs: the latest for whoever asks, all of it for the store, a few times a
# second.
PART = "part"
KEPT = ("question", "so_far", "seconds")
QUESTIONS = {False: "L(q, q')", True: "L(t, q, q')"}
# Numbers of a later attempt are greater than those of any earlier one.
NUMBERS_PER_ATTEMPT = 10_000
MOST_EVENTS = 1_000
# Longer questions wait for their turn like all others, s.
SHORT = 0.5
# Jobs that are claimed for clients with nothing running although no worker is free.
AHEAD = 32
ENDED = ("done", "refused")
FINISHERS = 4
TICK = 0.1
# How often the events of jobs are written, s.
WRITE_EVENTS = 0.3
# So long, at most, a job runs on that another front end, or an operator, dismissed; s.
HEARTBEAT = 1.0
LEASE = 30.0
POLL = 0.5
# Open jobs for which there must be room, so that one count of them serves all questions of a
# heartbeat, also where another front end accepts as many meanwhile.
ENOUGH = 10_000
# A store that does not answer keeps no service from its end; what it does not hear is run again, s.
STOP_PATIENCE = 1.0
# The store cannot be reached now and may be back: disk full or locked, server gone.
AWAY = (sqlite3.OperationalError, model.StoreUnavailable, OSError)
# What is undetermined after this part of its time and more may be so for lack of time.
CLOCK_SHARE = 0.5


def described(report: Any, before: Mapping[str, Any]) -> dict[str, Any]:
    """The progress after a report; parts of a result (see `growing`) are merged into `so_far`."""
    if isinstance(report, Mapping) and "parts" in report:
        return {**before, **growing.grown(before, report)}
    if isinstance(report, Mapping):
        return {**before, **{str(key): value for key, value in report.items()}}
    kept = {key: before[key] for key in KEPT if key in before}
    if not isinstance(report, Stage):
        return {**kept, "stage": str(report)}
    if report.about:
        return {**kept, "stage": report.text}
    if report.step == DECISION:
        return {**kept, "stage": report.step, "question": QUESTIONS[report.timed]}
    if report.step in (ANSATZ, METHOD):
        return {**kept, "stage": report.step, "family": report.name}
    if report.order is not None:
        return {**kept, "stage": report.step, "order": report.order}
    return {**kept, "stage": report.text}


def event_number(attempt: int, count: int) -> int:
    """The number of an event by its attempt and its place among the events of that attempt."""
    return attempt * NUMBERS_PER_ATTEMPT + count


def last_events(store: stores.JobStore, job: model.Job) -> list[model.Event]:
    """What ends the stream of a final job: the greatest number of its attempt has its status.

    Before it the parts of an answer that was there before any part was sent; they are made of the
    answer.
    """
    began, status = event_number(job.attempt, 0), {"status": job.status}
    parts: list[dict[str, Any]] = []
    is_solved = (job.kind, job.status) == ("solve", "successful")
    if is_solved and all(
        event.kind != PART for event in store.events(job.id, began, 2 * MOST_EVENTS)
    ):
        body = job.body or store.part(job.id, 0, model.LARGEST_BODY)[1]
        parts = growing.events(growing.at_once(json.loads(body))) if body else []
    ending = [(PART, part) for part in parts] + [("status", status)]
    number = event_number(job.attempt + 1, -len(ending))
    return [model.Event(number + k, kind, data) for k, (kind, data) in enumerate(ending)]


@dataclass(slots=True)
class _Run:
    """What is known of a job that runs here: its attempt and the events of that so far, what an
    earlier attempt finished, events not written.
    """

    attempt: int = 0
    count: int = 0
    earlier: dict[str, Any] = field(default_factory=dict)
    latest: dict[str, Any] = field(default_factory=lambda: {"elapsed": 0.0})
    pending: list[model.Event] = field(default_factory=list)

    @property
    def has_told(self) -> bool:
        """Whether more is known of this attempt than that it has begun."""
        return self.count > 1

    @property
    def is_written(self) -> bool:
        """Whether some of this attempt is in the store."""
        return self.count > len(self.pending)

    @property
    def furthest(self) -> dict[str, Any] | None:
        """What is finished, as `so_far` and `seconds`: of this attempt or, where that came less
        far, of the earlier.
        """
        tries = (self.latest, self.earlier)
        found = [
            {key: each[key] for key in ("so_far", "seconds")}
            for each in tries
            if each.get("so_far")
        ]
        return min(found, key=lambda each: len(each["so_far"]["incomplete"]), default=None)


class EventLog:
    """Collects events of jobs and writes them together; safe to use from any thread."""

    def __init__(self, store: stores.JobStore) -> None:
        self._store = store
        self._lock = threading.Lock()
        self._runs: dict[str, _Run] = {}

    def begin(self, job: model.Job) -> None:
        """The first event of an attempt; what an earlier one finished before it died is kept until
        this one has it.
        """
        stored = self._stored(job)
        with self._lock:
            before = self._runs.get(job.id, _Run())
            run = _Run(job.attempt, earlier=before.furthest or stored, pending=before.pending)
            self._runs[job.id] = run
            self._append(job, run, "status", {"status": "running"})

    def _stored(self, job: model.Job) -> dict[str, Any]:
        so_far: dict[str, Any] = {}
        with contextlib.suppress(*AWAY):  # the job is claimed, and begins in any case
            if job.restarts and job.priority < model.BULK:
                for event in (one for one in self._store.events(job.id) if one.kind == PART):
                    so_far |= event.data["value"]
        return {"so_far": so_far, "seconds": {}} if so_far else {}

    def report(self, job: model.Job, began: float, value: Any) -> None:
        """Something that the worker says about a job."""
        with self._lock:
            if (run := self._runs.get(job.id)) is None:
                return
            is_part = isinstance(value, Mapping) and "parts" in value
            if (
                is_part and "format" in value["value"]
            ):  # another run of the same attempt begins from nothing
                run.earlier = run.furthest or {}
                run.latest.pop("so_far", None)
            progress = run.latest = described(value, run.latest)
            progress["elapsed"] = round(time.monotonic() - began, 3)
            if is_part:
                for event in growing.events(value):
                    self._append(job, run, PART, event)
            else:
                shown = {
                    key: value
                    for key, value in progress.items()
                    if key not in ("so_far", "seconds")
                }
                self._append(job, run, "progress", shown)

    def end(self, job: model.Job) -> None:
        """Nothing more comes of this job here; of an attempt that is over, nothing changes."""
        with self._lock:
            run = self._runs.get(job.id)
            if run is not None and run.attempt == job.attempt:
                del self._runs[job.id]

    def latest(self, id: str) -> Mapping[str, Any] | None:
        """Progress of a job that runs here."""
        with self._lock:
            run = self._runs.get(id)
            return None if run is None else {**run.latest, **(run.furthest or {})}

    def so_far(self, id: str) -> dict[str, Any] | None:
        """What is finished of the result of a job that runs here, see `_Run.furthest`."""
        with self._lock:
            return self._runs[id].furthest if id in self._runs else None

    def flush(self, id: str | None = None, is_answered: bool = False) -> None:
        """Write what was collected, of one job or of all; of a job that has only begun there is
        nothing to tell.

        Of one that `is_answered` the rest of what is written already, if any: an answer tells all
        else.
        """
        with self._lock:
            runs = (
                self._runs.items()
                if id is None
                else [(id, self._runs[id])]
                if id in self._runs
                else []
            )
            told = [
                (k, run) for k, run in runs if (run.is_written if is_answered else run.has_told)
            ]
            due = [(k, event) for k, run in told for event in run.pending]
        if due:
            self._store.add_events(due)
            written = {(k, event.number) for k, event in due}
            with self._lock:
                for k, run in self._runs.items():
                    run.pending = [
                        event for event in run.pending if (k, event.number) not in written
                    ]

    def _append(self, job: model.Job, run: _Run, kind: str, data: Mapping[str, Any]) -> None:
        # Nobody watches a single line of a batch.
        if job.priority >= model.BULK:
            return
        run.count += 1
        if run.count < MOST_EVENTS or kind == PART:
            number = event_number(run.attempt, run.count)
            run.pending.append(model.Event(number, kind, dict(data)))


@dataclass(slots=True, eq=False)
class _Claimed:
    """A job that is run here; `is_tried`: by the quick processes too; `is_ended`: its outcome is
    known, and counts.
    """

    job: model.Job
    task: workers.Running
    is_tried: bool = False
    is_ended: bool = False


class Supervisor:
    """Runs the jobs of one store on one executor; `quick` has processes for short questions of who
    has none running.
    """

    def __init__(
        self,
        store: stores.JobStore,
        executor: workers.Executor,
        client_running: int | None = None,
        quick: workers.Executor | None = None,
    ) -> None:
        self.events = EventLog(store)
        self._store, self._executor = store, executor
        self._client_running = client_running or model.NO_BOUND
        self._quick = quick
        self._owner = uuid.uuid4().hex
        self._running: dict[tuple[str, int], _Claimed] = {}
        self._lock = threading.Lock()
        self._wake = threading.Event()
        # Whether some may wait that were not claimed for lack of room: then the end of a run is a
        # reason to look.
        self._more = True
        self._stopping = threading.Event()
        self._finishers = ThreadPoolExecutor(FINISHERS, "finishing")
        self._thread = threading.Thread(target=self._work_loop, name="jobs", daemon=True)
        self._beaten = time.monotonic()
        # At the last heartbeat: open jobs by client, whether the operator lets none begin; and how
        # many were asked since.
        self._open: Mapping[str, int] | None = None
        self._is_drained = False
        self._asked_since = 0

    def start(self) -> None:
        """Take back what a dead service left behind, then work."""
        self._take_back(0.0 if self._store.exclusive else LEASE)
        self._look()
        self._store.on_change(self._changed)
        self._thread.start()
        self._wake.set()

    def submit_together(
        self, requests: Sequence[model.JobRequest], bounds: model.Bounds
    ) -> dict[str, model.Job]:
        """Store in one commit, and begin, those of these questions that are new; by id.

        Others are left to the store's `submit_one`, and so are all where open jobs come near their
        bounds, and those of a client that has used its quota.
        """
        if self._open is None:
            return {}
        self._asked_since += len(requests)
        clients = {request.client for request in requests}
        if bounds.room(self._open, clients) - self._asked_since < ENOUGH:
            return {}
        if bounds.daily < model.NO_BOUND:
            over = self._store.over_quota([*clients], bounds.daily)
            requests = [request for request in requests if request.client not in over]
        is_bounded = self._client_running < model.NO_BOUND  # then a claim counts what runs
        begin = 0 if is_bounded or self._stopping.is_set() else max(0, self._free())
        found = self._store.submit_together(requests, self._owner, begin) if requests else []
        for job in found:
            if job.status == "running":
                self._start(job)
        return {job.id: job for job in found}

    def cancel(self, id: str) -> None:
        """Stop the work on a job at once, if it runs here; the caller updates the store."""
        with self._lock:
            found = [claimed for claimed in self._running.values() if claimed.job.id == id]
        for claimed in found:
            claimed.task.cancel()

    @property
    def running(self) -> int:
        """Jobs taken by this process."""
        return len(self._running)

    def is_working(self) -> bool:
        """Whether jobs are claimed."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """Cancel what runs and give it back to the store; returns when that is stored."""
        self._stopping.set()
        self._wake.set()
        if not self._thread.is_alive():
            return
        self._thread.join(STOP_PATIENCE)
        end = time.monotonic() + STOP_PATIENCE
        while self._running and time.monotonic() < end:
            for claimed in list(self._running.values()):
                claimed.task.cancel()
            time.sleep(0.005)
        closing = threading.Thread(target=self._finishers.shutdown, daemon=True)
        closing.start()  # who closes the store next must not do so under a thread that uses it
        closing.join(max(0.0, end - time.monotonic()))
        self.events.flush()

    def _work_loop(self) -> None:
        """Claim jobs when woken; write events, try short questions and keep the claims now and
        then.
        """
        written = self._beaten
        while not self._stopping.is_set():
            # Where more run than there are workers, one that waits may be short; else there is less
            # to look for.
            is_woken = self._wake.wait(
                TICK if len(self._running) > self._executor.capacity else WRITE_EVENTS
            )
            self._wake.clear()
            now = time.monotonic()
            try:
                if is_woken:
                    self._claim()
                if now - written >= WRITE_EVENTS:
                    written = now
                    self.events.flush()
                    self._claim_ahead()
                if self._quick is not None:
                    self._try_short(self._quick)
                if now - self._beaten > HEARTBEAT:
                    self._beat()
            except (sqlite3.Error, errors.InverseServiceError, OSError):
                log.exception("the store does not answer; trying again")
                self._stopping.wait(POLL)
                self._wake.set()

    def _free(self) -> int:
        """How many jobs may be claimed: as many as run, and as many again, so that no worker waits
        for the disk.
        """
        return 2 * self._executor.capacity - len(self._running)

    @property
    def _together(self) -> int:
        """How many are claimed in one commit, at least: no worker waits as long as fewer have
        ended.
        """
        return min(self._executor.capacity, AHEAD)

    def _claim(self) -> None:
        self._more = True
        while not self._stopping.is_set() and (free := self._free()) >= self._together:
            self._more = False  # who accepts one from now on sets it again
            if not self._store.is_waiting():
                return
            self._more = True
            if self._begin(free, self._client_running) < free:
                return

    def _claim_ahead(self) -> None:
        """Where `_claim` waits for a run to end, claim for clients with nothing running: they may
        ask short ones.
        """
        free = self._free()
        if self._more and -AHEAD < free < self._together and self._quick is not None:
            self._begin(free + AHEAD, 1)

    def _begin(self, limit: int, most: int) -> int:
        """Claim so many jobs, `most` of one client, and run them; how many there were."""
        jobs = self._store.claim(self._owner, limit, most)
        for job in jobs:
            self._start(job)
        return len(jobs)

    def _start(self, job: model.Job) -> None:
        if job.restarts >= model.MAX_RESTARTS:
            fail(
                self._store,
                job,
                f"The service died {job.restarts} times while this job ran; it is not tried again.",
            )
            return
        options = model.stored_options(job.options)
        arguments = (job.kind, job.document, job.options)
        call = Call(
            tasks.job_task,
            arguments,
            options.time_limit,
            options.memory_limit,
            "long",
            job.priority,
            job.client,
        )
        self.events.begin(job)
        began = time.monotonic()
        with self._lock:
            task = self._executor.submit(call, lambda value: self.events.report(job, began, value))
            claimed = self._running[job.id, job.attempt] = _Claimed(job, task)
        task.outcome.add_done_callback(lambda done: self._end(claimed, done.result()))

    def _end(self, claimed: _Claimed, outcome: Outcome) -> bool:
        """Store it; a system that a limit stopped is understood first, by the workers like all
        else.

        False where an outcome of this run came before.
        """
        job = claimed.job
        with self._lock:
            if claimed.is_ended:
                return False
            claimed.is_ended = True
        is_over = not is_undetermined(job, outcome) or self._stopping.is_set()
        if is_over or self.events.so_far(job.id) is not None:
            self._finishers.submit(self._conclude, job, outcome)
            return True
        deadline = answers.UNDERSTAND_DEADLINE
        call = Call(
            tasks.understand_job_task,
            (job.document,),
            deadline,
            priority=workers.FIRST,
            client=job.client,
        )
        with self._lock:
            task = claimed.task = self._executor.submit(call)
        task.outcome.add_done_callback(
            lambda done: self._finishers.submit(
                self._conclude, job, answers.with_understood(outcome, done.result())
            )
        )
        return True

    def _try_short(self, quick: workers.Executor) -> None:
        """Try jobs that wait for a worker for a moment on the quick processes, each once; others go
        on waiting.
        """
        with self._lock:
            running = list(self._running.values())
        busy = {claimed.job.client for claimed in running if claimed.task.has_begun}
        for claimed in running:
            # How the system of a stopped job is understood is no answer.
            is_first = not (claimed.is_tried or claimed.is_ended)
            if (
                is_first
                and claimed.job.priority == model.INTERACTIVE
                and claimed.job.client not in busy
            ):
                claimed.is_tried, call = True, claimed.task.call
                tried = quick.submit(
                    replace(call, deadline=min(SHORT, call.deadline)), claimed.task.report
                )
                tried.outcome.add_done_callback(functools.partial(self._win, claimed))

    def _win(self, claimed: _Claimed, tried: Future[Outcome]) -> None:
        """A job that waited for a worker ended in the quick processes: it waits no more."""
        if tried.result().status in ENDED and self._end(claimed, tried.result()):
            claimed.task.cancel()

    def _conclude(self, job: model.Job, outcome: Outcome) -> None:
        """Store an answer however long the store stays away; where the service stops first, the job
        runs again.
        """
        told = False
        try:
            while True:
                try:
                    self._finish(job, outcome)
                    break
                except AWAY:
                    if not told:
                        log.exception("an answer waits for the store", extra={"job": job.id})
                    told = True
                if self._stopping.wait(POLL):
                    break
        except Exception:
            log.exception("an answer could not be stored", extra={"job": job.id})
            with contextlib.suppress(
                Exception
            ):  # claimed again after a restart; nobody else would end this job
                fail(self._store, job, "The answer was computed and could not be stored.")
        finally:
            with self._lock:
                self._running.pop((job.id, job.attempt), None)
            try:
                if self._more:
                    self._claim()
            except Exception:  # the thread that keeps watch tries again, and says what is wrong
                self._wake.set()

    def _finish(self, job: model.Job, outcome: Outcome) -> None:
        self.events.flush(job.id, outcome.status == "done")
        label = finish(
            self._store,
            job,
            outcome,
            None if outcome.status == "done" else self.events.so_far(job.id),
        )
        if label != "again":
            self.events.end(job)
        if outcome.status in ("crash", "killed"):
            monitoring.DEATHS.labels(outcome.status).inc()
        spent = outcome.spent
        monitoring.note_run(job.kind, label, spent.wall, spent.cpu, spent.memory)
        about = {
            "job": job.id,
            "client": job.client,
            "attempt": job.attempt,
            "kind": job.kind,
            "outcome": label,
        }
        figures = {
            "wall": round(spent.wall, 4),
            "cpu": round(spent.cpu, 4),
            "memory": round(spent.memory, 1),
        }
        monitoring.say(log, "job ended", about | figures)

    def _beat(self) -> None:
        """Keep the claims, stop what another front end dismissed or took over, take back those of
        one that is gone.
        """
        self._beaten = time.monotonic()
        self._look()
        self._wake.set()  # an operator's command may have let jobs begin
        with self._lock:
            running = dict(self._running)
        lost = set(self._store.heartbeat(self._owner, list(running))) if running else set()
        runs = Counter(id for id, _ in running)
        for (id, _), claimed in running.items():
            if id in lost and runs[id] == 1:  # with two, the later run may be ours
                claimed.task.cancel()
        if not self._store.exclusive:
            self._take_back(LEASE)

    def _look(self) -> None:
        """What the store says now of open jobs, and of the operator's wish."""
        self._open, self._asked_since = self._store.open_by_client(), 0
        self._is_drained = self._store.is_drained()

    def _changed(self, change: model.Change) -> None:
        """Claim what waits now; one question that had no room as it was accepted, at the end of a
        run. See at once whether what was dismissed elsewhere still is to run.
        """
        if change.what == "accepted":
            self._more = True
            if not self._is_drained and (not change.id or self._free() >= self._together):
                self._wake.set()
        elif change.what == "dismissed":
            with self._lock:
                runs_here = any(id == change.id for id, _ in self._running)
            if runs_here:
                self._beaten = -math.inf
                self._wake.set()

    def _take_back(self, lease: float) -> None:
        for job in self._store.recover(lease):
            log.warning("job runs again", extra={"job": job.id, "restarts": job.restarts})


def is_undetermined(job: model.Job, outcome: Outcome) -> bool:
    """Whether a limit stopped the job and this is its answer."""
    return outcome.status in LIMITS and tasks.KINDS[job.kind].limit_is_answer


def finish(
    store: stores.JobStore,
    job: model.Job,
    outcome: Outcome,
    so_far: Mapping[str, Any] | None = None,
) -> str:
    """Store what came of the job; the label it is counted under ("again": it runs once more).

    A job that was ended has as its result what is finished of it, `so_far`; where that is not
    known, and a limit stopped it, its value is how the system was understood.
    """
    usage, options = outcome.spent, model.stored_options(job.options)
    if outcome.status == "cancelled":
        # Dismissed: it is so in the store already. Otherwise the service stops, and the job runs
        # later.
        left = None if so_far is None else tasks.as_body(undetermined(outcome, options, so_far))
        store.release(job.id, job.attempt, usage=usage, left=left)
        return "cancelled"
    if outcome.status in ("crash", "killed") and job.crashes + 1 < model.MAX_CRASHES:
        log.warning("worker died: %s", outcome.detail, extra={"job": job.id})
        store.release_crashed(job.id, job.attempt, usage=usage)
        return "again"
    if outcome.status == "unstarted" and job.attempt < model.MAX_UNSTARTED:
        store.release(job.id, job.attempt, usage=usage)
        return "again"
    if outcome.status == "done":
        label, fault = outcome.value.label, outcome.value.fault
        if fault:
            log.error("no verdict for a fault of the program (%s)", fault, extra={"job": job.id})
        by_clock = label == "undetermined" and usage.cpu > CLOCK_SHARE * options.time_limit
        store.finish(
            job.id,
            job.attempt,
            outcome.value.body,
            usage,
            model.TRANSIENT if by_clock or fault else None,
        )
        return str(label)
    if outcome.status in ("crash", "fault", "unstarted"):
        log.error("task ended with %s: %s", outcome.status, outcome.detail, extra={"job": job.id})
    if is_undetermined(job, outcome) or (
        so_far is not None and outcome.status in ("crash", "killed")
    ):
        result = undetermined(outcome, options, so_far)
        store.finish(job.id, job.attempt, tasks.as_body(result), usage, model.TRANSIENT)
        return tasks.label_of(result)
    problem = answers.of_outcome(outcome, options.time_limit, options.memory_limit)
    kept = None if outcome.status == "refused" else model.TRANSIENT
    store.finish(job.id, job.attempt, answers.as_bytes(problem), usage, kept, "failed")
    return outcome.status


def fail(store: stores.JobStore, job: model.Job, detail: str) -> None:
    """End a job by a fault of ours."""
    problem = answers.as_bytes(answers.problem_document(500, "fault", detail))
    store.finish(job.id, job.attempt, problem, Usage(), model.TRANSIENT, "failed")


def undetermined(
    outcome: Outcome, options: model.JobOptions, so_far: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The result of a solve job that was ended."""
    asked = tasks.solve_options(options), options.memory_limit
    try:
        return answers.result_document(outcome, *asked, so_far)
    except errors.InverseServiceError:
        return answers.result_document(replace(outcome, value=None), *asked)

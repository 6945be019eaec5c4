"""Takes accepted jobs from the store, has them run, stores what came of them.

Threads: one claims, a few store answers (so that a worker never waits for the disk), the pool has its
own. The store is the truth; whatever this process forgets when it dies, is claimed again.
"""

from __future__ import annotations

import logging
import queue
import sqlite3
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from inverse_service.errors import InverseServiceError
from inverse_service.service.documents.answers import UNDERSTAND_DEADLINE, with_understood
from inverse_service.service.jobs import finishing, tasks
from inverse_service.service.jobs.event_log import EventLog
from inverse_service.service.jobs.metrics import Counters
from inverse_service.service.jobs.model import (
    INTERACTIVE,
    MAX_RESTARTS,
    NO_BOUND,
    Job,
    StoreUnavailable,
    stored_options,
)
from inverse_service.service.jobs.outcome import Call, Outcome
from inverse_service.service.jobs.store import JobStore
from inverse_service.service.jobs.workers import FIRST, Executor, Report, Running

# Longer questions wait for their turn like all others, s.
SHORT = 0.5
# Jobs that are claimed for clients with nothing running although no worker is free.
AHEAD = 32
ENDED = ("done", "refused")


@dataclass(slots=True)
class ShortLane:
    """Tries jobs that wait for a worker for a moment on processes of another pool; each once.

    A job that ends there is done, and its place among the others is given up; any other goes on waiting.
    """

    executor: Executor
    _tried: set[tuple[str, int]] = field(default_factory=set)

    def look(self, claimed: Iterable[tuple[Job, Running]], end: Callable[[Job, Outcome], None]) -> None:
        """Try what waits; `end` is called with each job that ended, from another thread."""
        claimed = list(claimed)
        busy = {job.client for job, task in claimed if task.has_begun}
        self._tried &= {(job.id, job.attempt) for job, _ in claimed}
        for job, task in claimed:
            key = (job.id, job.attempt)
            if task.call.task is not tasks.job_task:  # how the system of a stopped job is understood is no answer
                continue
            if job.priority == INTERACTIVE and job.client not in busy and key not in self._tried:
                self._tried.add(key)
                self._try(job, task, end)

    def _try(self, job: Job, task: Running, end: Callable[[Job, Outcome], None]) -> None:
        call = replace(task.call, deadline=min(SHORT, task.call.deadline))
        running = self.executor.submit(call, task.report)
        running.outcome.add_done_callback(lambda done: _ended(job, done.result(), end))


def _ended(job: Job, outcome: Outcome, end: Callable[[Job, Outcome], None]) -> None:
    if outcome.status in ENDED:
        end(job, outcome)


log = logging.getLogger(__name__)
DEATHS = ("inverse_service_worker_deaths_total", "Workers that died.")
FINISHERS = 4
TICK = 0.1
HEARTBEAT = 5.0
LEASE = 30.0
POLL = 0.5
# A store that does not answer keeps no service from its end; what it does not hear is run again, s.
STOP_PATIENCE = 1.0
# The store cannot be reached now and may be back: disk full or locked, server gone.
AWAY = (sqlite3.OperationalError, StoreUnavailable, OSError)


@dataclass(frozen=True, slots=True)
class _Ended:
    job: Job
    outcome: Outcome


class Supervisor:
    """Runs the jobs of one store on one executor; `quick` has processes for short questions of who has none running."""

    def __init__(
        self,
        store: JobStore,
        executor: Executor,
        counters: Counters | None = None,
        client_running: int | None = None,
        quick: Executor | None = None,
    ) -> None:
        self.counters = counters or Counters()
        for how in ("crash", "killed"):  # an alert on what grows needs a beginning
            self.counters.add(*DEATHS, 0.0, how=how)
        self.events = EventLog(store)
        self._store, self._executor = store, executor
        self._client_running = client_running or NO_BOUND
        self._short = None if quick is None else ShortLane(quick)
        self._owner = uuid.uuid4().hex
        self._running: dict[tuple[str, int], tuple[Job, Running]] = {}
        self._won: set[tuple[str, int]] = set()
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._ended: queue.SimpleQueue[_Ended | None] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._beaten = time.monotonic()
        self._doubtful = False

    def start(self) -> None:
        """Take back what a dead service left behind, then work."""
        self._take_back(0.0 if self._store.exclusive else LEASE)
        self._store.on_change(self._changed)
        work = [self._claim_loop, self._tick_loop, *[self._finish_loop] * FINISHERS]
        self._threads = [threading.Thread(target=w, name=f"jobs-{k}", daemon=True) for k, w in enumerate(work)]
        for thread in self._threads:
            thread.start()
        self._wake.set()

    def cancel(self, id: str) -> None:
        """Stop the work on a job at once, if it runs here; the caller updates the store."""
        with self._lock:
            found = [task for (job, _), (_, task) in self._running.items() if job == id]
        for task in found:
            task.cancel()

    @property
    def running(self) -> int:
        """Jobs taken by this process."""
        return len(self._running)

    def is_working(self) -> bool:
        """Whether all threads live."""
        return bool(self._threads) and all(thread.is_alive() for thread in self._threads)

    def stop(self) -> None:
        """Cancel what runs and give it back to the store; returns when that is stored."""
        self._stopping.set()
        self._wake.set()
        if not self._threads:
            return
        self._threads[0].join(STOP_PATIENCE)
        with self._lock:
            running = [found[1] for found in self._running.values()]
        for task in running:
            task.cancel()
        end = time.monotonic() + STOP_PATIENCE
        while self._running and time.monotonic() < end:
            time.sleep(0.005)
        for _ in range(FINISHERS):
            self._ended.put(None)
        for thread in self._threads[1:]:
            thread.join(max(0.0, end - time.monotonic()))
        self.events.flush()

    def _claim_loop(self) -> None:
        while not self._stopping.is_set():
            self._wake.wait(None if self._store.exclusive else POLL)
            self._wake.clear()
            try:
                self._claim()
            except (sqlite3.Error, InverseServiceError, OSError):
                log.exception("jobs cannot be claimed; trying again")
                self._stopping.wait(POLL)
                self._wake.set()

    def _claim(self) -> None:
        """Claim as many as run, and as many again, so that no worker waits for the disk."""
        while not self._stopping.is_set():
            free, most = 2 * self._executor.capacity - len(self._running), self._client_running
            if free <= 0 and self._short is not None:
                free, most = free + AHEAD, 1
            jobs = self._store.claim(self._owner, free, most) if free > 0 else []
            if not jobs:
                return
            for job in jobs:
                self._start(job)

    def _start(self, job: Job) -> None:
        if job.restarts >= MAX_RESTARTS:
            finishing.give_up(self._store, job)
            return
        options = stored_options(job.options)
        arguments = (job.kind, job.document, job.options)
        call = Call(tasks.job_task, arguments, options.time_limit, options.memory_limit, True, job.priority, job.client)
        self.events.begin(job)
        began = time.monotonic()
        self._run(job, call, self._end, lambda value: self.events.report(job, began, value))

    def _run(self, job: Job, call: Call, end: Callable[[Job, Outcome], None], report: Report | None = None) -> None:
        with self._lock:
            task = self._executor.submit(call, report)
            self._running[job.id, job.attempt] = (job, task)
        task.outcome.add_done_callback(lambda done: end(job, done.result()))

    def _end(self, job: Job, outcome: Outcome) -> None:
        """To the finishers; a system that a limit stopped is understood first, by the workers like all else."""
        if (job.id, job.attempt) in self._won:
            return
        is_known = self.events.so_far(job.id) is not None
        if is_known or not finishing.is_undetermined(job, outcome) or self._stopping.is_set():
            self._ended.put(_Ended(job, outcome))
            return
        call = Call(tasks.understand_job_task, (job.document,), UNDERSTAND_DEADLINE, None, False, FIRST, job.client)
        self._run(job, call, lambda job, understood: self._ended.put(_Ended(job, with_understood(outcome, understood))))

    def _win(self, job: Job, outcome: Outcome) -> None:
        """A job that waited for a worker ended in the short lane: it waits no more."""
        with self._lock:
            found = self._running.get((job.id, job.attempt))
            if found is None:  # its turn came, and it ended there
                return
            self._won.add((job.id, job.attempt))
        found[1].cancel()
        self._ended.put(_Ended(job, outcome))

    def _finish_loop(self) -> None:
        while (ended := self._ended.get()) is not None:
            try:
                self._insist(ended)
            except Exception:  # the thread must live
                log.exception("an answer could not be stored", extra={"job": ended.job.id})
                self._fail(ended.job)
            finally:
                with self._lock:
                    self._running.pop((ended.job.id, ended.job.attempt), None)
                    self._won.discard((ended.job.id, ended.job.attempt))
                self._wake.set()

    def _insist(self, ended: _Ended) -> None:
        """Store an answer however long the store stays away; where the service stops first, the job runs again."""
        told = False
        while True:
            try:
                return self._finish(ended.job, ended.outcome)
            except AWAY:
                if not told:
                    log.exception("an answer waits for the store", extra={"job": ended.job.id})
                told = True
            if self._stopping.wait(POLL):
                return None

    def _fail(self, job: Job) -> None:
        """The answer is lost by a fault of ours: say so, for nobody would ever end this job."""
        try:
            finishing.lose(self._store, job)
        except Exception:  # claimed again after a restart
            log.exception("a fault could not be stored", extra={"job": job.id})

    def _finish(self, job: Job, outcome: Outcome) -> None:
        events = self.events.pending(job.id)
        label = finishing.finish(self._store, job, outcome, self.events.so_far(job.id), events)
        self.events.written(job.id, events)
        self.events.end(job, again=label == "again")
        if outcome.status in ("crash", "killed"):
            self.counters.add(*DEATHS, how=outcome.status)
        spent = outcome.spent
        about = {"kind": job.kind, "outcome": label}
        self.counters.add("inverse_service_jobs_total", "Runs of jobs by how they ended.", kind=job.kind, outcome=label)
        self.counters.observe("inverse_service_job_wall_seconds", "Wall clock of a run.", spent.wall, kind=job.kind)
        self.counters.add("inverse_service_job_cpu_seconds_total", "Processor time of runs.", spent.cpu, kind=job.kind)
        self.counters.highest(
            "inverse_service_job_memory_peak_mebibytes", "Largest memory of a run.", spent.memory, kind=job.kind
        )
        figures = {"wall": round(spent.wall, 4), "cpu": round(spent.cpu, 4), "memory": round(spent.memory, 1)}
        log.info("job ended", extra={"job": job.id, "client": job.client, "attempt": job.attempt, **about, **figures})

    def _tick_loop(self) -> None:
        while not self._stopping.wait(TICK):
            try:
                self.events.flush()
                if self._short is not None:
                    with self._lock:
                        claimed = list(self._running.values())
                    self._short.look(claimed, self._win)
                if time.monotonic() - self._beaten > HEARTBEAT:
                    self._beat()
                elif self._doubtful:
                    self._keep()
            except (sqlite3.Error, InverseServiceError, OSError):
                log.exception("the store does not answer")

    def _beat(self) -> None:
        """Keep the claims, and take back those of a front end that is gone."""
        self._beaten = time.monotonic()
        self._keep()
        self._wake.set()  # an operator's command may have let jobs begin
        if not self._store.exclusive:
            self._take_back(LEASE)

    def _keep(self) -> None:
        """Keep the claims; stop what another front end dismissed or took over."""
        self._doubtful = False
        with self._lock:
            running = dict(self._running)
        lost = set(self._store.heartbeat(self._owner, list(running)))
        runs = Counter(id for id, _ in running)
        for (id, _), (_, task) in running.items():
            if id in lost and runs[id] == 1:  # with two, the later run may be ours
                task.cancel()

    def _changed(self, id: str) -> None:
        """A job changed; where another front end may have dismissed it, look before the next heartbeat."""
        self._wake.set()
        if not self._store.exclusive:
            with self._lock:
                self._doubtful = self._doubtful or any(job.id == id for job, _ in self._running.values())

    def _take_back(self, lease: float) -> None:
        for job in self._store.recover(None, lease):
            log.warning("job runs again", extra={"job": job.id, "restarts": job.restarts})

"""A pool of killable worker processes: every task has a deadline that holds even inside C code.

One thread a process: it hands over a task, waits for the answer or the deadline, and replaces the
process where that died. A process is forked from a small server process that has the engine loaded
already, so a replacement costs some 20 ms; it never starts from the threads of the service.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.outcome import Call, Outcome
from inverse_service.service.jobs.worker_process import NotStarted, Report, WorkerProcess, start_server

T = TypeVar("T")
NO_SHARE = 1_000_000


class FairQueue(Generic[T]):
    """Safe to use from any thread. Of one client at most `share` tasks are out at a time, until they are `done`."""

    def __init__(self, share: int = NO_SHARE) -> None:
        self._share = share
        self._waiting: dict[str, list[tuple[int, int, T]]] = {}
        self._out: Counter[str] = Counter()
        self._numbers = itertools.count()
        self._changed = threading.Condition()
        self._closed = False

    def put(self, client: str, priority: int, task: T) -> bool:
        """Let a task wait; the smaller `priority` goes first. False where the queue is closed."""
        with self._changed:
            if not self._closed:
                heapq.heappush(self._waiting.setdefault(client, []), (priority, next(self._numbers), task))
                self._changed.notify()
            return not self._closed

    def get(self, seconds: float) -> tuple[str, T] | None:
        """The next task and its client; None where none comes in so many seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._next() is not None, seconds)
            client = self._next()
            if client is None:
                return None
            task = heapq.heappop(self._waiting[client])[2]
            if not self._waiting[client]:
                del self._waiting[client]
            self._out[client] += 1
            return client, task

    def done(self, client: str) -> None:
        """A task that `get` gave ended."""
        with self._changed:
            self._out[client] -= 1
            if not self._out[client]:
                del self._out[client]
            self._changed.notify()

    @property
    def length(self) -> int:
        """How many tasks wait."""
        with self._changed:
            return sum(len(tasks) for tasks in self._waiting.values())

    def remove(self, client: str, task: T) -> None:
        """Forget a task that waits; nothing happens where it does not."""
        with self._changed:
            left = [entry for entry in self._waiting.get(client, ()) if entry[2] is not task]
            heapq.heapify(left)
            self._waiting[client] = left
            if not left:
                del self._waiting[client]

    def close(self) -> list[T]:
        """Take no more and wake all that wait in `get`; the tasks that nobody gets."""
        with self._changed:
            self._closed = True
            left = [task for tasks in self._waiting.values() for _, _, task in tasks]
            self._waiting.clear()
            self._changed.notify_all()
            return left

    def _next(self) -> str | None:
        able = [client for client in self._waiting if self._out[client] < self._share]
        return min(able, key=lambda client: (self._out[client], self._waiting[client][0][:2]), default=None)


log = logging.getLogger(__name__)
TASKS_PER_WORKER = 200
# A worker that once needed this much is replaced, so that what its libraries keep is given back.
MEMORY_TO_REPLACE = 700.0
STARTS = 3
# Between attempts to start a process where the system has none to give, s.
START_PAUSE = 0.5
IDLE_LOOK = 1.0
# The first task of all shows that the engine can be loaded, s.
PING_DEADLINE = 60.0
FIRST = -1


@dataclass(slots=True, eq=False)
class Running:
    """A task in the pool: `outcome` always ends with an Outcome, never with an exception."""

    call: Call
    report: Report | None = None
    outcome: Future[Outcome] = field(default_factory=Future)
    _worker: WorkerProcess | None = None
    _cancelled: bool = False
    _ended: bool = False
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        # From here on nobody can cancel the future itself (asyncio does when a wait runs out).
        self.outcome.set_running_or_notify_cancel()

    def cancel(self) -> None:
        """Stop the work: a task that waits ends at once, the process of one that runs is killed."""
        with self._lock:
            self._cancelled = True
            worker = self._worker
            if worker is not None:
                worker.kill()
        if worker is None:
            self.end(Outcome("cancelled"))

    @property
    def has_begun(self) -> bool:
        """Whether some process works on it, as far as is known here."""
        return self._worker is not None

    @property
    def is_cancelled(self) -> bool:
        """Whether `cancel` was called."""
        return self._cancelled

    def begin(self, worker: WorkerProcess) -> bool:
        """Mark it as running in this worker; False where it was cancelled before."""
        with self._lock:
            if not self._cancelled:
                self._worker = worker
            return not self._cancelled

    def end(self, outcome: Outcome) -> None:
        """Hand the outcome over, once; what a cancelled task says does not count."""
        with self._lock:
            self._worker = None
            if self._ended:
                return
            self._ended = True
        self.outcome.set_result(Outcome("cancelled", spent=outcome.spent) if self._cancelled else outcome)


class Executor(Protocol):
    """Where tasks run: the pool of this machine, or many machines."""

    @property
    def capacity(self) -> int:
        """How many tasks run at the same time."""

    def start(self) -> None:
        """Start the processes; call from a thread that lives as long as they do."""

    def submit(self, call: Call, report: Report | None = None) -> Running:
        """Run the call; returns at once."""

    def withdraw(self, running: Running) -> None:
        """Cancel a task and forget it where it waits."""

    def fault(self) -> str:
        """Why nothing can run now, in a sentence; empty where it can."""

    def stop(self) -> None:
        """End everything at once; tasks not done end as cancelled."""


class Workers:
    """A pool that heals itself; safe to use from any thread. Of one client at most `share` tasks run at a time."""

    def __init__(self, count: int, memory_limit: int, share: int = NO_SHARE) -> None:
        self._count = count
        self._memory_limit = memory_limit
        self._lock = threading.Lock()
        self._tasks: FairQueue[Running] = FairQueue(share)
        self._threads: list[threading.Thread] = []
        # The threads that have a process, and how the first task of all ended, which no client asked for.
        self._alive: set[int] = set()
        self.first: Future[Outcome] = Future()
        self._running: set[Running] = set()
        self._stopped = False
        self._stopping = threading.Event()

    @property
    def capacity(self) -> int:
        """The number of processes."""
        return self._count

    def start(self) -> None:
        """Start the processes; they load the engine while the caller goes on."""
        with self._lock:
            if self._threads or self._stopped:
                return
            start_server()
            self._threads = [
                threading.Thread(target=self._serve, args=(k,), name=f"worker-{k}", daemon=True)
                for k in range(self._count)
            ]
        for thread in self._threads:
            thread.start()
        self.submit(Call(tasks.load_engine, (), PING_DEADLINE, priority=FIRST)).outcome.add_done_callback(self._prove)

    def submit(self, call: Call, report: Report | None = None) -> Running:
        """Run the call in one of the processes: the clients in turn, the urgent calls of each first."""
        running = Running(call, report)
        if not self._threads or not self._tasks.put(call.client, call.priority, running):
            running.end(Outcome("crash", detail="The worker processes are stopped."))
        return running

    def withdraw(self, running: Running) -> None:
        """Cancel a task and forget it where it waits."""
        self._tasks.remove(running.call.client, running)
        running.cancel()

    def fault(self) -> str:
        """Says the same whatever clients ask: a process has answered once, and there is one."""
        if not self._threads or self._stopped:
            return "The worker processes are stopped."
        if not self.first.done() or self.first.result().status != "done":
            return "No worker process answers yet."
        return "" if self._alive else "No worker process can be started."

    def run(self, task: Callable[..., Outcome], arguments: tuple[Any, ...], deadline: float) -> Outcome:
        """`submit` and wait."""
        return self.submit(Call(task, arguments, deadline)).outcome.result()

    def stop(self) -> None:
        """End all processes at once; tasks not done end as cancelled."""
        with self._lock:
            self._stopped = True
            self._stopping.set()
            running = list(self._running)
        for task in (*self._tasks.close(), *running):
            task.cancel()
        for thread in self._threads:
            thread.join(2)

    def _prove(self, pinged: Future[Outcome]) -> None:
        outcome = pinged.result()
        self.first.set_result(outcome)
        if outcome.status != "done":
            log.error("the first task of a worker ended with %s: %s", outcome.status, outcome.detail)

    def _serve(self, number: int) -> None:
        worker: WorkerProcess | None = None
        while not self._stopped:
            worker = self._noted(number, self._healthy(worker))
            found = self._tasks.get(IDLE_LOOK)
            if found is None:
                continue
            client, task = found
            try:
                worker = self._noted(number, self._work(task, worker))
            finally:
                self._tasks.done(client)
        if worker is not None:
            worker.close()

    def _noted(self, number: int, worker: WorkerProcess | None) -> WorkerProcess | None:
        (self._alive.discard if worker is None else self._alive.add)(number)
        return worker

    def _work(self, task: Running, worker: WorkerProcess | None) -> WorkerProcess | None:
        """Run one task; the process to go on with."""
        with self._lock:
            self._running.add(task)
            if self._stopped:
                task.cancel()
        outcome = Outcome("unstarted", detail="no worker process can be started")
        for _ in range(STARTS):
            worker = self._healthy(worker)
            if worker is None:
                self._stopping.wait(START_PAUSE)
                continue
            if not task.begin(worker):
                break
            try:
                outcome = worker.run(task.call, task.report)
                break
            except NotStarted:
                log.warning("a worker process was found dead")
                worker.close()
                worker = None
        with self._lock:
            self._running.discard(task)
        worker = _kept(worker, outcome)
        task.end(outcome)
        return worker

    def _healthy(self, worker: WorkerProcess | None) -> WorkerProcess | None:
        if worker is not None and worker.is_alive():
            return worker
        if worker is not None:
            worker.close()
        try:
            return WorkerProcess(self._memory_limit)
        except (OSError, EOFError, RuntimeError):
            log.exception("no worker process can be started")
            return None


def _kept(worker: WorkerProcess | None, outcome: Outcome) -> WorkerProcess | None:
    """The worker, unless it is dead, spent, or holds much memory."""
    if worker is None:
        return None
    is_well = outcome.status in ("done", "refused", "fault")
    if is_well and worker.tasks < TASKS_PER_WORKER and outcome.spent.memory < MEMORY_TO_REPLACE:
        return worker
    worker.close()
    return None

"""A pool of killable worker processes: every task has a deadline that holds even inside C code.

A `WorkerProcess` runs one task after another, within bounds on memory and processor time; its
parent waits with a deadline and kills it there. It is forked from a small server process that has
the engine loaded, so a replacement costs some 20 ms, and never from the threads of the service.
`Workers` has one thread a process, which takes tasks from a queue that is fair to clients, hands
them over, and replaces a process that died. `run_alone` is a single task in a process of its own,
for a call of the command line.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import itertools
import logging
import math
import multiprocessing
import multiprocessing.forkserver
import multiprocessing.util
import os
import select
import signal
import sys
import threading
import time
import warnings
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal, Protocol

from inverse_service import garbage
from inverse_service.service.jobs import locks, tasks
from inverse_service.service.jobs.tasks import Call, Outcome, Report, Usage, guard, outcome_of_exit

PR_SET_PDEATHSIG = 1
# The wall clock ends a task first; the bound on processor time is for tasks that start threads.
THREADS = 2
# A deadline is at most so many times as long where other programs have the processor.
MOST_CROWDED = 2.0
WARM = "inverse_service.service.jobs.warm"
# What a task says is sent this often, from its beginning, so that a short one only says that it is
# done; s.
BETWEEN_REPORTS = 0.3
starting = threading.Lock()
# What the server that forks the workers has loaded.
_preloaded = [WARM]
NO_SHARE = 1_000_000
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
# What a process says as it takes a task: one that dies before did not die of the task.
TAKEN = None
# The exit code that multiprocessing gives where the server that forks is not there to tell.
UNTOLD = 255


class NotStarted(Exception):
    """The process died before it took the task, which is innocent."""


class WorkerProcess:
    """A process with the engine loaded. `run` is for one thread at a time, `kill` for any."""

    def __init__(self, memory_limit: int, context: Any = None, is_alone: bool = False) -> None:
        context = context or process_context()
        receiver, sender = context.Pipe(duplex=True)
        self._connection: Connection = receiver
        self._heard = select.poll()
        self._heard.register(receiver, select.POLLIN)
        with starting:
            self._process = context.Process(
                target=serve, args=(sender, memory_limit, is_alone), daemon=True
            )
            self._process.start()
        sender.close()
        self._server = None if is_alone else forking_server()
        self.pid, self.tasks = int(self._process.pid or 0), 0
        # What it says before it takes a task: the seconds of processor that it used, and waited for
        # one, until then.
        self._ready: tuple[float, float] | None = None
        # When the task under way began, and what it took, read before the process that could tell
        # is killed.
        self._began, self._used = 0.0, Usage()
        self.is_stopped = False  # on purpose, by `kill`

    def is_alive(self) -> bool:
        """Whether the process can take a task."""
        return bool(self._process.is_alive())

    def run(self, call: Call, report: Report | None = None) -> Outcome:
        """Run the task and kill the process at its deadline. Raises NotStarted."""
        self._began, self._used = time.monotonic(), Usage()
        try:
            self._ready = self._ready or self._connection.recv()
            self._connection.send(call)
        except (OSError, EOFError):
            raise NotStarted from None
        self.tasks += 1
        outcome = self._await(call, self._ready[1], report)
        if outcome.spent.wall:
            return outcome
        wall = time.monotonic() - self._began
        return replace(outcome, spent=self._used if self._used.wall else Usage(wall, wall))

    def kill(self) -> None:
        """End the process at once, whatever it does."""
        self.is_stopped = True
        used, wall = processor_time(self.pid), time.monotonic() - self._began
        # Where the system does not tell, a task is taken to have used the processor all the time.
        # It counts in steps.
        processor = wall if used is None or self._ready is None else max(0.0, used - self._ready[0])
        self._used = Usage(wall, processor, peak_memory(self.pid))
        with contextlib.suppress(OSError, AttributeError):
            self._process.kill()

    def close(self) -> None:
        """Kill the process and give everything back."""
        self.kill()
        self._process.join(5)
        self._connection.close()

    def _await(self, call: Call, waited: float, report: Report | None) -> Outcome:
        """The answer within so many seconds by the clock, and as many more as others had the
        processor.
        """
        began, deadline, is_taken = time.monotonic(), call.deadline, False
        end, patience = began + deadline, max(call.patience, (MOST_CROWDED - 1) * deadline)
        while True:
            while not self._heard.poll(max(0.0, 1e3 * (end - time.monotonic()))):
                end = began + deadline + min(_waited(self.pid) - waited, patience)
                if end <= time.monotonic():
                    self.kill()
                    return Outcome("deadline")
            try:
                message = self._connection.recv()
            except (OSError, EOFError):
                if not is_taken:  # it was killed as it waited
                    raise NotStarted from None
                self._process.join(5)
                if (
                    self._process.exitcode == UNTOLD
                    and self._server is not None
                    and has_ended(self._server)
                ):
                    return Outcome(
                        "unstarted",
                        detail="the server that forks the workers died, and they with it",
                    )
                return outcome_of_exit(self._process.exitcode)
            if message is TAKEN:
                is_taken = True
                continue
            said, outcome, ready = message
            if report is not None:
                try:
                    for value in said:
                        report(value)
                except Exception:  # who listens has a fault; the task goes on
                    log.exception("what a task said was not told")
            if outcome is not None:
                found: Outcome = outcome
                self._ready = ready
                return found


def forking_server() -> int | None:
    """The process that forks the workers; it alone knows how they end."""
    found: int | None = getattr(
        getattr(multiprocessing.forkserver, "_forkserver", None), "_forkserver_pid", None
    )
    return found


def has_ended(pid: int) -> bool:
    """Whether this child of ours has ended; it is not taken away from whoever waits for it."""
    try:
        return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
    except ChildProcessError:
        return True


def process_context() -> Any:
    """Processes forked from a server without threads where the system has it, else spawned."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_preloaded)
    return context


def preload(module: str) -> None:
    """Have the server that forks the workers load one more module; call before the first pool
    starts.
    """
    if module not in _preloaded:
        _preloaded.append(module)


def start_server() -> None:
    """Start the server that forks the workers; call from a thread that lives as long as they do.

    Linux ties the death signal of a process to the thread that made it.
    """
    # Not under `starting`: who has that waits for the server to load everything, and the loop must
    # not.
    if process_context().get_start_method() == "forkserver":
        multiprocessing.forkserver.ensure_running()
        locks.hold(Path(multiprocessing.util.get_temp_dir()))


def serve(connection: Connection, memory_limit: int, is_alone: bool) -> None:
    """The life of a worker process: tasks until the parent closes the pipe; one task where it is
    alone.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence_standard_error()
    if not is_alone:
        guard(tasks.load_engine)
    saying = _Saying(connection)
    isolate(memory_limit)
    connection.send(ready())
    while True:
        try:
            call: Call = connection.recv()
            connection.send(TAKEN)
        except (OSError, EOFError):
            return
        bound_memory(min(call.memory_limit or memory_limit, memory_limit), memory_limit)
        bound_processor(call.deadline)
        forget_peak()
        wall, cpu = time.monotonic(), time.process_time()
        extra = {"report": saying.say} if call.reports else {}
        outcome = guard(call.task, *call.arguments, **extra)
        spent = Usage(time.monotonic() - wall, time.process_time() - cpu, peak_memory())
        saying.end(replace(outcome, spent=spent), call.reports is True)
        if is_alone:
            return


def ready() -> tuple[float, float]:
    """Seconds of processor that this process has used, and waited for one."""
    return time.process_time(), _waited("self")


class _Saying:
    """What a task says, sent to the parent now and then: (what was said, outcome, `ready`), None
    before its end.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock, self._some = threading.Lock(), threading.Event()
        self._said: list[Any] = []
        self._is_heard, self._began = False, 0.0
        threading.Thread(target=self._send_in_time, name="reports", daemon=True).start()

    def say(self, value: Any) -> None:
        """Send it soon."""
        with self._lock:
            if not (self._said or self._is_heard):
                self._began = time.monotonic()
            self._said.append(value)
        self._some.set()

    def end(self, outcome: Outcome, is_told: bool) -> None:
        """Send how the task ended, and what is left where some was sent already or it `is_told` in
        any case.
        """
        with self._lock:
            self._connection.send(
                (self._said if self._is_heard or is_told else [], outcome, ready())
            )
            self._said, self._is_heard = [], False

    def _send_in_time(self) -> None:
        while self._some.wait():
            time.sleep(BETWEEN_REPORTS)
            with self._lock, contextlib.suppress(OSError):  # a parent that is gone is not told
                if time.monotonic() - self._began < BETWEEN_REPORTS:  # it is of the next task
                    continue
                self._some.clear()
                if self._said:
                    self._connection.send((self._said, None, None))
                    self._said, self._is_heard = [], True


def isolate(memory_limit: int) -> None:
    """Bound the address space to `memory_limit` MiB, write no core file, die with the parent;
    collect garbage seldom.

    Where the system has no such limits (Windows, partly macOS) a step is left out.
    """
    garbage.look_seldom()
    _limit("RLIMIT_CORE", 0, 0)
    # The service has a smaller one, which its workers inherit; theirs is that of the address space.
    bound_data(memory_limit)
    bound_memory(memory_limit, memory_limit)
    die_with_parent()


def die_with_parent() -> None:
    """Have the kernel kill this process when the thread that started it ends (Linux only).

    Without it a worker that spins in C outlives a service that was killed with SIGKILL.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def bound_memory(soft: int, hard: int) -> None:
    """Bound the address space, in MiB; a task may have less than its process."""
    _limit("RLIMIT_AS", soft * 2**20, hard * 2**20)


def bound_data(limit: int) -> None:
    """Bound what this process has for its data, in MiB; the processes that it starts may raise that
    again.
    """
    _limit("RLIMIT_DATA", limit * 2**20, None)


def bound_processor(deadline: float) -> None:
    """End this process by SIGXCPU when the task that starts now used its time on all its
    threads.
    """
    _limit("RLIMIT_CPU", math.ceil(time.process_time() + THREADS * deadline) + 1, None)


def forget_peak() -> None:
    """Begin to measure the peak of memory again (Linux only)."""
    with contextlib.suppress(OSError), open("/proc/self/clear_refs", "w") as stream:
        stream.write("5")


def peak_memory(pid: int | Literal["self"] = "self") -> float:
    """Largest resident memory of a process since its `forget_peak`, in MiB; 0 where the system does
    not tell.
    """
    with contextlib.suppress(OSError), open(f"/proc/{pid}/status") as stream:
        for line in stream:
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    return 0.0


def silence_standard_error() -> None:
    """C libraries print as they abort; the parent says what happened in one sentence."""
    faulthandler.disable()
    with contextlib.suppress(OSError):
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 2)
        os.close(silence)


def _waited(pid: int | Literal["self"]) -> float:
    """Seconds in which a process was ready and others ran (Linux; 0 where the system does not
    tell).
    """
    with contextlib.suppress(OSError), open(f"/proc/{pid}/schedstat") as stream:
        return int(stream.read().split()[1]) / 1e9
    return 0.0


def processor_time(pid: int) -> float | None:
    """Seconds of processor that a process has used; None where the system does not tell."""
    with (
        contextlib.suppress(OSError, AttributeError, IndexError),
        open(f"/proc/{pid}/stat") as stream,
    ):
        # After the name, which may hold blanks: state and ten numbers, then those of user and
        # system.
        user, system = stream.read().rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
    return None


def _limit(name: str, soft: int, hard: int | None) -> None:
    try:
        import resource
    except ImportError:
        return
    with contextlib.suppress(ValueError, OSError, AttributeError):
        which = getattr(resource, name)
        present = resource.getrlimit(which)[1]
        largest = present if hard is None else hard
        resource.setrlimit(
            which, (soft if present == resource.RLIM_INFINITY else min(soft, present), largest)
        )


class FairQueue:
    """The tasks of a pool that wait; safe to use from any thread.

    Of one client at most `share` tasks are out at a time, until they are `done`.
    """

    def __init__(self, share: int = NO_SHARE) -> None:
        self._share = share
        self._waiting: list[tuple[int, int, str, Running]] = []
        self._out: Counter[str] = Counter()
        self._numbers = itertools.count()
        self._changed = threading.Condition()
        self._closed = False

    def put(self, client: str, priority: int, task: Running) -> bool:
        """Let a task wait; the smaller `priority` goes first. False where the queue is closed."""
        with self._changed:
            self._waiting = [entry for entry in self._waiting if not entry[3].is_cancelled]
            if not self._closed:
                self._waiting.append((priority, next(self._numbers), client, task))
                self._changed.notify()
            return not self._closed

    def get(self, seconds: float) -> tuple[str, Running] | None:
        """The next task and its client; None where none comes in so many seconds."""
        with self._changed:
            found = self._changed.wait_for(lambda: self._next() or self._closed, seconds)
            return None if isinstance(found, bool) else found

    def done(self, client: str) -> None:
        """A task that `get` gave ended."""
        with self._changed:
            self._out[client] -= 1
            if not self._out[client]:
                del self._out[client]
            if self._waiting:
                self._changed.notify()

    def close(self) -> list[Running]:
        """Take no more and wake all that wait in `get`; the tasks that nobody gets."""
        with self._changed:
            self._closed = True
            left, self._waiting = [entry[3] for entry in self._waiting], []
            self._changed.notify_all()
            return left

    def _next(self) -> tuple[str, Running] | None:
        """A task of the client with the fewest out; some ten wait at most, so all are looked at."""
        able = [entry for entry in self._waiting if self._out[entry[2]] < self._share]
        if not able:
            return None
        entry = min(able, key=lambda entry: (self._out[entry[2]], entry[:2]))
        self._waiting.remove(entry)
        self._out[entry[2]] += 1
        return entry[2:]


@dataclass(slots=True, eq=False)
class Running:
    """A task in the pool: `outcome` always ends with an Outcome, never with an exception."""

    call: Call
    report: Report | None = None
    outcome: Future[Outcome] = field(default_factory=Future)
    _worker: WorkerProcess | None = None
    is_cancelled: bool = False
    _ended: bool = False
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        # From here on nobody can cancel the future itself (asyncio does when a wait runs out).
        self.outcome.set_running_or_notify_cancel()

    def cancel(self) -> None:
        """Stop the work: a task that waits ends at once, the process of one that runs is killed."""
        with self._lock:
            self.is_cancelled = True
            worker = self._worker
            if worker is not None:
                worker.kill()
        if worker is None:
            self.end(Outcome("cancelled"))

    @property
    def has_begun(self) -> bool:
        """Whether some process works on it, as far as is known here."""
        return self._worker is not None

    def begin(self, worker: WorkerProcess) -> bool:
        """Mark it as running in this worker; False where it was cancelled before."""
        with self._lock:
            if not self.is_cancelled:
                self._worker = worker
            return not self.is_cancelled

    def end(self, outcome: Outcome) -> bool:
        """Hand the outcome over; False where that was done before. What a cancelled task says does
        not count.
        """
        with self._lock:
            self._worker = None
            is_first, self._ended = not self._ended, True
        if is_first:
            self.outcome.set_result(
                Outcome("cancelled", spent=outcome.spent) if self.is_cancelled else outcome
            )
        return is_first


class Executor(Protocol):
    """Where tasks run: the pool of this machine, or many machines."""

    @property
    def capacity(self) -> int:
        """How many tasks run at the same time."""

    def start(self) -> None:
        """Start the processes; call from a thread that lives as long as they do."""

    def submit(self, call: Call, report: Report | None = None) -> Running:
        """Run the call; returns at once."""

    def fault(self) -> str:
        """Why nothing can run now, in a sentence; empty where it can."""

    def stop(self) -> None:
        """End everything at once; tasks not done end as cancelled."""


class Workers:
    """A pool that heals itself; safe to use from any thread. Of one client at most `share` tasks
    run at a time.
    """

    def __init__(self, count: int, memory_limit: int, share: int = NO_SHARE) -> None:
        self.capacity = count
        self._memory_limit = memory_limit
        self._lock = threading.Lock()
        self._tasks: FairQueue = FairQueue(share)
        self._threads: list[threading.Thread] = []
        # The threads that have a process, and how the first task of all ended, which no client
        # asked for.
        self._alive: set[int] = set()
        self.first: Future[Outcome] = Future()
        self._running: set[Running] = set()
        self._stopping = threading.Event()

    def start(self) -> None:
        """Start the processes; they load the engine while the caller goes on."""
        with self._lock:
            if self._threads or self._stopping.is_set():
                return
            start_server()
            self._threads = [
                threading.Thread(target=self._serve, args=(k,), name=f"worker-{k}", daemon=True)
                for k in range(self.capacity)
            ]
        for thread in self._threads:
            thread.start()
        self.submit(
            Call(tasks.load_engine, (), PING_DEADLINE, priority=FIRST)
        ).outcome.add_done_callback(self._prove)

    def submit(self, call: Call, report: Report | None = None) -> Running:
        """Run the call in one of the processes: the clients in turn, the urgent calls of each
        first.
        """
        running = Running(call, report)
        if not self._threads or not self._tasks.put(call.client, call.priority, running):
            running.end(Outcome("crash", detail="The worker processes are stopped."))
        return running

    def fault(self) -> str:
        """Says the same whatever clients ask: a process has answered once, and there is one."""
        if not self._threads or self._stopping.is_set():
            return "The worker processes are stopped."
        if not self.first.done() or self.first.result().status != "done":
            return "No worker process answers yet."
        return "" if self._alive else "No worker process can be started."

    def stop(self) -> None:
        """End all processes at once; tasks not done end as cancelled."""
        self._stopping.set()
        for task in (*self._tasks.close(), *list(self._running)):
            task.cancel()
        for thread in self._threads:
            thread.join(2)

    def _prove(self, pinged: Future[Outcome]) -> None:
        outcome = pinged.result()
        self.first.set_result(outcome)
        if (
            outcome.status != "done" and not self._stopping.is_set()
        ):  # who stops at once has no fault
            log.error(
                "the first task of a worker ended with %s: %s", outcome.status, outcome.detail
            )

    def _serve(self, number: int) -> None:
        worker: WorkerProcess | None = None
        found = None
        while not self._stopping.is_set():
            if worker is None or found is None:  # one that has just answered lives
                worker = self._noted(number, self._healthy(worker))
            found = self._tasks.get(IDLE_LOOK)
            if found is not None:
                try:
                    worker = self._noted(number, self._work(found[1], worker))
                finally:
                    self._tasks.done(found[0])
        if worker is not None:
            worker.close()

    def _noted(self, number: int, worker: WorkerProcess | None) -> WorkerProcess | None:
        (self._alive.discard if worker is None else self._alive.add)(number)
        return worker

    def _work(self, task: Running, worker: WorkerProcess | None) -> WorkerProcess | None:
        """Run one task; the process to go on with."""
        self._running.add(task)
        if self._stopping.is_set():
            task.cancel()
        outcome = Outcome("unstarted", detail="no worker process can be started")
        for _ in range(STARTS):
            worker = worker or self._healthy(None)  # one that is dead by now says so itself
            if worker is None:
                self._stopping.wait(START_PAUSE)
                continue
            if not task.begin(worker):
                outcome = Outcome("cancelled")
                break
            try:
                outcome = worker.run(task.call, task.report)
                break
            except NotStarted:
                is_stopped = worker.is_stopped
                worker.close()
                worker = None
                if self._stopping.is_set() or task.is_cancelled:  # that killed it
                    outcome = Outcome("cancelled")
                    break
                # Who cancels a task that has just ended stops a process that was kept.
                if not is_stopped:
                    log.warning("a worker process was found dead")
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
    is_well = outcome.status in ("done", "refused", "fault", "cancelled")
    if is_well and worker.tasks < TASKS_PER_WORKER and outcome.spent.memory < MEMORY_TO_REPLACE:
        return worker
    worker.close()
    return None


def run_alone(
    task: Callable[..., Any],
    arguments: tuple[Any, ...],
    deadline: float,
    memory_limit: int,
    report: Report | None = None,
) -> Outcome:
    """Run `task(*arguments)` in a new process and kill it after `deadline` s, of which none counts
    while other programs have the processor: nobody else waits for it.

    The process is forked from this one, which has no threads and has not loaded the engine; it
    loads what the task needs. With `report` the task gets a keyword `report`, a function whose
    values come out of `report` here.
    """
    method = "fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn"
    with warnings.catch_warnings():
        # Newer Pythons warn of any thread of the process; those of numerical libraries survive a
        # fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        worker = WorkerProcess(memory_limit, multiprocessing.get_context(method), is_alone=True)
    try:
        call = Call(task, arguments, deadline, reports=report is not None, patience=math.inf)
        outcome = worker.run(call, report)
    except NotStarted:
        outcome = Outcome("unstarted", detail="the process died before it took the task")
    finally:
        worker.close()
    # Nobody else knows of this process: whoever killed it was the kernel, short of memory.
    return replace(outcome, status="memory") if outcome.status == "killed" else outcome

"""One killable process that runs one task after another; its parent waits with a deadline.

At the end: what such a process does to itself (bounds, no core file, no orphans), and what measures it.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import gc
import math
import multiprocessing
import multiprocessing.forkserver
import multiprocessing.util
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.locks import hold
from inverse_service.service.jobs.outcome import Call, Outcome, Usage, guard, outcome_of_exit

PR_SET_PDEATHSIG = 1
# The wall clock ends a task first; the bound on processor time is for tasks that start threads.
THREADS = 2
# Objects made between collections of cyclic garbage. With Python's 700, expressions that are kept for later systems are
# looked through so often that this takes a tenth of the time, and half of a long search late in a worker's life.
BETWEEN_COLLECTIONS = 100_000
# A deadline is at most so many times as long where other programs have the processor.
MOST_CROWDED = 2.0
WARM = "inverse_service.service.jobs.warm"
STARTED, REPORT, DONE = "started", "report", "done"
Report = Callable[[Any], None]
_starting = threading.Lock()
# What the server that forks the workers has loaded.
_preloaded = [WARM]


class NotStarted(Exception):
    """The process died before it took the task, which is innocent."""


class WorkerProcess:
    """A process with the engine loaded. `run` is for one thread at a time, `kill` for any."""

    def __init__(self, memory_limit: int) -> None:
        self._memory_limit = memory_limit
        receiver, sender = process_context().Pipe(duplex=True)
        self._connection: Connection = receiver
        with _starting:
            self._process = process_context().Process(target=serve, args=(sender, memory_limit), daemon=True)
            self._process.start()
        sender.close()
        self.tasks = 0
        # What the task under way took, read before the process that could tell is killed.
        self._began, self._used = Reading(), Usage()

    @property
    def pid(self) -> int:
        """The number of the process."""
        return int(self._process.pid or 0)

    def is_alive(self) -> bool:
        """Whether the process can take a task."""
        return bool(self._process.is_alive())

    def run(self, call: Call, report: Report | None = None) -> Outcome:
        """Run the task and kill the process at its deadline. Raises NotStarted."""
        self._began, self._used = Reading.of(self.pid), Usage()
        try:
            self._connection.send(call)
            self._connection.recv()
        except (OSError, EOFError):
            raise NotStarted from None
        self.tasks += 1
        outcome = self._await(Patience(self.pid, call.deadline), report)
        if outcome.spent.wall:
            return outcome
        wall = time.monotonic() - self._began.moment
        return replace(outcome, spent=self._used if self._used.wall else Usage(wall, wall))

    def kill(self) -> None:
        """End the process at once, whatever it does."""
        self._used = Reading.of(self.pid).since(self._began)
        with contextlib.suppress(OSError, AttributeError):
            self._process.kill()

    def close(self) -> None:
        """Kill the process and give everything back."""
        self.kill()
        self._process.join(5)
        self._connection.close()

    def _await(self, patience: Patience, report: Report | None) -> Outcome:
        while True:
            if not patience.is_answered(self._connection):
                self.kill()
                return Outcome("deadline")
            try:
                kind, value = self._connection.recv()
            except (OSError, EOFError):
                self._process.join(5)
                return outcome_of_exit(self._process.exitcode)
            if kind == DONE:
                outcome: Outcome = value
                return outcome
            if report is not None:
                report(value)


def process_context() -> Any:
    """Processes forked from a server without threads where the system has it, else spawned."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_preloaded)
    return context


def preload(module: str) -> None:
    """Have the server that forks the workers load one more module; call before the first pool starts."""
    if module not in _preloaded:
        _preloaded.append(module)


def start_server() -> None:
    """Start the server that forks the workers; call from a thread that lives as long as they do.

    Linux ties the death signal of a process to the thread that made it.
    """
    # Not under `_starting`: who has that waits for the server to load everything, and the loop must not.
    if process_context().get_start_method() == "forkserver":
        multiprocessing.forkserver.ensure_running()
        hold(Path(multiprocessing.util.get_temp_dir()))


def serve(connection: Connection, memory_limit: int) -> None:
    """The life of a worker process: tasks until the parent closes the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence_standard_error()
    guard(tasks.load_engine)
    isolate(memory_limit)
    while True:
        try:
            call: Call = connection.recv()
        except (OSError, EOFError):
            return
        connection.send((STARTED, None))
        _bound(call, memory_limit)
        connection.send((DONE, _run(call, connection)))


def _bound(call: Call, memory_limit: int) -> None:
    bound_memory(min(call.memory_limit or memory_limit, memory_limit), memory_limit)
    bound_processor(call.deadline)


def _run(call: Call, connection: Connection) -> Outcome:
    meter = Meter()
    extra = {"report": lambda value: connection.send((REPORT, value))} if call.reports else {}
    return replace(guard(call.task, *call.arguments, **extra), spent=meter.spent())


def isolate(memory_limit: int) -> None:
    """Bound the address space to `memory_limit` MiB, write no core file, die with the parent; collect garbage seldom.

    Where the system has no such limits (Windows, partly macOS) a step is left out.
    """
    gc.set_threshold(BETWEEN_COLLECTIONS, 10, 10)
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
    """Bound what this process has for its data, in MiB; the processes that it starts may raise that again."""
    _limit("RLIMIT_DATA", limit * 2**20, None)


def bound_processor(deadline: float) -> None:
    """End this process by SIGXCPU when the task that starts now used its time on all its threads."""
    _limit("RLIMIT_CPU", math.ceil(time.process_time() + THREADS * deadline) + 1, None)


def forget_peak() -> None:
    """Begin to measure the peak of memory again (Linux only)."""
    with contextlib.suppress(OSError), open("/proc/self/clear_refs", "w") as stream:
        stream.write("5")


def peak_memory(pid: int | Literal["self"] = "self") -> float:
    """Largest resident memory of a process since its `forget_peak`, in MiB; 0 where the system does not tell."""
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


class Patience:
    """How long a process is waited for: so many seconds by the clock, and as long as others had the processor."""

    def __init__(self, pid: int, deadline: float) -> None:
        self._pid, self._deadline = pid, deadline
        self._began, self._waited = time.monotonic(), _waited(pid)

    def is_answered(self, connection: Connection) -> bool:
        """Whether something comes over the connection in time."""
        while True:
            crowded = min(_waited(self._pid) - self._waited, (MOST_CROWDED - 1) * self._deadline)
            left = self._began + self._deadline + crowded - time.monotonic()
            if connection.poll(max(0.0, left)):
                return True
            if left <= 0:
                return False


def _waited(pid: int) -> float:
    """Seconds in which a process was ready and others ran (Linux; 0 where the system does not tell)."""
    with contextlib.suppress(OSError), open(f"/proc/{pid}/schedstat") as stream:
        return int(stream.read().split()[1]) / 1e9
    return 0.0


@dataclass(frozen=True, slots=True)
class Reading:
    """What another process has used at a moment: s of processor, MiB at the peak; None where the system does not tell.

    Where it does not, a task is taken to have used the processor all the time.
    """

    moment: float = 0.0
    cpu: float | None = None
    memory: float = 0.0

    @classmethod
    def of(cls, pid: int) -> Reading:
        """That of now."""
        cpu = None
        with contextlib.suppress(OSError, AttributeError, IndexError), open(f"/proc/{pid}/stat") as stream:
            # After the name, which may hold blanks: state and ten numbers, then those of user and system.
            user, system = stream.read().rpartition(")")[2].split()[11:13]
            cpu = (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
        return cls(time.monotonic(), cpu, peak_memory(pid))

    def since(self, before: Reading) -> Usage:
        """What was used between the two."""
        wall = self.moment - before.moment
        is_known = self.cpu is not None and before.cpu is not None
        return Usage(wall, (self.cpu or 0.0) - (before.cpu or 0.0) if is_known else wall, self.memory)


class Meter:
    """Measures one task from its making to `spent`."""

    def __init__(self) -> None:
        forget_peak()
        self._wall, self._cpu = time.monotonic(), time.process_time()

    def spent(self) -> Usage:
        """What was used since."""
        return Usage(time.monotonic() - self._wall, time.process_time() - self._cpu, peak_memory())


def _limit(name: str, soft: int, hard: int | None) -> None:
    try:
        import resource
    except ImportError:
        return
    with contextlib.suppress(ValueError, OSError, AttributeError):
        which = getattr(resource, name)
        present = resource.getrlimit(which)[1]
        largest = present if hard is None else hard
        resource.setrlimit(which, (soft if present == resource.RLIM_INFINITY else min(soft, present), largest))

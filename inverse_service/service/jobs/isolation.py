"""What a worker process does to itself (bounds, no core file, no orphans), and one task in a process of its own.

A single call of the command line is such a task, with a deadline.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import gc
import math
import multiprocessing
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from inverse_service.service.jobs.outcome import Outcome, Usage, guard, outcome_of_exit

PR_SET_PDEATHSIG = 1
# The wall clock ends a task first; the bound on processor time is for tasks that start threads.
THREADS = 2
# A deadline is at most so many times as long where other programs have the processor.
MOST_CROWDED = 10.0


def isolate(memory_limit: int) -> None:
    """Bound the address space to `memory_limit` MiB, write no core file, die with the parent.

    Where the system has no such limits (Windows, partly macOS) a step is left out.
    """
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


def peak_memory() -> float:
    """Largest resident memory since `forget_peak`, in MiB; 0 where the system does not tell."""
    with contextlib.suppress(OSError), open("/proc/self/status") as stream:
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


Report = Callable[[str], None]
# Reports of a task that follow each other faster than this, in s, are left out.
_BETWEEN_REPORTS = 0.1
# Objects made between collections of cyclic garbage.
_BETWEEN_COLLECTIONS = 250_000


def run_alone(
    task: Callable[..., Any],
    arguments: tuple[Any, ...],
    deadline: float,
    memory_limit: int,
    report: Report | None = None,
) -> Outcome:
    """Run `task(*arguments)` in a new process and kill it after `deadline` s (see `Patience`).

    The process is forked from this one, which has no threads and has not loaded the engine. With
    `report` the task gets a further argument, a function whose texts come out of `report` here.
    """
    method = "fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn"
    context: Any = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    given = (sender, task, arguments, memory_limit, report is not None)
    process = context.Process(target=_child, args=given, daemon=True)
    with warnings.catch_warnings():
        # Newer Pythons warn of any thread of the process; those of numerical libraries survive a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    sender.close()
    try:
        return _receive(receiver, process, deadline, report)
    finally:
        process.kill()
        process.join()


def _receive(receiver: Connection, process: Any, deadline: float, report: Report | None) -> Outcome:
    patience = Patience(process.pid, deadline)
    while patience.is_answered(receiver):
        try:
            received: Outcome | str = receiver.recv()
        except EOFError:
            process.join()
            ended = outcome_of_exit(process.exitcode)
            # Nobody else knows of this process: whoever killed it was the kernel, short of memory.
            return Outcome("memory", detail=ended.detail) if ended.status == "killed" else ended
        if isinstance(received, Outcome):
            return received
        if report is not None:
            report(received)
    return Outcome("deadline")


def _child(
    sender: Connection, task: Callable[..., Any], arguments: tuple[Any, ...], memory_limit: int, reports: bool
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence_standard_error()
    isolate(memory_limit)
    # The import of the engine makes 100,000 objects that stay; looking through them once takes 0.02 s.
    gc.set_threshold(_BETWEEN_COLLECTIONS, 10, 10)
    last = 0.0

    def report(text: str) -> None:
        nonlocal last
        if time.monotonic() - last > _BETWEEN_REPORTS:
            last = time.monotonic()
            sender.send(text)

    sender.send(guard(task, *arguments, *([report] if reports else [])))

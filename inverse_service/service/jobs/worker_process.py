"""One killable process that runs one task after another; its parent waits with a deadline."""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.forkserver
import multiprocessing.util
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from inverse_service.service.jobs import isolation, tasks
from inverse_service.service.jobs.locks import hold
from inverse_service.service.jobs.outcome import Call, Outcome, Usage, guard, outcome_of_exit

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

    @property
    def pid(self) -> int:
        """The number of the process."""
        return int(self._process.pid or 0)

    def is_alive(self) -> bool:
        """Whether the process can take a task."""
        return bool(self._process.is_alive())

    def run(self, call: Call, report: Report | None = None) -> Outcome:
        """Run the task and kill the process at its deadline. Raises NotStarted."""
        began = time.monotonic()
        try:
            self._connection.send(call)
            self._connection.recv()
        except (OSError, EOFError):
            raise NotStarted from None
        self.tasks += 1
        outcome = self._await(isolation.Patience(self.pid, call.deadline), report)
        return outcome if outcome.spent.wall else replace(outcome, spent=Usage(wall=time.monotonic() - began))

    def kill(self) -> None:
        """End the process at once, whatever it does."""
        with contextlib.suppress(OSError, AttributeError):
            self._process.kill()

    def close(self) -> None:
        """Kill the process and give everything back."""
        self.kill()
        self._process.join(5)
        self._connection.close()

    def _await(self, patience: isolation.Patience, report: Report | None) -> Outcome:
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
    isolation.silence_standard_error()
    guard(tasks.load_engine)
    isolation.isolate(memory_limit)
    while True:
        try:
            call: Call = connection.recv()
        except (OSError, EOFError):
            return
        connection.send((STARTED, None))
        _bound(call, memory_limit)
        connection.send((DONE, _run(call, connection)))


def _bound(call: Call, memory_limit: int) -> None:
    isolation.bound_memory(min(call.memory_limit or memory_limit, memory_limit), memory_limit)
    isolation.bound_processor(call.deadline)


def _run(call: Call, connection: Connection) -> Outcome:
    meter = isolation.Meter()
    extra = {"report": lambda value: connection.send((REPORT, value))} if call.reports else {}
    return replace(guard(call.task, *call.arguments, **extra), spent=meter.spent())

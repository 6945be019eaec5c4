"""One task in a process of its own, with a deadline: a single call of the command line."""

from __future__ import annotations

import multiprocessing
import signal
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any

from inverse_service.service.jobs.outcome import Outcome, Usage, guard, outcome_of_exit
from inverse_service.service.jobs.worker_process import Patience, isolate, silence_standard_error

Report = Callable[[Any], None]
# Stages of a task that follow each other faster than this, in s, are left out.
_BETWEEN_REPORTS = 0.1


def run_alone(
    task: Callable[..., Any],
    arguments: tuple[Any, ...],
    deadline: float,
    memory_limit: int,
    report: Report | None = None,
) -> Outcome:
    """Run `task(*arguments)` in a new process and kill it after `deadline` s (see `Patience`).

    The process is forked from this one, which has no threads and has not loaded the engine. With
    `report` the task gets a further argument, a function whose values come out of `report` here.
    """
    began = time.monotonic()
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
        outcome = _receive(receiver, process, deadline, report)
        return replace(outcome, spent=Usage(wall=time.monotonic() - began))
    finally:
        process.kill()
        process.join()


def _receive(receiver: Connection, process: Any, deadline: float, report: Report | None) -> Outcome:
    patience = Patience(process.pid, deadline)
    while patience.is_answered(receiver):
        try:
            received: Any = receiver.recv()
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
    last = 0.0

    def report(value: Any) -> None:
        nonlocal last
        if not isinstance(value, str) or time.monotonic() - last > _BETWEEN_REPORTS:
            last = time.monotonic()
            sender.send(value)

    sender.send(guard(task, *arguments, *([report] if reports else [])))

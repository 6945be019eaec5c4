"""One task in one process of its own, with a deadline: for a single call of the command line."""

from __future__ import annotations

import multiprocessing
import signal
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from inverse_service.service.isolation import isolate, silence_standard_error
from inverse_service.service.outcome import Outcome, outcome_of_exit


def run_alone(task: Callable[..., Outcome], arguments: tuple[Any, ...], deadline: float, memory_limit: int) -> Outcome:
    """Run `task(*arguments)` in a new process and kill it after `deadline` s.

    The process is forked from this one, which has no threads and has not loaded the engine.
    """
    method = "fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn"
    context: Any = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_child, args=(sender, task, arguments, memory_limit), daemon=True)
    with warnings.catch_warnings():
        # Newer Pythons warn of any thread of the process; those of numerical libraries survive a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    sender.close()
    try:
        return _receive(receiver, process, deadline)
    finally:
        process.kill()
        process.join()


def _receive(receiver: Connection, process: Any, deadline: float) -> Outcome:
    if not receiver.poll(deadline):
        return Outcome("deadline")
    try:
        outcome: Outcome = receiver.recv()
    except EOFError:
        process.join()
        ended = outcome_of_exit(process.exitcode)
        # Nobody else knows of this process: whoever killed it was the kernel, short of memory.
        return Outcome("memory", detail=ended.detail) if ended.status == "killed" else ended
    return outcome


def _child(sender: Connection, task: Callable[..., Outcome], arguments: tuple[Any, ...], memory_limit: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence_standard_error()
    isolate(memory_limit)
    try:
        outcome = task(*arguments)
    except MemoryError:
        outcome = Outcome("memory")
    sender.send(outcome)

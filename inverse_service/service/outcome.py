"""How a task in a worker ended, as plain data that crosses the process boundary."""

from __future__ import annotations

import signal
from dataclasses import dataclass
from typing import Any, Literal

Status = Literal["done", "refused", "deadline", "memory", "crash", "fault"]
# SIGABRT: FLINT and GMP abort when memory runs out; SIGKILL that is not ours: the kernel's killer.
MEMORY_SIGNALS = frozenset({signal.SIGABRT, getattr(signal, "SIGKILL", signal.SIGABRT)})


@dataclass(frozen=True, slots=True)
class Place:
    """One fault of the input: pointer into the document, column from 1, and a sentence."""

    detail: str
    pointer: str = ""
    column: int | None = None
    code: str = "bad-input"


@dataclass(frozen=True, slots=True)
class Outcome:
    """`done` has a value, `refused` has places, the others a detail for the log.

    deadline: stopped at its time limit; memory: at its memory limit; crash: the process died;
    fault: an error of this program.
    """

    status: Status
    value: Any = None
    places: tuple[Place, ...] = ()
    detail: str = ""


def outcome_of_exit(exitcode: int | None) -> Outcome:
    """What the exit code of a dead process says; negative codes are signals."""
    if exitcode is not None and -exitcode in MEMORY_SIGNALS:
        return Outcome("memory")
    return Outcome("crash", detail=f"worker process ended with exit code {exitcode}")

"""How a task in a worker ended, as plain data that crosses the process boundary.

Without slots, with which a frozen class takes several times as long to pickle.
"""

import logging
import signal
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from inverse_service import errors

log = logging.getLogger(__name__)
Status = Literal["done", "refused", "deadline", "memory", "killed", "crash", "fault", "cancelled", "unstarted"]
LIMITS: Final[Mapping[str, str]] = {"deadline": "time", "memory": "memory"}
KILL = getattr(signal, "SIGKILL", None)
OVER_CPU = getattr(signal, "SIGXCPU", None)


@dataclass(frozen=True)
class Usage:
    """What a task took: seconds of wall clock and of processor, peak memory in MiB."""

    wall: float = 0.0
    cpu: float = 0.0
    memory: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """`done` has a value, `refused` has places, the others a detail for the log.

    deadline: stopped at its time limit; memory: at its memory limit; killed: by a signal that was
    not ours, most often the kernel short of memory; crash: the process died of itself; fault: an
    error of this program; cancelled: stopped because nobody wants it any more; unstarted: there was
    no process to run it in, which says nothing of the task.
    """

    status: Status
    value: Any = None
    places: tuple[errors.Place, ...] = ()
    detail: str = ""
    spent: Usage = field(default=Usage(), compare=False)


@dataclass(frozen=True)
class Call:
    """What a worker is to do: `task(*arguments)` within `deadline` s and `memory_limit` MiB (None: the pool's).

    `reports`: the task takes a keyword `report` and calls it with what it is doing; "long": what one said that is done
    within a moment is not told. `client`: whose it is, so that nobody waits for the many of another. `priority`: the
    smaller one of a client goes first.
    """

    task: Callable[..., Any]
    arguments: tuple[Any, ...]
    deadline: float
    memory_limit: int | None = None
    reports: bool | Literal["long"] = False
    priority: int = 0
    client: str = ""


def guard(task: Callable[..., Any], *arguments: Any, **named: Any) -> Outcome:
    """Run it and say as data how it ended; nothing but process death gets past."""
    try:
        found = task(*arguments, **named)
    except errors.InputError as error:
        return Outcome("refused", places=error.places)
    except MemoryError:
        return Outcome("memory")
    except OverflowError:
        detail = "A number of this document leaves the range that can be computed with; write smaller numbers."
        return Outcome("refused", places=(errors.Place(detail, code="limit"),))
    except ImportError as error:
        missing = errors.missing_extra(error)
        return _fault(error) if missing is None else Outcome("refused", places=missing.places)
    except Exception as error:  # the boundary of the process: a fault of ours becomes data for the log
        return _fault(error)
    return found if isinstance(found, Outcome) else Outcome("done", found)


def _fault(error: Exception) -> Outcome:
    trace = "".join(traceback.format_exception(error))[-8000:]
    return Outcome("fault", value=f"{type(error).__name__}", detail=trace)


def value_of(outcome: Outcome) -> Any:
    """The value of a task that is done; raises DocumentRefused or WorkerFailed for the others."""
    if outcome.status == "done":
        return outcome.value
    if outcome.status == "refused":
        raise errors.DocumentRefused(outcome.places)
    log.error("task ended with %s: %s", outcome.status, outcome.detail)
    if outcome.status in LIMITS:
        raise errors.WorkerFailed(f"The work was stopped at its {LIMITS[outcome.status]} limit.")
    if outcome.status == "unstarted":
        raise errors.NoWorker("No worker process can be started; try again in some seconds.")
    kind = f" ({outcome.value})" if outcome.value else ""
    raise errors.WorkerFailed(f"The program failed on this document{kind}; this is an error in the program.")


def outcome_of_exit(exitcode: int | None) -> Outcome:
    """What the exit code of a dead process says; negative codes are signals.

    SIGABRT counts as memory: FLINT and GMP abort when an allocation fails.
    """
    signal_number = -exitcode if exitcode is not None and exitcode < 0 else None
    if signal_number is None:
        return Outcome("crash", detail=f"worker process ended with exit code {exitcode}")
    if signal_number == signal.SIGABRT:
        return Outcome("memory")
    if signal_number == OVER_CPU:
        return Outcome("deadline", detail="processor time")
    if signal_number == KILL:
        return Outcome("killed", detail="worker process was killed by somebody else")
    return Outcome("crash", detail=f"worker process ended with signal {signal_number}")

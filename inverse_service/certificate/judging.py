"""The verdict of a check, and the one place where a check ends."""

import random
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from .cell import Cell
from .formulas import Ended
from .numbers import Undefined, Unsettled
from .question import Tools


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The checker's verdict, and sentences that give its reasons."""

    verdict: Literal["valid", "incomplete", "invalid"]
    reasons: tuple[str, ...] = ()
    # For a valid certificate: where its claim is valid, where its formulas are, the parameters for
    # which it is not proven, and whether the theorem on one coordinate proves it beyond them.
    cell: Cell | None = None
    formulas: Cell | None = None
    exceptions: Sequence[str] = ()
    by_theorem: bool = False


def judged(
    work: Callable[[Tools], Iterable[str]], time_limit: float, seed: int | None
) -> CheckResult:
    """The result of the work as sentences, or the way it ended; no other exception leaves this
    function.
    """
    tools = Tools(random.Random(seed), time.thread_time() + time_limit)
    try:
        return CheckResult("valid", tuple(work(tools)))
    except Ended as end:
        return CheckResult(end.verdict, end.reasons)
    except (Undefined, Unsettled, StopIteration):
        return CheckResult("incomplete", ("A number in the document could not be computed.",))
    except (RecursionError, MemoryError, OverflowError):
        return CheckResult(
            "incomplete", ("The document is too large for the memory of the checker.",)
        )

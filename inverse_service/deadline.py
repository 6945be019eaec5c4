"""Limits for work: a moment or an amount of work, checked in long loops.

All moments of the solver are processor time of the working thread (`now`), so that it gets as far
on a busy machine as on an idle one. Callers use the wall clock to end a process that is stuck. Work
is counted, not timed, so that a search inside a search finds the same on every machine. One unit is
about ten microseconds on a machine of 2024.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

# The moment that it is, in s of processor time of this thread.
now = time.thread_time
_ENDS: ContextVar[float] = ContextVar("ends", default=float("inf"))
_HALF: ContextVar[float] = ContextVar("half", default=float("-inf"))
# The least time for a part of the work that has begun, in s.
LEAST = 0.1
# The cost of a point with its tensors, or of a residual, in addition to the nodes visited, in units
# of work.
STEP = 60


@dataclass(slots=True)
class _Work:
    """The remaining part of an amount of work."""

    left: int


_AMOUNTS: ContextVar[tuple[_Work, ...]] = ContextVar("amounts", default=())


class OutOfTime(Exception):
    """The time or the work for the search is used up; caught only where that limit was set."""


def left(moment: float, least: float = LEAST) -> float:
    """The seconds until a moment (`now`), at least `least`."""
    return max(least, moment - now())


@contextmanager
def whole(limit: float) -> Iterator[None]:
    """Within the block a question is answered that has so many seconds altogether."""
    token = _HALF.set(now() + limit / 2)
    try:
        yield
    finally:
        _HALF.reset(token)


def share(part: float, end: float) -> float:
    """The moment until which a decision may take this part of the time until `end`.

    In the first half of the `whole` time none has to leave some to others: what is decided by then
    without a limit is decided with it.
    """
    return max(now() + part * (end - now()), _HALF.get())


@contextmanager
def until(moment: float) -> Iterator[None]:
    """Within the block `check` fails after this moment (`now`), or an earlier one set outside."""
    token = _ENDS.set(min(moment, _ENDS.get()))
    try:
        yield
    finally:
        _ENDS.reset(token)


def end() -> float:
    """The moment (`now`) set outside."""
    return _ENDS.get()


@contextmanager
def within(work: int) -> Iterator[None]:
    """Within the block `check` fails after so much work, which also counts for the enclosing
    blocks.
    """
    token = _AMOUNTS.set((*_AMOUNTS.get(), _Work(work)))
    try:
        yield
    finally:
        _AMOUNTS.reset(token)


def check(work: int = 1) -> None:
    """Count so many units; OutOfTime where the time set or an amount of work is used up."""
    over = now() > _ENDS.get()
    for amount in _AMOUNTS.get():
        amount.left -= work
        over = over or amount.left < 0
    if over:
        raise OutOfTime("the time for the search is used up")

"""When work has to end: at a moment, or after an amount of work; looked at in long loops.

All moments of the solver are processor time of the thread that works (`now`), so that it goes as far on a busy machine
as on a quiet one. The wall clock is for those who wait: it ends a process that is stuck. Work is counted, not timed, so
that a search inside a search finds the same on every machine. One unit is about ten microseconds on a machine of 2024.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


@dataclass(slots=True)
class _Work:
    """What is left of an amount of work."""

    left: int


# The moment that it is, in s of processor time of this thread.
now = time.thread_time
_ENDS: ContextVar[float] = ContextVar("ends", default=float("inf"))
_AMOUNTS: ContextVar[tuple[_Work, ...]] = ContextVar("amounts", default=())
# A part of the work that is begun has at least so long, in s.
LEAST = 0.1
# What a point with its tensors, or a residual, takes besides what is walked through, in units of work.
STEP = 60


class OutOfTime(Exception):
    """The time or the work for the search is used up; caught where that amount was set, and nowhere between."""


def left(moment: float, least: float = LEAST) -> float:
    """The seconds until a moment (`now`), and no less than `least`."""
    return max(least, moment - now())


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
    """Within the block `check` fails after so much work, which counts for the blocks around it too."""
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

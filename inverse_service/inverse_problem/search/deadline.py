"""When a search has to end: after processor time, at a moment, or after work; looked at in its long loops.

The share of a search is processor time of its thread, so that it goes as far on a busy machine as on a quiet one; the
moment by the wall clock is the one at which the answer has to leave. Work is counted, not timed, so that a search
inside a search finds the same on every machine. One unit is about ten microseconds on a machine of 2024.
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


_ENDS: ContextVar[float] = ContextVar("ends", default=float("inf"))
_SPENT: ContextVar[float] = ContextVar("spent", default=float("inf"))
_AMOUNTS: ContextVar[tuple[_Work, ...]] = ContextVar("amounts", default=())


class OutOfTime(Exception):
    """The time or the work for the search is used up; caught where that amount was set, and nowhere between."""


@contextmanager
def until(moment: float, seconds: float = float("inf")) -> Iterator[None]:
    """Within the block `check` fails after this moment (time.monotonic), or an earlier one set outside.

    It also fails after so many seconds of processor time of this thread, those of blocks inside included.
    """
    token = _ENDS.set(min(moment, _ENDS.get()))
    spent = _SPENT.set(min(time.thread_time() + seconds, _SPENT.get()))
    try:
        yield
    finally:
        _ENDS.reset(token)
        _SPENT.reset(spent)


def end() -> float:
    """The moment (time.monotonic) set outside."""
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
    over = time.monotonic() > _ENDS.get() or time.thread_time() > _SPENT.get()
    for amount in _AMOUNTS.get():
        amount.left -= work
        over = over or amount.left < 0
    if over:
        raise OutOfTime("the time for the search is used up")

"""When a search has to end: at a moment set from outside, or after an amount of work, looked at in its long loops.

Work is counted, not timed, so that a search inside a search finds the same on every machine and under
every load. One unit is about ten microseconds on a machine of 2024.
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
_AMOUNTS: ContextVar[tuple[_Work, ...]] = ContextVar("amounts", default=())


class OutOfTime(Exception):
    """The time or the work for the search is used up; caught where that amount was set, and nowhere between."""


@contextmanager
def until(moment: float) -> Iterator[None]:
    """Within the block `check` fails after this moment (time.monotonic), or an earlier one set outside."""
    token = _ENDS.set(min(moment, _ENDS.get()))
    try:
        yield
    finally:
        _ENDS.reset(token)


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
    """Count so many units; OutOfTime after the moment set, or where an amount of work is used up."""
    over = time.monotonic() > _ENDS.get()
    for amount in _AMOUNTS.get():
        amount.left -= work
        over = over or amount.left < 0
    if over:
        raise OutOfTime("the time for the search is used up")

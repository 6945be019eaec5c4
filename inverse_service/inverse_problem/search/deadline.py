"""The moment at which a search has to end, looked at inside its long loops."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from inverse_service.errors import IrreducibleAtoms

_ENDS: ContextVar[float] = ContextVar("ends", default=float("inf"))
_USED_UP: ContextVar[float] = ContextVar("used up", default=float("inf"))


class OutOfTime(IrreducibleAtoms):
    """The time for the search is used up; an ansatz then counts as one that found nothing."""

    code = "out-of-time"


@contextmanager
def until(moment: float) -> Iterator[None]:
    """Within the block `check` fails after this moment (time.monotonic), or an earlier one set outside."""
    token = _ENDS.set(min(moment, _ENDS.get()))
    try:
        yield
    finally:
        _ENDS.reset(token)


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Within the block `check` fails after so much processor time, which other programs do not shorten."""
    token = _USED_UP.set(min(time.process_time() + seconds, _USED_UP.get()))
    try:
        yield
    finally:
        _USED_UP.reset(token)


def check() -> None:
    """Raise OutOfTime after the moment set, or where the processor time is used up."""
    if time.monotonic() > _ENDS.get() or time.process_time() > _USED_UP.get():
        raise OutOfTime("the time for the search is used up")

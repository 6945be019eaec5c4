"""The moment at which a search has to end, looked at inside its long loops."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from inverse_service.errors import IrreducibleAtoms

_ENDS: ContextVar[float] = ContextVar("ends", default=float("inf"))


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


def check() -> None:
    """Raise OutOfTime after the moment set."""
    if time.monotonic() > _ENDS.get():
        raise OutOfTime("the time for the search is used up")

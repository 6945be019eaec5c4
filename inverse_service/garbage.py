"""Cyclic garbage is looked for seldom while a question is answered.

With Python's 700 new objects between collections, the expressions that an answer keeps for later
are looked through so often that this takes up to a tenth of the time, and half of a long search
late in a worker's life. What has no cycles is freed at once as ever.
"""

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

# Objects made between collections.
BETWEEN_COLLECTIONS = 250_000


def look_seldom() -> None:
    """From now on, in a process that has no other work."""
    gc.set_threshold(BETWEEN_COLLECTIONS, 10, 10)


@dataclass(slots=True)
class _Askers:
    """How many blocks of `seldom` have begun and not ended, and the thresholds before them."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    count: int = 0
    before: tuple[int, int, int] = (0, 0, 0)


_ASKERS = _Askers()


@contextmanager
def seldom() -> Iterator[None]:
    """Within the block, in a process of which others use the rest.

    The last of several threads restores what was set before the first. A process that collects
    more seldom, or not at all (0), is left alone.
    """
    with _ASKERS.lock:
        _ASKERS.count += 1
        if _ASKERS.count == 1:
            _ASKERS.before = gc.get_threshold()
            if 0 < _ASKERS.before[0] < BETWEEN_COLLECTIONS:
                look_seldom()
    try:
        yield
    finally:
        with _ASKERS.lock:
            _ASKERS.count -= 1
            if not _ASKERS.count and gc.get_threshold() != _ASKERS.before:
                gc.set_threshold(*_ASKERS.before)

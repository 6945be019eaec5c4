"""One function over many items on all cores, by processes forked from this one, until a deadline.

Forked children share what was computed before the fork, and need no new imports. They die with their
parent, so that a task that is killed leaves none behind. Where there is no fork, the items are done here.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import pickle
import selectors
import signal
import struct
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

_PR_SET_PDEATHSIG = 1
_HEADER = struct.Struct("!Q")
# A child sends its results in batches of about so many seconds.
_BATCH = 0.2


def cores() -> int:
    """The processors that this process may use."""
    with contextlib.suppress(AttributeError, OSError):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


@dataclass(slots=True)
class _Child(Generic[R]):
    """A process at work on every k-th item, and what came from it so far."""

    number: int
    stream: int
    received: bytearray = field(default_factory=bytearray)


def forked_map(
    function: Callable[[T], R],
    items: Sequence[T],
    deadline: float = float("inf"),
    progress: Callable[[int], None] | None = None,
    processes: int | None = None,
) -> list[R | None]:
    """[function(item), …]; None for an item not done at the deadline (time.monotonic).

    `progress` is told how many items are done. An exception of the function in a child ends that child;
    its items stay None. Results cross a pipe as pickles that this program wrote itself.
    """
    report = progress or (lambda _: None)
    count = min(processes or cores(), len(items))
    if count < 2 or not hasattr(os, "fork"):
        return _here(function, items, deadline, report)
    results: list[R | None] = [None] * len(items)
    children: list[_Child[R]] = []
    try:
        for k in range(count):
            children.append(_start(function, items, (k, count), deadline, children))
        _collect(children, results, deadline, report)
    finally:
        for child in children:
            _end(child)
    return results


def _here(
    function: Callable[[T], R], items: Sequence[T], deadline: float, report: Callable[[int], None]
) -> list[R | None]:
    results: list[R | None] = [None] * len(items)
    for k, item in enumerate(items):
        if time.monotonic() > deadline:
            break
        results[k] = function(item)
        report(k + 1)
    return results


def _start(
    function: Callable[[T], R], items: Sequence[T], part: tuple[int, int], deadline: float, others: Sequence[_Child[R]]
) -> _Child[R]:
    """Fork a child that does items part[0], part[0] + part[1], …"""
    reader, writer = os.pipe()
    with warnings.catch_warnings():
        # Newer Pythons warn of any thread of the process; those of numerical libraries survive a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        number = os.fork()
    if number:
        os.close(writer)
        return _Child(number, reader)
    status = 1
    try:
        _prepare([reader, *(child.stream for child in others)])
        _work(function, items, part, deadline, writer)
        status = 0
    finally:
        os._exit(status)


def _prepare(streams: Sequence[int]) -> None:
    """In the child: close what belongs to others, die with the parent, die at SIGTERM."""
    for stream in streams:
        os.close(stream)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _work(function: Callable[[T], R], items: Sequence[T], part: tuple[int, int], deadline: float, stream: int) -> None:
    batch: list[tuple[int, R]] = []
    sent = time.monotonic()
    for k in range(part[0], len(items), part[1]):
        if time.monotonic() > deadline:
            break
        batch.append((k, function(items[k])))
        if time.monotonic() - sent > _BATCH:
            _send(stream, batch)
            batch, sent = [], time.monotonic()
    _send(stream, batch)


def _send(stream: int, batch: Any) -> None:
    data = pickle.dumps(batch)
    left = memoryview(_HEADER.pack(len(data)) + data)
    while left:
        left = left[os.write(stream, left) :]


def _collect(
    children: Sequence[_Child[R]], results: list[R | None], deadline: float, report: Callable[[int], None]
) -> None:
    done = 0
    with selectors.DefaultSelector() as selector:
        for child in children:
            selector.register(child.stream, selectors.EVENT_READ, child)
        while selector.get_map():
            # A child looks at the deadline between items; one that is late by a second is not waited for.
            wait = None if deadline == float("inf") else max(0.0, deadline + 1.0 - time.monotonic())
            ready = selector.select(wait)
            if not ready:
                return
            for key, _ in ready:
                data = os.read(key.fd, 1 << 20)
                if not data:
                    selector.unregister(key.fd)
                    continue
                key.data.received += data
                done += _unpack(key.data, results)
            report(done)


def _unpack(child: _Child[R], results: list[R | None]) -> int:
    """Take the complete batches off what was received; the number of results in them."""
    count = 0
    while len(child.received) >= _HEADER.size:
        (length,) = _HEADER.unpack_from(child.received)
        end = _HEADER.size + length
        if len(child.received) < end:
            break
        for place, value in pickle.loads(bytes(child.received[_HEADER.size : end])):
            results[place] = value
            count += 1
        del child.received[:end]
    return count


def _end(child: _Child[R]) -> None:
    os.close(child.stream)
    with contextlib.suppress(ProcessLookupError):
        os.kill(child.number, signal.SIGKILL)
    with contextlib.suppress(ChildProcessError):
        os.waitpid(child.number, 0)

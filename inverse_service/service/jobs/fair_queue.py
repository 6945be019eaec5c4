"""Tasks that wait for a process: the client with the fewest running ones is next, with its most urgent task."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections import Counter
from typing import Generic, TypeVar

T = TypeVar("T")
NO_SHARE = 1_000_000


class FairQueue(Generic[T]):
    """Safe to use from any thread. Of one client at most `share` tasks are out at a time, until they are `done`."""

    def __init__(self, share: int = NO_SHARE) -> None:
        self._share = share
        self._waiting: dict[str, list[tuple[int, int, T]]] = {}
        self._out: Counter[str] = Counter()
        self._numbers = itertools.count()
        self._changed = threading.Condition()
        self._closed = False

    def put(self, client: str, priority: int, task: T) -> bool:
        """Let a task wait; the smaller `priority` goes first. False where the queue is closed."""
        with self._changed:
            if not self._closed:
                heapq.heappush(self._waiting.setdefault(client, []), (priority, next(self._numbers), task))
                self._changed.notify()
            return not self._closed

    def get(self, seconds: float) -> tuple[str, T] | None:
        """The next task and its client; None where none comes in so many seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._next() is not None, seconds)
            client = self._next()
            if client is None:
                return None
            task = heapq.heappop(self._waiting[client])[2]
            if not self._waiting[client]:
                del self._waiting[client]
            self._out[client] += 1
            return client, task

    def done(self, client: str) -> None:
        """A task that `get` gave ended."""
        with self._changed:
            self._out[client] -= 1
            if not self._out[client]:
                del self._out[client]
            self._changed.notify()

    @property
    def length(self) -> int:
        """How many tasks wait."""
        with self._changed:
            return sum(len(tasks) for tasks in self._waiting.values())

    def remove(self, client: str, task: T) -> None:
        """Forget a task that waits; nothing happens where it does not."""
        with self._changed:
            left = [entry for entry in self._waiting.get(client, ()) if entry[2] is not task]
            heapq.heapify(left)
            self._waiting[client] = left
            if not left:
                del self._waiting[client]

    def close(self) -> list[T]:
        """Take no more and wake all that wait in `get`; the tasks that nobody gets."""
        with self._changed:
            self._closed = True
            left = [task for tasks in self._waiting.values() for _, _, task in tasks]
            self._waiting.clear()
            self._changed.notify_all()
            return left

    def _next(self) -> str | None:
        able = [client for client in self._waiting if self._out[client] < self._share]
        return min(able, key=lambda client: (self._out[client], self._waiting[client][0][:2]), default=None)

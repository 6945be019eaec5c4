"""The one thread that writes to a SQLite file."""

from __future__ import annotations

import queue
import sqlite3
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")
MOST_AT_ONCE = 200
SAVE, UNDO, KEEP = "SAVEPOINT change", "ROLLBACK TO change", "RELEASE change"


@dataclass(frozen=True, slots=True)
class _Change:
    """A function of the connection, whether it must be on the disk before it counts, and its answer."""

    function: Callable[[sqlite3.Connection], Any]
    durable: bool
    answer: Future[Any]


class Writer:
    """The one thread that writes: changes that wait at the same time share one commit, and so one fsync."""

    def __init__(self, connection: sqlite3.Connection, durable: bool = True) -> None:
        self._connection = connection
        self._durable = durable
        self._changes: queue.SimpleQueue[_Change | None] = queue.SimpleQueue()
        self._closed = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="store-writer", daemon=True)
        self._thread.start()

    def write(self, function: Callable[[sqlite3.Connection], T], durable: bool = True) -> T:
        """Run it, commit, return its value; its exception where it raises one (nothing is changed then)."""
        answer: Future[T] = Future()
        with self._lock:
            if self._closed:
                raise sqlite3.ProgrammingError("the store is closed")
            self._changes.put(_Change(function, durable, answer))
        return answer.result()

    def close(self) -> None:
        """Finish what waits and close the connection."""
        with self._lock:
            if not self._closed:
                self._closed = True
                self._changes.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (first := self._changes.get()) is not None:
            changes, last = self._waiting(first)
            self._commit(changes)
            if last:
                break
        self._connection.close()

    def _waiting(self, first: _Change) -> tuple[list[_Change], bool]:
        changes = [first]
        while len(changes) < MOST_AT_ONCE and not self._changes.empty():
            change = self._changes.get()
            if change is None:
                return changes, True
            changes.append(change)
        return changes, False

    def _commit(self, changes: list[_Change]) -> None:
        durable = self._durable and any(change.durable for change in changes)
        ended: list[tuple[_Change, Any, Exception | None]] = []
        try:
            self._connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
            self._connection.execute("BEGIN IMMEDIATE")
            ended = [self._apply(change) for change in changes]
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:  # disk full, for example: none of them happened
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            ended = [(change, None, error) for change in changes]
        for change, value, problem in ended:
            if problem is None:
                change.answer.set_result(value)
            else:
                change.answer.set_exception(problem)

    def _apply(self, change: _Change) -> tuple[_Change, Any, Exception | None]:
        self._connection.execute(SAVE)
        try:
            value = change.function(self._connection)
        except Exception as error:  # handed to the caller, who is in another thread
            self._connection.execute(UNDO)
            self._connection.execute(KEEP)
            return change, None, error
        self._connection.execute(KEEP)
        return change, value, None

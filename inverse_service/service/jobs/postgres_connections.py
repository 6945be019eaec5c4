"""Connections to PostgreSQL that are shared by threads and made anew when the server went away."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

import psycopg
from psycopg.rows import dict_row

from inverse_service.service.jobs.model import StoreUnavailable
from inverse_service.service.jobs.postgres_schema import prepare

T = TypeVar("T")
Row = dict[str, Any]
Connection = psycopg.Connection[Row]
MOST = 8
# A server that is started again is back within this time (s); what waits for it does not fail.
PATIENCE = 15.0
CONNECT_TIMEOUT = 10
LOST = (psycopg.OperationalError, psycopg.InterfaceError)
CONFLICT = (psycopg.errors.DeadlockDetected, psycopg.errors.SerializationFailure)


class Connections:
    """At most MOST connections; a thread has one for the time of one transaction."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._idle: list[Connection] = []
        self._free = threading.BoundedSemaphore(MOST)
        self._lock = threading.Lock()
        self._closed = False
        first = connect(address)
        prepare(first)
        self._idle.append(first)

    def write(self, function: Callable[[Connection], T], durable: bool = True) -> T:
        """Run it in a transaction and return its value after the commit.

        It runs again where the connection broke, so it must bear that a first run was committed.
        Raises what it raises, with everything undone; StoreUnavailable where the server stays away.
        """

        def transaction(connection: Connection) -> T:
            # In a pipeline, statements whose rows nobody waits for cost no way to the server and back.
            with connection.pipeline(), connection.transaction():
                if not durable:
                    connection.execute("SET LOCAL synchronous_commit TO off")
                return function(connection)

        return self._insist(transaction)

    def read(self, function: Callable[[Connection], T]) -> T:
        """Run it without a transaction around it."""
        return self._insist(function)

    def close(self) -> None:
        """Close all that are idle, and the others when they come back."""
        with self._lock:
            self._closed = True
            idle, self._idle = self._idle, []
        for connection in idle:
            connection.close()

    def _insist(self, function: Callable[[Connection], T]) -> T:
        end = time.monotonic() + PATIENCE
        pause = 0.02
        while True:
            try:
                with self._free:
                    return self._once(function)
            except (*LOST, *CONFLICT) as error:
                if self._closed or time.monotonic() + pause > end:
                    raise StoreUnavailable(f"The database does not answer ({type(error).__name__}).") from error
            time.sleep(pause)
            pause = min(1.0, 2 * pause)

    def _once(self, function: Callable[[Connection], T]) -> T:
        connection = self._take()
        try:
            return function(connection)
        finally:
            self._give_back(connection)

    def _take(self) -> Connection:
        with self._lock:
            if self._closed:
                raise StoreUnavailable("The store is closed.")
            if self._idle:
                return self._idle.pop()
        return connect(self._address)

    def _give_back(self, connection: Connection) -> None:
        with self._lock:
            if not (connection.closed or connection.broken or self._closed):
                self._idle.append(connection)
                return
            broken = connection.broken
            stale, self._idle = (self._idle, []) if broken else ([], self._idle)
        for each in (connection, *stale):  # the server went away for all of them
            each.close()


def connect(address: str) -> Connection:
    """A connection in autocommit mode that sees our schema; raises psycopg.OperationalError."""
    connection = psycopg.connect(
        address, autocommit=True, row_factory=dict_row, connect_timeout=CONNECT_TIMEOUT,
        application_name="inverse-service", keepalives_idle=30, keepalives_interval=10, keepalives_count=3,
    )  # fmt: skip
    connection.execute("SET search_path TO inverse_service")
    return connection

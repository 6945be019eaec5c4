"""News of changes between front ends: each tells the others by NOTIFY, and listens on one connection."""

from __future__ import annotations

import contextlib
import logging
import threading
import uuid
from collections.abc import Callable, Iterable

import psycopg

from inverse_service.service.jobs.postgres_connections import Connection, connect

log = logging.getLogger(__name__)
CHANNEL = "inverse_service_changes"
LOOK = 0.1
PAUSE = 1.0
# Above this many changes at once one message says that something changed.
MOST = 50


class Changes:
    """Calls listeners with the ids of jobs that changed, here or in another front end."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._origin = uuid.uuid4().hex
        self._listeners: list[Callable[[str], None]] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="store-changes", daemon=True)
        self._thread.start()

    def on_change(self, listener: Callable[[str], None]) -> None:
        """Call it from now on; an empty id says that something changed."""
        self._listeners.append(listener)

    def announce(self, connection: Connection, ids: Iterable[str]) -> None:
        """Tell the others, when the transaction is committed."""
        told = list(ids)
        if told:
            notices = [f"{self._origin}:{id}" for id in (told if len(told) <= MOST else [""])]
            connection.execute("SELECT pg_notify(%s, notice) FROM unnest(%s::text[]) AS notice", (CHANNEL, notices))

    def tell(self, ids: Iterable[str]) -> None:
        """Call the listeners of this process."""
        for id in ids:
            for listener in self._listeners:
                listener(id)

    def close(self) -> None:
        """Stop listening."""
        self._stopping.set()
        self._thread.join()

    def _listen(self) -> None:
        while not self._stopping.is_set():
            try:
                with contextlib.closing(connect(self._address)) as connection:
                    self._hear(connection)
            except psycopg.Error as error:
                log.warning("news of other front ends are interrupted (%s)", type(error).__name__)
                self._stopping.wait(PAUSE)

    def _hear(self, connection: Connection) -> None:
        connection.execute(f"LISTEN {CHANNEL}")
        self.tell([""])  # whatever changed while nobody listened
        while not self._stopping.is_set():
            for notice in connection.notifies(timeout=LOOK):
                origin, _, id = notice.payload.partition(":")
                if origin != self._origin:
                    self.tell([id])
                if self._stopping.is_set():
                    return

"""The process that holds the killable workers on a machine of a cluster.

It is a program of its own because a Dask worker under a nanny is daemonic and may have no children
of the multiprocessing kind. It ends when its connection does: a Dask worker that is killed closes
it, and the death signal of `workers` takes the workers with it.

    python -m inverse_service.service.cluster.host DESCRIPTOR COUNT MEMORY_LIMIT
"""

from __future__ import annotations

import contextlib
import sys
import threading
from concurrent.futures import Future
from multiprocessing.connection import Connection
from typing import Any

from inverse_service.service.cluster import remote
from inverse_service.service.jobs.outcome import Outcome
from inverse_service.service.jobs.workers import Running, Workers


class Host:
    """Performs what comes over the connection until the connection ends."""

    def __init__(self, connection: Connection, count: int, memory_limit: int) -> None:
        self._connection = connection
        self._sending = threading.Lock()
        self._workers = Workers(count, memory_limit)
        self._under_way: dict[str, Running] = {}

    def serve(self) -> None:
        """Until the other side is gone; the workers are dead then."""
        self._workers.start()
        try:
            while True:
                self._perform(self._connection.recv())
        except (EOFError, OSError):
            return
        finally:
            self._workers.stop()

    def _perform(self, message: remote.Order | remote.Cancel) -> None:
        if isinstance(message, remote.Cancel):
            if (running := self._under_way.get(message.key)) is not None:
                running.cancel()
            return
        key = message.key
        running = self._workers.submit(message.call, lambda value: self._send(remote.REPORT, key, value))
        self._under_way[key] = running
        running.outcome.add_done_callback(lambda done: self._end(key, done))

    def _end(self, key: str, done: Future[Outcome]) -> None:
        self._under_way.pop(key, None)
        self._send(remote.DONE, key, done.result())

    def _send(self, kind: str, key: str, value: Any) -> None:
        with self._sending, contextlib.suppress(OSError):
            self._connection.send((kind, key, value))


def main() -> None:
    descriptor, count, memory_limit = map(int, sys.argv[1:])
    Host(Connection(descriptor), count, memory_limit).serve()


if __name__ == "__main__":
    main()

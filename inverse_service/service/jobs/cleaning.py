"""Forgets old answers now and then, by age and by size."""

from __future__ import annotations

import logging
import threading
import time

from inverse_service.service.jobs.store import JobStore

log = logging.getLogger(__name__)
FIRST, INTERVAL = 30.0, 600.0


class Cleaner:
    """A thread that prunes the store to answers younger than `age` s and at most `size` bytes."""

    def __init__(self, store: JobStore, age: float, size: int) -> None:
        self._store, self._age, self._size = store, age, size
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="cleaner", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stopping.set()
        self._thread.join(10)

    def _run(self) -> None:
        seconds = FIRST
        while not self._stopping.wait(seconds):
            seconds = INTERVAL
            try:
                forgotten = self._store.prune(time.time() - self._age, self._size)
            except Exception:  # the store may be away for a while; the next round tries again
                log.exception("old jobs could not be forgotten")
                continue
            if forgotten:
                log.info("old jobs forgotten", extra={"jobs": forgotten})

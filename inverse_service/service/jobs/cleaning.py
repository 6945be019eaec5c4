"""Forgets old answers now and then, by age and by size."""

from __future__ import annotations

import logging
import threading
import time

from inverse_service.service.jobs.store import JobStore

log = logging.getLogger(__name__)
FIRST, INTERVAL = 30.0, 600.0
# A clock that went forward by more than this since the last look, or since the newest job, is not believed for a day.
JUMP, DISTRUST = 86_400.0, 86_400.0


class Cleaner:
    """A thread that prunes the store to answers younger than `age` s and at most `size` bytes."""

    def __init__(self, store: JobStore, age: float, size: int) -> None:
        self._store, self._age, self._size = store, age, size
        self._offset = time.time() - time.monotonic()
        self._believed = 0.0
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
                forgotten = self._store.prune(self._oldest(), self._size)
            except Exception:  # the store may be away for a while; the next round tries again
                log.exception("old jobs could not be forgotten")
                continue
            if forgotten:
                log.info("old jobs forgotten", extra={"jobs": forgotten})

    def _oldest(self) -> float:
        """What ended before is forgotten: nothing by its age while the clock may be wrong."""
        newest, _ = self._store.jobs(limit=1)
        offset, self._offset = self._offset, time.time() - time.monotonic()
        is_first = self._believed == 0.0
        jumped = self._offset - offset > JUMP or (is_first and any(time.time() - job.created > JUMP for job in newest))
        if jumped:
            log.warning("the clock went forward, or nothing was asked for a day: nothing is forgotten by age for a day")
        if jumped or is_first:
            self._believed = time.monotonic() + (DISTRUST if jumped else 0.0)
        return time.time() - self._age if time.monotonic() >= self._believed else 0.0

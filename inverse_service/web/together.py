"""Questions that come while others are stored are stored after them, together in one commit."""

import asyncio
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

from inverse_service.service.jobs import model

# Questions of one commit.
MOST = 200


class _Asked(NamedTuple):
    """A question, and who waits until it is stored."""

    request: model.JobRequest
    stored: asyncio.Future[model.Job | None]


class Together:
    """Threads that call `store` with the questions that have come meanwhile.

    Make it on the loop. `store` gives by id the jobs of those that are new; where it raises, each
    of its questions is told.
    """

    def __init__(
        self, store: Callable[[Sequence[model.JobRequest]], dict[str, model.Job]], threads: int
    ) -> None:
        self._store = store
        self._loop = asyncio.get_running_loop()
        self._changed = threading.Condition()
        self._asked, self._is_stopped = list[_Asked](), False
        for number in range(threads):
            threading.Thread(target=self._work, name=f"questions-{number}", daemon=True).start()

    def submit(self, request: model.JobRequest) -> asyncio.Future[model.Job | None]:
        """The job of a question that is new, else None."""
        stored = self._loop.create_future()
        with self._changed:
            self._asked.append(_Asked(request, stored))
            self._changed.notify()
        return stored

    def stop(self) -> None:
        """Store no more; those that wait are told nothing, as their loop ends."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._asked or self._is_stopped)
                if self._is_stopped:
                    return
                some, self._asked = self._asked[:MOST], self._asked[MOST:]
            found, fault = dict[str, model.Job](), None
            try:
                found = self._store([asked.request for asked in some])
            except Exception as error:
                fault = error
            with suppress(RuntimeError):  # the loop has ended, and with it whoever waited
                self._loop.call_soon_threadsafe(_tell, some, found, fault)


def _tell(some: Sequence[_Asked], found: dict[str, model.Job], fault: Exception | None) -> None:
    """Of two that asked the same, one is told of the new job; the other reads it."""
    for request, stored in some:
        if stored.done():
            continue
        if fault is not None:
            stored.set_exception(fault)
        else:
            stored.set_result(found.pop(request.id, None))

"""Tells waiting requests that a job changed; changes come from threads of the store."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

# Who waits for any job at all: the streams of batches.
ANY = "*"


class Hub:
    """One asyncio.Event for each waiting request, by the id of the job it waits for."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: dict[str, set[asyncio.Event]] = defaultdict(set)
        self.closing = False

    def tell(self, id: str) -> None:
        """The job changed; may be called from any thread."""
        if id in self._waiting or ANY in self._waiting:
            self._loop.call_soon_threadsafe(self._set, id)

    def close(self) -> None:
        """The service stops: everybody who waits goes on and looks at `closing`."""
        self.closing = True
        self._loop.call_soon_threadsafe(self._set_all)

    @contextmanager
    def waiting(self, id: str) -> Iterator[asyncio.Event]:
        """An event that is set at each change; its user clears it before looking at the store."""
        event = asyncio.Event()
        self._waiting[id].add(event)
        try:
            yield event
        finally:
            self._waiting[id].discard(event)
            if not self._waiting[id]:
                del self._waiting[id]

    def _set(self, id: str) -> None:
        for key in (id, ANY):
            for event in self._waiting.get(key, ()):
                event.set()

    def _set_all(self) -> None:
        for events in self._waiting.values():
            for event in events:
                event.set()


async def until_set(event: asyncio.Event, seconds: float) -> bool:
    """Wait at most so long; whether it was set."""
    try:
        async with asyncio.timeout(seconds):
            await event.wait()
    except TimeoutError:
        return False
    return True

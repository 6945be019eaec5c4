"""Answers that come line by line: what is understood of them, and when a stream is begun again.

A stream may break at any byte (a proxy, a restart of the service). It is asked for again then, and
nothing is handed out twice.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

from api_schemas.job import FINAL
from inverse_service.client.calls import Call
from inverse_service.client.flows import batch_path, job_path
from inverse_service.client.reading import BatchAnswer, Event, EventReader, batch_answer, unexpected

Item = TypeVar("Item", covariant=True)


class Reader(Protocol[Item]):
    """Turns the lines of a stream into items; `done` says that there is no need to ask again.

    `status_path` is the address that tells whether what the stream is about is final.
    """

    done: bool
    status_path: str

    def call(self) -> Call:
        """The request of the stream, or of what is still missing of it."""

    def feed(self, line: str) -> Item | None:
        """The item that a line completes, if it completes a new one."""

    def close(self) -> None:
        """The stream ended whole and nothing will be added; raises UnexpectedAnswer if something is missing."""


class Lines:
    """Whole lines from bytes as they come. Only a line feed ends one: JSON may hold U+2028 and its like."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """The lines that are whole now, without their ends."""
        *whole, self._rest = (self._rest + data).split(b"\n")
        return [line.removesuffix(b"\r").decode("utf-8", "replace") for line in whole]


class JobEvents:
    """The events of a job up to its last one."""

    def __init__(self, job_id: str) -> None:
        self.status_path = job_path(job_id)
        self._path = f"{self.status_path}/events"
        self._reader = EventReader()
        self.done = False

    def call(self) -> Call:
        last = self._reader.last_id
        self._reader = EventReader(last)
        headers = {"Accept": "text/event-stream", **({"Last-Event-ID": last} if last else {})}
        return Call("GET", self._path, headers=headers)

    def feed(self, line: str) -> Event | None:
        event = self._reader.feed(line)
        if event is not None and event.data.get("status") in FINAL:
            self.done = True
        return event

    def close(self) -> None:
        """The last event was lost; there is nothing to miss."""


class BatchResults:
    """The answers of a batch as they come, each one once."""

    def __init__(self, batch_id: str, total: int) -> None:
        self.status_path = batch_path(batch_id)
        self._path = f"{self.status_path}/results"
        self._total = total
        self._seen: set[Any] = set()
        self.done = total == 0

    def call(self) -> Call:
        return Call("GET", self._path)

    def feed(self, line: str) -> BatchAnswer | None:
        if not line.strip():
            return None
        answer = batch_answer(line)
        key = ("line", answer.line) if answer.line is not None else ("id", answer.id)
        if key in self._seen:
            return None
        self._seen.add(key)
        self.done = len(self._seen) >= self._total
        return answer

    def close(self) -> None:
        missing = self._total - len(self._seen)
        if missing:
            raise unexpected(f"lacks {missing} of {self._total} results of a finished batch")

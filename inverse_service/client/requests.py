"""Requests and answers as plain data, and the rule by which a request is repeated.

A flow is a generator that yields steps and is sent what comes of them: an Open the head of an answer, a More the next
bytes of its body. The two clients only differ in how they perform these. Every call may be repeated, also POST: a
job's id is a hash of its question, so asking twice computes once.
"""

from __future__ import annotations

import email.utils
import random
import time
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeVar

from inverse_service.client.decoding import ServiceBusy, ServiceUnreachable, problem_of, unexpected

BUSY: Final = frozenset({429, 502, 503, 504})
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
JITTER = 1.25
LOOK_AGAIN = 0.5
# The largest answers of the service have a tenth of it. After its first seconds a body may come this slowly.
LARGEST_BODY = 512 * 2**20
BODY_GRACE, BYTES_A_SECOND = 60.0, 10_000
NDJSON: Final = "application/x-ndjson"


@dataclass(frozen=True, slots=True)
class Call:
    """One HTTP request; `path` is absolute or a whole URL of the same service, `timeout` (s) less than the client's."""

    method: str
    path: str
    body: bytes | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    timeout: float | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """One HTTP response; the names of `headers` are in small letters."""

    status: int
    headers: Mapping[str, str]
    body: bytes = b""


@dataclass(frozen=True, slots=True)
class Pause:
    """Do nothing for so many seconds."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Open:
    """Send a call: the Answer without its body. One answer is open at a time."""

    call: Call


@dataclass(frozen=True, slots=True)
class More:
    """The next bytes of the body that is open; none at its end."""


@dataclass(frozen=True, slots=True)
class Item:
    """Something for the caller."""

    value: Any


Value = TypeVar("Value")
Flow = Generator[Open | More | Pause | Item, Any, Value]


def exchange(call: Call, patience: float) -> Flow[Answer]:
    """The answer of a call, repeated with pauses while the service is busy or away.

    Raises ServiceBusy or ServiceUnreachable when the next pause would pass `patience` s.
    """
    repetition = Repetition(patience)
    while True:
        try:
            answer: Answer = yield Open(call)
            answer = replace(answer, body=(yield from body_of(call)))
        except ServiceUnreachable as error:
            yield repetition.pause_after(error)
            continue
        if answer.status not in BUSY:
            return answer
        yield repetition.pause_after(ServiceBusy(answer.status, problem_of(answer.status, answer.body)), answer.headers)


def body_of(call: Call) -> Flow[bytes]:
    """The whole body of the answer that is open. Raises UnexpectedAnswer where it has no end in size or time."""
    body, began = bytearray(), time.monotonic()
    while data := (yield More()):
        body += data
        if len(body) > LARGEST_BODY:
            raise unexpected(f"has more than {LARGEST_BODY} bytes")
        if time.monotonic() - began > BODY_GRACE + len(body) / BYTES_A_SECOND:
            raise ServiceUnreachable("The answer comes too slowly.")
    return bytes(body)


class Repetition:
    """Pauses that double up to LONGEST_PAUSE, or as long as Retry-After asks; `patience` s in all."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        """The call went well: the next failure is a first one."""
        self._end = time.monotonic() + self._patience
        self._pauses = pauses(FIRST_PAUSE, LONGEST_PAUSE)

    def pause_after(self, failure: ServiceBusy | ServiceUnreachable, headers: Mapping[str, str] = {}) -> Pause:
        """How long to wait before the next attempt; raises `failure` when patience is at its end."""
        # Not all who were refused together come back together.
        seconds = max(next(self._pauses), retry_after(headers) or 0.0) * random.uniform(1.0, JITTER)
        if time.monotonic() + seconds > self._end:
            raise failure
        return Pause(seconds)


def pauses(first: float, longest: float) -> Iterator[float]:
    """first, 2 first, 4 first, ..., longest, longest, ..."""
    while True:
        yield first
        first = min(2 * first, longest)


def retry_after(headers: Mapping[str, str]) -> float | None:
    """The seconds of Retry-After, which is a number or a date (RFC 9110); None without a usable one."""
    text = headers.get("retry-after", "").strip()
    if text.isascii() and text.isdigit() and len(text) < 9:
        return float(text)
    try:
        moment = email.utils.parsedate_to_datetime(text)
    except (TypeError, ValueError):
        return None
    return max(0.0, moment.timestamp() - time.time())

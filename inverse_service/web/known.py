"""Answers that were given a moment ago, found by the bytes of the question before any process or store is asked."""

from __future__ import annotations

import hashlib
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass

from inverse_service.service.jobs import model

# How long, in seconds, an answer is given without asking the store, even if it was erased there.
KEPT = 5.0
# Bytes of all answers, and of one; larger ones are read in parts. To compress one of 7 kB takes 0.3 ms of processor
# time, as much as all else that its giving takes.
MOST_BYTES, LARGEST = 64 * 2**20, 256 * 2**10


@dataclass(frozen=True, slots=True)
class KnownAnswer:
    """The answer to a question: the job it is of, its headers, its body, and until when it is given."""

    job: str
    headers: dict[str, str]
    body: bytes
    until: float


class KnownAnswers:
    """The latest answers, those asked for longest ago forgotten first; safe to use from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._answers: OrderedDict[bytes, KnownAnswer] = OrderedDict()
        self._keys: dict[str, set[bytes]] = {}
        self._bytes = 0

    def get(self, key: bytes) -> KnownAnswer | None:
        """The answer to a question, if it was given a moment ago and its job has not changed."""
        with self._lock:
            found = self._answers.get(key)
            if found is None or found.until < time.monotonic():
                return None
            self._answers.move_to_end(key)
            return found

    def keep(self, key: bytes, job: str, headers: dict[str, str], body: bytes) -> None:
        """Note an answer that holds until its job changes."""
        if len(body) > LARGEST:
            return
        with self._lock:
            self._forget(key)
            self._answers[key] = KnownAnswer(job, headers, body, time.monotonic() + KEPT)
            self._keys.setdefault(job, set()).add(key)
            self._bytes += len(body)
            while self._bytes > MOST_BYTES:
                self._forget(next(iter(self._answers)))

    def drop(self, change: model.Change) -> None:
        """A job changed."""
        job = change.id
        if job in self._keys:
            with self._lock:
                for key in tuple(self._keys.get(job, ())):
                    self._forget(key)

    def _forget(self, key: bytes) -> None:
        if (found := self._answers.pop(key, None)) is not None:
            self._bytes -= len(found.body)
            self._keys[found.job].discard(key)
            if not self._keys[found.job]:
                del self._keys[found.job]


def digest(*parts: str | bytes) -> bytes:
    """The key of a question: everything that its answer depends on."""
    found = hashlib.sha256()
    for part in parts:
        raw = part.encode() if isinstance(part, str) else part
        found.update(len(raw).to_bytes(8, "big") + raw)
    return found.digest()

"""Answers that were given a moment ago, found by the bytes of the question before any process or store is asked."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Final

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from inverse_service.service.jobs import metrics, model
from inverse_service.web import clients, middleware, problems

if TYPE_CHECKING:
    from inverse_service.web.engine import Engine

# How long, in seconds, an answer is given without asking the store, even if it was erased there.
KEPT = 5.0
# Bytes of all answers, and of one; larger ones are read in parts. To compress one of 7 kB takes 0.3 ms of processor
# time, as much as all else that its giving takes.
MOST_BYTES, LARGEST = 64 * 2**20, 256 * 2**10
# Where questions are asked, by path: the kind of job.
ASKED: Final = {f"/v1/{kind}": kind for kind in ("solve", "simulate", "work-precision")}
# The headers that an answer depends on; it holds for the same ones, letter by letter.
READ: Final = frozenset((
    b"accept", b"authorization", b"cache-control", b"content-encoding", b"content-length", b"content-type", b"cookie",
    b"host", b"idempotency-key", b"origin", b"prefer", b"sec-fetch-site", b"transfer-encoding", b"x-api-key",
))  # fmt: skip
# Of each call, and so not of an answer.
OF_A_CALL: Final = frozenset((b"ratelimit", b"ratelimit-policy"))
# Larger questions, and those that come in pieces, are read where their bytes are counted.
SMALL_QUESTION = 64 * 1024


@dataclass(frozen=True, slots=True)
class KnownAnswer:
    """The answer to a question: its headers, its body, and until when it is given."""

    headers: Sequence[tuple[bytes, bytes]]
    body: bytes
    until: float


class KnownAnswers:
    """The latest answers, all forgotten together where they become too many; safe to use from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._answers: dict[bytes, KnownAnswer] = {}
        self._keys: dict[str, set[bytes]] = {}
        self._bytes = 0

    def get(self, key: bytes) -> KnownAnswer | None:
        """The answer to a question, if it was given a moment ago and its job has not changed."""
        found = self._answers.get(key)
        return None if found is None or found.until < time.monotonic() else found

    def keep(self, key: bytes, job: str, headers: Sequence[tuple[bytes, bytes]], body: bytes) -> None:
        """Note an answer that holds until its job changes."""
        if len(body) > LARGEST:
            return
        with self._lock:
            before = self._answers.get(key)
            self._bytes += len(body) - (len(before.body) if before else 0)
            if self._bytes > MOST_BYTES:
                self._answers, self._keys, self._bytes = {}, {}, len(body)
            self._answers[key] = KnownAnswer(headers, body, time.monotonic() + KEPT)
            self._keys.setdefault(job, set()).add(key)

    def drop(self, change: model.Change) -> None:
        """A job changed."""
        if change.id in self._keys:
            with self._lock:
                # A question may be one of another job since, whose change took its answer.
                gone = [self._answers.pop(key, None) for key in self._keys.pop(change.id, ())]
                self._bytes -= sum(len(answer.body) for answer in gone if answer)


def _key_of(scope: Scope, body: bytes, read: Sequence[tuple[bytes, bytes]]) -> bytes:
    """The key of a question: everything that its answer depends on."""
    about = (scope["scheme"], scope["path"], scope["query_string"], body, read)
    return hashlib.sha256(repr(about).encode()).digest()


def may_be_kept(scope: Scope, job: str) -> None:
    """Note that the answer to this request holds until this job changes."""
    scope["state"]["answers"] = job


class KnownFirst(middleware.Middleware):
    """Gives known answers before anything is routed or parsed; keeps those that `may_be_kept` notes."""

    def __init__(self, app: ASGIApp, engine: Engine) -> None:
        super().__init__(app)
        self._engine = engine

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        scope.setdefault("state", {})
        kind, read = ASKED.get(scope["path"]), [pair for pair in scope["headers"] if pair[0] in READ]
        length = dict(read).get(b"content-length", b"")
        if kind is None or scope["method"] != "POST" or not length.isdigit() or int(length[:9]) > SMALL_QUESTION:
            await self.app(scope, receive, send)
            return
        pending = [await receive()]
        key = b"" if pending[0].get("more_body") else _key_of(scope, pending[0].get("body", b""), read)
        if (known := self._engine.known.get(key)) is not None and self._is_client(scope):
            scope["route"] = SimpleNamespace(path=scope["path"])  # as the counts of requests name it
            metrics.KNOWN.labels(kind).inc()
            more = await self._engine.rate_limit(scope["state"]["client_name"])
            of_call = [(name.lower().encode(), value.encode()) for name, value in more.items()]
            await send({"type": "http.response.start", "status": 200, "headers": [*known.headers, *of_call]})
            await send({"type": "http.response.body", "body": known.body})
            return

        async def receive_again() -> Message:
            return pending.pop() if pending else await receive()

        headers: list[tuple[bytes, bytes]] = []

        async def send_and_keep(message: Message) -> None:
            nonlocal key
            if message["type"] == "http.response.start":
                headers.extend(pair for pair in message["headers"] if pair[0] not in OF_A_CALL)
            elif message.get("more_body"):
                key = b""
            elif key and (job := scope["state"].get("answers")):
                self._engine.known.keep(key, job, headers, message["body"])
            await send(message)

        await self.app(scope, receive_again, send_and_keep)

    def _is_client(self, scope: Scope) -> bool:
        """Whether who asks may still ask."""
        try:
            clients.note_client(Request(scope))
        except problems.Refusal:
            return False
        return self._engine.is_open

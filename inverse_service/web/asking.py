"""The body of a request, bounded and counted, the options in its headers, and the requests that wait for jobs."""

import asyncio
import math
import re
import uuid
from collections import defaultdict
from collections.abc import AsyncIterator, Container, Iterable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from starlette.requests import Request

from inverse_service.service.jobs import model
from inverse_service.web import clients, middleware
from inverse_service.web.problems import Refusal

# How many times MAX_BODY each may have: a scene may hold a result, a result many certificates, a
# batch many systems.
FACTORS = {"solve": 1, "simulate": 5, "work-precision": 5, "check": 10, "batch": 16}
LARGEST_FACTOR = max(FACTORS.values())
DEFAULT_WAIT = 2.0
MAX_WAIT = 20.0
LARGEST_KEY = 255
WAIT = re.compile(r"(?:^|[,;\s])wait\s*=\s*\"?(\d{1,15})", re.IGNORECASE)
NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")
ASYNC = re.compile(r"(?:^|[,;\s])respond-async(?:$|[,;\s])", re.IGNORECASE)
# Who waits for the end of any job at all: the streams of batches.
ANY = "*"


@asynccontextmanager
async def body_of(
    request: Request, limit: int, types: Container[str] | None = ()
) -> AsyncIterator[bytes]:
    """The body, which counts as under way to the end of the context; 413 for more than `limit`
    bytes, unread.

    415 if it is neither JSON nor of one of the `types` (None: any is taken), and if it is
    compressed, because its final size is unknown.
    """
    if types is not None and not is_json(request) and content_type(request) not in types:
        lines = " or 'application/x-ndjson'" if types else ""
        raise Refusal(
            415,
            "content-type",
            f"Send JSON with the header 'Content-Type: application/json'{lines}.",
        )
    declared = middleware.header_of(request.scope, b"content-length")
    if declared.isascii() and declared.isdigit():
        refuse_longer(int(declared[:16]), limit)
    if middleware.header_of(request.scope, b"content-encoding").lower() not in ("", "identity"):
        raise Refusal(
            415,
            "content-type",
            "Compressed bodies are not accepted; send it without 'Content-Encoding'.",
        )
    under_way: clients.Shares = request.app.state.engine.bytes
    with under_way.hold(clients.client_of(request)) as take:
        parts, is_more = list[bytes](), True
        while is_more:
            message = await request.receive()
            if message["type"] == "http.disconnect":
                raise Refusal(
                    400, "unreadable", "The connection was closed before the whole body had come."
                )
            parts.append(message.get("body", b""))
            refuse_longer(take(len(parts[-1])), limit)
            is_more = message.get("more_body", False)
        yield b"".join(parts)


def refuse_longer(size: int, limit: int) -> None:
    """Raises Refusal (413) for a body of more bytes than its limit."""
    if size > limit:
        raise Refusal(
            413, "too-large", f"The body has more than {limit:,} bytes; send a smaller document."
        )


def content_type(request: Request) -> str:
    """The media type of the body, without parameters."""
    return middleware.header_of(request.scope, b"content-type").partition(";")[0].strip().lower()


def is_json(request: Request) -> bool:
    """Whether the body is declared as one JSON value."""
    media_type = content_type(request)
    return media_type == "application/json" or media_type.endswith("+json")


@dataclass(frozen=True, slots=True)
class Preference:
    """How long to wait for an answer, in seconds, and the part of `Prefer` that was applied."""

    wait: float
    applied: str
    is_async: bool = False


def preference_of(request: Request) -> Preference:
    """`Prefer: respond-async` and `wait=S`, of which at most 20 s are applied. Others are ignored (RFC 7240)."""
    text = middleware.header_of(request.scope, b"prefer")
    found = WAIT.search(text)
    seconds = min(float(found[1]), MAX_WAIT) if found else 0.0
    applied = f"wait={seconds:g}" if found else ""
    if ASYNC.search(text):
        # RFC 7240: with both, the answer may come within the time.
        both = ", ".join(part for part in ("respond-async", applied) if part)
        return Preference(seconds, both, is_async=True)
    return Preference(seconds, applied) if found else Preference(DEFAULT_WAIT, "")


def wants_fresh(request: Request) -> bool:
    """`Cache-Control: no-cache`: the question is to be computed again."""
    directives = {
        part.strip().lower()
        for part in middleware.header_of(request.scope, b"cache-control").split(",")
    }
    return bool(directives & {"no-cache", "no-store"})


def key_of(request: Request) -> str:
    """`Idempotency-Key`, which a client sends with one question or one batch only; empty where there is none."""
    given = middleware.header_of(request.scope, b"idempotency-key")
    if len(given) > LARGEST_KEY:
        raise Refusal(
            422, "limit", f"The header 'Idempotency-Key' takes at most {LARGEST_KEY} characters."
        )
    return given


def batch_key_of(request: Request) -> str:
    """The key, which distinguishes batches of the same lines; a random one for a fresh batch."""
    return key_of(request) or (uuid.uuid4().hex if wants_fresh(request) else "")


def time_limit_of(request: Request, server: model.JobOptions) -> float | None:
    """The `time_limit` of the query, which overrides the one of the document; None if there is none."""
    text = request.query_params.get("time_limit") if request.scope["query_string"] else None
    if text is None:
        return None
    # Only Python takes 1_0 and the digits of other scripts for numbers.
    number = float(text) if len(text) < 30 and NUMBER.fullmatch(text) else math.nan
    return model.read_time_limit(number, server.time_limit, "/time_limit")


def end_of(job: str) -> str:
    """The event of a request that waits for the end of a job only."""
    return f"end of {job}"


class Waiting(asyncio.Event):
    """A waiting request; `job` is the job that ended, if it ended in this process.

    Its user clears it before looking at the store.
    """

    job: model.Job | None = None


class Hub:
    """One event for each waiting request, by the id of the job it waits for, its end, or ANY."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: dict[str, set[Waiting]] = defaultdict(set)
        self.closing = False

    def tell(self, change: model.Change) -> None:
        """A job changed; may be called from any thread."""
        id, what, job = change
        keys = (id, end_of(id), ANY) if what in model.FINAL else (id,)
        if any(key in self._waiting for key in keys):
            self._loop.call_soon_threadsafe(self._set, keys, job)

    def close(self) -> None:
        """The service stops: wake everyone who waits, to look at `closing`."""
        self.closing = True
        self._loop.call_soon_threadsafe(lambda: self._set(tuple(self._waiting)))

    @contextmanager
    def waiting(self, id: str) -> Iterator[Waiting]:
        """An event that is set at each change, within its context."""
        event = Waiting()
        self._waiting[id].add(event)
        try:
            yield event
        finally:
            self._waiting[id].discard(event)
            if not self._waiting[id]:
                del self._waiting[id]

    def _set(self, keys: Iterable[str], job: model.Job | None = None) -> None:
        for key in keys:
            for event in self._waiting.get(key, ()):
                event.job = job
                event.set()


class Found(NamedTuple):
    """What a look at something that grows found: new parts, whether they are the last, or more are there already."""

    parts: AsyncIterator[bytes]
    is_last: bool
    is_more: bool


async def each(parts: Iterable[bytes] = ()) -> AsyncIterator[bytes]:
    """The parts, one after another."""
    for part in parts:
        yield part


async def until_set(event: asyncio.Event, seconds: float) -> None:
    """Wait for the event, which is set after so many seconds in any case."""
    late = asyncio.get_running_loop().call_later(seconds, event.set)
    try:
        await event.wait()
    finally:
        late.cancel()

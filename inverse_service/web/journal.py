"""The log of the service, one JSON object a line on standard error, and what is counted and noted of each request."""

from __future__ import annotations

import json
import logging
import re
import sys
import time
import uuid
from collections import Counter
from contextvars import ContextVar
from dataclasses import dataclass

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from inverse_service.service.jobs.metrics import Counters

STANDARD = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "color_message", "taskName"}
BETWEEN = 10.0
# The id of the request that is worked on; every line of the log that comes of it has it.
REQUEST: ContextVar[str] = ContextVar("request", default="")


class JsonLines(logging.Formatter):
    """Time (UTC), level, where, what; then the extras of the record, such as `job`."""

    def format(self, record: logging.LogRecord) -> str:
        moment = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line = {
            "time": f"{moment}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "where": record.name,
            "what": record.getMessage(),
        }
        if REQUEST.get():
            line["request"] = REQUEST.get()
        line |= {key: value for key, value in vars(record).items() if key not in STANDARD}
        if record.exc_info:
            line["trace"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


class Seldom(logging.Filter):
    """Lets the same sentence through once in BETWEEN, and says how many were left out since."""

    def __init__(self) -> None:
        super().__init__()
        self._last: dict[str, float] = {}
        self._left_out: Counter[str] = Counter()

    def filter(self, record: logging.LogRecord) -> bool:
        sentence = str(record.msg)[:100]
        if record.created - self._last.get(sentence, -BETWEEN) < BETWEEN:
            self._left_out[sentence] += 1
            return False
        self._last[sentence] = record.created
        record.left_out = self._left_out.pop(sentence, 0)
        return True


def begin(level: str) -> None:
    """Send all records of this process to standard error as JSON lines."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("inverse_service").setLevel(level.upper())
    # What strangers can make these write has no end: bad requests, and connections where descriptors run out.
    for name in ("asyncio", "uvicorn.error"):
        logging.getLogger(name).addFilter(Seldom())
    logging.captureWarnings(True)


log = logging.getLogger(__name__)
GIVEN = re.compile(r"[A-Za-z0-9._-]{1,64}")
# W3C trace context: the trace that a caller is part of.
TRACE = re.compile(r"[0-9a-f]{2}-([0-9a-f]{32})-[0-9a-f]{16}-[0-9a-f]{2}")
# What asks so often that its requests would be all of the log.
QUIET = frozenset({"/livez", "/readyz", "/metrics"})


@dataclass(slots=True)
class _Answer:
    """What was answered: its status, 500 where nothing was."""

    status: int = 500
    seconds: float | None = None


class Measured:
    """Middleware; requests are told apart by route (never by the path, which anybody can make up)."""

    def __init__(self, app: ASGIApp, counters: Counters) -> None:
        self.app = app
        self._counters = counters

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began, answer = time.monotonic(), _Answer()
        identifier = identifier_of(scope)
        token = REQUEST.set(identifier)

        async def send_measured(message: Message) -> None:
            if message["type"] == "http.response.start":
                answer.status, answer.seconds = message["status"], time.monotonic() - began
                MutableHeaders(scope=message)["X-Request-Id"] = identifier
            await send(message)

        try:
            await self.app(scope, receive, send_measured)
        finally:
            # Also where the application raised: what is outside of this one answers with 500 then.
            self._count(scope, answer.status, answer.seconds or time.monotonic() - began)
            _note(scope, answer.status, time.monotonic() - began)
            REQUEST.reset(token)

    def _count(self, scope: Scope, status: int, seconds: float) -> None:
        route = getattr(scope.get("route"), "path", "none")
        self._counters.add(
            "inverse_service_http_requests_total", "Requests by route and status.", route=route, status=str(status)
        )
        self._counters.observe("inverse_service_http_seconds", "Time until an answer begins.", seconds, route=route)


def identifier_of(scope: Scope) -> str:
    """The caller's `X-Request-Id`, the trace that it is part of, or a new one."""
    headers = Headers(scope=scope)
    given, trace = headers.get("x-request-id", ""), TRACE.fullmatch(headers.get("traceparent", ""))
    if GIVEN.fullmatch(given):
        return given
    return trace[1] if trace is not None else uuid.uuid4().hex


def _note(scope: Scope, status: int, seconds: float) -> None:
    """A line of the access log: who asked for what, and how it was answered; a refused key stands out."""
    if scope["path"] in QUIET:
        return
    client = scope.get("state", {}).get("client_name") or (scope.get("client") or ("",))[0]
    about = {"client": client, "method": scope["method"], "path": scope["path"][:200], "status": status}
    level = logging.WARNING if status == 401 else logging.INFO
    log.log(level, "request", extra={**about, "seconds": round(seconds, 4)})

"""The log of the service: a JSON object a line on standard error."""

import contextlib
import json
import logging
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from typing import Any, Final

# The id of the request that is worked on; every line of the log that comes of it has it.
REQUEST: ContextVar[str] = ContextVar("request", default="")
_AS_JSON = json.JSONEncoder(default=str).encode
# Who writes the lines of the log, where they are JSON.
WRITERS: Final[list[Callable[[str], object]]] = []
STANDARD: Final = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "color_message", "taskName"}
# The same sentence of what strangers can make us write comes so often, s.
BETWEEN: Final = 10.0


def line(level: str, where: str, what: str, moment: float, more: Mapping[str, Any]) -> str:
    """A line of the log: time (UTC), level, where, what, the request; then more, such as `job`."""
    second = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(moment))
    about = {"time": f"{second}.{int(moment % 1 * 1000):03d}Z", "level": level.lower(), "where": where, "what": what}
    if identifier := REQUEST.get():
        about["request"] = identifier
    return _AS_JSON({**about, **more}) + "\n"


def say(log: logging.Logger, what: str, more: Mapping[str, Any], level: int = logging.INFO) -> None:
    """Log what is said of each request; without the records of `logging`, which cost several times as much."""
    if not WRITERS:
        log.log(level, what, extra=more)
    elif log.isEnabledFor(level):
        with contextlib.suppress(OSError, ValueError):  # nobody reads the log any more
            WRITERS[0](line(logging.getLevelName(level), log.name, what, time.time(), more))


class JsonLines(logging.Formatter):
    """A record as a line, with its extras."""

    def format(self, record: logging.LogRecord) -> str:
        more = {key: value for key, value in vars(record).items() if key not in STANDARD}
        if record.exc_info:
            more["trace"] = self.formatException(record.exc_info)
        return line(record.levelname, record.name, record.getMessage(), record.created, more)


class Seldom(logging.Filter):
    """Lets the same sentence through once in BETWEEN, and says how many were left out since; none of `no_fault`."""

    def __init__(self, no_fault: type[Exception]) -> None:
        super().__init__()
        self._no_fault = no_fault
        self._last: dict[str, float] = {}
        self._left_out: Counter[str] = Counter()

    def filter(self, record: logging.LogRecord) -> bool:
        if record.exc_info and isinstance(record.exc_info[1], self._no_fault):
            return False
        sentence = str(record.msg)[:100]
        if record.created - self._last.get(sentence, -BETWEEN) < BETWEEN:
            self._left_out[sentence] += 1
            return False
        self._last[sentence] = record.created
        record.left_out = self._left_out.pop(sentence, 0)
        return True


def begin(level: str, no_fault: type[Exception]) -> None:
    """Send all records of this process to standard error as JSON lines."""
    WRITERS[:] = [sys.stderr.write]
    handler = logging.StreamHandler(sys.stderr)
    handler.terminator = ""  # a line has its end
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("inverse_service").setLevel(level.upper())
    # What strangers can make these write has no end: bad requests, and connections where descriptors run out.
    for name in ("asyncio", "uvicorn.error"):
        logging.getLogger(name).addFilter(Seldom(no_fault))
    logging.captureWarnings(True)

"""The log of the service, one JSON object a line on standard error."""

import json
import logging
import sys
import time
from collections import Counter
from contextvars import ContextVar

STANDARD = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "color_message", "taskName"}
AS_JSON = json.JSONEncoder(default=str).encode
BETWEEN = 10.0
# The id of the request that is worked on; every line of the log that comes of it has it.
REQUEST: ContextVar[str] = ContextVar("request", default="")


class StreamCut(Exception):
    """A stream ends before its last answer; raised, as only a broken connection tells its reader so. It is no fault."""


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
        return AS_JSON(line)


class Seldom(logging.Filter):
    """Lets the same sentence through once in BETWEEN, and says how many were left out since."""

    def __init__(self) -> None:
        super().__init__()
        self._last: dict[str, float] = {}
        self._left_out: Counter[str] = Counter()

    def filter(self, record: logging.LogRecord) -> bool:
        if record.exc_info and isinstance(record.exc_info[1], StreamCut):
            return False
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
    for fact in ("_srcfile", "logThreads", "logProcesses", "logMultiprocessing"):  # which no line shows
        setattr(logging, fact, None)

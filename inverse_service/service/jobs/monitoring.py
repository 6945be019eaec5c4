"""What an operator sees: metrics of a process in the text format of Prometheus, and the log, a JSON
object a line on standard error.
"""

import contextlib
import functools
import json
import logging
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextvars import ContextVar
from types import SimpleNamespace
from typing import Any, Final

import prometheus_client
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.metrics_core import Metric

prometheus_client.disable_created_metrics()  # type: ignore[no-untyped-call]
REGISTRY: Final = prometheus_client.CollectorRegistry()
BUCKETS: Final = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)
NAME: Final = "inverse_service"
_counter = functools.partial(prometheus_client.Counter, namespace=NAME, registry=REGISTRY)
_times = functools.partial(
    prometheus_client.Histogram, namespace=NAME, registry=REGISTRY, buckets=BUCKETS
)

# Under the names that every dashboard knows: process_cpu_seconds_total,
# process_resident_memory_bytes, ...
prometheus_client.ProcessCollector(registry=REGISTRY)
REQUESTS: Final = _counter(
    "http_requests", "Requests by method, route and status.", ("method", "route", "status")
)
ANSWERED: Final = _times(
    "http_request_duration_seconds", "Time until an answer begins.", ("method", "route")
)
KNOWN: Final = _counter("answers_from_store", "Questions that were known already.", ("kind",))
STORE: Final = _times("store_seconds", "Reads and changes.")
LAG: Final = _times("loop_lag_seconds", "How late the event loop was.")
QUICK: Final = _counter("quick_tasks", "Tasks that are no jobs.", ("task", "outcome"))
QUICK_CPU: Final = _counter("quick_cpu_seconds", "Their processor time.", ("task",))
JOBS: Final = _counter("jobs", "Runs of jobs by how they ended.", ("kind", "outcome"))
JOB_WALL: Final = _times("job_wall_seconds", "Wall clock of a run.", ("kind",))
JOB_CPU: Final = _counter("job_cpu_seconds", "Processor time of runs.", ("kind",))
DEATHS: Final = _counter("worker_deaths", "Workers that died.", ("how",))
for how in ("crash", "killed"):  # an alert on what grows needs a beginning
    DEATHS.labels(how)
_largest: dict[str, float] = {}
# The id of the request that is worked on; every line of the log that comes of it has it.
REQUEST: ContextVar[str] = ContextVar("request", default="")
_AS_JSON = json.JSONEncoder(default=str).encode
# Who writes the lines of the log, where they are JSON.
WRITERS: Final[list[Callable[[str], object]]] = []
STANDARD: Final = frozenset(vars(logging.makeLogRecord({}))) | {
    "message",
    "asctime",
    "color_message",
    "taskName",
}
# The same sentence of what strangers can make us write comes so often, s.
BETWEEN: Final = 10.0


@functools.lru_cache(maxsize=1024)
def of(family: Any, *labels: str) -> Any:
    """The part of a counter or of times with these labels; to look for it takes longer than to
    count.
    """
    return family.labels(*labels)


def note_run(kind: str, outcome: str, wall: float, processor: float, mebibytes: float) -> None:
    """How a run of a job ended, and what it took: seconds, and memory."""
    of(JOBS, kind, outcome).inc()
    of(JOB_WALL, kind).observe(wall)
    of(JOB_CPU, kind).inc(processor)
    _largest[kind] = max(mebibytes, _largest.get(kind, mebibytes))


def metrics_page(families: Iterable[Metric]) -> bytes:
    """All that was counted since the start, with these, which are read when they are asked for."""
    by_kind: dict[tuple[str, ...], float] = {
        (kind,): value * 2**20 for kind, value in _largest.items()
    }
    memory = gauge("job_memory_peak_bytes", "Largest memory of a run.", by_kind, ("kind",))
    read: Any = SimpleNamespace(collect=lambda: [*REGISTRY.collect(), *families, memory])
    return prometheus_client.generate_latest(read)


def gauge(
    name: str,
    text: str,
    found: Mapping[tuple[str, ...], float] | float,
    labels: tuple[str, ...] = (),
) -> Metric:
    """A metric that is read when it is asked for, with labels or without."""
    family = GaugeMetricFamily(f"{NAME}_{name}", text, labels=labels)
    for values, value in found.items() if isinstance(found, Mapping) else [((), float(found))]:
        family.add_metric(values, value)
    return family


def line(level: str, where: str, what: str, moment: float, more: Mapping[str, Any]) -> str:
    """A line of the log: time (UTC), level, where, what, the request; then more, such as `job`."""
    second = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(moment))
    about = {
        "time": f"{second}.{int(moment % 1 * 1000):03d}Z",
        "level": level.lower(),
        "where": where,
        "what": what,
    }
    if identifier := REQUEST.get():
        about["request"] = identifier
    return _AS_JSON({**about, **more}) + "\n"


def say(log: logging.Logger, what: str, more: Mapping[str, Any], level: int = logging.INFO) -> None:
    """Log what is said of each request; without the records of `logging`, which cost several times
    as much.
    """
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
    """Lets the same sentence through once in BETWEEN, and says how many were left out since; none
    of `no_fault`.
    """

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
    # What strangers can make these write has no end: bad requests, and connections where
    # descriptors run out.
    for name in ("asyncio", "uvicorn.error"):
        logging.getLogger(name).addFilter(Seldom(no_fault))
    logging.captureWarnings(True)

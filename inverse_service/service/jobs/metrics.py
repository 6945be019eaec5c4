"""What a process of the service counts, in the text format of Prometheus."""

import functools
from collections.abc import Iterable, Mapping
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
_times = functools.partial(prometheus_client.Histogram, namespace=NAME, registry=REGISTRY, buckets=BUCKETS)

prometheus_client.ProcessCollector(NAME, registry=REGISTRY)
REQUESTS: Final = _counter("http_requests", "Requests by route and status.", ("route", "status"))
ANSWERED: Final = _times("http_seconds", "Time until an answer begins.", ("route",))
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


@functools.lru_cache(maxsize=1024)
def of(family: Any, *labels: str) -> Any:
    """The part of a counter or of times with these labels; to look for it takes longer than to count."""
    return family.labels(*labels)


def note_run(kind: str, outcome: str, wall: float, processor: float, mebibytes: float) -> None:
    """How a run of a job ended, and what it took: seconds, and memory."""
    of(JOBS, kind, outcome).inc()
    of(JOB_WALL, kind).observe(wall)
    of(JOB_CPU, kind).inc(processor)
    _largest[kind] = max(mebibytes, _largest.get(kind, mebibytes))


def written(families: Iterable[Metric]) -> bytes:
    """All that was counted since the start, with these, which are read when they are asked for."""
    by_kind: dict[tuple[str, ...], float] = {(kind,): value for kind, value in _largest.items()}
    memory = gauge("job_memory_peak_mebibytes", "Largest memory of a run.", by_kind, ("kind",))
    read: Any = SimpleNamespace(collect=lambda: [*REGISTRY.collect(), *families, memory])
    return prometheus_client.generate_latest(read)


def gauge(name: str, text: str, found: Mapping[tuple[str, ...], float] | float, labels: tuple[str, ...] = ()) -> Metric:
    """A metric that is read when it is asked for, with labels or without."""
    family = GaugeMetricFamily(f"{NAME}_{name}", text, labels=labels)
    for values, value in found.items() if isinstance(found, Mapping) else [((), float(found))]:
        family.add_metric(values, value)
    return family

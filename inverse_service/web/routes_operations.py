"""What operators and their programs ask: does it live, is it ready, what does it do."""

from __future__ import annotations

import resource
import sys
import time

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from inverse_service import __version__
from inverse_service.service.jobs.identity import engine_version
from inverse_service.service.jobs.metrics import Labels, Metric, gauge, written
from inverse_service.service.jobs.model import STATUSES
from inverse_service.web.engine import Engine
from inverse_service.web.openapi import refusals
from inverse_service.web.problems import Refusal
from inverse_service.web.routes_jobs import engine_of

router = APIRouter()
PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"
# ru_maxrss counts KiB on Linux and bytes on macOS.
RSS_UNIT = 1 if sys.platform == "darwin" else 1024


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive"}


@router.get("/readyz", responses=refusals(503))
async def readyz(request: Request) -> dict[str, str]:
    """The store answers, jobs are looked after, a worker process answers, the queue has room."""
    engine: Engine = request.app.state.engine
    faults = await engine.faults()
    if faults:
        raise Refusal(503, "not-ready", " ".join(faults), headers={"Retry-After": "2"})
    return {"status": "ready"}


@router.get("/metrics", response_class=PlainTextResponse)
async def metrics(request: Request) -> Response:
    """Counters and gauges in the text format of Prometheus."""
    engine = engine_of(request)
    counts = await engine.read(engine.store.counts)
    oldest, size = await engine.read(engine.store.oldest), await engine.read(engine.store.size)
    age = 0.0 if oldest is None else max(0.0, time.time() - oldest)
    by_status: dict[Labels, float] = {(("status", s),): float(counts.get(s, 0)) for s in STATUSES}
    found = [
        *engine.counters.metrics(),
        gauge("inverse_service_jobs", "Stored jobs by status.", by_status),
        gauge("inverse_service_queue_length", "Jobs that wait for a worker.", {(): float(counts.get("accepted", 0))}),
        gauge("inverse_service_queue_age_seconds", "How long the oldest of them waits.", {(): age}),
        gauge("inverse_service_store_bytes", "Size of the database.", {(): float(size)}),
        gauge("inverse_service_connections", "Open connections.", {(): float(len(engine.connections))}),
        gauge(
            "inverse_service_quick_waiting", "Requests that are read or wait for that.", {(): float(len(engine.places))}
        ),
        gauge("inverse_service_workers", "Worker processes.", {(): float(engine.settings.workers)}),
        gauge(
            "inverse_service_jobs_taken", "Jobs that this process has taken.", {(): float(engine.supervisor.running)}
        ),
        *_of_the_process(engine),
    ]
    return Response(written(found), media_type=PROMETHEUS)


def _of_the_process(engine: Engine) -> list[Metric]:
    own = resource.getrusage(resource.RUSAGE_SELF)
    version: Labels = (("engine", engine_version()), ("version", __version__))
    return [
        gauge("inverse_service_info", "What runs.", {version: 1.0}),
        gauge("inverse_service_uptime_seconds", "Since the start.", {(): time.time() - engine.started}),
        Metric(
            "inverse_service_process_cpu_seconds_total",
            "counter",
            "Processor time of the web process; that of its workers is counted with jobs and quick tasks.",
            {("", ()): own.ru_utime + own.ru_stime},
        ),
        gauge(
            "inverse_service_process_memory_peak_bytes",
            "Largest resident memory of the service itself.",
            {(): float(own.ru_maxrss * RSS_UNIT)},
        ),
    ]

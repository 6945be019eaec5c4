"""The calls that make no jobs: those under /v1, the catalogue and the atlas (by name, tag and equations) with them, and
what operators ask: does it live, is it ready, what does it do."""

import dataclasses
import time
from importlib import resources
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response

from api_schemas import base
from api_schemas.job import AtlasEntry, AtlasLine, AtlasList
from inverse_service import __version__, catalogue, errors
from inverse_service.catalogue import atlas
from inverse_service.expressions.refusals import LIMITS
from inverse_service.service.documents import alike
from inverse_service.service.jobs import batch, model, tasks, workers
from inverse_service.service.jobs.metrics import gauge, written
from inverse_service.web import asking, clients, job_answers, openapi, routes_jobs
from inverse_service.web.engine import Engine
from inverse_service.web.problems import Refusal, known

router = APIRouter(dependencies=[Depends(clients.require_client)])
named = APIRouter(dependencies=[Depends(clients.require_client)], tags=["catalogue"])
open_router = APIRouter()
LICENSE = "MIT"
CITE = "The inverse-service atlas: systems of equations of motion with their Lagrangians, computed and checked."
LATE = "Reading these equations takes too long for a search."
PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"


@router.post(
    "/v1/parse",
    tags=["systems"],
    responses={200: openapi.PARSED, **openapi.BAD_BODY},
    openapi_extra=openapi.SYSTEM_BODY,
)
async def parse(request: Request) -> Response:
    """How a System document is parsed: text, LaTeX and MathML of each acceleration."""
    engine = routes_jobs.engine_of(request)
    async with asking.body_of(request, engine.settings.max_body) as body:
        found = await engine.read_body(clients.client_of(request), tasks.parse_task, body)
    return Response(found, media_type="application/json")


@router.post(
    "/v1/check",
    tags=["systems"],
    responses={200: {"model": base.CheckAnswer}, **openapi.BAD_BODY},
    openapi_extra=openapi.body_of("CheckedDocument"),
)
async def check(request: Request) -> Response:
    """The independent checker's verdict on a result or a certificate, or on {"document": …, "result": …}.

    The system of a result is compared with the document that it carries, or with the one given with it.
    {"system": …, "lagrangian": "…"} tests whether your Lagrangian yields these equations: verdict and residual.
    """
    engine = routes_jobs.engine_of(request)
    async with asking.body_of(request, asking.FACTORS["check"] * engine.settings.max_body) as body:
        return JSONResponse(await engine.check(clients.client_of(request), body))


@named.get("/v1/catalogue", response_model=base.CatalogueList)
async def list_catalogue() -> Response:
    """The names and titles of all systems of the catalogue."""
    entries = [catalogue.entry(name) for name in catalogue.names()]
    return JSONResponse({"systems": [{key: e.get(key, "") for key in ("name", "title", "group")} for e in entries]})


@named.get(
    "/v1/catalogue/{name}",
    responses={200: {"model": base.CatalogueEntry}, **openapi.refusals(404)},
)
async def catalogue_entry(name: str) -> Response:
    """One system of the catalogue: its document and what is known about it."""
    try:
        entry = catalogue.entry(name)
    except errors.InputError:
        detail = "The catalogue has no system of this name; GET /v1/catalogue lists them."
        raise Refusal(404, "not-found", detail) from None
    entry = {key: entry[key] for key in base.CatalogueEntry.model_fields if key in entry}
    return JSONResponse(entry)


def form_task(equations: str) -> str:
    """The form of typed equations; InputError where they cannot be read."""
    return alike.form_of(tasks.understand_task(model.split_options({"equations": equations, "parameters": "guess"})[0]))


async def found_by(request: Request, words: str, tag: str, equations: str) -> list[dict[str, Any]]:
    """The systems of a search; refuses equations that cannot be read."""
    form = None
    if equations.strip():
        form = await routes_jobs.engine_of(request).made(
            clients.client_of(request), form_task, equations[:4_000], late=LATE
        )
    return atlas.search(words[:200], tag[:80], form)


@named.get("/v1/atlas", response_model=AtlasList, responses=openapi.refusals(422))
async def search(
    request: Request,
    q: Annotated[str, Query(description="words of name, title, source, tags or equations")] = "",
    tag: Annotated[str, Query(description="a tag, such as Kamke or constraints")] = "",
    equations: Annotated[
        str, Query(description="equations: systems of the same form, up to names, order and constant factors")
    ] = "",
) -> Response:
    """Systems with computed answers, by words, by tag, and by equations."""
    found = await found_by(request, q, tag, equations)
    lines = [{key: entry[key] for key in AtlasLine.model_fields} for entry in found[:100]]
    return JSONResponse({"count": len(found), "systems": lines, "license": LICENSE, "cite": CITE})


@named.get("/v1/atlas.ndjson", response_class=Response, responses={200: {"content": {"application/x-ndjson": {}}}})
async def whole(request: Request) -> Response:
    """The whole atlas, one system per line."""
    data, mark = atlas.whole()
    headers = {
        "ETag": f'"{mark}"',
        "Cache-Control": "public, no-cache",
        "Content-Disposition": 'attachment; filename="atlas.ndjson"',
        "X-License": LICENSE,
    }
    if job_answers.is_known(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    return Response(data, headers=headers, media_type="application/x-ndjson")


@named.get("/v1/atlas/{name}", responses={200: {"model": AtlasEntry}, **openapi.refusals(404)})
async def entry(name: str) -> Response:
    """One system: its document, its answers, L, H and where they hold."""
    return JSONResponse(known(atlas.entries().get(name), "system of this name; GET /v1/atlas searches the atlas."))


@router.get("/v1/limits", response_model=base.LimitsAnswer)
async def limits(request: Request) -> Response:
    """Every limit that a refusal can name."""
    settings = routes_jobs.engine_of(request).settings
    document = {name.lower(): value for name, value in vars(base).items() if name.startswith("MAX_")}
    service = {
        "time_limit_seconds": settings.time_limit,
        "time_limit_on_a_busy_machine_seconds": workers.MOST_CROWDED * settings.time_limit,
        "memory_limit_mib": settings.memory_limit,
        "max_body_bytes": settings.max_body,
        "max_result_bytes": asking.FACTORS["check"] * settings.max_body,
        "max_batch_bytes": asking.FACTORS["batch"] * settings.max_body,
        "max_batch_lines": settings.max_lines,
        "max_line_bytes": batch.MAX_LINE_BYTES,
        "default_wait_seconds": asking.DEFAULT_WAIT,
        "max_wait_seconds": asking.MAX_WAIT,
        "open_jobs": settings.queue,
        "open_jobs_of_a_client": settings.client_queue,
        "running_jobs_of_a_client": settings.client_running or settings.workers,
        "processor_seconds_of_a_client_a_day": settings.client_daily_seconds or 86_400 * settings.workers,
        "waiting_requests": settings.waiting,
        "retention_days": settings.retention_days,
        "store_mib": settings.store_size,
    }
    return JSONResponse({"document": document, "formula": dataclasses.asdict(LIMITS), "service": service})


@open_router.get("/llms.txt", response_class=PlainTextResponse)
async def llms() -> PlainTextResponse:
    """A summary of the calls for programs, in ten lines."""
    return PlainTextResponse(resources.files("inverse_service.web").joinpath("static/llms.txt").read_bytes())


@open_router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive"}


@open_router.get("/readyz", responses=openapi.refusals(503))
async def readyz(request: Request) -> dict[str, str]:
    """The store and a worker process answer, the supervisor of the jobs runs, the queue has room."""
    engine: Engine = request.app.state.engine
    faults = await engine.faults()
    if faults:
        raise Refusal(503, "not-ready", " ".join(faults), headers={"Retry-After": "2"})
    return {"status": "ready"}


@open_router.get("/metrics", response_class=PlainTextResponse)
async def metrics(request: Request) -> Response:
    """Counters and gauges in the text format of Prometheus."""
    engine = routes_jobs.engine_of(request)
    counts = await engine.read(engine.store.counts)
    oldest, size = await engine.read(engine.store.oldest), await engine.read(engine.store.size)
    age = 0.0 if oldest is None else max(0.0, time.time() - oldest)
    by_status: dict[tuple[str, ...], float] = {(status,): float(counts.get(status, 0)) for status in model.STATUSES}
    found = [
        gauge("jobs", "Stored jobs by status.", by_status, ("status",)),
        gauge("queue_length", "Jobs that wait for a worker.", counts.get("accepted", 0)),
        gauge("queue_age_seconds", "How long the oldest of them waits.", age),
        gauge("store_bytes", "Size of the database.", size),
        gauge("connections", "Open connections.", len(engine.connections)),
        gauge("quick_waiting", "Requests that are read or wait for that.", len(engine.places)),
        gauge("workers", "Worker processes.", engine.settings.workers),
        gauge("jobs_taken", "Jobs that this process has taken.", engine.supervisor.running),
        gauge("info", "What runs.", {(model.engine_version(), __version__): 1.0}, ("engine", "version")),
    ]
    return Response(written(found), media_type=PROMETHEUS)

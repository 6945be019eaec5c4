"""All calls of the HTTP interface: questions and scenes as jobs, and batches of them; what makes no
job, with the catalogue and the atlas (by name, tag and equations); what operators ask: does it
live, is it ready, what does it do."""

import asyncio
import copy
import dataclasses
import hashlib
import json
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from functools import lru_cache
from importlib import resources
from types import SimpleNamespace
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from api_schemas import base
from api_schemas.job import (
    AtlasEntry,
    AtlasLine,
    AtlasList,
    Batch as BatchDocument,
    BatchList,
    Job as JobDocument,
    JobList,
)
from inverse_service import __version__, catalogue, errors
from inverse_service.expressions.refusals import LIMITS
from inverse_service.service.documents import alike, short_results
from inverse_service.service.jobs import model, monitoring, supervisor, tasks, workers
from inverse_service.service.jobs.batch import MAX_LINE_BYTES
from inverse_service.web import asking, clients, job_answers, middleware, openapi, problems
from inverse_service.web.engine import KEEP_ALIVE, Engine, key_of

jobs = APIRouter(dependencies=[Depends(clients.require_client)], tags=["jobs"])
batches = APIRouter(dependencies=[Depends(clients.require_client)], tags=["batches"])
plain = APIRouter(dependencies=[Depends(clients.require_client)])
named = APIRouter(dependencies=[Depends(clients.require_client)], tags=["catalogue"])
open_router = APIRouter()
# Calls that read all of their requests themselves, so that the framework has nothing to resolve for
# them.
asked = APIRouter()
FORGOTTEN = "job of this id; it may have been forgotten. Ask again."
STILL_THERE = b": still there\n\n"
ASKED_ANSWERS = {202: {"model": JobDocument, "headers": openapi.JOB_HEADERS}, **openapi.BAD_BODY}
SCENE = openapi.body_of("SceneDocument") | openapi.TIME_LIMIT_QUERY
# Where questions are asked, and the kind of their jobs.
QUESTIONS = {f"/v1/{kind}": kind for kind in ("solve", "simulate", "work-precision")}
Route = Callable[[Request], Awaitable[Response]]
NDJSON = "application/x-ndjson"
NDJSON_TYPES = frozenset(
    {NDJSON, "application/ndjson", "application/jsonl", "application/x-jsonlines"}
)
# A stream that wakes for every job would read the store more than it writes answers.
SMALLEST_PAUSE, LARGEST_PAUSE = 0.02, 0.5
LICENSE = "MIT"
CITE = "The inverse-service atlas: systems of equations of motion with their Lagrangians, computed and checked."
LATE = "Reading these equations takes too long for a search."
PROMETHEUS = "text/plain; version=0.0.4; charset=utf-8"


def posted(
    router: APIRouter, path: str, tag: str, found: dict[str, Any], taken: dict[str, Any]
) -> Callable[[Route], Route]:
    """A call that reads its body itself: what it answers with 200, and what it takes; those of `asked` make jobs."""
    others = ASKED_ANSWERS if router is asked else openapi.BAD_BODY
    return router.post(path, tags=[tag], responses={200: found, **others}, openapi_extra=taken)


@posted(
    asked, "/v1/solve", "systems", openapi.SOLVED, openapi.SYSTEM_BODY | openapi.TIME_LIMIT_QUERY
)
async def solve(request: Request) -> Response:
    """Solve one system.

    The job is stored before any answer. The call waits 2 s, or as `Prefer: wait=S` says (at most
    20); past it, or with `Prefer: respond-async`, the answer is 202 with the job's address.
    `?time_limit=S`, or `"options": {"time_limit": S, "memory_limit": MiB, "seed": N}` in the
    document, lower the limits of the service. The same question is answered from the store;
    `Cache-Control: no-cache` asks again. An `Idempotency-Key` that came with another question
    before is refused (422). `Accept` may ask for text, LaTeX or a SymPy program instead of JSON.
    """
    return await answered(request, "solve")


async def ask(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer a question; as the routes describe it."""
    request = Request(scope, receive)
    try:
        response = await answered(request, QUESTIONS[scope["path"]])
    except problems.REFUSED as error:
        response = await problems.on_error(request, error)
    await response(scope, receive, send)


async def answered(request: Request, kind: str) -> Response:
    """The common path of all questions: store the job, wait briefly, answer; one answered a moment ago is known."""
    request.scope["route"] = SimpleNamespace(
        path=f"/v1/{kind}"
    )  # as the counts of requests name it
    clients.note_client(request)
    engine, client = engine_of(request), clients.client_of(request)
    async with asking.body_of(request, asking.FACTORS[kind] * engine.settings.max_body) as body:
        key = key_of(request.scope, body)
        if (answer := engine.known.get(key, kind)) is None:
            limit = asking.time_limit_of(request, engine.server_options)
            terms = tasks.Terms(
                kind, engine.server_options, limit, client, asking.wants_fresh(request)
            )
            question = await engine.question(body, terms)
    if answer is None:
        preference, viewer = asking.preference_of(request), clients.viewer_of(request)
        job = await engine.ask(question, viewer, preference.wait, asking.key_of(request))
        answer = await job_answers.result_response(request, job, engine, preference)
        if job.status == "successful" and job.expires is None and not terms.fresh:
            engine.known.keep(key, job.id, answer)
    if limits := await engine.rate_limit(client):
        answer = copy.copy(answer)
        answer.raw_headers = [*answer.raw_headers, *Headers(limits).raw]
    return answer


@jobs.get(
    "/v1/jobs", response_model=JobList, responses={**openapi.refusals(422), **openapi.KEY_AND_RATE}
)
async def list_jobs(
    request: Request,
    status: Literal["accepted", "running", "successful", "failed", "dismissed"] | None = None,
    kind: str | None = Query(None, max_length=40),
    cursor: str | None = Query(None, max_length=40),
    limit: int = Query(50, ge=1, le=500),
) -> Response:
    """Jobs, newest first, without their results; `next` is the cursor of the next page."""
    engine = engine_of(request)
    client = clients.viewer_of(request).listed
    try:
        found, following = await engine.read(
            engine.store.jobs, status=status, kind=kind, client=client, cursor=cursor, limit=limit
        )
    except ValueError:
        raise _bad_cursor("job") from None
    fields = await engine.read(lambda: [job_answers.job_fields(job, engine) for job in found])
    return JSONResponse({"jobs": fields, "next": following})


@jobs.get(
    "/v1/jobs/{id}",
    responses={
        200: {"model": JobDocument, "headers": {"ETag": {"schema": {"type": "string"}}}},
        202: {"model": JobDocument},
        304: {"description": "The caller has this answer already."},
        **openapi.UNKNOWN,
    },
)
async def job(request: Request, id: str) -> Response:
    """A job: 202 while it is open, 200 with an ETag when it is done, 304 on If-None-Match."""
    engine = engine_of(request)
    found = problems.known(await engine.job(id, clients.viewer_of(request)), FORGOTTEN)
    return await job_answers.job_response(request, found, engine)


@jobs.delete("/v1/jobs/{id}", responses={200: {"model": JobDocument}, **openapi.UNKNOWN})
async def dismiss_jobs(request: Request, id: str) -> Response:
    """Cancel an open job; a finished job stays unchanged, with its result.

    It is dismissed for you. The work stops when no other client waits for it; the finished part is
    its result.
    """
    engine = engine_of(request)
    found = problems.known(await engine.dismiss(id, clients.viewer_of(request)), FORGOTTEN)
    return await job_answers.job_document(found, engine, {}, is_whole=True)


@jobs.get(
    "/v1/jobs/{id}/events",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}},
        **openapi.UNKNOWN,
    },
)
async def events(request: Request, id: str) -> Response:
    """Server-sent events of a job, to the end. Resumable with Last-Event-ID.

    Each has an `id`, an `event` and as `data` a JSON object (JobEvent): `status` {status};
    `progress` {elapsed, stage, order, family}; `part` {part, value}, the fields of the result that
    are known with a part of it, as it is finished. The values merged in their order are the result.
    """
    engine = engine_of(request)
    viewer = clients.viewer_of(request)
    problems.known(await engine.job(id, viewer), FORGOTTEN)
    text = request.headers.get("last-event-id", request.query_params.get("last_event_id", "0"))
    after = int(text) if text.isascii() and text.isdigit() and len(text) < 16 else 0
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(
        _events_of(engine, id, viewer, after), headers=headers, media_type="text/event-stream"
    )


async def _events_of(
    engine: Engine, id: str, viewer: model.Viewer, after: int
) -> AsyncIterator[bytes]:
    async def look() -> asking.Found:
        nonlocal after
        found = await engine.job(id, viewer)
        new = await engine.read(engine.store.events, id, after)
        is_over = found is None or not found.is_open
        is_last = is_over and not new
        if is_last and found is not None:
            new = await engine.read(supervisor.last_events, engine.store, found)
        fresh = [event for event in new if event.number > after]
        after = max((event.number for event in fresh), default=after)
        return asking.Found(asking.each(map(event_bytes, fresh)), is_last, is_over)

    yield b"retry: 1000\n\n"
    async for part in engine.followed(id, look, STILL_THERE):
        yield part


def event_bytes(event: model.Event) -> bytes:
    """An event in the WHATWG format."""
    return f"id: {event.number}\nevent: {event.kind}\ndata: {json.dumps(dict(event.data))}\n\n".encode()


def engine_of(request: Request) -> Engine:
    """The engine of this application; 503 while it is starting or shutting down."""
    engine: Engine = request.app.state.engine
    if not engine.is_open:
        detail = "The service is starting up or shutting down; try again in a few seconds."
        raise problems.Refusal(503, "not-ready", detail, headers={"Retry-After": "2"})
    return engine


@posted(
    asked, "/v1/simulate", "simulations", openapi.answer(openapi.any_of("SimulationResult")), SCENE
)
async def simulate(request: Request) -> Response:
    """Integrate a scene: each method's outcome, the observed quantities, thinned points.

    A method still running near the time limit is stopped there, and its outcome says so.
    """
    return await answered(request, "simulate")


@posted(
    asked,
    "/v1/work-precision",
    "simulations",
    openapi.answer(openapi.any_of("WorkPrecisionResult")),
    SCENE,
)
async def work_precision(request: Request) -> Response:
    """Measure error against time for every method of a scene, at many step sizes."""
    return await answered(request, "work-precision")


KindName = Literal["solve", "check", "simulate", "work-precision"]


@batches.post(
    "/v1/batches",
    status_code=202,
    response_model=BatchDocument,
    responses={202: {"headers": openapi.JOB_HEADERS}, **openapi.BAD_BODY},
    openapi_extra=openapi.BATCH_BODY,
)
async def create(request: Request, kind: KindName = "solve") -> Response:
    """Many documents: a JSON array, or NDJSON with one document per line; each may have its own
    `id`.

    All lines are stored before the answer, which is 202 with the address of the batch. With
    `Prefer: respond-async`, NDJSON is stored as it came and read after the answer. A bad line is
    answered by a problem object. Equal documents are computed once. `?kind=` asks for another kind
    of job. The same lines sent again are the same batch, unless some of it was cancelled,
    `Cache-Control: no-cache` asks again, or `Idempotency-Key` is another one. A key that came with
    other lines before is refused (422).
    """
    engine = engine_of(request)
    server, client, key = (
        engine.server_options,
        clients.client_of(request),
        asking.batch_key_of(request),
    )
    limit, fresh = asking.time_limit_of(request, server), asking.wants_fresh(request)
    terms = tasks.Terms(kind, server, limit, client, fresh, engine.settings.max_lines)
    async with asking.body_of(
        request, asking.FACTORS["batch"] * engine.settings.max_body, NDJSON_TYPES
    ) as body:
        preference, viewer = asking.preference_of(request), clients.viewer_of(request)
        is_later = preference.is_async and not asking.is_json(request)
        stored = await engine.send_batch(body, terms, viewer, key) if is_later else None
        applied = {} if stored is None else {"Preference-Applied": "respond-async"}
        if stored is None:
            stored = await engine.ask_batch(body, asking.is_json(request), terms, viewer, key)
    headers = applied | {
        "Location": f"/v1/batches/{stored.id}",
        "Retry-After": job_answers.RETRY_AFTER,
    }
    return JSONResponse(
        job_answers.batch_fields(stored), 202, headers | await engine.rate_limit(client)
    )


@batches.get(
    "/v1/batches",
    response_model=BatchList,
    responses={**openapi.refusals(422), **openapi.KEY_AND_RATE},
)
async def list_batches(
    request: Request,
    cursor: str | None = Query(None, max_length=64),
    limit: int = Query(20, ge=1, le=100),
) -> Response:
    """Batches, newest first, with the number of their lines in each status; `next` is the cursor of the next page."""
    engine, client = engine_of(request), clients.viewer_of(request).listed
    try:
        found, following = await engine.read(engine.store.batches, client, cursor, limit)
    except ValueError:
        raise _bad_cursor("batch") from None
    return JSONResponse(
        {"batches": [job_answers.batch_fields(one) for one in found], "next": following}
    )


def _bad_cursor(what: str) -> problems.Refusal:
    detail = (
        f"The cursor is not one that this list gave, or its {what} is forgotten; begin without one."
    )
    return problems.Refusal(422, "bad-input", detail, (errors.Place(detail, "/cursor"),))


@batches.get("/v1/batches/{id}", response_model=BatchDocument, responses={**openapi.UNKNOWN})
async def batch(request: Request, id: str) -> Response:
    """A batch with the number of its lines in each status."""
    return JSONResponse(job_answers.batch_fields(await _known_batch(request, id)))


@batches.delete("/v1/batches/{id}", response_model=BatchDocument, responses={**openapi.UNKNOWN})
async def dismiss_batches(request: Request, id: str) -> Response:
    """Cancel the lines that are still open in a batch; work that no other client waits for stops."""
    await engine_of(request).dismiss_batch(id, clients.viewer_of(request))
    return JSONResponse(job_answers.batch_fields(await _known_batch(request, id)))


@batches.get(
    "/v1/batches/{id}/results",
    response_class=StreamingResponse,
    responses={200: {"content": openapi.PARTS["batch_results"]}, **openapi.UNKNOWN},
)
async def results(request: Request, id: str) -> Response:
    """The answers as NDJSON in the order in which they come, each with the `id` of its line.

    The stream stays open until every line has its answer; an empty line every 10 s of silence says
    that it is alive. With `Accept: application/json` alone, they come as one JSON array.
    """
    found = await _known_batch(request, id)
    lines = answers_of(engine_of(request), found)
    if _wants_array(request):
        return StreamingResponse(
            as_array(lines), media_type="application/json", headers={"Vary": "Accept"}
        )
    return StreamingResponse(lines, media_type=NDJSON, headers={"Vary": "Accept"})


def _wants_array(request: Request) -> bool:
    accepted = [
        part.partition(";")[0].strip()
        for part in middleware.header_of(request.scope, b"accept").lower().split(",")
    ]
    # Who takes anything besides, as many programs say by default, gets the lines.
    return "application/json" in accepted and not {"*/*", *NDJSON_TYPES} & {*accepted}


async def as_array(parts: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """Lines, which come in parts of any length, as the elements of an array; empty ones are white space in it."""
    yield b"["
    is_first = begins = True
    async for part in parts:
        shown = list[bytes]()
        for place, piece in enumerate(part.split(b"\n")):
            begins = begins or place > 0
            if piece:
                shown += [b"" if not begins or is_first else b",\n", piece]
                is_first = begins = False
        yield b"".join(shown) or b"\n"
    yield b"]\n"


async def answers_of(engine: Engine, batch: model.Batch) -> AsyncIterator[bytes]:
    sent, after, looked, pause = 0, 0, time.monotonic(), 0.0

    async def look() -> asking.Found:
        nonlocal sent, after, looked, pause
        await asyncio.sleep(
            pause
        )  # readers of batches where nothing happens are woken by all others too
        answers = await engine.read(
            engine.store.batch_answers, batch.id, after, job_answers.AT_ONCE, job_answers.SMALL
        )
        pause = SMALLEST_PAUSE if answers else max(SMALLEST_PAUSE, min(LARGEST_PAUSE, 2 * pause))
        if answers or time.monotonic() - looked > KEEP_ALIVE:
            looked = time.monotonic()
            if not answers and await engine.read(engine.store.batch, batch.id) is None:
                raise middleware.StreamCut  # it was forgotten, or erased
        sent, after = sent + len(answers), answers[-1].order if answers else after
        is_last, is_more = sent >= batch.total, len(answers) == job_answers.AT_ONCE
        return asking.Found(job_answers.lines_of(engine, answers), is_last, is_more)

    async for part in engine.followed(asking.ANY, look, b"\n"):
        yield part
    if sent < batch.total:  # what ends as it should is taken for all answers
        raise middleware.StreamCut


async def _known_batch(request: Request, id: str) -> model.Batch:
    found = await engine_of(request).batch(id, clients.viewer_of(request))
    return problems.known(found, "batch of this id; it may have been forgotten.")


@posted(plain, "/v1/parse", "systems", openapi.PARSED, openapi.SYSTEM_BODY)
async def parse(request: Request) -> Response:
    """How a System document is parsed: text, LaTeX and MathML of each acceleration."""
    engine = engine_of(request)
    async with asking.body_of(request, engine.settings.max_body) as body:
        found = await engine.read_body(clients.client_of(request), tasks.parse_task, body)
    return Response(found, media_type="application/json")


@posted(
    plain, "/v1/check", "systems", {"model": base.CheckAnswer}, openapi.body_of("CheckedDocument")
)
async def check(request: Request) -> Response:
    """The independent checker's verdict on a result or a certificate, or on {"document": …,
    "result": …}.

    The system of a result is compared with the document that it carries, or with the one given with
    it. {"system": …, "lagrangian": "…"} tests whether your Lagrangian yields these equations:
    verdict and residual.
    """
    engine = engine_of(request)
    async with asking.body_of(request, asking.FACTORS["check"] * engine.settings.max_body) as body:
        return JSONResponse(await engine.check(clients.client_of(request), body))


@named.get("/v1/catalogue", response_model=base.CatalogueList)
async def list_catalogue() -> Response:
    """The names and titles of all systems of the catalogue."""
    entries = [catalogue.entry(name) for name in catalogue.names()]
    return JSONResponse(
        {"systems": [{key: e.get(key, "") for key in ("name", "title", "group")} for e in entries]}
    )


@named.get(
    "/v1/catalogue/{name}", responses={200: {"model": base.CatalogueEntry}, **openapi.refusals(404)}
)
async def catalogue_entry(name: str) -> Response:
    """One system of the catalogue: its document and what is known about it."""
    try:
        entry = catalogue.entry(name)
    except errors.InputError:
        detail = "The catalogue has no system of this name; GET /v1/catalogue lists them."
        raise problems.Refusal(404, "not-found", detail) from None
    entry = {key: entry[key] for key in base.CatalogueEntry.model_fields if key in entry}
    return JSONResponse(entry)


def form_task(equations: str) -> str:
    """The form of typed equations; InputError where they cannot be read."""
    return alike.form_of(
        tasks.understand_task(
            model.split_options({"equations": equations, "parameters": "guess"})[0]
        )
    )


async def found_by(request: Request, words: str, tag: str, equations: str) -> list[dict[str, Any]]:
    """The systems of a search; refuses equations that cannot be read."""
    form = None
    if equations.strip():
        form = await engine_of(request).made(
            clients.client_of(request), form_task, equations[:4_000], late=LATE
        )
    return catalogue.search_atlas(words[:200], tag[:80], form)


@named.get("/v1/atlas", response_model=AtlasList, responses=openapi.refusals(422))
async def search(
    request: Request,
    q: Annotated[str, Query(description="words of name, title, source, tags or equations")] = "",
    tag: Annotated[str, Query(description="a tag, such as Kamke or constraints")] = "",
    equations: Annotated[
        str,
        Query(
            description="equations: systems of the same form, up to names, order and constant factors"
        ),
    ] = "",
) -> Response:
    """Systems with computed answers, by words, by tag, and by equations."""
    found = await found_by(request, q, tag, equations)
    lines = [{key: entry[key] for key in AtlasLine.model_fields} for entry in found[:100]]
    return JSONResponse({"count": len(found), "systems": lines, "license": LICENSE, "cite": CITE})


@named.get(
    "/v1/atlas.ndjson",
    response_class=Response,
    responses={200: {"content": {"application/x-ndjson": {}}}},
)
async def whole(request: Request) -> Response:
    """The whole atlas, one system per line."""
    data, mark = await engine_of(request).in_thread(whole_atlas)
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
    """One system: its document and its answers, without their proofs."""
    found = problems.known(
        catalogue.atlas().get(name), "system of this name; GET /v1/atlas searches the atlas."
    )
    return JSONResponse(atlas_entry(found))


def atlas_entry(found: Mapping[str, Any]) -> dict[str, Any]:
    """An entry of the atlas as programs get it."""
    return {**found, "result": short_results.for_programs(found["result"])}


@lru_cache(maxsize=1)
def whole_atlas() -> tuple[bytes, str]:
    """All entries as NDJSON, and a digest of that."""
    lines = (
        json.dumps(atlas_entry(found), ensure_ascii=False) for found in catalogue.atlas().values()
    )
    data = "".join(f"{line}\n" for line in lines).encode()
    return data, hashlib.sha256(data).hexdigest()[:16]


@plain.get("/v1/limits", response_model=base.LimitsAnswer)
async def limits(request: Request) -> Response:
    """Every limit that a refusal can name."""
    settings = engine_of(request).settings
    document = {
        name.lower(): value for name, value in vars(base).items() if name.startswith("MAX_")
    }
    service = {
        "time_limit_seconds": settings.time_limit,
        "time_limit_on_a_busy_machine_seconds": workers.MOST_CROWDED * settings.time_limit,
        "memory_limit_mib": settings.memory_limit,
        "max_body_bytes": settings.max_body,
        "max_result_bytes": asking.FACTORS["check"] * settings.max_body,
        "max_batch_bytes": asking.FACTORS["batch"] * settings.max_body,
        "max_batch_lines": settings.max_lines,
        "max_line_bytes": MAX_LINE_BYTES,
        "default_wait_seconds": asking.DEFAULT_WAIT,
        "max_wait_seconds": asking.MAX_WAIT,
        "open_jobs": settings.queue,
        "open_jobs_of_a_client": settings.client_queue,
        "running_jobs_of_a_client": settings.client_running or settings.workers,
        "processor_seconds_of_a_client_a_day": settings.client_daily_seconds
        or 86_400 * settings.workers,
        "waiting_requests": settings.waiting,
        "retention_days": settings.retention_days,
        "store_mib": settings.store_size,
    }
    return JSONResponse(
        {"document": document, "formula": dataclasses.asdict(LIMITS), "service": service}
    )


@open_router.get("/llms.txt", response_class=PlainTextResponse)
async def llms() -> PlainTextResponse:
    """A summary of the calls for programs, in ten lines."""
    return PlainTextResponse(
        resources.files("inverse_service.web").joinpath("static/llms.txt").read_bytes()
    )


@open_router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive"}


@open_router.get("/readyz", responses=openapi.refusals(503))
async def readyz(request: Request) -> dict[str, str]:
    """The store answers, the supervisor of the jobs runs, the queue has room, no pool is at fault.

    `workers`: "loading" until the first process that reads has answered; questions are taken
    before.
    """
    engine: Engine = request.app.state.engine
    if faults := await engine.faults():
        raise problems.Refusal(503, "not-ready", " ".join(faults), headers={"Retry-After": "2"})
    return {"status": "ready", "workers": "running" if engine.is_reading else "loading"}


@open_router.get("/metrics", response_class=PlainTextResponse)
async def metrics(request: Request) -> Response:
    """Counters and gauges in the text format of Prometheus."""
    engine = engine_of(request)
    counts = await engine.read(engine.store.counts)
    oldest, size = await engine.read(engine.store.oldest), await engine.read(engine.store.size)
    age = 0.0 if oldest is None else max(0.0, time.time() - oldest)
    by_status: dict[tuple[str, ...], float] = {
        (status,): float(counts.get(status, 0)) for status in model.STATUSES
    }
    found = [
        monitoring.gauge("jobs", "Stored jobs by status.", by_status, ("status",)),
        monitoring.gauge("queue_length", "Jobs that wait for a worker.", counts.get("accepted", 0)),
        monitoring.gauge("queue_age_seconds", "How long the oldest of them waits.", age),
        monitoring.gauge("queue_limit", "At most so many jobs are open.", engine.settings.queue),
        monitoring.gauge("store_bytes", "Size of the database.", size),
        monitoring.gauge(
            "store_limit_bytes", "From there old answers go.", engine.settings.store_size * 2**20
        ),
        monitoring.gauge("connections", "Open connections.", len(engine.connections)),
        monitoring.gauge(
            "connections_limit", "At most so many are open.", engine.settings.connections
        ),
        monitoring.gauge(
            "quick_waiting", "Requests that are read or wait for that.", len(engine.places)
        ),
        monitoring.gauge("workers", "Worker processes.", engine.settings.workers),
        monitoring.gauge(
            "jobs_taken", "Jobs that this process has taken.", engine.supervisor.running
        ),
        monitoring.gauge(
            "info",
            "What runs.",
            {(model.engine_version(), __version__): 1.0},
            ("engine", "version"),
        ),
    ]
    return Response(monitoring.metrics_page(found), media_type=PROMETHEUS)

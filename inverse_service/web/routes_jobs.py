"""Questions and scenes as jobs: asked, looked at, followed, cancelled."""

import json
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any, Literal

from fastapi import APIRouter, Depends, Query
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from api_schemas.job import Job as JobDocument, JobList
from inverse_service import errors
from inverse_service.service.jobs import model, supervisor, tasks
from inverse_service.web import asking, clients, job_answers, openapi
from inverse_service.web.engine import Engine
from inverse_service.web.known import may_be_kept
from inverse_service.web.problems import Refusal, known

router = APIRouter(dependencies=[Depends(clients.require_client)], tags=["jobs"])
# Calls that read all of their requests themselves, so that the framework has nothing to resolve for them.
asked = APIRouter()
FORGOTTEN = "job of this id; it may have been forgotten. Ask again."
STILL_THERE = b": still there\n\n"


@asked.post(
    "/v1/solve",
    tags=["systems"],
    responses={
        200: openapi.SOLVED,
        202: {"model": JobDocument, "headers": openapi.JOB_HEADERS},
        **openapi.BAD_BODY,
    },
    openapi_extra=openapi.SYSTEM_BODY | openapi.TIME_LIMIT_QUERY,
)
async def solve(request: Request) -> Response:
    """Solve one system.

    The job is stored before any answer. The call waits 2 s, or as `Prefer: wait=S` says (at most 20);
    past it, or with `Prefer: respond-async`, the answer is 202 with the job's address. `?time_limit=S`, or
    `"options": {"time_limit": S, "memory_limit": MiB, "seed": N}` in the document, lower the limits of
    the service. The same question is answered from the store; `Cache-Control: no-cache` asks again. An
    `Idempotency-Key` that came with another question before is refused (422).
    `Accept` may ask for text, LaTeX or a SymPy program instead of JSON.
    """
    return await ask(request, "solve")


async def ask(request: Request, kind: str) -> Response:
    """The common path of all questions: store the job, wait briefly, answer."""
    request.scope["route"] = SimpleNamespace(path=f"/v1/{kind}")  # as the counts of requests name it
    clients.note_client(request)
    engine = engine_of(request)
    preference = asking.preference_of(request)
    client, server, viewer = clients.client_of(request), engine.server_options, clients.viewer_of(request)
    terms = tasks.Terms(kind, server, asking.time_limit_of(request, server), client, asking.wants_fresh(request))
    async with asking.body_of(request, asking.FACTORS[kind] * engine.settings.max_body) as body:
        question = await engine.question(body, terms)
    job = await engine.submit(question, viewer, preference.wait, asking.key_of(request))
    if job.is_open and preference.wait <= 0 and kind == "solve":
        await engine.look_ahead(client, question.document)
    answer = await job_answers.result_response(request, job, engine, preference)
    if job.status == "successful" and job.expires is None and not terms.fresh:
        may_be_kept(request.scope, job.id)
    answer.headers.update(await engine.rate_limit(client))
    return answer


@router.get("/v1/jobs", response_model=JobList, responses={**openapi.refusals(422), **openapi.KEY_AND_RATE})
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
        jobs, following = await engine.read(
            engine.store.jobs, status=status, kind=kind, client=client, cursor=cursor, limit=limit
        )
    except ValueError:
        detail = "The cursor is not one that this list gave, or its job is forgotten; begin without one."
        raise Refusal(422, "bad-input", detail, (errors.Place(detail, "/cursor"),)) from None
    fields = await engine.read(lambda: [job_answers.job_fields(job, engine) for job in jobs])
    return JSONResponse({"jobs": fields, "next": following})


@router.get(
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
    found = known(await engine.job(id, clients.viewer_of(request)), FORGOTTEN)
    return await job_answers.job_response(request, found, engine)


@router.delete("/v1/jobs/{id}", responses={200: {"model": JobDocument}, **openapi.UNKNOWN})
async def dismiss_jobs(request: Request, id: str) -> Response:
    """Cancel an open job; a finished job stays unchanged, with its result.

    It is dismissed for you. The work stops when no other client waits for it; the finished part is its result.
    """
    engine = engine_of(request)
    found = known(await engine.dismiss(id, clients.viewer_of(request)), FORGOTTEN)
    return await job_answers.job_document(found, engine, {}, is_whole=True)


@router.get(
    "/v1/jobs/{id}/events",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}},
        **openapi.UNKNOWN,
    },
)
async def events(request: Request, id: str) -> Response:
    """Server-sent events of a job, to the end. Resumable with Last-Event-ID.

    Each has an `id`, an `event` and as `data` a JSON object (JobEvent): `status` {status}; `progress` {elapsed, stage,
    order, family}; `part` {part, value}, the fields of the result that are known with a part of it, as it is
    finished. The values merged in their order are the result.
    """
    engine = engine_of(request)
    viewer = clients.viewer_of(request)
    known(await engine.job(id, viewer), FORGOTTEN)
    text = request.headers.get("last-event-id", request.query_params.get("last_event_id", "0"))
    after = int(text) if text.isascii() and text.isdigit() and len(text) < 16 else 0
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(_stream(engine, id, viewer, after), headers=headers, media_type="text/event-stream")


async def _stream(engine: Engine, id: str, viewer: model.Viewer, after: int) -> AsyncIterator[bytes]:
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
        return asking.Found(asking.each(map(written, fresh)), is_last, is_over)

    yield b"retry: 1000\n\n"
    async for part in engine.followed(id, look, STILL_THERE):
        yield part


def written(event: model.Event) -> bytes:
    """An event in the WHATWG format."""
    return f"id: {event.number}\nevent: {event.kind}\ndata: {json.dumps(dict(event.data))}\n\n".encode()


def engine_of(request: Request) -> Engine:
    """The engine of this application; 503 while it is starting or shutting down."""
    engine: Engine = request.app.state.engine
    if not engine.is_open:
        raise Refusal(
            503,
            "not-ready",
            "The service is starting up or shutting down; try again in a few seconds.",
            headers={"Retry-After": "2"},
        )
    return engine


SCENE = openapi.body_of("SceneDocument") | openapi.TIME_LIMIT_QUERY
ANSWERS: dict[int | str, dict[str, Any]] = {
    202: {"model": JobDocument, "headers": openapi.JOB_HEADERS},
    **openapi.BAD_BODY,
}


@asked.post(
    "/v1/simulate",
    tags=["simulations"],
    responses={200: openapi.answer(openapi.any_of("SimulationResult")), **ANSWERS},
    openapi_extra=SCENE,
)
async def simulate(request: Request) -> Response:
    """Integrate a scene: each method's outcome, the observed quantities, thinned points.

    A method still running near the time limit is stopped there, and its outcome says so.
    """
    return await ask(request, "simulate")


@asked.post(
    "/v1/work-precision",
    tags=["simulations"],
    responses={200: openapi.answer(openapi.any_of("WorkPrecisionResult")), **ANSWERS},
    openapi_extra=SCENE,
)
async def work_precision(request: Request) -> Response:
    """Measure error against time for every method of a scene, at many step sizes."""
    return await ask(request, "work-precision")


ASKED = {"/v1/solve": solve, "/v1/simulate": simulate, "/v1/work-precision": work_precision}

"""Batches: many documents in one call, their answers streamed as they come."""

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Any, Literal

from fastapi import APIRouter, Depends
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from api_schemas.job import Batch as BatchDocument
from inverse_service.errors import InputError
from inverse_service.service.jobs import model, statements
from inverse_service.service.jobs.tasks import Terms, batch_task
from inverse_service.web import asking, clients, job_answers, openapi
from inverse_service.web.engine import KEEP_ALIVE, LONG_DEADLINE, LOOK_AGAIN, Engine
from inverse_service.web.journal import StreamCut
from inverse_service.web.problems import Refusal, known
from inverse_service.web.routes_jobs import engine_of

router = APIRouter(dependencies=[Depends(clients.require_client)], tags=["batches"])
NDJSON = "application/x-ndjson"
NDJSON_TYPES = frozenset({NDJSON, "application/ndjson", "application/jsonl", "application/x-jsonlines"})
KindName = Literal["solve", "check", "simulate", "work-precision"]
# A stream that wakes for every job would read the store more than it writes answers.
LINES = {"type": "array", "items": {"type": "object", "description": "The answer of a line, with its `id`."}}
SMALLEST_PAUSE, LARGEST_PAUSE = 0.02, 0.5
# Any element is taken; one that is no document is answered by a problem object.
BATCH_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": {
                    "type": "array",
                    "minItems": 1,
                    "items": {"description": "A document; what is none gets an error line."},
                }
            },
            NDJSON: {"schema": {"type": "string"}},
        },
    }
}


@router.post(
    "/v1/batches",
    status_code=202,
    response_model=BatchDocument,
    responses={202: {"headers": openapi.JOB_HEADERS}, **openapi.BAD_BODY},
    openapi_extra=BATCH_BODY | openapi.BATCH_PARAMETERS,
)
async def create(request: Request, kind: KindName = "solve") -> Response:
    """Many documents: a JSON array, or NDJSON with one document per line; each may have its own `id`.

    All lines are stored before the answer, which is 202 with the address of the batch. A bad line is
    answered by a problem object. Equal documents are computed once. `?kind=` asks for another kind of job.
    The same lines sent again are the same batch, unless some of it was cancelled, `Cache-Control: no-cache`
    asks again, or `Idempotency-Key` is another one. A key that came with other lines before is refused (422).
    """
    engine = engine_of(request)
    media_type = asking.content_type(request)
    if media_type not in NDJSON_TYPES and not asking.is_json(media_type):
        raise Refusal(415, "content-type", f"Send 'Content-Type: {NDJSON}' or 'Content-Type: application/json'.")
    server, client, key = engine.server_options, clients.client_of(request), asking.batch_key_of(request)
    limit, fresh = asking.time_limit_of(request, server), asking.wants_fresh(request)
    terms = Terms(kind, server, limit, client, fresh, engine.settings.max_lines)
    try:
        async with asking.body_of(request, asking.FACTORS["batch"] * engine.settings.max_body) as body:
            form = (body, asking.is_json(media_type), terms)
            lines = await engine.read_body(client, batch_task, *form, seconds=LONG_DEADLINE)
            stored = await engine.create_batch(kind, clients.viewer_of(request), lines, key)
    except InputError as error:
        if error.code != "limit":
            raise
        raise Refusal(413, error.code, error.detail) from None
    headers = {
        "Location": f"/v1/batches/{stored.id}",
        "Retry-After": job_answers.RETRY_AFTER,
    } | await engine.rate_limit(client)
    return JSONResponse(job_answers.batch_fields(stored), 202, headers)


@router.get("/v1/batches/{id}", response_model=BatchDocument, responses={**openapi.UNKNOWN})
async def batch(request: Request, id: str) -> Response:
    """A batch with the number of its lines in each status."""
    return JSONResponse(job_answers.batch_fields(await _known(request, id)))


@router.delete("/v1/batches/{id}", response_model=BatchDocument, responses={**openapi.UNKNOWN})
async def dismiss_batches(request: Request, id: str) -> Response:
    """Cancel the lines that are still open in a batch; work that no other client waits for stops."""
    await engine_of(request).dismiss_batch(id, clients.viewer_of(request))
    return JSONResponse(job_answers.batch_fields(await _known(request, id)))


@router.get(
    "/v1/batches/{id}/results",
    response_class=StreamingResponse,
    responses={
        200: {"content": {NDJSON: {"schema": {"type": "string"}}, "application/json": {"schema": LINES}}},
        **openapi.UNKNOWN,
    },
)
async def results(request: Request, id: str) -> Response:
    """The answers as NDJSON in the order in which they come, each with the `id` of its line.

    The stream stays open until every line has its answer; an empty line every 10 s of silence says that it is alive.
    With `Accept: application/json` alone, they come as one JSON array.
    """
    found = await _known(request, id)
    lines = _stream(engine_of(request), found)
    if _wants_array(request):
        return StreamingResponse(as_array(lines), media_type="application/json", headers={"Vary": "Accept"})
    return StreamingResponse(lines, media_type=NDJSON, headers={"Vary": "Accept"})


def _wants_array(request: Request) -> bool:
    accepted = [part.partition(";")[0].strip() for part in request.headers.get("accept", "").lower().split(",")]
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


async def _stream(engine: Engine, batch: statements.Batch) -> AsyncIterator[bytes]:
    sent, after, spoken, pause = 0, 0, time.monotonic(), SMALLEST_PAUSE
    with engine.hub.waiting(asking.ANY) as changed:
        while sent < batch.total and not engine.hub.closing:
            changed.clear()
            patience = engine.look_again
            try:
                answers = await engine.read(
                    engine.store.batch_answers, batch.id, after, job_answers.AT_ONCE, job_answers.SMALL
                )
                is_silent = not answers and time.monotonic() - spoken > KEEP_ALIVE
                if is_silent and await engine.read(engine.store.batch, batch.id) is None:
                    break  # it was forgotten, or erased
            except model.StoreUnavailable:  # the stream continues when it is back
                answers, patience = [], LOOK_AGAIN
            # Readers of batches where nothing happens are woken by all others too.
            pause = SMALLEST_PAUSE if answers else min(LARGEST_PAUSE, 2 * pause)
            if answers:
                after, sent, spoken = answers[-1].order, sent + len(answers), time.monotonic()
                async for part in job_answers.lines_of(engine, answers):
                    yield part
            if time.monotonic() - spoken > KEEP_ALIVE:  # or the reader and proxies take us for dead
                spoken = time.monotonic()
                yield b"\n"
            if len(answers) < job_answers.AT_ONCE and sent < batch.total:
                await asking.until_set(changed, patience)
                await asyncio.sleep(pause)
    if sent < batch.total:  # what ends as it should is taken for all answers
        raise StreamCut


async def _known(request: Request, id: str) -> statements.Batch:
    found = await engine_of(request).batch(id, clients.viewer_of(request))
    return known(found, "batch of this id; it may have been forgotten.")

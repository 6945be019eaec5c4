"""Batches: many documents in one call, their answers streamed as they come."""

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Literal

from fastapi import APIRouter, Depends
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse

from api_schemas.job import Batch as BatchDocument
from inverse_service.errors import InputError
from inverse_service.service.jobs import statements
from inverse_service.service.jobs.tasks import Terms, batch_task
from inverse_service.web import asking, clients, job_answers, openapi
from inverse_service.web.engine import KEEP_ALIVE, LONG_DEADLINE, Engine
from inverse_service.web.journal import StreamCut
from inverse_service.web.problems import Refusal, known
from inverse_service.web.routes_jobs import engine_of

router = APIRouter(dependencies=[Depends(clients.require_client)], tags=["batches"])
NDJSON = "application/x-ndjson"
NDJSON_TYPES = frozenset({NDJSON, "application/ndjson", "application/jsonl", "application/x-jsonlines"})
KindName = Literal["solve", "check", "simulate", "work-precision"]
# A stream that wakes for every job would read the store more than it writes answers.
SMALLEST_PAUSE, LARGEST_PAUSE = 0.02, 0.5


@router.post(
    "/v1/batches",
    status_code=202,
    response_model=BatchDocument,
    responses={202: {"headers": openapi.JOB_HEADERS}, **openapi.BAD_BODY},
    openapi_extra=openapi.BATCH_BODY,
)
async def create(request: Request, kind: KindName = "solve") -> Response:
    """Many documents: a JSON array, or NDJSON with one document per line; each may have its own `id`.

    All lines are stored before the answer, which is 202 with the address of the batch. A bad line is
    answered by a problem object. Equal documents are computed once. `?kind=` asks for another kind of job.
    The same lines sent again are the same batch, unless some of it was cancelled, `Cache-Control: no-cache`
    asks again, or `Idempotency-Key` is another one. A key that came with other lines before is refused (422).
    """
    engine = engine_of(request)
    server, client, key = engine.server_options, clients.client_of(request), asking.batch_key_of(request)
    limit, fresh = asking.time_limit_of(request, server), asking.wants_fresh(request)
    terms = Terms(kind, server, limit, client, fresh, engine.settings.max_lines)
    try:
        async with asking.body_of(request, asking.FACTORS["batch"] * engine.settings.max_body, NDJSON_TYPES) as body:
            form = (body, asking.is_json(request), terms)
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
    responses={200: {"content": openapi.PARTS["batch_results"]}, **openapi.UNKNOWN},
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
    sent, after, looked, pause = 0, 0, time.monotonic(), 0.0

    async def look() -> asking.Found:
        nonlocal sent, after, looked, pause
        await asyncio.sleep(pause)  # readers of batches where nothing happens are woken by all others too
        answers = await engine.read(engine.store.batch_answers, batch.id, after, job_answers.AT_ONCE, job_answers.SMALL)
        pause = SMALLEST_PAUSE if answers else max(SMALLEST_PAUSE, min(LARGEST_PAUSE, 2 * pause))
        if answers or time.monotonic() - looked > KEEP_ALIVE:
            looked = time.monotonic()
            if not answers and await engine.read(engine.store.batch, batch.id) is None:
                raise StreamCut  # it was forgotten, or erased
        sent, after = sent + len(answers), answers[-1].order if answers else after
        is_last, is_more = sent >= batch.total, len(answers) == job_answers.AT_ONCE
        return asking.Found(job_answers.lines_of(engine, answers), is_last, is_more)

    async for part in engine.followed(asking.ANY, look, b"\n"):
        yield part
    if sent < batch.total:  # what ends as it should is taken for all answers
        raise StreamCut


async def _known(request: Request, id: str) -> statements.Batch:
    found = await engine_of(request).batch(id, clients.viewer_of(request))
    return known(found, "batch of this id; it may have been forgotten.")

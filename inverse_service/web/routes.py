"""The calls under /v1 and the probes."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from api_schemas import sizes
from api_schemas.problem import CatalogueEntry, CatalogueList, CheckAnswer, LimitsAnswer, ParseAnswer, ProblemDocument
from api_schemas.result import ResultDocument
from inverse_service import catalogue
from inverse_service.expressions.limits import LIMITS
from inverse_service.service.reading import decode
from inverse_service.web.bodies import as_json, read_body, read_json_body
from inverse_service.web.engine import Engine
from inverse_service.web.problems import MEDIA_TYPE, Refusal

MAX_WAIT = 20.0
CHECK_BODY_FACTOR = 20
WAIT = re.compile(r"(?:^|[,;\s])wait\s*=\s*\"?(\d{1,6})", re.IGNORECASE)

router = APIRouter()


def refusals(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The problem documents of a route, for the OpenAPI description."""
    return {status: {"model": ProblemDocument, "content": {MEDIA_TYPE: {}}} for status in statuses}


def body_of(schema: str) -> dict[str, Any]:
    """The body of a route that reads it itself, for the OpenAPI description."""
    reference = {"$ref": f"#/components/schemas/{schema}"}
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": reference}}}}


BAD_BODY = refusals(400, 413, 415, 422, 503)
SYSTEM_BODY = body_of("SystemDocument")


@router.post("/v1/parse", responses={200: {"model": ParseAnswer}, **BAD_BODY}, openapi_extra=SYSTEM_BODY)
async def parse(request: Request) -> Response:
    """What was understood of a System document: text, LaTeX and MathML of each acceleration."""
    engine = engine_of(request)
    document = await read_json_body(request, engine.settings.max_body)
    return JSONResponse(await engine.parse(document))


@router.post("/v1/solve", responses={200: {"model": ResultDocument}, **BAD_BODY}, openapi_extra=SYSTEM_BODY)
async def solve(request: Request) -> Response:
    """One system to its result.

    The answer comes with this call, at the latest at the time limit of the service (GET /v1/limits), and
    is undetermined then. `?time_limit=S` asks for a shorter limit. `Prefer: wait=S` (at most 20) is
    accepted; there are no stored jobs yet to point to, so the call waits for the result all the same.
    """
    engine = engine_of(request)
    wait_of(request)
    limit = time_limit_of(request, engine.settings.time_limit)
    document = await read_json_body(request, engine.settings.max_body)
    return JSONResponse(await engine.solve(document, limit))


@router.post("/v1/check", responses={200: {"model": CheckAnswer}, **BAD_BODY}, openapi_extra=body_of("ResultDocument"))
async def check(request: Request) -> Response:
    """The independent checker's verdict on a result."""
    engine = engine_of(request)
    body_limit = CHECK_BODY_FACTOR * engine.settings.max_body
    if not isinstance(await read_json_body_again(request, body_limit), dict):
        raise Refusal(422, "bad-input", "The body is not a result: send the JSON object that /v1/solve answered.")
    return JSONResponse(await engine.check(decode(request.state.body)))


@router.get("/v1/catalogue", response_model=CatalogueList)
async def list_catalogue() -> Response:
    """The names and titles of all systems of the catalogue."""
    entries = [catalogue.entry(name) for name in catalogue.names()]
    return JSONResponse({"systems": [{key: e.get(key, "") for key in ("name", "title", "group")} for e in entries]})


@router.get("/v1/catalogue/{name}", responses={200: {"model": CatalogueEntry}, **refusals(404)})
async def catalogue_entry(name: str) -> Response:
    """One system of the catalogue: its document and what is known about it."""
    try:
        entry = catalogue.entry(name)
    except KeyError:
        raise Refusal(
            404, "not-found", "The catalogue has no system of this name; GET /v1/catalogue lists them."
        ) from None
    entry = {key: entry[key] for key in CatalogueEntry.model_fields if key in entry}
    return JSONResponse(entry)


@router.get("/v1/limits", response_model=LimitsAnswer)
async def limits(request: Request) -> Response:
    """Every limit that a refusal can name."""
    settings = engine_of(request).settings
    document = {name.lower(): value for name, value in vars(sizes).items() if name.startswith("MAX_")}
    service = {
        "time_limit_seconds": settings.time_limit,
        "memory_limit_mib": settings.memory_limit,
        "max_body_bytes": settings.max_body,
        "max_result_bytes": CHECK_BODY_FACTOR * settings.max_body,
        "max_wait_seconds": MAX_WAIT,
        "waiting_requests": settings.queue,
    }
    return JSONResponse({"document": document, "formula": dataclasses.asdict(LIMITS), "service": service})


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive"}


@router.get("/readyz", responses=refusals(503))
async def readyz(request: Request) -> dict[str, str]:
    """A worker process answers."""
    if not await engine_of(request).is_ready():
        raise Refusal(503, "not-ready", "No worker process answers yet; try again in some seconds.")
    return {"status": "ready"}


def engine_of(request: Request) -> Engine:
    """The engine of this application."""
    engine: Engine = request.app.state.engine
    return engine


def wait_of(request: Request) -> float | None:
    """The S of `Prefer: wait=S`, or None; refuses more than 20 s. An unknown preference is ignored (RFC 7240)."""
    found = WAIT.search(request.headers.get("prefer", ""))
    if found is None:
        return None
    if float(found.group(1)) > MAX_WAIT:
        raise Refusal(422, "limit", f"'Prefer: wait=S' takes at most {MAX_WAIT:g} s.")
    return float(found.group(1))


def time_limit_of(request: Request, largest: float) -> float:
    """The `time_limit` of the query, or the largest one; refuses what is no such number of seconds."""
    text = request.query_params.get("time_limit")
    if text is None:
        return largest
    try:
        value = float(text) if len(text) < 30 else float("nan")
    except ValueError:
        value = float("nan")
    if not 0 < value <= largest:
        raise Refusal(422, "limit", f"time_limit must be a number of seconds above 0 and at most {largest:g}.")
    return value


async def read_json_body_again(request: Request, limit: int) -> Any:
    """The JSON value of the body, whose bytes stay at hand for the checker, which reads them itself."""
    request.state.body = await read_body(request, limit)
    return as_json(request.state.body)

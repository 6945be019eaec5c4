"""Scenes over HTTP: the same rules of jobs as for solving."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Depends
from starlette.requests import Request
from starlette.responses import Response

from api_schemas.job import Job as JobDocument
from inverse_service.web.clients import require_client
from inverse_service.web.describing import BAD_BODY, JOB_HEADERS, OBJECT, TIME_LIMIT_QUERY, body_of
from inverse_service.web.routes_jobs import ask

router = APIRouter(dependencies=[Depends(require_client)])
SCENE = body_of("SceneDocument") | TIME_LIMIT_QUERY
ANSWERS: dict[int | str, dict[str, Any]] = {
    200: OBJECT,
    202: {"model": JobDocument, "headers": JOB_HEADERS},
    **BAD_BODY,
}


@router.post("/v1/simulate", responses=ANSWERS, openapi_extra=SCENE)
async def simulate(request: Request) -> Response:
    """A scene to its result: each method's outcome, the observed quantities, thinned points.

    A method still running near the time limit is stopped there, and its outcome says so.
    """
    return await ask(request, "simulate")


@router.post("/v1/work-precision", responses=ANSWERS, openapi_extra=SCENE)
async def work_precision(request: Request) -> Response:
    """A scene to error against time for every method, at many step sizes."""
    return await ask(request, "work-precision")

"""The atlas: search by name, tag and equations, one entry, and the whole as NDJSON."""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from api_schemas.job import AtlasEntry, AtlasLine, AtlasList
from inverse_service.catalogue import atlas
from inverse_service.service.documents import alike
from inverse_service.service.jobs import model, tasks
from inverse_service.web import clients, job_answers, openapi
from inverse_service.web.engine import Engine
from inverse_service.web.problems import known

router = APIRouter(dependencies=[Depends(clients.require_client)], tags=["catalogue"])
LICENSE = "MIT"
CITE = "The inverse-service atlas: systems of equations of motion with their Lagrangians, computed and checked."
LATE = "Reading these equations takes too long for a search."


def form_task(equations: str) -> str:
    """The form of typed equations; InputError where they cannot be read."""
    return alike.form_of(tasks.understand_task(model.split_options({"equations": equations, "parameters": "guess"})[0]))


async def found_by(request: Request, words: str, tag: str, equations: str) -> list[dict[str, Any]]:
    """The systems of a search; refuses equations that cannot be read."""
    form = None
    if equations.strip():
        engine: Engine = request.app.state.engine
        form = await engine.made(clients.client_of(request), form_task, equations[:4_000], late=LATE)
    return atlas.search(words[:200], tag[:80], form)


@router.get("/v1/atlas", response_model=AtlasList, responses=openapi.refusals(422))
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


@router.get("/v1/atlas.ndjson", response_class=Response, responses={200: {"content": {"application/x-ndjson": {}}}})
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


@router.get("/v1/atlas/{name}", responses={200: {"model": AtlasEntry}, **openapi.refusals(404)})
async def entry(name: str) -> Response:
    """One system: its document, its answers, L, H and where they hold."""
    return JSONResponse(known(atlas.entries().get(name), "system of this name; GET /v1/atlas searches the atlas."))

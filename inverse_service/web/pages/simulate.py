"""The page that runs a scene, and its way to the result."""

from __future__ import annotations

import json
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service import catalogue
from inverse_service.errors import InputError
from inverse_service.web.engine import Engine
from inverse_service.web.pages import reading_back
from inverse_service.web.pages.calls import call
from inverse_service.web.pages.forms import read_form
from inverse_service.web.pages.rendering import page
from inverse_service.web.pages.results import IDENTIFIER
from inverse_service.web.pages.scenes import (
    METHODS,
    OBSERVABLES,
    SceneForm,
    form_of_scene,
    scene_document,
    scene_form,
    with_sent,
)
from inverse_service.web.pages.solve import example_document, result_address
from inverse_service.web.problems import Refusal

router = APIRouter()
CONSTRAINED = ("name", "coordinates", "lagrangian", "constraints", "parameters", "functions")
FIRST_SYSTEM = "vertically-rolling-disk"
CALLS = {"simulate": "/v1/simulate", "work-precision": "/v1/work-precision"}


@router.get("/simulate")
async def form(request: Request) -> HTMLResponse:
    """The form for a system of the catalogue, for a result, or for a scene that was run before."""
    query = request.query_params
    if "scene" in query:
        return simulate_page(await _form_of_job(request, query["scene"]))
    found, _ = await _empty_form(request, query.get("system", FIRST_SYSTEM), query.get("job", ""))
    return simulate_page(found)


@router.post("/simulate")
async def run(request: Request) -> Response:
    """The job of the scene; on to its page, or back with what to change."""
    sent = await read_form(request, request.app.state.engine.settings.max_body)
    empty, system = await _empty_form(request, sent.text("system"), sent.text("job"))
    filled = with_sent(empty, sent)
    try:
        scene = scene_document(filled, system)
    except InputError as error:
        return simulate_page(filled, reading_back.problem_of_error(error, {}), 422)
    kind = "work-precision" if sent.text("kind") == "work-precision" else "simulate"
    answer = await call(request, "POST", CALLS[kind], scene, {"Prefer": "respond-async"})
    if answer.is_problem:
        return simulate_page(filled, reading_back.problem_of(answer.value, {}), answer.status)
    return RedirectResponse(result_address(answer), 303)


def simulate_page(form: SceneForm, problem: reading_back.Problem | None = None, status: int = 200) -> HTMLResponse:
    """The page with the form filled in."""
    systems = [(name, catalogue.entry(name)["title"]) for name in catalogue.names("nonholonomic")]
    return page(
        "simulate.html",
        status,
        active="/simulate",
        form=form,
        systems=systems,
        methods=METHODS,
        observables=OBSERVABLES,
        problem=problem,
    )


async def _empty_form(request: Request, system: str, job: str) -> tuple[SceneForm, dict[str, Any] | None]:
    """The form of a result with the system of its scenes, or that of a catalogue entry.

    A result of a constrained system gives that one, any other its equations with the Lagrangian that was found.
    """
    if not job:
        document = example_document(system)
        return scene_form(document, catalogue.entry(system)["title"], system=system), None
    answer = await call(request, "GET", f"/v1/jobs/{job}") if IDENTIFIER.fullmatch(job) else None
    result = None if answer is None or answer.is_problem else answer.value.get("result")
    if not result or not result.get("system") or not result.get("lagrangian"):
        raise Refusal(404, "not-found", "There is no result with a Lagrangian at this address.")
    shown = result["system"]
    if result.get("nonholonomic"):
        given = {key: shown["given"][key] for key in CONSTRAINED if key in shown["given"]}
        return scene_form(given, given.get("name") or "the system that was solved", job=job), {"document": given}
    document = {"coordinates": shown["coordinates"], "parameters": shown["parameters"], "functions": shown["functions"]}
    return scene_form(document, shown["name"] or "the system that was solved", job=job), {"result": result}


async def _form_of_job(request: Request, identifier: str) -> SceneForm:
    engine: Engine = request.app.state.engine
    job = engine.store.job(identifier, with_body=False) if IDENTIFIER.fullmatch(identifier) else None
    if job is None or job.kind not in CALLS:
        raise Refusal(404, "not-found", "There is no scene at this address.")
    scene = json.loads(job.document)
    system = scene.get("system", {})
    if "catalogue" in system:
        found, _ = await _empty_form(request, system["catalogue"], "")
        return form_of_scene(found, scene)
    raise Refusal(404, "not-found", "This scene was not made on this page; change its document instead.")

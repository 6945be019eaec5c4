"""The page that runs a scene, and its way to the result."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response

from inverse_service import catalogue
from inverse_service.errors import DocumentRefused, InputError, Place
from inverse_service.reading.reader import equation_line, has_acceleration
from inverse_service.service.documents.text_page import answers_of
from inverse_service.web.clients import client_of
from inverse_service.web.engine import LONG_DEADLINE, Engine
from inverse_service.web.pages import reading_back, scenes
from inverse_service.web.pages.atlas_pages import body_of
from inverse_service.web.pages.forms import Form
from inverse_service.web.pages.own_calls import call, read_form
from inverse_service.web.pages.preview import preview_task, price_task
from inverse_service.web.pages.rendering import page
from inverse_service.web.pages.result_pages import made, result_address, stored_job, successful
from inverse_service.web.pages.result_tasks import part_task
from inverse_service.web.pages.solve import example_document
from inverse_service.web.problems import Refusal

router = APIRouter()
CONSTRAINED = ("name", "coordinates", "lagrangian", "constraints", "parameters", "functions")
FIRST_SYSTEM = "vertically-rolling-disk"
WITHOUT_LAGRANGIAN = ("runge-kutta", "reference")
LONGEST_TITLE = 60
CALLS = {"simulate": "/v1/simulate", "work-precision": "/v1/work-precision"}


@router.get("/simulate")
async def form(request: Request) -> HTMLResponse:
    """The form for a system of the catalogue, for a result, or for a scene that was run before."""
    query = request.query_params
    if "scene" in query:
        return simulate_page((await _form_of_scene(request, query["scene"]))[0])
    found, _ = await _empty_form(request, query.get("system", FIRST_SYSTEM), query.get("job", ""))
    if "step" in query:  # a scene in the address, before it is run
        fields = {name: tuple(query.getlist(name)) for name in query}
        found = scenes.with_sent(found, Form(fields))
    return simulate_page(found)


@router.post("/simulate")
async def run(request: Request) -> Response:
    """The job of the scene; on to its page, or back with what to change."""
    sent = await read_form(request, request.app.state.engine.settings.max_body)
    filled, base = await _sent_form(request, sent)
    try:
        scene = scenes.changed_scene(base, scenes.scene_document(filled, base["system"]))
        await _refuse_unreadable(request, scene)
    except InputError as error:
        return simulate_page(filled, reading_back.problem_of_error(error, {}), 422)
    kind = "work-precision" if sent.text("kind") == "work-precision" else "simulate"
    answer = await call(request, "POST", CALLS[kind], scene, {"Prefer": "respond-async"})
    if answer.is_problem:
        return simulate_page(filled, reading_back.problem_of(answer.value, {}), answer.status)
    return RedirectResponse(result_address(answer), 303)


async def _refuse_unreadable(request: Request, scene: dict[str, Any]) -> None:
    """InputError where a value of the form cannot be read: it is told beside its field, and no job is made."""
    engine: Engine = request.app.state.engine
    outcome = await engine.run_quick(client_of(request), preview_task, scene, seconds=LONG_DEADLINE)
    if outcome.places:
        raise DocumentRefused(tuple(outcome.places))


# Where a document says it, and the field of the form that is about it.
FIELDS = (
    ("/parameters/", "parameter."),
    ("/functions/", "function."),
    ("/initial/positions/", "position."),
    ("/initial/velocities/", "velocity."),
)


def field_of(pointer: str) -> str:
    """The name of the field of the form that a pointer into a scene is about; empty where there is none."""
    for start, name in FIELDS:
        if pointer.startswith(start):
            return name + pointer.removeprefix(start)
    return pointer[1:] if pointer in ("/step", "/steps") else ""


@router.post("/simulate/preview")
async def preview(request: Request) -> Response:
    """The formulas and the start of the form as it stands, for the script that plays with them."""
    return await _of_form(request, preview_task)


@router.post("/simulate/price")
async def price(request: Request) -> Response:
    """What the step of the form costs."""
    return await _of_form(request, price_task)


async def _of_form(request: Request, task: Callable[[Mapping[str, Any]], dict[str, Any]]) -> Response:
    """What a task makes of the form as it stands, or what is wrong beside which field."""
    sent = await read_form(request, request.app.state.engine.settings.max_body)
    form, base = await _sent_form(request, sent)
    engine: Engine = request.app.state.engine
    try:
        scene = scenes.changed_scene(base, scenes.scene_document(form, base["system"]))
        outcome = await engine.run_quick(client_of(request), task, scene, seconds=LONG_DEADLINE)
        found = outcome.value if outcome.status == "done" else _told(outcome.places)
    except InputError as error:
        found = _told(error.places)
    return JSONResponse(found)


def _told(places: Sequence[Place]) -> dict[str, Any]:
    """What is wrong, and beside which fields it is said."""
    faults = {field_of(place.pointer): reading_back.sentence(place) for place in places}
    return {"reason": " ".join(faults.values()), "faults": {name: said for name, said in faults.items() if name}}


async def _sent_form(request: Request, sent: Form) -> tuple[scenes.SceneForm, dict[str, Any]]:
    """The form as it was sent, and what its scenes begin with."""
    if sent.text("scene"):
        empty, base = await _form_of_scene(request, sent.text("scene"))
    else:
        empty, base = await _empty_form(request, sent.text("system"), sent.text("job"))
    # A button of the start page sends the form as it is filled.
    return empty if sent.text("filled") else scenes.with_sent(empty, sent), base


def simulate_page(
    form: scenes.SceneForm, problem: reading_back.Problem | None = None, status: int = 200
) -> HTMLResponse:
    """The page with the form filled in."""
    systems = [(name, catalogue.entry(name)["title"]) for name in catalogue.names("nonholonomic")]
    return page(
        "simulate.html",
        status,
        active="/simulate",
        form=form,
        body=body_of(form.system),
        systems=systems,
        methods=scenes.METHODS,
        observables=scenes.OBSERVABLES,
        problem=problem,
        faults={field_of(place.pointer): place.detail for place in problem.places} if problem else {},
    )


async def _empty_form(request: Request, system: str, job: str) -> tuple[scenes.SceneForm, dict[str, Any]]:
    """The form of a result or of a catalogue entry, with what its scenes begin with.

    A result of a constrained system gives that one with the Lagrangian that was found for an associated system as
    the free Lagrangian, any other its equations with their Lagrangian.
    """
    if not job:
        return form_of_system({"catalogue": system}), {"system": {"catalogue": system}}
    found = None
    if await successful(request, job) is not None:
        found = await made(request, job, part_task, partial(_form_of_result, job=job))
    if found is None:
        raise Refusal(404, "not-found", "There is no result with a system at this address.")
    form, base = found
    return form, base


def _form_of_result(result: Mapping[str, Any], job: str) -> tuple[scenes.SceneForm, dict[str, Any]] | None:
    """The same of a result, inside a worker; None where it has no system that was solved."""
    given = (result.get("system") or {}).get("given")
    if not given:
        return None
    starts = importlib.import_module("inverse_service.web.pages.starts")
    is_forward = "verdict" not in result
    if result.get("nonholonomic") or is_forward:
        # Names that were left to be found in the text are taken from what was found.
        names = {key: list(result["system"][key]) for key in ("coordinates", "parameters")
                 if not isinstance(given.get(key), list | dict)}  # fmt: skip
        system_of_it = {"document": {key: given[key] for key in CONSTRAINED if key in given} | names}
        if is_forward:
            form = form_of_system(system_of_it, job=job)
            return starts.with_good_start(form, system_of_it, {}), {"system": system_of_it}
        # A Lagrangian with arbitrary functions is looked for again, with the functions that the scene gives.
        known = result.get("lagrangian") and not given.get("functions")
        found = {"free_lagrangian": result["lagrangian"]["text"]} if known else {}
        form = starts.with_good_start(form_of_system(system_of_it, job=job), system_of_it, {}, found)
        return form, {"system": system_of_it, **found}
    base = {"system": {"result": result}}
    form = form_of_system(base["system"], job=job)
    with_lagrangian = [answer for answer, _ in answers_of(result, result) if answer["lagrangian"]]
    return starts.with_good_start(form, base["system"], with_lagrangian[0] if with_lagrangian else {}), base


def form_of_system(system: Mapping[str, Any], **address: str) -> scenes.SceneForm:
    """The form for a scene's `system`: an entry of the catalogue, a document, a result, or a system written out."""
    if "catalogue" in system:
        name = system["catalogue"]
        return scenes.scene_form(example_document(name), catalogue.entry(name)["title"], system=name, **address)
    if "result" in system:
        shown = system["result"]["system"]
        kept = ("coordinates", "parameters", "functions", "equations")
        solved = {key: shown[key] for key in kept if key in shown}
        unsolved = any(has_acceleration(text) for text in shown.get("equations", {}).values())
        form = scenes.scene_form(shown["given"] if unsolved else solved, shown["name"] or _title(shown), **address)
        answers = (system["result"], system["result"].get("with_time") or {})
        # Without a Lagrangian there is nothing to discretize but the equations.
        return form if any(a.get("lagrangian") for a in answers) else replace(form, methods=WITHOUT_LAGRANGIAN)
    document = system.get("document", system)
    return scenes.scene_form(document, document.get("name") or _title(document), **address)


def _title(system: Mapping[str, Any]) -> str:
    """What tells a system without a name from others: its Lagrangian, its first equation, or its coordinates."""
    equations = system.get("equations") or {}
    first = next(iter(equations.items()), None) if isinstance(equations, dict) else None
    formula = f"L = {system['lagrangian']}" if system.get("lagrangian") else equation_line(*first) if first else ""
    title = f"motion of {formula or 'a system'}"
    return title if len(title) <= LONGEST_TITLE else f"motion of {', '.join(system['coordinates'])}"[:LONGEST_TITLE]


async def _form_of_scene(request: Request, identifier: str) -> tuple[scenes.SceneForm, dict[str, Any]]:
    """The form filled with a scene that was run before, and that scene."""
    job = await stored_job(request, identifier)
    if job is None or job.kind not in CALLS:
        raise Refusal(404, "not-found", "There is no scene at this address.")
    scene = json.loads(job.document)
    try:
        empty = form_of_system(scene["system"], scene=identifier)
    except (AttributeError, KeyError, TypeError, ValueError):
        raise Refusal(422, "bad-input", "This scene names no coordinates; change its document instead.") from None
    return scenes.form_of_scene(empty, scene), scene

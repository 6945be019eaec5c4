"""The page of a scene: its form for a system, a result, or a scene that was run before, and its way to a result."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response

from inverse_service import catalogue, errors
from inverse_service.reading import reader
from inverse_service.service.documents import text_page
from inverse_service.web.pages import forms, library, rendering, result_tasks, results, scene_form, solve
from inverse_service.web.pages.forms import Form
from inverse_service.web.pages.preview import preview_task, price_task
from inverse_service.web.pages.scene_form import SceneForm
from inverse_service.web.problems import Refusal, known

router = APIRouter()
CONSTRAINED = ("name", "coordinates", "lagrangian", "constraints", "parameters", "functions")
FIRST_SYSTEM = "vertically-rolling-disk"
WITHOUT_LAGRANGIAN = ("runge-kutta", "reference")
# What a price is compared with, besides the methods that are ticked.
COMPARED: tuple[dict[str, Any], ...] = (
    {"method": "adaptive"}, {"method": "runge-kutta"}, {"method": "runge-kutta", "order": 8}, {"method": "reference"},
)  # fmt: skip
CALLS = {"simulate": "/v1/simulate", "work-precision": "/v1/work-precision"}
# Where a document says it, and the field of the form that is about it.
FIELDS = (
    ("/parameters/", "parameter."),
    ("/functions/", "function."),
    ("/initial/positions/", "position."),
    ("/initial/velocities/", "velocity."),
)


@router.get("/simulate")
async def form(request: Request) -> HTMLResponse:
    """The form for a system of the catalogue, for a result, or for a scene that was run before."""
    query = request.query_params
    if "scene" in query:
        return simulate_page((await _form_of_scene(request, query["scene"]))[0])
    found, _ = await _empty_form(request, query.get("system", FIRST_SYSTEM), query.get("job", ""))
    if "step" in query:  # a scene in the address, before it is run
        fields = {name: tuple(query.getlist(name)) for name in query}
        found = scene_form.with_sent(found, Form(fields))
    return simulate_page(found)


@router.post("/simulate")
async def run(request: Request) -> Response:
    """The job of the scene; redirect to its page, or back to the form with corrections."""
    sent = await results.read_form(request)
    filled, base = await _sent_form(request, sent)
    try:
        scene = scene_form.changed_scene(base, scene_form.scene_document(filled, base["system"]))
        # A value that cannot be read is reported next to its field, and no job is created.
        outcome = await results.quick(request, preview_task, scene)
        if outcome.places:
            raise errors.DocumentRefused(tuple(outcome.places))
    except errors.InputError as error:
        return simulate_page(filled, forms.problem_of_error(error, {}), 422)
    kind = "work-precision" if sent.text("kind") == "work-precision" else "simulate"
    if kind == "work-precision":
        scene["methods"] += [one for one in COMPARED if one not in scene["methods"]]
    answer = await results.call(request, "POST", CALLS[kind], scene, {"Prefer": "respond-async"})
    if answer.is_error:
        return simulate_page(filled, forms.problem_of(answer.json(), {}), answer.status_code)
    return RedirectResponse(results.result_address(answer), 303)


def field_of(pointer: str) -> str:
    """The name of the form field that a pointer into a scene refers to; empty if there is none."""
    for start, name in FIELDS:
        if pointer.startswith(start):
            return name + pointer.removeprefix(start)
    return pointer[1:] if pointer in ("/step", "/steps") else ""


@router.post("/simulate/preview")
async def preview(request: Request) -> Response:
    """The formulas and the start of the current form, for the script that animates them."""
    return await _of_form(request, preview_task)


@router.post("/simulate/price")
async def price(request: Request) -> Response:
    """The cost of a step of the form."""
    return await _of_form(request, price_task)


async def _of_form(request: Request, task: Callable[[Mapping[str, Any]], dict[str, Any]]) -> Response:
    """The result of a task for the current form, or the errors and their fields."""
    sent = await results.read_form(request)
    form, base = await _sent_form(request, sent)
    try:
        scene = scene_form.changed_scene(base, scene_form.scene_document(form, base["system"]))
        outcome = await results.quick(request, task, scene)
        found = outcome.value if outcome.status == "done" else _told(outcome.places)
    except errors.InputError as error:
        found = _told(error.places)
    return JSONResponse(found)


def _told(places: Sequence[errors.Place]) -> dict[str, Any]:
    """The errors, and next to which fields they are shown."""
    faults = {field_of(place.pointer): forms.sentence(place) for place in places}
    return {"reason": " ".join(faults.values()), "faults": {name: said for name, said in faults.items() if name}}


async def _sent_form(request: Request, sent: Form) -> tuple[SceneForm, dict[str, Any]]:
    """The form as sent, and the base of its scenes."""
    if sent.text("scene"):
        empty, base = await _form_of_scene(request, sent.text("scene"))
    else:
        empty, base = await _empty_form(request, sent.text("system"), sent.text("job"))
    return scene_form.with_sent(empty, sent), base


def simulate_page(form: SceneForm, problem: forms.Problem | None = None, status: int = 200) -> HTMLResponse:
    """The page with the form filled in."""
    systems = [(name, catalogue.entry(name)["title"]) for name in catalogue.names("nonholonomic")]
    return rendering.page(
        "simulate.html",
        status,
        active="/simulate",
        form=form,
        body=library.body_of(form.system),
        systems=systems,
        methods=scene_form.METHODS,
        observables=scene_form.OBSERVABLES,
        problem=problem,
        faults={field_of(place.pointer): place.detail for place in problem or ()},
    )


async def _empty_form(request: Request, system: str, job: str) -> tuple[SceneForm, dict[str, Any]]:
    """The form of a result or of a catalogue entry, with what its scenes begin with.

    A result of a constrained system gives that one with the Lagrangian that was found for an associated system as
    the free Lagrangian, any other its equations with their Lagrangian.
    """
    if not job:
        return form_of_system({"catalogue": system}), {"system": {"catalogue": system}}
    await results.successful(request, job)
    choose = partial(_form_of_result, job=job)
    found: tuple[SceneForm, dict[str, Any]] | None = await results.made(request, job, result_tasks.part_task, choose)
    return known(found, "result with a system at this address.")


def _form_of_result(result: Mapping[str, Any], job: str) -> tuple[SceneForm, dict[str, Any]] | None:
    """The same of a result, inside a worker; None where it has no system that was solved."""
    given = (result.get("system") or {}).get("given")
    if not given:
        return None
    from inverse_service.web.pages import starts  # which needs the extras of simulations

    answer: Mapping[str, Any] = {}
    found, is_forward = dict[str, str](), "verdict" not in result
    if result.get("nonholonomic") or is_forward:
        # Names that were left to be found in the text are taken from what was found.
        names = {key: list(result["system"][key]) for key in ("coordinates", "parameters")
                 if not isinstance(given.get(key), list | dict)}  # fmt: skip
        system: dict[str, Any] = {"document": {key: given[key] for key in CONSTRAINED if key in given} | names}
        # A Lagrangian with arbitrary functions is looked for again, with the functions that the scene gives.
        if not is_forward and result.get("lagrangian") and not given.get("functions"):
            found = {"free_lagrangian": result["lagrangian"]["text"]}
    else:
        system = {"result": result}
        answer = next((one for one, _ in text_page.answers_of(result, result) if one["lagrangian"]), answer)
    form = starts.with_good_start(form_of_system(system, job=job), system, answer, found)
    return form, {"system": system, **found}


def form_of_system(system: Mapping[str, Any], **address: str) -> SceneForm:
    """The form for a scene's `system`: an entry of the catalogue, a document, a result, or a system written out."""
    if "catalogue" in system:
        name = system["catalogue"]
        return scene_form.form_for(solve.example_document(name), catalogue.entry(name)["title"], system=name, **address)
    if "result" in system:
        shown = system["result"]["system"]
        kept = ("coordinates", "parameters", "functions", "equations")
        solved = {key: shown[key] for key in kept if key in shown}
        unsolved = any(reader.has_acceleration(text) for text in shown.get("equations", {}).values())
        form = scene_form.form_for(shown["given"] if unsolved else solved, shown["name"] or "", **address)
        answers = (system["result"], system["result"].get("with_time") or {})
        # Without a Lagrangian there is nothing to discretize but the equations.
        return form if any(a.get("lagrangian") for a in answers) else replace(form, methods=WITHOUT_LAGRANGIAN)
    document = system.get("document", system)
    return scene_form.form_for(document, document.get("name") or "", **address)


async def _form_of_scene(request: Request, identifier: str) -> tuple[SceneForm, dict[str, Any]]:
    """The form filled with a scene that was run before, and that scene."""
    job = await results.stored_job(request, identifier)
    job = known(job if job is not None and job.kind in CALLS else None, "scene at this address.")
    scene = json.loads(job.document)
    try:
        empty = form_of_system(scene["system"], scene=identifier)
    except (AttributeError, KeyError, TypeError, ValueError):
        raise Refusal(422, "bad-input", "This scene names no coordinates; change its document instead.") from None
    return scene_form.form_of_scene(empty, scene), scene

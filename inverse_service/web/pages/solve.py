"""The start page: a form for a system, an echo of what was understood, and the way to its result."""

from __future__ import annotations

import asyncio
from functools import lru_cache
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from api_schemas import system as system_schema
from api_schemas.base import MAX_COORDINATES
from inverse_service import catalogue
from inverse_service.errors import InputError
from inverse_service.web.clients import client_of
from inverse_service.web.engine import QUICK_DEADLINE, Engine
from inverse_service.web.pages import form_documents, form_tasks, reading_back
from inverse_service.web.pages.own_calls import call, read_form, read_sent
from inverse_service.web.pages.rendering import can_simulate, page
from inverse_service.web.pages.result_pages import made, result_address, successful
from inverse_service.web.pages.result_tasks import fields_task
from inverse_service.web.pages.sheets import Judged
from inverse_service.web.problems import Refusal

router = APIRouter()
ASSOCIATED = (
    ("first", "first", "the forces of constraint, written in the velocities that are left free"),
    ("second", "second", "the same forces, written in the velocities that the constraints determine"),
    (
        "third",
        "third",
        "the velocities turn like an arrow, as x\u2033 = \u2212\u03c6\u2032y\u2032, y\u2033 = \u03c6\u2032x\u2032 "
        "of a knife edge; for some systems only",
    ),
    ("any", "any", "whether any has a Lagrangian at all: the motion alone"),
)
# Entries of the catalogue with the words of the palette.
EXAMPLES = (
    ("damped-pendulum", "Damped pendulum", "friction, and still a Lagrangian"),
    ("kepler-polar", "Kepler problem", "in polar coordinates"),
    ("double-pendulum", "Double pendulum", "the L of every textbook"),
    ("magnetic-field-b-x", "Charge in a magnetic field", "B depends on x"),
    ("wind-drag-position-dependent", "Drag that grows with y", "a Lagrangian with a logarithm"),
    ("vertically-rolling-disk-first", "Rolling disk, first system", "no Lagrangian: a proof"),
    ("vertically-rolling-disk-second", "Rolling disk, second system", "a Lagrangian with ẋ²/φ̇"),
    ("generic-class-one-second", "Arbitrary function A(r₁)", "a whole class at once"),
    ("modified-emden", "Modified Emden", "an unusual Lagrangian"),
    ("sho", "Harmonic oscillator", "one coordinate"),
)
NONHOLONOMIC_EXAMPLES = (
    ("vertically-rolling-disk", "Rolling disk", "rolls without slipping"),
    ("knife-edge", "Knife edge", "slides along its blade"),
    ("nonholonomic-particle", "Particle", "z\u2032 = \u2212x y\u2032"),
    ("mobile-robot", "Mobile robot", "with fixed orientation"),
    ("inclined-knife-edge", "Inclined knife edge", "under gravity"),
)
FIRST_NONHOLONOMIC = "nonholonomic-particle"
AT_ONCE = 0.1  # s
LONGEST_OWN = 30_000  # bytes of a form whose address carries it
START = "x'' = -x + k*y\ny'' = -y + k*x"


@router.get("/")
async def form(request: Request) -> HTMLResponse:
    """The form, empty, with an example of the catalogue, or with the document of a result."""
    query = request.query_params
    kind = "nonholonomic" if query.get("kind") == "nonholonomic" else "equations"
    linked = form_documents.fields_of_link(query)
    if linked is not None:
        fields = linked
    elif "example" in query:
        fields = form_documents.lean_fields(example_document(query["example"]))
    elif "job" in query:
        fields = await fields_of_job(request, query["job"])
    elif kind == "nonholonomic":
        fields = form_documents.lean_fields(example_document(FIRST_NONHOLONOMIC))
    else:
        fields = form_documents.fields_from({"equations": START})
    # A page at its start is shown at once: while the workers of a fresh service start, the script asks by itself.
    engine: Engine = request.app.state.engine
    patience = None if query else AT_ONCE * engine.is_reading
    judged = await own_judged(request, fields, query["own"]) if linked and query.get("own") else None
    found = await understand(request, fields, patience)
    notes = form_documents.left_out_of_link(query)
    return solve_page(fields, reveal=form_documents.revealed_of_link(query), own=judged, notes=notes, **found)


@router.post("/own")
async def own(request: Request) -> Response:
    """A student's L and the typed equations, on to their link; the form stays an exercise where it was one."""
    fields = form_documents.fields_of(await read_form(request, LONGEST_OWN))
    text, reveal = fields["lagrangian"], ",".join(form_documents.revealed_of_link(request.query_params))
    kept = {"own": text} | ({"reveal": reveal} if reveal else {})
    return RedirectResponse(form_documents.link_of_fields(fields | {"lagrangian": ""}, **kept), 303)


async def own_judged(request: Request, fields: dict[str, str], text: str) -> Judged:
    """What is said of a student's L for the equations of the form."""
    engine: Engine = request.app.state.engine
    late = "Judging this L takes longer than a page may; find the answer, and check it there."
    return await engine.made(
        client_of(request), form_tasks.own_task, fields, text, late=late, seconds=2 * form_tasks.GLANCE
    )


@router.post("/")
async def submit(request: Request) -> Response:
    """The job of the form; on to its page, or back with what to change."""
    try:
        sent = await read_sent(request, request.app.state.engine.settings.max_body, form_tasks.sent_task)
    except Refusal as refusal:
        return _not_read(refusal)
    if sent.document is None:
        return await _refused(request, sent.fields, sent.problem, 422)
    answer = await call(request, "POST", "/v1/solve", sent.document, {"Prefer": "respond-async"})
    if answer.is_problem:
        return await _refused(request, sent.shown, reading_back.problem_of(answer.value, sent.shown), answer.status)
    return RedirectResponse(result_address(answer), 303)


@router.post("/understood")
async def echo(request: Request) -> Response:
    """What was understood of the form: the fragment for the script, else the form's link, whose page says it."""
    try:
        fields, found = await read_sent(request, request.app.state.engine.settings.max_body, form_tasks.echo_sent_task)
    except Refusal as refusal:
        return _not_read(refusal)
    if request.query_params.get("fragment"):
        return page("understood.html", **({"problem": None, "understood": None} | found))
    return (
        solve_page(fields, **found)
        if not form_documents.is_whole(fields)
        else RedirectResponse(form_documents.link_of_fields(fields), 303)
    )


async def _refused(
    request: Request, fields: dict[str, str], problem: reading_back.Problem | None, status: int
) -> Response:
    """The form with what to change: its link where the page there says the same, so that a reload asks nothing."""
    if form_documents.is_whole(fields) and (await understand(request, fields)).get("problem") == problem:
        return RedirectResponse(form_documents.link_of_fields(fields), 303)
    return solve_page(fields, problem=problem, status=status)


@router.post("/answer")
async def answer_beside(request: Request) -> Response:
    """The answer next to the form: nothing is stored; one at a time for each client, and none where it takes long."""
    engine: Engine = request.app.state.engine
    with engine.places.glance(client_of(request)) as is_free:
        if not is_free:
            return Response(status_code=204)
        try:
            found = await read_sent(request, engine.settings.max_body, form_tasks.glance_task, 2 * form_tasks.GLANCE)
        except Refusal as refusal:
            if refusal.kind not in ("limit", "busy"):
                raise
            found = None
    return page("glance.html", glance=found, hint="hint" in request.query_params)


def _not_read(refusal: Refusal) -> HTMLResponse:
    """The form at its start, where what was sent is too heavy to be read; anything else is refused as everywhere."""
    if refusal.kind != "limit":
        raise refusal
    problem = reading_back.problem_of({"detail": refusal.detail}, {})
    return solve_page(form_documents.fields_from({"equations": START}), problem=problem, status=refusal.status)


async def understand(request: Request, fields: dict[str, str], patience: float | None = None) -> dict[str, Any]:
    """How the fields are understood, for the template; nothing where no worker has said it in `patience` seconds."""
    engine: Engine = request.app.state.engine
    asked = engine.run_quick(client_of(request), form_tasks.echo_task, fields, seconds=QUICK_DEADLINE)
    try:
        outcome = await asyncio.wait_for(asked, patience)
    except (Refusal, TimeoutError):
        return {}
    found: dict[str, Any] = outcome.value if outcome.status == "done" else {}
    return found


def solve_page(fields: dict[str, str], status: int = 200, **values: Any) -> HTMLResponse:
    """The page with the form filled in."""
    nonholonomic = fields["kind"] == "nonholonomic"
    shown: dict[str, Any] = {"problem": None, "understood": None, "reveal": (), "own": None, "notes": ()} | values
    return page(
        "solve.html",
        status,
        active="/",
        fields=fields,
        associated=ASSOCIATED,
        lagrangians=form_documents.LAGRANGIANS,
        examples=examples(NONHOLONOMIC_EXAMPLES if nonholonomic else EXAMPLES),
        can_simulate=can_simulate(),
        most_coordinates=MAX_COORDINATES,
        has_special_cases="special_cases" in system_schema.SystemDocument.model_fields,
        **shown,
    )


@lru_cache(maxsize=4)
def examples(chosen: tuple[tuple[str, str, str], ...]) -> list[dict[str, Any]]:
    """The palette, each example with the fields that it fills."""
    return [
        {"name": name, "label": label, "hint": hint, "fields": form_documents.lean_fields(catalogue.document(name))}
        for name, label, hint in chosen
    ]


def example_document(name: str) -> dict[str, Any]:
    """The document of a catalogue entry; 404 where there is none."""
    try:
        return catalogue.document(name)
    except InputError:
        raise Refusal(404, "not-found", "The catalogue has no system of this name; /gallery shows them.") from None


async def fields_of_job(request: Request, identifier: str) -> dict[str, str]:
    """The form filled with the document of a result."""
    if await successful(request, identifier) is None:
        raise Refusal(404, "not-found", "There is no result at this address.")
    return await made(request, identifier, fields_task) or form_documents.fields_from({"equations": START})

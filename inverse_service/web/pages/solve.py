"""The start page: a form for a system, an echo of how it is parsed, and the way to its result."""

import asyncio
import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from fastapi import APIRouter
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from api_schemas import base
from api_schemas.system import KINDS_OF_LAGRANGIANS
from inverse_service import catalogue, errors
from inverse_service.web import clients
from inverse_service.web.engine import LONG_DEADLINE, QUICK_DEADLINE, Engine
from inverse_service.web.pages import WORDS, forms, kept, rendering, result_tasks, results
from inverse_service.web.problems import REFUSED, Refusal, refusal_of

router = APIRouter()
EXAMPLES: list[dict[str, Any]] = WORDS["examples"]
FROM_LAGRANGIAN = "m/2*(x'^2 + y'^2) - k/2*(x^2 + y^2)"
FIRST_NONHOLONOMIC = "nonholonomic-particle"
AT_ONCE = 0.1  # s
SOON = 0.3  # s that a page waits for the answer next to its form
START: str = EXAMPLES[0]["document"]["equations"]
_GLANCES = kept.Kept(64)  # answers of links and examples


@router.get("/")
async def form(request: Request) -> Response:
    """The form, empty, with an example of the catalogue, or with the document of a result."""
    query = request.query_params
    kind = query.get("kind", "equations")
    linked = forms.fields_of_link(query)
    if linked is not None:
        fields = linked
    elif "example" in query:
        fields = forms.lean_fields(example_document(query["example"]))
    elif "job" in query:
        fields = await fields_of_job(request, query["job"])
    elif kind == "nonholonomic":
        fields = forms.lean_fields(example_document(FIRST_NONHOLONOMIC))
    elif kind == "lagrangian":
        fields = forms.fields_from({"lagrangian": FROM_LAGRANGIAN})
    else:
        fields = forms.fields_from({"equations": START})
    # A page at its start is shown at once: while the workers of a fresh service start, the script
    # asks by itself.
    engine: Engine = request.app.state.engine
    patience = None if query else AT_ONCE * engine.is_reading
    # Both are waited for at once, as the page is not painted before both are there or late.
    understood = understand(request, fields, patience)
    if not query or linked is not None:
        answer = glance_of(request, fields, SOON * engine.is_reading)
        found, glance = await asyncio.gather(understood, answer)
        coming = "" if glance else _key_of(fields)
    else:
        found, glance, coming = await understood, None, ""
    notes = forms.left_out_of_link(query)
    return solve_page(fields, glance=glance, coming=coming, notes=notes, **found)


@router.get("/ask")
async def ask(request: Request) -> Response:
    """The form with everything that can be asked."""
    query = request.query_params
    fields = forms.fields_of_link(query) or forms.fields_from({"equations": START})
    if query.get("kind") in forms.KINDS:
        fields |= {"kind": query["kind"]}
    found: dict[str, Any] = {"problem": None, "understood": None} | await understand(
        request, fields
    )
    return rendering.page(
        "ask.html",
        active="/",
        fields=fields,
        kinds=KINDS_OF_LAGRANGIANS,
        most_coordinates=base.MAX_COORDINATES,
        **found,
    )


async def glance_of(request: Request, fields: dict[str, str], patience: float) -> Markup | None:
    """The answer to show next to a form at its start; None if it is not ready in a moment."""
    engine, client = request.app.state.engine, clients.client_of(request)

    async def make() -> Markup | None:
        outcome = await engine.run_quick(
            client, result_tasks.glance_of_fields, fields, seconds=LONG_DEADLINE
        )
        return outcome.value if outcome.status == "done" else None

    return await _GLANCES.of(_key_of(fields), make, patience)


def _key_of(fields: Mapping[str, str]) -> str:
    """What an answer next to a form is kept by."""
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()


@router.post("/")
async def submit(request: Request) -> Response:
    """The job of the form; redirect to its page, or back to the form with corrections."""
    try:
        sent = await results.read_sent(request, forms.sent_task)
    except Refusal as refusal:
        return _not_read(refusal)
    if sent.document is None:
        return await _refused(request, sent.fields, sent.problem, 422)
    try:
        job = await results.ask(request, "solve", sent.document)
    except REFUSED as error:
        found = refusal_of(request, error)
        return await _refused(
            request, sent.shown, forms.problem_of(found, sent.shown), found.status
        )
    return RedirectResponse(f"/results/{job.id}", 303)


@router.post("/understood")
async def echo(request: Request) -> Response:
    """What was understood of the form: the fragment for the script, else the form's link, whose page says it."""
    is_fragment = bool(request.query_params.get("fragment"))
    try:
        fields, found = await results.read_sent(request, forms.echo_sent_task)
        status = 200
    except Refusal as refusal:
        if not is_fragment:
            return _not_read(refusal)
        fields, found, status = (
            {},
            {"problem": [forms.ShownPlace(refusal.detail)]},
            _status_of_busy(refusal),
        )
    if is_fragment:
        return rendering.page(
            "understood.html", status, **({"problem": None, "understood": None} | found)
        )
    is_whole = forms.is_whole(fields)
    return (
        RedirectResponse(forms.link_of_fields(fields), 303)
        if is_whole
        else solve_page(fields, **found)
    )


async def _refused(
    request: Request, fields: dict[str, str], problem: forms.Problem | None, status: int
) -> Response:
    """The form with what to change: its link where the page there says the same, so that a reload asks nothing."""
    if forms.is_whole(fields) and (await understand(request, fields)).get("problem") == problem:
        return RedirectResponse(forms.link_of_fields(fields), 303)
    return solve_page(fields, problem=problem, status=status)


@router.post("/answer")
async def answer_beside(request: Request) -> Response:
    """The answer next to the form: nothing is stored; one at a time for each client, and none where
    it takes long.

    `coming` is the key of one that is being made since its page was asked for; `rest` asks for the
    formulas too where the verdict came first.
    """
    engine: Engine = request.app.state.engine
    coming = request.query_params.get("coming", "")
    if coming and (made := await _GLANCES.soon(coming, LONG_DEADLINE)) is not None:
        return rendering.sent(made, "text/html", {"Content-Security-Policy": rendering.POLICY})
    try:
        with engine.glances.hold(clients.client_of(request), 1):
            is_rest = "rest" in request.query_params
            task = result_tasks.rest_task if is_rest else result_tasks.glance_task
            found = await results.read_sent(request, task, 2 * result_tasks.GLANCE)
    except Refusal as refusal:
        return rendering.page("glance.html", _status_of_busy(refusal), glance=None)
    return rendering.sent(found, "text/html", {"Content-Security-Policy": rendering.POLICY})


def _status_of_busy(refusal: Refusal) -> int:
    """503, on which the script asks again, where the machine was busy or cold; anything else is
    refused as everywhere.

    The work is bounded by processor time, so one that runs into a limit of the clock did not get
    the processor.
    """
    if refusal.kind not in ("limit", "busy"):
        raise refusal
    return 503


def _not_read(refusal: Refusal) -> HTMLResponse:
    """The form at its start, where what was sent is too heavy to be read; anything else is refused as everywhere."""
    if refusal.kind != "limit":
        raise refusal
    problem = [forms.ShownPlace(refusal.detail)]
    return solve_page(
        forms.fields_from({"equations": START}), problem=problem, status=refusal.status
    )


async def understand(
    request: Request, fields: dict[str, str], patience: float | None = None
) -> dict[str, Any]:
    """How the fields are understood, for the template; nothing where no worker has said it in `patience` seconds."""
    asked = results.quick(request, forms.echo_task, fields, seconds=QUICK_DEADLINE)
    try:
        outcome = await asyncio.wait_for(asked, patience)
    except (Refusal, TimeoutError):
        return {}
    found: dict[str, Any] = outcome.value if outcome.status == "done" else {}
    return found


def solve_page(fields: dict[str, str], status: int = 200, **values: Any) -> HTMLResponse:
    """The page with the form filled in."""
    mode = (
        "equations"
        if fields["kind"] == "equations"
        else "constraints"
        if fields["constraints"]
        else "lagrangian"
    )
    shown: dict[str, Any] = {
        "problem": None,
        "understood": None,
        "notes": (),
        "glance": None,
        "coming": "",
    } | values
    examples = [{**one, "is_shown": _same(one["fields"], fields)} for one in tiles()]
    return rendering.page(
        "solve.html", status, active="/", fields=fields, mode=mode, examples=examples, **shown
    )


def _same(one: Mapping[str, str], other: Mapping[str, str]) -> bool:
    return all(one[name] == other[name] for name in ("equations", "lagrangian", "constraints"))


@lru_cache(maxsize=1)
def tiles() -> list[dict[str, Any]]:
    """The examples, each with the link that fills the form with it."""
    filled = [{**one, "fields": forms.fields_from(one["document"])} for one in EXAMPLES]
    return [{**one, "address": forms.link_of_fields(one["fields"])} for one in filled]


def example_document(name: str) -> dict[str, Any]:
    """The document of a catalogue entry; 404 if there is none."""
    try:
        return catalogue.document(name)
    except errors.InputError:
        raise Refusal(
            404, "not-found", "The catalogue has no system of this name; /atlas shows them."
        ) from None


async def fields_of_job(request: Request, identifier: str) -> dict[str, str]:
    """The form filled with the document of a result."""
    await results.successful(request, identifier)
    return await results.made(request, identifier, result_tasks.fields_task) or forms.fields_from(
        {"equations": START}
    )

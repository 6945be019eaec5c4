"""From data: a form for fitted equations or a table of q(t), and the page of the nearest systems with a Lagrangian."""

from collections.abc import Mapping
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from inverse_service import errors
from inverse_service.expressions import notation
from inverse_service.web import problems
from inverse_service.web.engine import LONG_DEADLINE
from inverse_service.web.pages import forms, nearest_tasks, rendering, results, solve

router = APIRouter()
EXAMPLE = {
    "equations": "x'' = -1.02*x + 0.51*y\ny'' = 0.248*x - 0.99*y - 0.01*y'",
    "nearest": "0.02",
}
OWN = ("library", "nice")  # fields besides those of the form of a system
LATE = "Fitting this table ran into the {} limit: send fewer rows, or choose a lower degree."


@lru_cache(maxsize=1)
def can_fit() -> bool:
    """Whether this installation has PySINDy."""
    return find_spec("pysindy") is not None


@router.get("/nearest")
async def form(request: Request) -> Response:
    """The form, with an example or filled by a link."""
    query = request.query_params
    linked = forms.fields_of_link(query)
    fields = linked or forms.fields_from({"equations": ""}) | EXAMPLE
    more = {name: query.get(name, "") for name in OWN}
    return _page(fields, more, **await solve.understand(request, fields))


@router.post("/nearest")
async def submit(request: Request) -> Response:
    """The job of the form; redirect to its page, or the form with what to change."""
    sent = await results.read_form(request)
    fields = forms.fields_of(sent) | {"kind": "equations"}
    more = {name: sent.text(name) for name in OWN}
    try:
        document = document_of(fields, more)
        job = await results.ask(request, "solve", document)
    except (errors.InputError, *problems.REFUSED) as error:
        found = problems.refusal_of(request, error)
        return _page(fields, more, found.status, problem=forms.problem_of(found, fields))
    return RedirectResponse(f"/results/{job.id}/nearest", 303)


@router.post("/nearest/table")
async def submit_table(request: Request) -> Response:
    """The job of what PySINDy fits to a table; redirect to its page, or the form with what to change."""
    try:
        document = await results.read_sent(
            request, nearest_tasks.fit_task, LONG_DEADLINE, late=LATE
        )
        job = await results.ask(request, "solve", document)
    except (errors.InputError, *problems.REFUSED) as error:
        found = problems.refusal_of(request, error)
        fields = forms.fields_from({"equations": ""}) | EXAMPLE
        said = " ".join(place.detail for place in found.places) or found.detail
        return _page(fields, dict.fromkeys(OWN, ""), found.status, fault=said)
    return RedirectResponse(f"/results/{job.id}/nearest", 303)


@router.get("/results/{identifier}/nearest")
async def nearest(request: Request, identifier: str) -> Response:
    """The nearest systems of a result, or how far it is."""
    job = await results.finished(request, identifier, results.PATIENCE)
    if job.status != "successful":
        return await results.shown(request, job)
    await results.successful(request, identifier, ("solve",))
    look, query = results.look_of(request), dict(request.query_params)
    found = await results.made(request, identifier, nearest_tasks.page_task, look, query)
    return problems.known(found, results.RESULT)


def document_of(fields: Mapping[str, str], more: Mapping[str, str]) -> dict[str, Any]:
    """The question for the nearest systems; InputError where a field cannot be read."""
    document = forms.document_of_fields({**fields, "nearest": fields["nearest"] or "relative"})
    question = document["nearest"]
    asked: dict[str, Any] = {} if question is True else dict(question)
    terms = [one.strip() for _, one in notation.split_outside(more["library"], "[,;\n]")]
    if any(terms):
        asked["library"] = [one for one in terms if one]
    if more["nice"]:
        asked["nice"] = True
    return {**document, "nearest": asked or True}


def _page(
    fields: Mapping[str, str], more: Mapping[str, str], status: int = 200, **values: Any
) -> Response:
    shown: dict[str, Any] = {"problem": None, "understood": None, "fault": ""} | values
    return rendering.page(
        "nearest.html",
        status,
        active="/nearest",
        fields=fields,
        more=more,
        can_fit=can_fit(),
        no_fits=nearest_tasks.NO_FITS,
        **shown,
    )

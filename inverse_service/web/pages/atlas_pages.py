"""The atlas: twenty pictures, a search by name, tag and equations, and a page for each system."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter
from markupsafe import Markup, escape
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service import errors
from inverse_service.catalogue import atlas
from inverse_service.reading.names import Names
from inverse_service.service.documents import text_page
from inverse_service.web import routes_atlas
from inverse_service.web.pages import forms, rendering, typesetting
from inverse_service.web.problems import Refusal

router = APIRouter()
FIRST_SHOWN, MOST_SHOWN = 20, 200
REFERENCE = re.compile(
    r"(?:arXiv:\s*|(?<=, ))(?P<arxiv>\d{4}\.\d{4,5})|doi:\s*(?P<doi>10\.\d{4,}/[^\s,;]+[^\s,;.])"
    r"|math\.stackexchange\.com/questions/(?P<stack>\d+)|(?:MathOverflow |mathoverflow\.net/questions/)(?P<flow>\d+)"
    r"|github\.com/(?P<github>[\w./-]+)",
    re.I,
)
REFERRED = {
    "arxiv": "https://arxiv.org/abs/{}",
    "doi": "https://doi.org/{}",
    "stack": "https://math.stackexchange.com/questions/{}",
    "flow": "https://mathoverflow.net/questions/{}",
    "github": "https://github.com/{}",
}
# What the name of a system says of its body, as bodies.html draws it; the first that fits.
BODIES = (
    ("double-pendulum", "double-pendulum"), ("elastic-pendulum", "elastic-pendulum"), ("cart", "cart-pendulum"),
    ("pendula", "two-pendula"), ("pendulum", "pendulum"), ("kepler", "orbit"), ("poynting", "orbit"), ("hill", "orbit"),
    ("masses", "masses"), ("two-body", "masses"), ("chain", "masses"), ("toda", "masses"), ("disk", "disk"),
    ("inclined-knife-edge", "inclined-knife-edge"), ("knife-edge-inclined", "inclined-knife-edge"),
    ("knife-edge", "knife-edge"), ("sleigh", "knife-edge"), ("robot", "robot"), ("carriage", "carriage"),
    ("nonholonomic-particle", "particle"), ("magnetic", "charge"), ("charged", "charge"), ("sphere", "sphere"),
    ("ballistics", "projectile"), ("quadrotor", "projectile"), ("drag-2d", "projectile"), ("drag", "drag"),
    ("oscillator", "spring"), ("sho", "spring"), ("duffing", "spring"), ("van-der-pol", "spring"),
)  # fmt: skip
PICTURES = (
    "sho", "duffing", "van-der-pol", "damped-pendulum", "double-pendulum", "damped-double-pendulum", "elastic-pendulum",
    "pendulum-on-viscous-cart", "kepler-polar", "magnetic-field-b-x", "damped-henon-heiles", "sphere-geodesics",
    "vertically-rolling-disk", "tilting-disk", "knife-edge", "inclined-knife-edge", "nonholonomic-particle",
    "mobile-robot", "two-wheeled-carriage", "wind-drag-position-dependent", "poynting-robertson",
)  # fmt: skip
MOST_PICTURES = 20


def body_of(name: str) -> str:
    """The drawing of a system of this name; empty where the name tells of no body."""
    return next((body for words, body in BODIES if f"-{words}-" in f"-{name}-"), "")


@router.get("/atlas")
async def shown(request: Request) -> HTMLResponse:
    """The search and what it found; the pictures where nothing is searched."""
    query = request.query_params
    sent = {name: query.get(name, "").strip() for name in ("q", "tag", "equations")}
    most = MOST_SHOWN if query.get("all") else FIRST_SHOWN
    problem, found = "", []
    try:
        found = await routes_atlas.found_by(request, sent["q"], sent["tag"], sent["equations"])
    except (Refusal, errors.InputError) as error:
        problem = str(getattr(error, "detail", error))
    return rendering.page(
        "atlas.html",
        active="/atlas",
        sent=sent,
        problem=problem,
        found=[_line(entry) for entry in found[:most]],
        count=len(found),
        more=f"/atlas?{urlencode({**sent, 'all': 'yes'})}#systems" if len(found) > most else "",
        whole=len(atlas.entries()),
        tags=list(atlas.tags().items())[:24],
        pictures=() if any(sent.values()) else pictures(),
        license=routes_atlas.LICENSE,
    )


@lru_cache(maxsize=1)
def pictures() -> list[dict[str, Any]]:
    """Twenty systems whose body is drawn."""
    known = [atlas.entries()[name] for name in PICTURES if name in atlas.entries()]
    known += [entry for entry in atlas.entries().values() if body_of(entry["name"]) and entry not in known]
    return [{**entry, "body": body_of(entry["name"]) or "spring"} for entry in known[:MOST_PICTURES]]


def _line(entry: dict[str, Any]) -> dict[str, Any]:
    return {**entry, "text": "; ".join(entry["equations"])[:160]}


@router.get("/atlas/{name}")
async def entry(name: str) -> HTMLResponse:
    """One system with its answers."""
    found = atlas.entries().get(name)
    if found is None:
        raise Refusal(404, "not-found", "The atlas has no system of this name; /atlas searches it.")
    names = _names(found["document"])
    formulas = [typesetting.proposition(text, names) for text in found["equations"]]
    answers = [(letter, found[key]) for letter, key in (("L", "lagrangian"), ("H", "hamiltonian")) if found[key]]
    return rendering.page(
        "atlas_entry.html",
        active="/atlas",
        entry=found,
        equations=formulas,
        answers=[(letter, typesetting.equation(letter, text, names), f"{letter} = {text}") for letter, text in answers],
        domain=typesetting.conditions(text_page.conditions_of({"lagrangian": {"domain": found["domain"]}}), names),
        source=referenced(found["source"]),
        body=body_of(name),
        alike=[one for one in atlas.search(form=found["form"]) if one["name"] != name][:12] if found["form"] else [],
        question=forms.question_address(found["document"]),
        can_simulate=rendering.can_simulate(),
        cite=routes_atlas.CITE,
    )


def _names(document: dict[str, Any]) -> Names:
    given = document.get("parameters") or ()
    parameters = tuple(given) if not isinstance(given, str) else ()
    functions = {name: tuple(of) for name, of in (document.get("functions") or {}).items()}
    coordinates = document.get("coordinates") or tuple(document.get("equations") or ())
    return typesetting.names_of({"coordinates": coordinates, "parameters": parameters, "functions": functions})


def referenced(source: str) -> Markup:
    """A source with a link for each arXiv number, DOI, and question that it names."""
    text = Markup("")
    place = 0
    for match in REFERENCE.finditer(source):
        address = next(REFERRED[kind].format(number) for kind, number in match.groupdict().items() if number)
        text += escape(source[place : match.start()]) + Markup('<a href="{}">{}</a>').format(address, match.group())
        place = match.end()
    return text + escape(source[place:])


@router.get("/gallery")
async def gallery() -> Response:
    """The gallery is the atlas."""
    return RedirectResponse("/atlas", 301)

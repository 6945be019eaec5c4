"""The systems of the catalogue, those of the paper with their formulas."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from fastapi import APIRouter
from markupsafe import Markup, escape
from starlette.responses import HTMLResponse

from inverse_service import catalogue
from inverse_service.reading.names import Names
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.form_documents import parameters_of
from inverse_service.web.pages.learn import hamiltonized
from inverse_service.web.pages.paper_figures import FIGURES, has_thumbnail, plane_of
from inverse_service.web.pages.rendering import can_simulate, page

router = APIRouter()
WORDS = {"variational": "a Lagrangian", "not_variational": "none", "undetermined": "open"}
ORDER = ("first", "second", "third")
GROUP_TITLES = {
    "n=1 (Sonin/Darboux: always variational; Jacobi last multiplier)": "One coordinate",
    "w''=0, x''=w' A(w) x' (contains the second-type systems and all groups with abelian codim-1 ideal)": (
        "Systems w'' = 0, x'' = w' A(w) x'"
    ),
}


REFERENCE = re.compile(
    r"(?:arXiv:\s*|(?<=, ))(?P<arxiv>\d{4}\.\d{4,5})|doi:\s*(?P<doi>10\.\d{4,}/[^\s,;]+[^\s,;.])"
    r"|math\.stackexchange\.com/questions/(?P<stack>\d+)|(?:MathOverflow |mathoverflow\.net/questions/)(?P<flow>\d+)",
    re.I,
)
REFERRED = {
    "arxiv": "https://arxiv.org/abs/{}",
    "doi": "https://doi.org/{}",
    "stack": "https://math.stackexchange.com/questions/{}",
    "flow": "https://mathoverflow.net/questions/{}",
}

# What the name of a system says of its body, as bodies.html draws it; the first that fits.
BODIES = (
    ("double-pendulum", "double-pendulum"), ("elastic-pendulum", "elastic-pendulum"), ("cart", "cart-pendulum"),
    ("pendula", "two-pendula"), ("pendulum", "pendulum"), ("kepler", "orbit"), ("poynting", "orbit"), ("hill", "orbit"),
    ("masses", "masses"), ("two-body", "masses"), ("chain", "masses"), ("toda", "masses"), ("disk", "disk"),
    ("inclined-knife-edge", "inclined-knife-edge"), ("knife-edge-inclined", "inclined-knife-edge"),
    ("knife-edge", "knife-edge"), ("sleigh", "knife-edge"), ("robot", "robot"), ("carriage", "carriage"),
    ("nonholonomic-particle", "particle"), ("magnetic", "charge"), ("charged", "charge"), ("sphere", "sphere"),
    ("ballistics", "projectile"), ("quadrotor", "projectile"), ("drag-2d", "projectile"),
    ("oscillator", "spring"), ("sho", "spring"), ("duffing", "spring"), ("van-der-pol", "spring"),
)  # fmt: skip


def body_of(name: str) -> str:
    """The drawing of a system of this name; empty where the name tells of no body."""
    return next((body for words, body in BODIES if f"-{words}-" in f"-{name}-"), "")


@dataclass(frozen=True, slots=True)
class Line:
    """An entry of the catalogue: its name, its title, and the verdict that the literature or a proof knows."""

    name: str
    title: str
    verdict: str
    words: str
    formulas: list[Markup] = field(default_factory=list)
    note: str = ""
    source: Markup | str = ""
    text: str = ""
    body: str = ""


@dataclass(frozen=True, slots=True)
class Card:
    """A nonholonomic system of the paper with its associated systems."""

    name: str
    title: str
    lagrangian: Markup
    constraints: list[Markup]
    associated: list[tuple[str, Line]]
    plane: tuple[str, str] | None
    body: str


@router.get("/gallery")
async def gallery() -> HTMLResponse:
    """All systems."""
    return page(
        "gallery.html",
        active="/gallery",
        figures=FIGURES if can_simulate() else (),
        cards=cards(),
        others=paper_others(),
        groups=groups(),
        motions=hamiltonized(),
        can_simulate=can_simulate(),
    )


@lru_cache(maxsize=1)
def cards() -> list[Card]:
    """The nonholonomic systems of the paper."""
    by_system: dict[str, list[tuple[str, Line]]] = {}
    for name in catalogue.names():
        entry = catalogue.entry(name)
        if "associated_with" in entry:
            kind = next((kind for kind in ORDER if name.endswith(f"-{kind}")), "")
            by_system.setdefault(entry["associated_with"], []).append((kind, _line(entry)))
    return [_card(catalogue.entry(name), by_system.get(name, [])) for name in catalogue.names("nonholonomic")]


def _card(entry: dict[str, Any], associated: list[tuple[str, Line]]) -> Card:
    document = entry["document"]
    names = _names(document)
    constraints = [typesetting.formula(f"{text} = 0", names) for text in document["constraints"]]
    lagrangian = typesetting.formula(document["lagrangian"], names)
    plane = plane_of(entry["name"]) if has_thumbnail(entry["name"]) else None
    return Card(entry["name"], entry["title"], lagrangian, constraints, associated, plane, body_of(entry["name"]))


@lru_cache(maxsize=1)
def paper_others() -> list[Line]:
    """Systems of the paper that belong to no nonholonomic system."""
    entries = [catalogue.entry(name) for name in catalogue.names()]
    return [_line(e, formulas=True) for e in entries if e["group"] == "paper" and "associated_with" not in e]


@lru_cache(maxsize=1)
def groups() -> list[tuple[str, list[Line]]]:
    """Everything else by its group."""
    found: dict[str, list[Line]] = {}
    for name in catalogue.names():
        entry = catalogue.entry(name)
        if entry["group"] != "paper" and "associated_with" not in entry:
            found.setdefault(entry["group"], []).append(_line(entry))
    return [(GROUP_TITLES.get(group, group[:1].upper() + group[1:]), lines) for group, lines in found.items()]


def _line(entry: dict[str, Any], formulas: bool = False) -> Line:
    verdict = entry["expected"]["verdict"] or "undetermined"
    shown = _equations(entry["document"]) if formulas else []
    return Line(
        entry["name"],
        entry["title"],
        verdict,
        WORDS[verdict],
        shown,
        entry.get("note", ""),
        referenced(entry.get("source", "")),
        text_of(entry["document"]),
        body_of(entry["name"]),
    )


def referenced(source: str) -> Markup:
    """A source with a link for each arXiv number, DOI and question of the two exchanges."""
    shown = Markup("")
    place = 0
    for match in REFERENCE.finditer(source):
        address = next(REFERRED[kind].format(number) for kind, number in match.groupdict().items() if number)
        shown += escape(source[place : match.start()]) + Markup('<a href="{}">{}</a>').format(address, match.group())
        place = match.end()
    return shown + escape(source[place:])


def text_of(document: dict[str, Any]) -> str:
    """The equations as one line, for the search."""
    equations = document.get("equations") or ""
    if isinstance(equations, dict):
        return "; ".join(f"{name}'' = {f}" for name, f in equations.items())
    return str(equations)


def _equations(document: dict[str, Any]) -> list[Markup]:
    equations = document["equations"]
    if not isinstance(equations, dict):
        return []
    names = _names(document)
    return [typesetting.formula(f"{coordinate}'' = {f}", names) for coordinate, f in equations.items()]


def _names(document: dict[str, Any]) -> Names:
    parameters = document.get("parameters", [])
    named = tuple(parameters) if not isinstance(parameters, str) else tuple(parameters_of(parameters))
    functions = {name: tuple(arguments) for name, arguments in document.get("functions", {}).items()}
    return Names(tuple(document["coordinates"]), named, functions)

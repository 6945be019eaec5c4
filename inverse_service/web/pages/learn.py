"""Six short screens (learn.html), the manual from Markdown pages of the project, about, and the calls for programs."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import dataclass
from html import unescape
from importlib import resources
from typing import Any

from fastapi import APIRouter
from markdown_it import MarkdownIt
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse

from inverse_service import __version__, catalogue
from inverse_service.reading.names import Names
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.rendering import can_simulate, page
from inverse_service.web.problems import Refusal

router = APIRouter()
open_router = APIRouter()  # asks for no key


# Those of the systems in the lessons.
NAMES = Names(("x", "y", "phi", "theta"), ("R", "L"))


@router.get("/learn")
async def learn() -> HTMLResponse:
    """The six screens."""
    return page("learn.html", active="/learn", names=NAMES, manual=PAGES, can_simulate=can_simulate())


# (name in the address, title) of the pages in web/manual; the first page are the six screens.
PAGES = (("mathematics", "The mathematics"), ("constraints", "Constraints"), ("calls", "Calls for programs"))
_FORMULA = re.compile(r"<p>\$(.+?)\$</p>|\$(.+?)\$")
CITATION = f"""@software{{inverse_service,
  title   = {{inverse-service: the inverse problem of the calculus of variations, decided and certified}},
  author  = {{{{The inverse-service authors}}}},
  version = {{{__version__}}},
  note    = {{MIT license}}
}}"""
PAPER = """@article{mestdag_bloch_fernandez_2009,
  title  = {Hamiltonization and geometric integration of nonholonomic mechanical systems},
  author = {Mestdag, Tom and Bloch, Anthony M. and Fernandez, Oscar E.},
  year   = {2009}
}"""


@open_router.get("/about")
async def about() -> HTMLResponse:
    """What this is, whose method it extends, and how to cite both."""
    return page("about.html", active="", version=__version__, citation=CITATION, paper=PAPER)


@open_router.get("/learn/{name}")
async def manual(request: Request, name: str) -> HTMLResponse:
    """One page of the manual."""
    titles = dict(PAGES)
    if name not in titles:
        raise Refusal(404, "not-found", "The manual has no such page; /learn lists them.")
    return page(
        "manual.html",
        active="/learn",
        title=titles[name],
        body=_body(name, str(request.base_url).rstrip("/")),
        pages=PAGES,
        name=name,
    )


def _body(name: str, address: str) -> Markup:
    """The page as HTML; what is between dollars is a formula of the theory."""
    text = (resources.files("inverse_service.web") / "manual" / f"{name}.md").read_text(encoding="utf-8")
    text = text.replace("ADDRESS", address)
    html = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    return Markup(_FORMULA.sub(lambda found: _formula(unescape(found[1] or found[2]), bool(found[1])), html))


def _formula(text: str, alone: bool) -> str:
    math = typesetting.of_theory(text)
    return f'<p class="formula">{math}</p>' if alone else str(math)


SYSTEM = {"coordinates": ["x", "y"], "equations": "x'' = -x; y'' = -y"}
SCENE = {
    "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "effects": ["constraints"],
    "initial": {"positions": {"phi": 0.1, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 1}},
    "step": 0.05,
    "steps": 200,
    "methods": [{"method": "variational", "alpha": 0}, {"method": "exact"}],
    "observe": ["trajectory", "energy"],
}
BODIES: dict[str, Any] = {
    "/v1/parse": SYSTEM,
    "/v1/solve": SYSTEM,
    "/v1/batches": [{"id": "first", **SYSTEM}, {"id": "second", "equations": "x'' = -x'"}],
    "/v1/simulate": SCENE,
    "/v1/work-precision": SCENE,
}
GROUPS = (
    ("Questions", ("/v1/parse", "/v1/solve", "/v1/check")),
    ("Jobs", ("/v1/jobs",)),
    ("Batches", ("/v1/batches",)),
    ("Simulation", ("/v1/simulate", "/v1/work-precision", "/v1/figures")),
    ("Atlas, catalogue, limits", ("/v1/atlas", "/v1/catalogue", "/v1/limits")),
    ("Operation", ("/",)),
)


@dataclass(frozen=True, slots=True)
class Call:
    """One call as OpenAPI describes it, with a line for a shell and a body to try."""

    method: str
    path: str
    about: dict[str, Any]
    address: str

    @property
    def key(self) -> str:
        """Its name on the page."""
        return "call" + re.sub(r"\W+", "-", f"{self.method}{self.path}").rstrip("-")

    @property
    def tried(self) -> str:
        """Where the page sends it."""
        return self.path.replace("{name}", catalogue.names()[0])

    @property
    def paragraphs(self) -> list[str]:
        """What it does; the first says it in a sentence."""
        return [part.replace("\n", " ").strip() for part in self.about.get("description", "").split("\n\n")]

    @property
    def body(self) -> Any:
        """What is sent, None where that is nothing or up to the reader."""
        return BODIES.get(self.path) if self.method == "POST" else None

    @property
    def example(self) -> str:
        """The call with curl, empty where it needs an id."""
        if self.body is not None:
            sent = f"-H 'Content-Type: application/json' -d {shlex.quote(json.dumps(self.body))}"
            return f"curl -s {self.address}{self.path} {sent}"
        is_plain = self.method == "GET" and "{" not in self.tried
        return f"curl -s {self.address}{self.tried}" if is_plain else ""


@open_router.get("/docs")
async def documentation(request: Request) -> HTMLResponse:
    """The calls in groups."""
    description: dict[str, Any] = request.app.openapi()
    address = str(request.base_url).rstrip("/")
    return page("calls.html", active="/docs", groups=groups(description, address))


def groups(description: dict[str, Any], address: str) -> list[tuple[str, list[Call]]]:
    """Each call in the first group whose addresses it begins with."""
    found: dict[str, list[Call]] = {heading: [] for heading, _ in GROUPS}
    for path, calls in description["paths"].items():
        heading = next(heading for heading, starts in GROUPS if path.startswith(starts))
        found[heading] += [Call(method.upper(), path, about, address) for method, about in calls.items()]
    return [(heading, calls) for heading, calls in found.items() if calls]

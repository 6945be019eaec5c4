"""Six short screens (learn.html), the manual from Markdown pages of the project, about, and the calls for programs."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from html import unescape
from importlib import resources
from typing import Any

from fastapi import APIRouter
from markdown_it import MarkdownIt
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse

from inverse_service import __version__
from inverse_service.reading.names import Names
from inverse_service.web.pages import rendering, typesetting
from inverse_service.web.problems import Refusal

router = APIRouter()
open_router = APIRouter()  # asks for no key


# Those of the systems in the lessons.
NAMES = Names(("x", "y", "phi", "theta"), ("R", "L"))


@router.get("/learn")
async def learn() -> HTMLResponse:
    """The six screens."""
    return rendering.page(
        "learn.html", active="/learn", names=NAMES, manual=PAGES, can_simulate=rendering.can_simulate()
    )


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
    return rendering.page("about.html", active="", version=__version__, citation=CITATION, paper=PAPER)


@open_router.get("/learn/{name}")
async def manual(request: Request, name: str) -> HTMLResponse:
    """One page of the manual."""
    if name not in dict(PAGES):
        raise Refusal(404, "not-found", "The manual has no such page; /learn lists them.")
    return _manual(request, name)


@open_router.get("/docs")
async def documentation(request: Request) -> HTMLResponse:
    """How programs ask, and all calls of the OpenAPI description: (method, path, what it does)."""
    paths: dict[str, Any] = request.app.openapi()["paths"]
    calls = [
        (method.upper(), path, about.get("description", "").partition("\n\n")[0].replace("\n", " "))
        for path, methods in paths.items()
        for method, about in methods.items()
    ]
    return _manual(request, "calls", calls)


def _manual(request: Request, name: str, calls: Sequence[tuple[str, str, str]] = ()) -> HTMLResponse:
    body = _body(name, str(request.base_url).rstrip("/"))
    active = "/docs" if calls else "/learn"
    return rendering.page(
        "manual.html", active=active, title=dict(PAGES)[name], body=body, pages=PAGES, name=name, calls=calls
    )


def _body(name: str, address: str) -> Markup:
    """The page as HTML; what is between dollars is a formula of the theory."""
    text = (resources.files("inverse_service.web") / "manual" / f"{name}.md").read_text(encoding="utf-8")
    text = text.replace("ADDRESS", address)
    html = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    k = itertools.count(1)
    html = re.sub("<pre>", lambda _: f'<pre tabindex="0" role="region" aria-label="Example {next(k)}">', html)
    return Markup(_FORMULA.sub(lambda found: _formula(unescape(found[1] or found[2]), bool(found[1])), html))


def _formula(text: str, alone: bool) -> str:
    math = typesetting.of_theory(text)
    return f'<p class="formula">{math}</p>' if alone else str(math)

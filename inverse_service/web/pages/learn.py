"""The inverse problem in six short screens, which are in learn.html; the manual and the about page.

The manual is the project's own Markdown pages, served along with what they explain.
"""

from __future__ import annotations

import posixpath
import re
from functools import lru_cache
from importlib import resources
from pathlib import Path

from fastapi import APIRouter
from markdown_it import MarkdownIt
from markupsafe import Markup
from starlette.responses import HTMLResponse

from inverse_service import __version__
from inverse_service.reading.names import Names
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


# (name in the address, title, file in docs/).
PAGES = (
    ("steps", "The inverse problem in small steps", "tutorials/inverse-problem.md"),
    ("disk", "The rolling disk", "tutorials/rolling-disk.md"),
    ("enter", "How to enter a system", "how-to/enter-systems.md"),
    ("verdicts", "What a verdict means", "explanation/verdicts.md"),
    ("mathematics", "The mathematics", "explanation/method.md"),
    ("constraints", "How to enter constraints on velocities", "how-to/constrained-systems.md"),
    ("associated", "Constraints on velocities, explained", "explanation/constrained-systems.md"),
    ("calls", "Calls for programs", "how-to/http.md"),
    ("glossary", "Glossary", "reference/glossary.md"),
)
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_KNOWN = {file: f"/learn/{name}" for name, _, file in PAGES}
_LINK = re.compile(r'href="([^":#]+)(#[^"]*)?"')
_IMAGE = re.compile(r"<img [^>]*>")
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
async def manual(name: str) -> HTMLResponse:
    """One page of the manual."""
    found = next(((title, file) for key, title, file in PAGES if key == name), None)
    if found is None:
        raise Refusal(404, "not-found", "The manual has no such page; /learn lists them.")
    title, file = found
    return page("manual.html", active="/learn", title=title, body=_body(file), pages=PAGES, name=name)


@lru_cache(maxsize=len(PAGES))
def _body(file: str) -> Markup:
    """The page as HTML; links to other pages of the manual stay on the site, those to files of the source go."""
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    html = markdown.render(_COMMENT.sub("", _text(file)).replace(".venv/bin/", ""))
    return Markup(_IMAGE.sub("", _LINK.sub(lambda link: _address(file, link), html)))


def _address(file: str, link: re.Match[str]) -> str:
    target, anchor = posixpath.normpath(posixpath.join(posixpath.dirname(file), link[1])), link[2] or ""
    return f'href="{_KNOWN[target]}{anchor}"' if target in _KNOWN else 'href="/learn"'


def _text(file: str) -> str:
    """From the wheel, or from the source tree."""
    packed = resources.files("inverse_service.web") / "manual" / file
    if packed.is_file():
        return packed.read_text(encoding="utf-8")
    return (Path(__file__).parents[3] / "docs" / file).read_text(encoding="utf-8")

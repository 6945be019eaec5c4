"""Templates to responses."""

from __future__ import annotations

import gzip
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from starlette.responses import HTMLResponse

from inverse_service.expressions.characters import greek_letter
from inverse_service.service.documents.text_page import guessed_words
from inverse_service.service.jobs.kinds import KINDS
from inverse_service.web.pages.assets import address
from inverse_service.web.pages.visitor import VISITOR

NAVIGATION = (
    ("/", "Solve"),
    ("/simulate", "Simulate"),
    ("/gallery", "Gallery"),
    ("/batch", "Batch"),
    ("/learn", "Learn"),
    ("/docs", "API"),
)
# Scripts and styles of our own files only; images of the figures are made on the page (blob:, data:).
WORTH_COMPRESSING = 2_000
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)


@lru_cache(maxsize=1)
def environment() -> Environment:
    """All templates; every value is escaped unless it is markup of our own."""
    found = Environment(
        loader=PackageLoader("inverse_service.web", "templates"),
        autoescape=True,
        auto_reload=False,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    shown = [(href, label) for href, label in NAVIGATION if href != "/simulate" or can_simulate()]
    found.globals |= {"address": address, "navigation": shown}
    found.filters["greek"] = lambda name: re.sub(r"[A-Za-z]+", lambda word: greek_letter(word[0]) or word[0], name)
    found.filters["guessed_words"] = guessed_words
    found.filters["short_number"] = short_number
    found.filters["duration"] = duration
    found.filters["code_marks"] = code_marks
    found.filters["capitalized"] = lambda text: text[:1].upper() + text[1:]
    found.filters["progress_text"] = progress_text
    return found


def code_marks(text: str) -> Markup:
    """Prose with `words` between grave accents set as code."""
    parts = [
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part) for k, part in enumerate(text.split("`"))
    ]
    return Markup("").join(parts)


def short_number(value: Any) -> str:
    """Three digits, powers of ten where they are shorter; a dash for what is no number."""
    if not isinstance(value, int | float):
        return "\u2013"
    return f"{value:.3g}".replace("e-0", "e-").replace("e+0", "e")


def duration(seconds: Any) -> str:
    """Seconds, or ms and microseconds where they are small."""
    if not isinstance(seconds, int | float):
        return "\u2013"
    if seconds < 1e-3:
        return f"{seconds * 1e6:.3g} \u00b5s"
    return f"{seconds * 1e3:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


def can_simulate() -> bool:
    """Whether this installation runs scenes."""
    return "simulate" in KINDS


def progress_text(progress: Any) -> str:
    """What a job says of its progress, in words."""
    if not isinstance(progress, dict):
        return str(progress or "")
    parts = [
        str(value) if key in ("stage", "message") else f"{key.replace('_', ' ')} {value}"
        for key, value in progress.items()
        if isinstance(value, str | int | float) and key != "elapsed"
    ]
    return ", ".join(parts)


def render(template: str, **values: Any) -> str:
    """The filled template."""
    return environment().get_template(template).render(visitor=VISITOR.get(), **values)


def page(template: str, status: int = 200, **values: Any) -> HTMLResponse:
    """A whole page under the policy of the pages."""
    return sent(render(template, **values), "text/html", {"Content-Security-Policy": POLICY}, status)


def sent(text: str, media_type: str, headers: Mapping[str, str], status: int = 200) -> HTMLResponse:
    """A text with its media type, compressed where the visitor takes that: formulas shrink to a tenth."""
    # A page is kept for Back and Forward only, so that what was typed into its form is still there.
    body, more = text.encode(), {"Vary": "Accept-Encoding, Cookie", "Cache-Control": "private, no-cache"}
    if VISITOR.get().takes_gzip and len(body) > WORTH_COMPRESSING:
        # What is sent holds no secret that its length could give away.
        body, more = gzip.compress(body, 5, mtime=0), more | {"Content-Encoding": "gzip"}
    return HTMLResponse(body, status, {**more, **headers}, media_type)

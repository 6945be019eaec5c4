"""Templates to responses, and who looks at a page: their colors, the client that their key names, their address."""

import base64
import csv
import gzip
import hashlib
import html
import importlib.util
import io
import re
import sys
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import (
    BytecodeCache,
    Environment,
    PackageLoader,
    StrictUndefined,
    __version__ as jinja_version,
)
from jinja2.bccache import Bucket
from markupsafe import Markup, escape
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from inverse_service.expressions import printing
from inverse_service.kernels.machine_code import code_store
from inverse_service.service.documents import sheets
from inverse_service.service.jobs import tasks
from inverse_service.service.scenes import views
from inverse_service.web import clients
from inverse_service.web.pages import WORDS, forms, typesetting
from inverse_service.web.problems import Refusal

TYPES = {
    "css": "text/css",
    "js": "text/javascript",
    "svg": "image/svg+xml",
    "png": "image/png",
    "woff2": "font/woff2",
}
FONT = "stix-two-math.woff2"
FORMULAS = "formulas.js"  # which carries the font
CHARTS = ("uPlot.iife.js", "uPlot.min.css")  # of the package uplot-python
NAMES = (
    FONT,
    FORMULAS,
    "style.css",
    "page.js",
    "figures.js",
    "motion.js",
    "pictures.js",
    "play.js",
    "family.js",
    "system.js",
    "icon.svg",
    *CHARTS,
)
# With a changed file all have another address, so an address never changes its content; scripts
# import their neighbors.
FOREVER = "public, max-age=31536000, immutable"
THEMES = ("light", "dark")
THEME_COOKIE = "theme"
NAVIGATE = ("navigate", "")
NAVIGATION: list[tuple[str, str]] = WORDS["navigation"]
# Scripts and styles of our own files only; images of the figures are made on the page (blob:,
# data:).
WORTH_COMPRESSING = 2_000
OK, NOT_MODIFIED = 200, 304


@lru_cache(maxsize=len(NAMES))
def asset(name: str) -> tuple[bytes, bytes]:
    """The file of this name, and compressed; KeyError for any other."""
    if name not in NAMES:
        raise KeyError(name)
    folder = chart_folder() if name in CHARTS else resources.files("inverse_service.web") / "static"
    if folder is None:
        raise KeyError(name)
    data = _font_script(folder / FONT) if name == FORMULAS else (folder / name).read_bytes()
    return data, gzip.compress(data, 6, mtime=0)


def _font_script(file: Traversable) -> bytes:
    """The font of formulas as a script that has added it when it ends: the first paint waits for
    it, so no formula changes its size later, as it would by a file that a style sheet names, in
    data: too. Compressed it is hardly larger than the file.
    """
    data = base64.b64encode(file.read_bytes()).decode()
    read = f'Uint8Array.from(atob("{data}"), (sign) => sign.charCodeAt(0))'
    return f'document.fonts.add(new FontFace("Formulas", {read}));\n'.encode()


@lru_cache(maxsize=1)
def mark() -> str:
    """A hash of the content of all files."""
    shown = NAMES if chart_folder() is not None else NAMES[: -len(CHARTS)]
    return hashlib.sha256(b"".join(asset(name)[0] for name in shown)).hexdigest()[:12]


@lru_cache(maxsize=1)
def chart_folder() -> Path | None:
    """Where the charting library is installed; its Python, which loads IPython, is left alone. None without it."""
    found = importlib.util.find_spec("uplot")
    folders = found.submodule_search_locations if found is not None else None
    return Path(folders[0]) / "static" if folders else None


@lru_cache(maxsize=1)
def style() -> Markup:
    """The style sheet, included in each page so that its first paint waits for nothing else."""
    return Markup(asset("style.css")[0].decode().replace(FONT, address(FONT)))


@lru_cache(maxsize=1)
def style_hash() -> str:
    """The hash of the style sheet in the policy of the pages."""
    return "sha256-" + base64.b64encode(hashlib.sha256(style().encode()).digest()).decode()


def address(name: str) -> str:
    """The address of the file in a page."""
    return f"/static/{mark()}/{name}"


async def static(request: Request, asked: str, name: str) -> Response:
    """One file; a request with an old hash gets the current file, which must be revalidated."""
    if name not in NAMES or (name in CHARTS and chart_folder() is None):
        raise Refusal(404, "not-found", "There is no such file.")
    data, compressed = asset(name)
    keep = FOREVER if asked == mark() else "no-cache"
    headers = {"Cache-Control": keep, "ETag": f'"{mark()}"', "Vary": "Accept-Encoding"}
    if request.headers.get("if-none-match") == headers["ETag"]:
        return Response(status_code=304, headers=headers)
    media_type = TYPES[name.rpartition(".")[2]]
    if "gzip" in request.headers.get("accept-encoding", ""):
        return Response(
            compressed, headers={**headers, "Content-Encoding": "gzip"}, media_type=media_type
        )
    return Response(data, headers=headers, media_type=media_type)


@dataclass(frozen=True, slots=True)
class Visitor:
    """`theme` is "light", "dark", or empty for that of the system; `client` is empty if no keys are required."""

    theme: str = ""
    client: str = ""
    address: str = "/"
    takes_gzip: bool = False
    known: str = ""  # the marks of the pages that the browser has


# Set for each request before its page is made; the templates read it.
VISITOR: ContextVar[Visitor] = ContextVar("visitor", default=Visitor())  # noqa: B039 (a frozen default)


async def note_visitor(request: Request) -> None:
    """A dependency of every page: notes the visitor."""
    note_visitor_of(request)


def note_visitor_of(request: Request) -> None:
    """The colors and the address of the visitor, without a client."""
    VISITOR.set(_visitor(request, ""))


async def require_visitor(request: Request) -> None:
    """A dependency of the pages that ask the service: on to /login without a good key, where keys are set."""
    keys = request.app.state.engine.keys.are_asked
    try:
        clients.note_client(request)
    except Refusal:
        if request.headers.get("sec-fetch-mode", "") not in NAVIGATE:
            raise
        place = f"/login?next={quote(_address(request), safe='/')}"
        raise Refusal(
            303, "key", "This service asks for a key: log in.", headers={"Location": place}
        ) from None
    VISITOR.set(_visitor(request, clients.client_of(request) if keys else ""))


def _visitor(request: Request, client: str) -> Visitor:
    takes_gzip = "gzip" in request.headers.get("accept-encoding", "")
    known = request.headers.get("if-none-match", "") if request.method == "GET" else ""
    chosen = request.cookies.get(THEME_COOKIE, "")
    return Visitor(chosen if chosen in THEMES else "", client, _address(request), takes_gzip, known)


def local_address(text: str) -> str:
    """An address on this service; the start page if the text is not one."""
    is_local = (
        text.startswith("/")
        and not text.startswith(("//", "/\\"))
        and text.isprintable()
        and len(text) < 2_000
    )
    return text if is_local else "/"


def _address(request: Request) -> str:
    """The address of the same page; the start page if a form was sent."""
    query = f"?{request.url.query}" if request.url.query else ""
    return local_address(request.url.path + query) if request.method == "GET" else "/"


POLICY = (
    f"default-src 'none'; script-src 'self'; style-src 'self' '{style_hash()}'; font-src 'self'; "
    "img-src 'self' data: blob:; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)


class _Compiled(BytecodeCache):
    """Templates as Python's code, kept with the kernels: to compile those of a page takes a tenth
    of a second, in each process.
    """

    def load_bytecode(self, bucket: Bucket) -> None:
        if (found := code_store.read(_entry_of(bucket), "template")) is not None:
            bucket.bytecode_from_string(found[1])

    def dump_bytecode(self, bucket: Bucket) -> None:
        code_store.store_entry(_entry_of(bucket), {}, bucket.bytecode_to_string(), "template")


def _entry_of(bucket: Bucket) -> str:
    """What the code of a template follows from: its name, its text, the settings, and the versions of Jinja and Python."""
    at = bucket.environment
    settings = f"{at.trim_blocks} {at.lstrip_blocks} {at.autoescape} {sorted(at.extensions)}"
    parts = (bucket.key, bucket.checksum, settings, jinja_version, sys.version)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@lru_cache(maxsize=1)
def environment() -> Environment:
    """All templates; every value is escaped unless it is markup of our own."""
    found = Environment(
        loader=PackageLoader("inverse_service.web", "templates"),
        undefined=StrictUndefined,
        autoescape=True,
        auto_reload=False,
        bytecode_cache=_Compiled(),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.policies["json.dumps_kwargs"] = {
        "sort_keys": False
    }  # sliders stand in the order of the parameters
    shown = [(href, label) for href, label in NAVIGATION if href != "/simulate" or can_simulate()]
    found.globals |= {
        "address": address,
        "style": style,
        "navigation": shown,
        "charts": chart_folder() is not None,
    }
    for typeset in (typesetting.equation, typesetting.formula, typesetting.of_theory):
        found.globals[typeset.__name__] = typeset
    found.filters["greek"] = lambda name: re.sub(
        r"[A-Za-z]+", lambda word: printing.displayed_name(word[0]), name
    )
    for said in (views.short_number, views.duration, views.method_name):
        found.filters[said.__name__] = said
    found.filters["code_marks"] = code_marks
    found.filters["question"] = forms.question_address
    found.filters["said"] = lambda sentence: typesetting.said(sentence, forms.question_address)
    found.filters["capitalized"] = sheets.capitalized
    found.filters["progress_text"] = progress_text
    return found


def code_marks(text: str) -> Markup:
    """Prose with `words` between grave accents set as code."""
    parts = [
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part)
        for k, part in enumerate(text.split("`"))
    ]
    return Markup("").join(parts)


def csv_of(rows: Iterable[Iterable[Any]]) -> str:
    """A table as CSV; a text with a leading sign, of which a spreadsheet makes a formula, begins with an apostrophe."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in rows:
        writer.writerow(
            [
                f"'{one}" if isinstance(one, str) and one[:1] in ("=", "+", "-", "@") else one
                for one in row
            ]
        )
    return text.getvalue()


def can_simulate() -> bool:
    """Whether this installation runs scenes."""
    return "simulate" in tasks.KINDS


def progress_text(progress: Any) -> str:
    """The progress of a job in words."""
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
    html = render(template, **values)
    return sent(html, "text/html", {"Content-Security-Policy": POLICY}, status)


def framed(response: HTMLResponse, origins: Iterable[str]) -> HTMLResponse:
    """The page, allowed in frames of this service and of other sites."""
    allowed = " ".join(("'self'", *origins))
    response.headers["Content-Security-Policy"] = POLICY.replace(
        "frame-ancestors 'none'", f"frame-ancestors {allowed}"
    )
    # The older header cannot hold a list; browsers that know the policy ignore it.
    response.headers["X-Frame-Options"] = "SAMEORIGIN"
    return response


def frame_code(address: str, title: str, width: str, height: int) -> str:
    """The HTML that shows a page of this service on a page of another site."""
    shown = f'src="{html.escape(address)}" title="{html.escape(title)}"'
    return f'<iframe {shown} width="{width}" height="{height}"></iframe>'


def sent(text: str, media_type: str, headers: Mapping[str, str], status: int = 200) -> HTMLResponse:
    """A text with its media type and its ETag, compressed where the visitor takes that: formulas shrink to a tenth."""
    # A page is kept for Back and Forward only, so that what was typed into its form is still there.
    visitor, body = VISITOR.get(), text.encode()
    mark = f'"{hashlib.sha256(body).hexdigest()[:20]}"'
    more = {"Vary": "Accept-Encoding, Cookie", "Cache-Control": "private, no-cache"}
    if status == OK:
        more["ETag"] = mark
        if mark in visitor.known:
            return HTMLResponse(b"", NOT_MODIFIED, {**more, **headers}, media_type)
    if visitor.takes_gzip and len(body) > WORTH_COMPRESSING:
        # What is sent holds no secret that its length could give away.
        body, more = gzip.compress(body, 5, mtime=0), more | {"Content-Encoding": "gzip"}
    return HTMLResponse(body, status, {**more, **headers}, media_type)


def packed(data: bytes, media_type: str, headers: Mapping[str, str]) -> Response:
    """What a worker has compressed, as it is for a visitor who takes that."""
    more = {"Vary": "Accept-Encoding"}
    if VISITOR.get().takes_gzip:
        return Response(
            data, headers={**headers, **more, "Content-Encoding": "gzip"}, media_type=media_type
        )
    return Response(gzip.decompress(data), headers={**headers, **more}, media_type=media_type)

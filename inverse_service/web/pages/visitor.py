"""Who looks at a page: the colours they chose, the client that their key names, and the address they are at."""

from __future__ import annotations

from contextvars import ContextVar
from dataclasses import dataclass
from urllib.parse import quote

from starlette.requests import Request

from inverse_service.web.clients import client_of, require_client
from inverse_service.web.problems import Refusal

THEMES = ("light", "dark")
THEME_COOKIE = "theme"
NAVIGATE = ("navigate", "")


@dataclass(frozen=True, slots=True)
class Visitor:
    """`theme` is "light", "dark", or empty for that of the system; `client` is empty where no keys are asked for."""

    theme: str = ""
    client: str = ""
    address: str = "/"
    takes_gzip: bool = False


# Set for each request before its page is made; the templates read it.
VISITOR: ContextVar[Visitor] = ContextVar("visitor", default=Visitor())  # noqa: B039 (a frozen default)


async def note_visitor(request: Request) -> None:
    """A dependency of every page: notes who looks at it."""
    note_visitor_of(request)


def note_visitor_of(request: Request) -> None:
    """The colours and the address of who looks, without a client."""
    VISITOR.set(_visitor(request, ""))


async def require_visitor(request: Request) -> None:
    """A dependency of the pages that ask the service: on to /login without a good key, where keys are set."""
    keys = request.app.state.engine.keys.are_asked
    try:
        require_client(request)
    except Refusal:
        if request.headers.get("sec-fetch-mode", "") not in NAVIGATE:
            raise
        place = f"/login?next={quote(_address(request), safe='/')}"
        raise Refusal(303, "key", "This service asks for a key: log in.", headers={"Location": place}) from None
    VISITOR.set(_visitor(request, client_of(request) if keys else ""))


def _visitor(request: Request, client: str) -> Visitor:
    takes_gzip = "gzip" in request.headers.get("accept-encoding", "")
    return Visitor(_theme(request), client, _address(request), takes_gzip)


def local_address(text: str) -> str:
    """An address on this service, the start page where the text is another or none."""
    is_local = text.startswith("/") and not text.startswith(("//", "/\\")) and text.isprintable() and len(text) < 2_000
    return text if is_local else "/"


def _theme(request: Request) -> str:
    chosen = request.cookies.get(THEME_COOKIE, "")
    return chosen if chosen in THEMES else ""


def _address(request: Request) -> str:
    """Where the same page is asked for again; the start page where a form was sent."""
    query = f"?{request.url.query}" if request.url.query else ""
    return local_address(request.url.path + query) if request.method == "GET" else "/"

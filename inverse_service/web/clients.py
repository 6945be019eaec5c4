"""Who asks: the name of an API key, or the address where no keys are asked for."""

from __future__ import annotations

import base64
import binascii

from starlette.requests import Request

from inverse_service.service.jobs.ownership import Viewer
from inverse_service.web.keys import LARGEST_KEY, Keys
from inverse_service.web.problems import Refusal

# Holds the key after a person logged in on the page; scripts cannot read it, and other sites never send it.
COOKIE = "inverse-service-key"
OWN_PAGES = ("same-origin", "none", "")


def require_client(request: Request) -> None:
    """A dependency of every call under /v1: notes who asks; 401 without a good key where keys are set."""
    keys = request.app.state.engine.keys
    request.state.client_name = _client(request, keys)
    request.state.viewer = Viewer(request.state.client_name, not keys.are_asked)


def viewer_of(request: Request) -> Viewer:
    """Who asks, as `require_client` found: all that is read, listed and cancelled is checked against it."""
    viewer: Viewer = request.state.viewer
    return viewer


def client_of(request: Request) -> str:
    """The client that `require_client` found, the address where nobody was asked for a key."""
    name: str = getattr(request.state, "client_name", None) or address_of(request)
    return name


def address_of(request: Request) -> str:
    """Where the request comes from."""
    return request.client.host if request.client else ""


def cookie_of_key(key: str) -> str:
    """A key as the value of a cookie, which takes no spaces, commas or umlauts."""
    return base64.urlsafe_b64encode(key.encode()).decode().rstrip("=")


def key_of_cookie(request: Request) -> str:
    """The key that a page of ours put into the cookie; nothing where another site sends the request."""
    value = request.cookies.get(COOKIE, "")[: 2 * LARGEST_KEY]
    if request.headers.get("sec-fetch-site", "") not in OWN_PAGES and request.method not in ("GET", "HEAD"):
        return ""
    try:
        return base64.urlsafe_b64decode(value + "=" * (-len(value) % 4)).decode()
    except (binascii.Error, ValueError):
        return ""


def _client(request: Request, keys: Keys) -> str:
    if not keys.are_asked:
        return address_of(request)
    scheme, _, token = request.headers.get("authorization", "").partition(" ")
    key = token.strip() if scheme.lower() == "bearer" else request.headers.get("x-api-key", "")
    name = keys.client_of(key or key_of_cookie(request))
    if name is None:
        detail = "This service asks for a key: send 'Authorization: Bearer KEY' or 'X-API-Key: KEY'; people use /login."
        raise Refusal(401, "key", detail, headers={"WWW-Authenticate": 'Bearer realm="inverse-service"'})
    return name

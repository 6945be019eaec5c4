"""Who asks: the name of an API key, or the address where no keys are asked for."""

from __future__ import annotations

import base64
import binascii
import hmac

from starlette.requests import Request

from inverse_service.service.jobs.ownership import Viewer
from inverse_service.settings import Settings, hash_of_key
from inverse_service.web.problems import Refusal

LARGEST_KEY = 200
# Holds the key after a person logged in on the page; scripts cannot read it, and other sites never send it.
COOKIE = "inverse-service-key"
OWN_PAGES = ("same-origin", "none", "")


def require_client(request: Request) -> None:
    """A dependency of every call under /v1: notes who asks; 401 without a good key where keys are set."""
    settings = request.app.state.engine.settings
    request.state.client_name = _client(request, settings)
    request.state.viewer = Viewer(request.state.client_name, not settings.api_keys)


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


def client_of_key(key: str, settings: Settings) -> str | None:
    """The client whose key this is, None where it is nobody's; takes as long for a wrong key as for a right one."""
    digest = hash_of_key(key[:LARGEST_KEY])
    names = [name for name, expected in settings.api_keys if hmac.compare_digest(digest, expected)]
    return names[0] if names and key else None


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


def _client(request: Request, settings: Settings) -> str:
    if not settings.api_keys:
        return address_of(request)
    scheme, _, token = request.headers.get("authorization", "").partition(" ")
    key = token.strip() if scheme.lower() == "bearer" else request.headers.get("x-api-key", "")
    name = client_of_key(key or key_of_cookie(request), settings)
    if name is None:
        detail = "This service asks for a key: send 'Authorization: Bearer KEY' or 'X-API-Key: KEY'; people use /login."
        raise Refusal(401, "key", detail, headers={"WWW-Authenticate": 'Bearer realm="inverse-service"'})
    return name

"""Who asks: the name of an API key, or the address where no keys are asked for."""

from __future__ import annotations

import hmac

from starlette.requests import Request

from inverse_service.settings import Settings, hash_of_key
from inverse_service.web.problems import Refusal

LARGEST_KEY = 200


def require_client(request: Request) -> None:
    """A dependency of every call under /v1: notes the client; 401 without a good key where keys are set."""
    request.state.client_name = _client(request, request.app.state.engine.settings)


def client_of(request: Request) -> str:
    """The client that `require_client` found."""
    name: str = request.state.client_name
    return name


def may_see_all(request: Request) -> bool:
    """Whether jobs of others are shown in lists and may be cancelled: only where nobody has a key."""
    return not request.app.state.engine.settings.api_keys


def _client(request: Request, settings: Settings) -> str:
    if not settings.api_keys:
        return request.client.host if request.client else ""
    scheme, _, token = request.headers.get("authorization", "").partition(" ")
    key = token.strip() if scheme.lower() == "bearer" else request.headers.get("x-api-key", "")
    digest = hash_of_key(key[:LARGEST_KEY])
    names = [name for name, expected in settings.api_keys if hmac.compare_digest(digest, expected)]
    if not names or not key:
        detail = "This service asks for a key: send 'Authorization: Bearer KEY' or 'X-API-Key: KEY'."
        raise Refusal(401, "key", detail, headers={"WWW-Authenticate": 'Bearer realm="inverse-service"'})
    return names[0]

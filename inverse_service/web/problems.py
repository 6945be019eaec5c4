"""Problem documents (RFC 9457): the one place where errors become status codes."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from typing import Any

from fastapi import FastAPI
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from inverse_service.errors import InputError, WorkerFailed
from inverse_service.service.outcome import Place
from inverse_service.service.refusals import DocumentRefused

log = logging.getLogger(__name__)
MEDIA_TYPE = "application/problem+json"
TITLES = {
    400: "The document cannot be read",
    404: "There is nothing at this address",
    405: "This address does not take this method",
    413: "The body is too large",
    415: "The body has another content type",
    422: "The document cannot be accepted",
    500: "A fault of the service",
    503: "The service is busy",
}
TYPES = {400: "unreadable", 404: "not-found", 405: "method", 413: "too-large", 415: "content-type", 500: "fault"}


class Refusal(Exception):
    """A request that a route refuses; `kind` is the stable end of the problem's type."""

    def __init__(
        self, status: int, kind: str, detail: str, places: tuple[Place, ...] = (), headers: Mapping[str, str] = {}
    ) -> None:
        super().__init__(detail)
        self.status, self.kind, self.detail, self.places, self.headers = status, kind, detail, places, dict(headers)


def problem(refusal: Refusal) -> Response:
    """The response of a refusal; its texts are ours, never the caller's."""
    content: dict[str, Any] = {
        "type": f"urn:inverse-service:problem:{refusal.kind}",
        "title": TITLES.get(refusal.status, "The request cannot be answered"),
        "status": refusal.status,
        "detail": refusal.detail,
        "errors": [{"pointer": p.pointer, "column": p.column, "detail": p.detail} for p in refusal.places],
    }
    body = json.dumps(content, ensure_ascii=True, allow_nan=False)
    return Response(body, refusal.status, headers=refusal.headers, media_type=MEDIA_TYPE)


def install(app: FastAPI) -> None:
    """Make every error of the application a problem document."""
    app.add_exception_handler(Refusal, _on_refusal)
    app.add_exception_handler(InputError, _on_input_error)
    app.add_exception_handler(WorkerFailed, _on_worker_failed)
    app.add_exception_handler(HTTPException, _on_http_exception)
    app.add_exception_handler(Exception, _on_fault)


async def _on_refusal(request: Request, error: Exception) -> Response:
    assert isinstance(error, Refusal)
    return problem(error)


async def _on_input_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, InputError)
    places = error.places if isinstance(error, DocumentRefused) else (Place(error.detail, error.pointer, error.column),)
    code = places[0].code if isinstance(error, DocumentRefused) else error.code
    return problem(Refusal(422, code, error.detail, places))


async def _on_worker_failed(request: Request, error: Exception) -> Response:
    assert isinstance(error, WorkerFailed)
    return problem(Refusal(500, "fault", error.detail))


async def _on_http_exception(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    detail = {
        404: "There is nothing at this address; GET /docs lists the addresses.",
        405: "This address does not take this method; GET /docs lists the methods.",
    }.get(error.status_code, "The request cannot be answered; GET /docs describes the service.")
    kind = TYPES.get(error.status_code, "refused")
    return problem(Refusal(error.status_code, kind, detail, headers=error.headers or {}))


async def _on_fault(request: Request, error: Exception) -> Response:
    log.error("fault at %s", request.url.path, exc_info=error)
    return problem(Refusal(500, "fault", "The service failed on this request; that is a fault of the service."))

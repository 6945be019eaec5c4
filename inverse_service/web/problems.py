"""Problem documents (RFC 9457): the one place where errors become status codes."""

from __future__ import annotations

import logging
import math
import re
import sqlite3
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar, cast

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from inverse_service.errors import InputError, NoWorker, Place, WorkerFailed
from inverse_service.service.documents import answers
from inverse_service.service.jobs import model, tasks
from inverse_service.web import middleware

if TYPE_CHECKING:
    from fastapi import FastAPI
    from fastapi.exceptions import RequestValidationError

log = logging.getLogger(__name__)
Found = TypeVar("Found")
MEDIA_TYPE = "application/problem+json"
TYPES = {
    400: "unreadable",
    404: "not-found",
    405: "method",
    413: "too-large",
    415: "content-type",
    500: "fault",
}


class Refusal(Exception):
    """A request that a route refuses; `kind` is the stable end of the problem's type."""

    def __init__(
        self,
        status: int,
        kind: str,
        detail: str,
        places: tuple[Place, ...] = (),
        headers: Mapping[str, str] = {},
    ) -> None:
        super().__init__(detail)
        self.status, self.kind, self.detail, self.places, self.headers = (
            status,
            kind,
            detail,
            places,
            dict(headers),
        )


class NoAddress(Refusal):
    """The service has no such address."""


# A full disk, for one (OperationalError): nothing was stored, and asking again is right.
STORE = (model.TooManyJobs, model.StoreUnavailable, sqlite3.OperationalError)
# What is answered by a problem document.
REFUSED = (Refusal, InputError, WorkerFailed, *STORE)


def known(found: Found | None, what: str) -> Found:
    """What was found; refuses with 404 where nothing was, also for what is another client's."""
    if found is None:
        raise Refusal(404, "not-found", f"There is no {what}")
    return found


def answer_to(request: Request, refusal: Refusal) -> Response:
    """A page where a browser asks for one, else a problem document."""
    shown = request.app.state.page_of_refusal(request, refusal)
    return shown if shown is not None else problem(refusal)


def problem(refusal: Refusal) -> Response:
    """The response of a refusal; its texts are ours, never the caller's."""
    content = answers.problem_document(refusal.status, refusal.kind, refusal.detail, refusal.places)
    return Response(
        answers.as_bytes(content), refusal.status, headers=refusal.headers, media_type=MEDIA_TYPE
    )


def install(app: FastAPI, page_of_refusal: Callable[[Request, Refusal], Response | None]) -> None:
    """Make every error of the application a problem document, or a page where `page_of_refusal`
    makes one.
    """
    from fastapi.exceptions import (
        RequestValidationError,
    )  # workers load this module, and never FastAPI

    app.state.page_of_refusal = page_of_refusal
    for error in (*REFUSED, HTTPException):
        app.add_exception_handler(error, on_error)
    app.add_exception_handler(RequestValidationError, _on_query)
    app.add_exception_handler(Exception, _on_fault)


async def on_error(request: Request, error: Exception) -> Response:
    """The answer to what a route raised of REFUSED."""
    return answer_to(request, refusal_of(request, error))


async def _on_query(request: Request, error: Exception) -> Response:
    faults = cast("RequestValidationError", error).errors()
    places = tuple(
        Place(f"{fault['msg']}.", f"/{_plain(fault)}") for fault in faults if fault.get("loc")
    )
    shown = ", ".join(sorted({_plain(fault) for fault in faults if fault.get("loc")}))
    detail = f"The address or its query is not as described in /docs: {shown}."
    return answer_to(request, Refusal(422, "bad-input", detail, places))


def _plain(fault: Mapping[str, Any]) -> str:
    """The name of a value of the query, without what could be markup."""
    return "".join(c if c.isalnum() or c in "-_" else "?" for c in str(fault["loc"][-1])[:40])


def rate_limit(quota: float, left: float, seconds: int) -> dict[str, str]:
    """The processor seconds of a day, and how many are left for so long
    (draft-ietf-httpapi-ratelimit-headers).

    None are left only where the next question is refused.
    """
    policy = f'"day";q={quota:.0f};w=86400'
    return {
        "RateLimit-Policy": policy,
        "RateLimit": f'"day";r={max(0, math.ceil(left))};t={seconds}',
    }


def refusal_of(request: Request, error: Exception) -> Refusal:
    """What an exception of REFUSED, or of the framework, says to a client."""
    match error:
        case Refusal():
            return error
        case HTTPException():
            return _of_framework(request, error)
        case InputError():
            status = 400 if error.code == tasks.UNREADABLE else 422
            return Refusal(status, error.code, error.detail, error.places)
        case NoWorker():
            return Refusal(503, "not-ready", error.detail, headers={"Retry-After": "5"})
        case WorkerFailed():
            return Refusal(500, "fault", error.detail)
        case model.TooManyJobs():
            limits = rate_limit(error.quota, 0.0, error.seconds) if error.quota else {}
            return Refusal(
                429, error.code, error.detail, headers={"Retry-After": str(error.seconds), **limits}
            )
    log.warning("the store does not answer at %s", request.url.path, exc_info=error)
    detail = "The store of jobs does not answer; try again in some seconds."
    return Refusal(503, model.StoreUnavailable.code, detail, headers={"Retry-After": "5"})


def _of_framework(request: Request, error: HTTPException) -> Refusal:
    detail = {
        404: "There is nothing at this address; GET /docs lists the addresses.",
        405: "This address does not take this method; GET /docs lists the methods.",
    }.get(error.status_code, "The request cannot be answered; GET /docs describes the service.")
    if error.status_code == 405 and "access-control-request-method" in request.headers:
        detail = "Pages of other origins may call where the operator lists these in INVERSE_SERVICE_CORS_ORIGINS."
    kind = TYPES.get(error.status_code, "refused")
    headers = dict(error.headers or {})
    if error.status_code == 405:
        known = {
            method.strip()
            for method in headers.pop("allow", headers.pop("Allow", "GET")).split(",")
        }
        headers["Allow"] = ", ".join(sorted(known | _methods(request)))
    made = NoAddress if error.status_code == 404 else Refusal
    return made(error.status_code, kind, detail, headers=headers)


def _methods(request: Request) -> set[str]:
    """What this address takes; the framework knows only of the first of its routes."""
    path, paths = request.scope["path"], request.app.openapi()["paths"]
    return {
        method.upper()
        for template, calls in paths.items()
        if re.fullmatch(re.sub(r"\\\{\w+\\\}", "[^/]+", re.escape(template)), path)
        for method in calls
    }


async def _on_fault(request: Request, error: Exception) -> Response:
    if isinstance(error, middleware.StreamCut):
        log.warning("a stream was cut off at %s", request.url.path)
    else:
        log.error("fault at %s", request.url.path, exc_info=error)
    # This answer is made outside of the middleware that adds them.
    detail = "The service failed on this request; that is a fault of the service."
    return problem(Refusal(500, "fault", detail, headers=middleware.HEADERS))

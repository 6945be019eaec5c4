"""The FastAPI application, put together: the calls, the pages, logging in and out, and the colors.

Pages are open or require a key. A mistyped address has a page, not JSON.
"""

import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, Depends, FastAPI
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service import __version__, errors
from inverse_service.service.documents import answers
from inverse_service.settings import PURPOSE, Settings
from inverse_service.web import clients, engine, middleware, openapi, problems, routes
from inverse_service.web.pages import (
    classes,
    exercises,
    library,
    nearest,
    rendering,
    results,
    simulate,
    solve,
)

page_router = APIRouter()
account = APIRouter()
TITLES = answers.TITLES | {
    403: "Forbidden",
    404: "Nothing here",
    422: "There is a problem with your input",
}
REDIRECTS = range(300, 400)
A_YEAR = 365 * 86_400
TITLE = "inverse-service"
# The setting that tells every program with OpenTelemetry where traces go.
ENDPOINT = "OTEL_EXPORTER_OTLP_ENDPOINT"
CORS_HEADERS = (
    "Authorization", "Cache-Control", "Content-Type", "Idempotency-Key", "If-None-Match", "Last-Event-ID", "Prefer",
    "traceparent", "X-API-Key", "X-Request-ID",
)  # fmt: skip

EXPOSED_HEADERS = (
    "ETag", "Link", "Location", "Preference-Applied", "RateLimit", "RateLimit-Policy", "Retry-After", "X-Request-ID",
)  # fmt: skip


def create_application(settings: Settings) -> FastAPI:
    """The service; its worker processes live from start to shutdown of the application."""
    app = FastAPI(
        title=TITLE, version=__version__, summary=PURPOSE, lifespan=_lifespan, docs_url=None, redoc_url=None,
        generate_unique_id_function=lambda route: route.name,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # see `trace`, and /metrics
    )  # fmt: skip
    app.state.engine = engine.Engine(settings)
    problems.install(app, page_of_refusal)
    app.add_middleware(
        middleware.Entrance, hosts=settings.hosts, questions=routes.QUESTIONS, ask=routes.ask
    )
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.cors_origins),
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=CORS_HEADERS,
            expose_headers=EXPOSED_HEADERS,
            max_age=600,
        )
    app.include_router(routes.asked)
    for router in (routes.jobs, routes.plain, routes.batches, routes.named, routes.open_router):
        app.include_router(router)
    app.include_router(page_router, include_in_schema=False)
    app.openapi = lambda: openapi.description_of(app)  # type: ignore[method-assign]
    if os.environ.get(ENDPOINT):
        trace(app)
    return app


def trace(app: FastAPI, exporter: Any = None) -> Any:
    """A span for each request, sent where ENDPOINT says; a caller's `traceparent` is its parent
    (extra `telemetry`).
    """
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.instrumentation.fastapi import FastAPIInstrumentor
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError:
        raise errors.InputError(
            f"{ENDPOINT} is set, which needs: pip install 'inverse-service[telemetry]'."
        ) from None
    provider = TracerProvider(
        resource=Resource.create({"service.name": TITLE, "service.version": __version__})
    )
    provider.add_span_processor(BatchSpanProcessor(exporter or OTLPSpanExporter()))
    FastAPIInstrumentor.instrument_app(
        app,
        tracer_provider=provider,
        excluded_urls="livez,readyz,metrics",
        exclude_spans=["receive", "send"],
    )
    return provider


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    app.state.engine.start()
    try:
        yield
    finally:
        app.state.engine.stop()


def page_of_refusal(request: Request, refusal: problems.Refusal) -> HTMLResponse | None:
    """The page; None for a program, which calls /v1 or does not accept HTML."""
    if request.url.path.startswith("/v1/") or "text/html" not in request.headers.get("accept", ""):
        return None
    if refusal.status in REDIRECTS:
        return None
    rendering.note_visitor_of(request)
    detail = (
        "The address may be mistyped."
        if isinstance(refusal, problems.NoAddress)
        else refusal.detail
    )
    title = TITLES.get(refusal.status, "This was refused")
    found = rendering.page("missing.html", refusal.status, active="", title=title, detail=detail)
    found.headers.update(refusal.headers)
    return found


@account.get("/login")
async def login_form(request: Request) -> Response:
    """The form for a key; the start page if no keys are required."""
    if not _engine(request).keys.are_asked:
        return RedirectResponse("/", 303)
    return _form(rendering.local_address(request.query_params.get("next", "/")))


@account.post("/login")
async def login(request: Request) -> Response:
    """The key, checked as in the header, kept in a cookie until the browser is closed."""
    sent = await results.read_form(request, results.SMALL_FORM)
    place, key = rendering.local_address(sent.text("next")), sent.text("key")
    if len(key) > clients.LARGEST_KEY or _engine(request).keys.client_of(key) is None:
        return _form(place, "This key is not known here.", 401)
    answer = RedirectResponse(place, 303)
    # The value of a cookie takes no spaces, commas or umlauts.
    answer.set_cookie(
        clients.COOKIE,
        quote(key, safe=""),
        httponly=True,
        samesite="strict",
        secure=_is_secure(request),
    )
    return answer


@account.post("/logout")
async def logout(request: Request) -> Response:
    """The cookie taken back."""
    await results.read_form(request, results.SMALL_FORM)
    answer = RedirectResponse("/login", 303)
    answer.delete_cookie(
        clients.COOKIE, httponly=True, samesite="strict", secure=_is_secure(request)
    )
    return answer


@account.post("/theme")
async def theme(request: Request) -> Response:
    """Light, dark, or as the system says; remembered for a year."""
    sent = await results.read_form(request, results.SMALL_FORM)
    answer = RedirectResponse(rendering.local_address(sent.text("back")), 303)
    if sent.text("theme") in rendering.THEMES:
        answer.set_cookie(
            rendering.THEME_COOKIE,
            sent.text("theme"),
            max_age=A_YEAR,
            samesite="lax",
            secure=_is_secure(request),
        )
    else:
        answer.delete_cookie(rendering.THEME_COOKIE, samesite="lax", secure=_is_secure(request))
    return answer


@account.get("/robots.txt")
async def robots() -> Response:
    """Pages may be read by all; answers to single questions are not a site's content."""
    return Response("User-agent: *\nDisallow: /results/\nDisallow: /v1/\n", media_type="text/plain")


@account.get("/favicon.ico")
async def favicon() -> Response:
    """The icon under the name that browsers request by default."""
    return RedirectResponse(
        rendering.address("icon.svg"), 301, {"Cache-Control": "public, max-age=86400"}
    )


def _form(place: str, problem: str = "", status: int = 200) -> HTMLResponse:
    return rendering.page("login.html", status, active="", place=place, problem=problem)


def _engine(request: Request) -> engine.Engine:
    found: engine.Engine = request.app.state.engine
    return found


def _is_secure(request: Request) -> bool:
    return request.url.scheme == "https"


page_router.get("/static/{asked}/{name}")(rendering.static)
for part in (account, library.open_router):
    page_router.include_router(part, dependencies=[Depends(rendering.note_visitor)])
for pages in (solve, exercises, classes, nearest, results, simulate, library):
    page_router.include_router(pages.router, dependencies=[Depends(rendering.require_visitor)])

"""The FastAPI application, put together."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from inverse_service import __version__
from inverse_service.settings import Settings
from inverse_service.web import (
    problems,
    routes,
    routes_batches,
    routes_jobs,
    routes_operations,
    routes_simulation,
)
from inverse_service.web.engine import Engine
from inverse_service.web.head_requests import HeadAsGet
from inverse_service.web.headers import SecurityHeaders
from inverse_service.web.leaving import StopWhenLeft
from inverse_service.web.measuring import Measured
from inverse_service.web.openapi import described
from inverse_service.web.pages import routing
from inverse_service.web.pages.refused import page_of_refusal

TITLE = "inverse-service"
SUMMARY = "Does q'' = f(t, q, q') come from a Lagrangian? A verdict with a proof that a second program checks."
CORS_HEADERS = (
    "Authorization", "Cache-Control", "Content-Type", "Idempotency-Key", "Last-Event-ID", "Prefer", "X-API-Key",
)  # fmt: skip


def create_application(settings: Settings) -> FastAPI:
    """The service; its worker processes live from start to shutdown of the application."""
    app = FastAPI(title=TITLE, version=__version__, summary=SUMMARY, lifespan=_lifespan, docs_url=None, redoc_url=None)
    app.state.engine = Engine(settings)
    problems.install(app, page_of_refusal)
    app.add_middleware(StopWhenLeft)
    app.add_middleware(HeadAsGet)
    app.add_middleware(SecurityHeaders, hosts=settings.hosts)
    app.add_middleware(Measured, counters=app.state.engine.counters)
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.cors_origins),
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=CORS_HEADERS,
            expose_headers=["ETag", "Link", "Location", "Preference-Applied", "Retry-After", "X-Request-ID"],
            max_age=600,
        )
    for part in (routes, routes_jobs, routes_simulation, routes_batches, routes_operations):
        app.include_router(part.router)
    app.include_router(routing.router, include_in_schema=False)
    app.openapi = lambda: described(app)  # type: ignore[method-assign]
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    engine: Engine = app.state.engine
    engine.start()
    try:
        yield
    finally:
        engine.stop()

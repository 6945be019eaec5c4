"""The FastAPI application, put together."""

import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware

from inverse_service import __version__, errors
from inverse_service.settings import Settings
from inverse_service.web import middleware, openapi, problems, routes
from inverse_service.web.engine import Engine
from inverse_service.web.pages import routing

TITLE = "inverse-service"
SUMMARY = "Decide whether q'' = f(t, q, q') comes from a Lagrangian, with a proof that a second program checks."
# The setting that tells every program with OpenTelemetry where traces go.
ENDPOINT = "OTEL_EXPORTER_OTLP_ENDPOINT"
CORS_HEADERS = (
    "Authorization", "Cache-Control", "Content-Type", "Idempotency-Key", "Last-Event-ID", "Prefer", "X-API-Key",
)  # fmt: skip


def create_application(settings: Settings) -> FastAPI:
    """The service; its worker processes live from start to shutdown of the application."""
    app = FastAPI(
        title=TITLE, version=__version__, summary=SUMMARY, lifespan=_lifespan, docs_url=None, redoc_url=None,
        generate_unique_id_function=lambda route: route.name,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # see `trace`, and /metrics
    )  # fmt: skip
    app.state.engine = Engine(settings)
    problems.install(app, routing.page_of_refusal)
    app.add_middleware(middleware.Entrance, hosts=settings.hosts, questions=routes.QUESTIONS, ask=routes.ask)
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=list(settings.cors_origins),
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=CORS_HEADERS,
            expose_headers=["ETag", "Link", "Location", "Preference-Applied", "Retry-After", "X-Request-ID"],
            max_age=600,
        )
    app.include_router(routes.asked)
    for router in (routes.jobs, routes.plain, routes.batches, routes.named, routes.open_router):
        app.include_router(router)
    app.include_router(routing.router, include_in_schema=False)
    app.openapi = lambda: openapi.description_of(app)  # type: ignore[method-assign]
    if os.environ.get(ENDPOINT):
        trace(app)
    return app


def trace(app: FastAPI, exporter: Any = None) -> Any:
    """A span for each request, sent where ENDPOINT says; a caller's `traceparent` is its parent (extra `telemetry`)."""
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.instrumentation.fastapi import FastAPIInstrumentor
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError:
        raise errors.InputError(f"{ENDPOINT} is set, which needs: pip install 'inverse-service[telemetry]'.") from None
    provider = TracerProvider(resource=Resource.create({"service.name": TITLE, "service.version": __version__}))
    provider.add_span_processor(BatchSpanProcessor(exporter or OTLPSpanExporter()))
    FastAPIInstrumentor.instrument_app(
        app, tracer_provider=provider, excluded_urls="livez,readyz,metrics", exclude_spans=["receive", "send"]
    )
    return provider


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    engine: Engine = app.state.engine
    engine.start()
    try:
        yield
    finally:
        engine.stop()

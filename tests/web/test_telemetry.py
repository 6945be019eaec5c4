"""Traces are off unless their endpoint is set; each request is a span within the trace of its
caller.
"""

from __future__ import annotations

import asyncio
import sys

import httpx
import pytest
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

from inverse_service.errors import InputError
from inverse_service.settings import Settings
from inverse_service.web import application

TRACE = "0af7651916cd43dd8448eb211c80319c"
ASKED = {"traceparent": f"00-{TRACE}-b7ad6b7169203331-01"}


def test_a_request_is_a_span_in_the_trace_of_its_caller_and_the_log_has_the_same_id() -> None:
    app, spans = application.create_application(Settings()), InMemorySpanExporter()
    provider = application.trace(app, spans)

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://service"
        ) as client:
            assert (await client.get("/livez")).status_code == 200
            return await client.get("/v1/catalogue/sho", headers=ASKED)

    assert asyncio.run(ask()).headers["x-request-id"] == TRACE
    provider.force_flush()
    (span,) = spans.get_finished_spans()
    assert (span.name, f"{span.context.trace_id:032x}") == ("GET /v1/catalogue/{name}", TRACE)
    provider.shutdown()


def test_without_an_endpoint_nothing_is_traced_and_with_one_the_extra_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "opentelemetry.instrumentation.fastapi", None)
    monkeypatch.delenv(application.ENDPOINT, raising=False)
    application.create_application(Settings())
    monkeypatch.setenv(application.ENDPOINT, "http://127.0.0.1:4318")
    with pytest.raises(InputError, match="telemetry"):
        application.create_application(Settings())

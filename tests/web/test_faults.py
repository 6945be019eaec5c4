"""Internal errors and a full queue give problem documents without internal details."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest

from inverse_service.errors import NoWorker
from inverse_service.service.jobs import monitoring
from inverse_service.service.jobs.tasks import Outcome, Usage, value_of
from inverse_service.settings import Settings
from inverse_service.web.application import EXPOSED_HEADERS, create_application
from inverse_service.web.engine import Engine
from inverse_service.web.problems import Refusal, rate_limit
from tests.logs import Logged
from tests.web.inline import Inline

DOCUMENT = {"coordinates": ["x"], "equations": {"x": "0"}}


def answer_of(
    monkeypatch: pytest.MonkeyPatch, error: Exception, settings: Settings | None = None
) -> httpx.Response:
    """The response that a client gets if solving raises the error."""

    async def fail(*_: Any) -> Any:
        raise error

    monkeypatch.setattr(Engine, "submit", fail)
    application = create_application(settings or Settings())
    application.state.engine.is_open = True
    application.state.engine.quick_workers = Inline()
    transport = httpx.ASGITransport(application, raise_app_exceptions=False)

    async def call() -> httpx.Response:
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.post(
                "/v1/solve", json=DOCUMENT, headers={"Origin": "https://a.example"}
            )

    return asyncio.run(call())


def test_an_exception_of_ours_is_a_problem_without_its_text(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    response = answer_of(monkeypatch, KeyError("a secret of the inside"))
    assert response.status_code == 500
    assert response.headers["content-type"] == "application/problem+json"
    assert "secret" not in response.text


@pytest.mark.parametrize("status", ["crash", "fault"])
def test_a_failed_task_is_a_problem_and_its_details_go_to_the_log(
    monkeypatch: pytest.MonkeyPatch, logged: Logged, status: Any
) -> None:
    with pytest.raises(Exception, match="error in the program") as raised:
        value_of(Outcome(status, "KeyError", detail="Traceback: a secret of the inside"))
    response = answer_of(monkeypatch, raised.value)
    assert response.status_code == 500
    assert "secret" not in response.text
    assert "secret" in logged.text


def test_without_a_worker_process_a_request_gets_retry_after(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(NoWorker) as raised:
        value_of(Outcome("unstarted"))
    response = answer_of(monkeypatch, raised.value)
    assert (response.status_code, response.json()["type"]) == (
        503,
        "urn:inverse-service:problem:not-ready",
    )
    assert int(response.headers["retry-after"]) > 0


def test_one_request_too_many_gets_retry_after() -> None:
    engine = Engine(Settings(waiting=4))
    with engine.places.hold("a", 1), engine.places.hold("a", 1):
        with pytest.raises(Refusal) as refused, engine.places.hold("a", 1):
            pass
        assert refused.value.status == 429
        assert refused.value.headers == {"Retry-After": "2"}
        b, c = engine.places.hold("b", 1), engine.places.hold("c", 1)
        with b, engine.places.hold("b", 1), pytest.raises(Refusal), c:
            pass
    with engine.places.hold("a", 1):
        pass


@pytest.mark.parametrize(("cpu", "status"), [(0.95, 422), (0.6, 503), (0.2, 503)])
def test_only_a_document_that_used_its_time_is_too_large(cpu: float, status: int) -> None:
    class Late(Engine):
        async def run_quick(self, *_: Any, **__: Any) -> Outcome:
            return Outcome("deadline", spent=Usage(1.0, cpu))

    with pytest.raises(Refusal) as refused:
        asyncio.run(Late(Settings()).read_body("a", len, b""))
    assert refused.value.status == status


@pytest.mark.parametrize(
    ("origins", "allowed"), [((), None), (("https://a.example",), "https://a.example")]
)
def test_other_pages_may_call_only_where_the_settings_say_so(
    monkeypatch: pytest.MonkeyPatch, origins: tuple[str, ...], allowed: str | None
) -> None:
    response = answer_of(monkeypatch, Refusal(422, "limit", "no"), Settings(cors_origins=origins))
    assert response.status_code == 422
    assert response.headers.get("access-control-allow-origin") == allowed


def test_a_fault_is_counted_and_has_an_id(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fail(*_: Any) -> Any:
        raise KeyError("inside")

    monkeypatch.setattr(Engine, "submit", fail)
    application = create_application(Settings())
    engine = application.state.engine
    engine.is_open, engine.quick_workers = True, Inline()
    transport = httpx.ASGITransport(application, raise_app_exceptions=False)

    async def call() -> httpx.Response:
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.post("/v1/solve", json=DOCUMENT)

    assert asyncio.run(call()).status_code == 500
    counted = b'inverse_service_http_requests_total{method="POST",route="/v1/solve",status="500"}'
    assert counted in monitoring.metrics_page([])


@pytest.mark.parametrize(("left", "shown"), [(6.0, 6), (0.2, 1), (0.0, 0), (-3.0, 0)])
def test_no_second_is_left_only_where_the_next_run_is_refused(left: float, shown: int) -> None:
    assert rate_limit(6.0, left, 60)["RateLimit"] == f'"day";r={shown};t=60'


def test_other_origins_may_send_and_read_what_the_pages_describe() -> None:
    application = create_application(Settings(cors_origins=("https://a.example",)))

    async def call() -> httpx.Response:
        asked = "if-none-match, traceparent, x-request-id, idempotency-key"
        headers = {"Origin": "https://a.example", "Access-Control-Request-Method": "POST"}
        transport = httpx.ASGITransport(application)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.options(
                "/v1/solve", headers=headers | {"Access-Control-Request-Headers": asked}
            )

    assert asyncio.run(call()).status_code == 200
    assert {"RateLimit", "RateLimit-Policy", "Retry-After", "X-Request-ID"} <= {*EXPOSED_HEADERS}

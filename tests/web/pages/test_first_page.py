"""The form appears immediately even if no worker can parse it yet."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from inverse_service.service.jobs.tasks import Outcome
from inverse_service.web import clients
from inverse_service.web.pages import results, solve
from inverse_service.web.problems import Refusal


class Starting:
    """An engine whose workers answer after `delay` seconds; `withdrawn` counts the abandoned
    requests.
    """

    def __init__(self, delay: float) -> None:
        self.delay, self.withdrawn = delay, 0

    async def run_quick(self, *arguments: Any, **options: Any) -> Outcome:
        try:
            await asyncio.sleep(self.delay)
        except asyncio.CancelledError:
            self.withdrawn += 1
            raise
        return Outcome("done", {"understood": "read"})


@pytest.mark.parametrize(
    ("delay", "patience", "found"), [(60, 0.01, {}), (0, 5, "read"), (0.05, None, "read")]
)
def test_a_page_at_its_start_does_not_wait_for_workers(
    monkeypatch: pytest.MonkeyPatch, delay: float, patience: float | None, found: Any
) -> None:
    engine = Starting(delay)
    monkeypatch.setattr(clients, "client_of", lambda request: "one")
    request: Any = SimpleNamespace(app=SimpleNamespace(state=SimpleNamespace(engine=engine)))
    answer = asyncio.run(solve.understand(request, {}, patience))
    assert answer == (found and {"understood": found})
    assert engine.withdrawn == (0 if found else 1)


@pytest.mark.parametrize(("kind", "status"), [("limit", 503), ("busy", 503), ("too-large", 413)])
def test_a_busy_service_says_that_it_has_to_be_asked_again(
    monkeypatch: pytest.MonkeyPatch, kind: str, status: int
) -> None:
    async def refuse(*arguments: Any) -> None:
        raise Refusal(status, kind, "Not now.")

    monkeypatch.setattr(clients, "client_of", lambda request: "one")
    monkeypatch.setattr(results, "read_sent", refuse)
    engine = SimpleNamespace(glances=clients.Shares(1, 1, ""), settings=SimpleNamespace(max_body=1))
    request: Any = SimpleNamespace(
        app=SimpleNamespace(state=SimpleNamespace(engine=engine)), query_params={}
    )
    try:
        found = asyncio.run(solve.answer_beside(request)).status_code
    except Refusal as refusal:
        found = refusal.status
    assert found == status

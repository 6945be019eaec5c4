"""The way of a document from the HTTP call to the mathematics is the one that docs/architecture.md draws."""

from __future__ import annotations

import asyncio
import re
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import httpx
import pytest

from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.outcome import Call, guard
from inverse_service.service.jobs.workers import Running
from inverse_service.settings import Settings
from inverse_service.web import engine
from inverse_service.web.application import create_application
from tests.web.inline import Inline

ROOT = Path(__file__).parents[2]
DRAWN = re.compile(r"^(?:around|received|read|stored|solved) +(.*)$", re.MULTILINE)
MATHEMATICS = ("inverse_service/inverse_problem/", "inverse_service/mechanics/", "inverse_service/expressions/")


class Reporting(Inline):
    """Runs also what reports, where it is submitted."""

    def submit(self, call: Call, report: Any = None) -> Running:
        running = Running(call, report)
        told = {"report": report or (lambda _: None)} if call.reports else {}
        running.end(guard(call.task, *call.arguments, **told))
        return running


class Trace:
    """The files of the package that are entered in any thread while it is `on`, up to the first of the mathematics."""

    def __init__(self) -> None:
        self.entered: dict[str, None] = {}
        self.on = False

    def __call__(self, frame: FrameType, event: str, argument: object) -> None:
        place = frame.f_code.co_filename.removeprefix(f"{ROOT}/")
        if not self.on or event != "call" or not place.startswith(("inverse_service/", "api_schemas/")):
            return
        if place.startswith(MATHEMATICS) and not place.endswith("options.py"):
            self.on = False
        else:
            self.entered[place] = None


@pytest.fixture
def trace() -> Iterator[Trace]:
    found = Trace()
    threading.setprofile(found)
    sys.setprofile(found)
    yield found
    sys.setprofile(None)
    threading.setprofile(None)  # type: ignore[arg-type]


async def answered(settings: Settings, trace: Trace) -> Any:
    """The answer to a question that is traced, which is the second of its service."""
    application = create_application(settings)
    transport, preference = httpx.ASGITransport(application), {"Prefer": "wait=20"}
    async with (
        application.router.lifespan_context(application),
        httpx.AsyncClient(transport=transport, base_url="http://way") as client,
    ):
        await client.post("/v1/solve", json={"equations": {"x": "-2*x"}}, headers=preference)
        await asyncio.sleep(1.0)  # what follows an answer is over
        trace.on = True
        return (await client.post("/v1/solve", json={"equations": {"x": "-x"}}, headers=preference)).json()


@pytest.mark.slow
def test_a_question_passes_the_files_that_are_drawn(
    trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "Workers", lambda *settings: Reporting())
    monkeypatch.setattr(engine, "_executor", lambda settings: Reporting())
    tasks.load_engine()
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    drawn = {name for line in DRAWN.findall(text) for name in re.findall(r"(?:\w+/)+\w+", line)}
    answer = asyncio.run(answered(Settings(database=str(tmp_path / "jobs.sqlite")), trace))
    assert answer["verdict"] == "variational"
    entered = {place.removeprefix("inverse_service/").removesuffix(".py") for place in trace.entered}
    assert entered - drawn == set()
    assert len(entered) > 19
    assert len(drawn) <= 20


def test_a_file_that_is_not_drawn_would_be_seen(trace: Trace) -> None:
    trace.on = True
    thread = threading.Thread(target=guard, args=(int, "x"))
    thread.start()
    thread.join()
    assert list(trace.entered) == ["inverse_service/service/jobs/outcome.py"]

"""Answers in parts equal the stored text byte for byte, and end early if the answer changes during
the transfer.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest

from inverse_service.service.jobs.batch import answer_line
from inverse_service.service.jobs.model import BatchLine, JobOptions, StoreUnavailable
from inverse_service.service.jobs.opening import stored_answer
from inverse_service.service.jobs.stores import Durability, SqliteStore
from inverse_service.service.jobs.tasks import Usage, request_of
from inverse_service.settings import Settings
from inverse_service.web import job_answers
from inverse_service.web.engine import Engine

SIZES = (1, 3, job_answers.SMALL, job_answers.PART // 2, job_answers.PART, 3 * job_answers.PART + 7)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    found = SqliteStore(tmp_path / "jobs.sqlite", Durability.LATER)
    yield found
    found.close()


def engine_with(store: SqliteStore) -> Engine:
    engine: Any = Engine(Settings())
    engine.job_store = store
    return engine  # type: ignore[no-any-return]


def answered(store: SqliteStore, sizes: tuple[int, ...]) -> list[tuple[str, bytes]]:
    """The ids of jobs in a batch "b", with their answers."""
    systems = [
        {"name": str(k), "coordinates": ["x"], "equations": {"x": "0"}} for k in range(len(sizes))
    ]
    requests = [request_of("solve", system, JobOptions()) for system in systems]
    store.create_batch(
        "b", "solve", "", [BatchLine(k, f'"{k}"', request) for k, request in enumerate(requests, 1)]
    )
    bodies = [json.dumps({"verdict": "a" * size}).encode() for size in sizes]
    jobs = {job.id: job for job in store.claim("test", len(sizes))}
    for request, body in zip(requests, bodies, strict=True):
        store.finish(request.id, jobs[request.id].attempt, body, Usage())
    return [(request.id, body) for request, body in zip(requests, bodies, strict=True)]


async def joined(parts: AsyncIterator[Any]) -> bytes:
    return b"".join([part async for part in parts])


def test_parts_make_the_whole_and_the_length_is_sent(store: SqliteStore) -> None:
    engine = engine_with(store)

    async def sent(id: str) -> tuple[bytes, str]:
        response: Any = await job_answers.stored_response(engine, id, {}, (b"<", b">"))
        body = (
            await joined(response.body_iterator)
            if hasattr(response, "body_iterator")
            else response.body
        )
        return body, response.headers["content-length"]

    for id, body in answered(store, SIZES):
        found, length = asyncio.run(sent(id))
        assert found == b"<" + body + b">"
        assert int(length) == len(found)
        assert stored_answer(store.address, id)[1] == body


def test_lines_in_parts_are_those_at_once(store: SqliteStore) -> None:
    answered(store, SIZES)
    whole = b"".join(answer_line(answer) for answer in store.batch_answers("b"))
    answers = store.batch_answers("b", largest=job_answers.SMALL)
    assert [answer.body is None for answer in answers] == [False, False, True, True, True, True]
    assert asyncio.run(joined(job_answers.lines_of(engine_with(store), answers))) == whole


def test_a_long_problem_is_not_taken_for_a_cancelled_line(store: SqliteStore) -> None:
    request = request_of("solve", {"coordinates": ["x"], "equations": {"x": "omega"}}, JobOptions())
    store.create_batch("b", "solve", "", [BatchLine(1, '"a"', request)])
    (job,) = store.claim("test", 1)
    problem = {"status": 422, "detail": "Mend it. " * job_answers.SMALL}
    store.finish(job.id, job.attempt, json.dumps(problem).encode(), Usage(), status="failed")
    answers = store.batch_answers("b", largest=job_answers.SMALL)
    line = json.loads(asyncio.run(joined(job_answers.lines_of(engine_with(store), answers))))
    assert (line["status"], line["detail"]) == (422, f"Line 1: {problem['detail']}")


def test_an_answer_that_changes_while_it_is_read_ends_the_stream(store: SqliteStore) -> None:
    (found,) = answered(store, SIZES[-1:])

    async def read() -> None:
        response: Any = await job_answers.stored_response(engine_with(store), found[0], {})
        parts = response.body_iterator
        await anext(parts)
        store.submit(
            [
                request_of(
                    "solve", json.loads(store.job(found[0]).document), JobOptions(), fresh=True
                )
            ]
        )  # type: ignore[union-attr]
        (job,) = store.claim("test", 1)
        store.finish(job.id, job.attempt, b"{}", Usage())
        await joined(parts)

    with pytest.raises(StoreUnavailable):
        asyncio.run(read())


def test_an_answer_that_was_forgotten_is_not_there(store: SqliteStore) -> None:
    assert store.part("nothing", 0, 10) == (0, b"")
    with pytest.raises(KeyError):
        stored_answer(store.address, "nothing")

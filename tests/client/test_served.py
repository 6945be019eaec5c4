"""The clients with a real service in a separate process."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

from inverse_service.client import AsyncClient, Client, JobDismissed, JobFailed, RequestRefused
from tests.serving import NAMES, TERMS, TIME_LIMIT


def oscillator(k: int) -> dict[str, Any]:
    return {"coordinates": ["x"], "equations": {"x": f"-{k}*x"}}


def hard(k: int) -> dict[str, Any]:
    """A system that takes minutes."""
    return {"coordinates": NAMES, "equations": dict.fromkeys(NAMES, f"{k}*{TERMS}")}


def listed(client: Client) -> Iterator[str]:
    """The ids of all jobs, page by page."""
    page = client.call("/v1/jobs")
    yield from (each.id for each in page.jobs)
    while page.next is not None:
        page = client.call(f"/v1/jobs?cursor={page.next}")
        yield from (each.id for each in page.jobs)


@pytest.fixture(scope="module")
def client(service: str) -> Iterator[Client]:
    with Client(service) as client:
        yield client


def test_a_system_is_solved_and_its_result_checked(client: Client) -> None:
    result = client.solve(oscillator(2))
    assert result.verdict == "variational"
    assert result.lagrangian is not None
    assert client.check(result).verdict == "valid"
    spoilt = {**result, "lagrangian": {**result.lagrangian, "text": "x'^2/2"}}
    assert client.check(spoilt).verdict != "valid"


def test_a_job_is_submitted_followed_and_fetched(client: Client) -> None:
    job = client.submit(oscillator(3))
    events = list(client.stream(job))
    assert events[-1].data["status"] == "successful"
    result = client.wait(job, timeout=30)
    assert result == client.solve(oscillator(3)), "the same question has the same answer"
    assert client.call(f"/v1/jobs/{job.id}").status == "successful"
    assert job.id in listed(client)
    assert list(client.stream(job))[-1].data["status"] == "successful", (
        "the events of a finished job end"
    )


def test_a_fresh_answer_is_computed_again(client: Client) -> None:
    first = client.solve(oscillator(4))
    second = client.solve(oscillator(4), fresh=True)
    assert first.verdict == second.verdict
    assert first.provenance != second.provenance


def test_a_cancelled_job_is_dismissed_at_once(client: Client) -> None:
    job = client.submit(hard(2))
    client.cancel(job)
    with pytest.raises(JobDismissed):
        client.wait(job, timeout=60)


def test_a_bad_document_carries_its_places(client: Client) -> None:
    bad = {"coordinates": ["x"], "equations": {"x": "-x + omega"}}
    with pytest.raises(RequestRefused, match="/equations/x, column 6") as refused:
        client.solve(bad)
    assert refused.value.status == 422
    with pytest.raises(RequestRefused):
        client.wait(client.submit({**bad, "name": "again"}))
    assert issubclass(JobFailed, RequestRefused)
    with pytest.raises(RequestRefused) as refused:
        client.wait("0" * 40)
    assert refused.value.status == 404


def test_a_batch_is_answered_line_by_line(client: Client) -> None:
    documents = [{"id": f"line {k}", **oscillator(k % 7 + 1)} for k in range(40)]
    documents[5] = {"id": "bad", "equations": 3}
    answers = {answer.id: answer for answer in client.batch(documents)}
    assert set(answers) == {document["id"] for document in documents}
    assert answers["bad"].problem is not None
    others = [answer.result for id, answer in answers.items() if id != "bad"]
    assert [result.verdict for result in others] == ["variational"] * 39
    batch = client.submit_batch(documents)
    assert len(list(client.batch_results(batch))) == 40
    assert client.call(f"/v1/batches/{batch.id}").counts == {"successful": 39, "failed": 1}
    client.cancel(batch)


def test_small_questions_have_their_answers(client: Client) -> None:
    assert client.call("/v1/parse", oscillator(1)).equations.x.text == "-x"
    names = [system["name"] for system in client.call("/v1/catalogue").systems]
    assert client.call(f"/v1/catalogue/{names[0]}").name == names[0]
    assert client.call("/v1/limits").service.time_limit_seconds == TIME_LIMIT


def test_the_asynchronous_client_does_the_same(service: str) -> None:
    async def run() -> None:
        async with AsyncClient(service) as client:
            results = await asyncio.gather(*(client.solve(oscillator(k)) for k in range(10, 20)))
            assert [result.verdict for result in results] == ["variational"] * 10
            job = await client.submit(oscillator(30))
            events = [event async for event in client.stream(job)]
            assert events[-1].data["status"] == "successful"
            assert (await client.wait(job)).verdict == "variational"
            answers = [answer async for answer in client.batch([oscillator(k) for k in range(5)])]
            assert sorted(answer.line or 0 for answer in answers) == [1, 2, 3, 4, 5]

    asyncio.run(run())

"""Questions that come at the same time share a commit, and each hears of its own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Sequence

import pytest

from inverse_service.service.jobs.model import Job, JobRequest
from inverse_service.web.together import MOST, Together


def request(name: str) -> JobRequest:
    return JobRequest(name, "solve", "{}")


def job(name: str) -> Job:
    return Job(name, "solve", "{}", "{}", "accepted")


def test_what_comes_while_a_commit_is_under_way_shares_the_next() -> None:
    groups = list[list[str]]()
    may_go = threading.Event()

    def store(some: Sequence[JobRequest]) -> dict[str, Job]:
        groups.append([one.id for one in some])
        assert may_go.wait(60)
        return {one.id: job(one.id) for one in some if one.id != "known"}

    async def ask() -> list[Job | None]:
        together = Together(store, 1)
        first = together.submit(request("0"))
        while not groups:
            await asyncio.sleep(0.001)
        names = [str(k) for k in range(1, MOST + 2)] + ["known", "1"]
        others = [together.submit(request(name)) for name in names]
        may_go.set()
        found = await asyncio.gather(first, *others)
        together.stop()
        return found

    *found, known, again = asyncio.run(ask())
    assert [one and one.id for one in found] == [str(k) for k in range(MOST + 2)]
    assert known is None
    assert again is None or again.id == "1"
    assert [len(group) for group in groups] == [1, MOST, 3]


def test_a_store_that_fails_is_told_to_all_who_asked_and_the_next_are_stored() -> None:
    faults = [ValueError("full")]

    def store(some: Sequence[JobRequest]) -> dict[str, Job]:
        if faults:
            raise faults.pop()
        return {one.id: job(one.id) for one in some}

    async def ask() -> str:
        together = Together(store, 1)
        with pytest.raises(ValueError, match="full"):
            await together.submit(request("a"))
        found = await together.submit(request("b"))
        together.stop()
        assert found is not None
        return found.id

    assert asyncio.run(ask()) == "b"


def test_who_has_left_is_not_told() -> None:
    async def ask() -> None:
        may_go = threading.Event()
        together = Together(lambda some: {"a": job("a")} if may_go.wait(60) else {}, 1)
        left, other = together.submit(request("a")), together.submit(request("b"))
        left.cancel()
        may_go.set()
        assert await other is None
        together.stop()

    asyncio.run(ask())

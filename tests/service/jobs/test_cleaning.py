"""A clock that jumps forward deletes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from inverse_service.service.jobs import stores as job_store
from inverse_service.service.jobs.model import Job
from inverse_service.service.jobs.stores import Cleaner

DAY = 86_400.0


@dataclass
class Clock:
    """The wall clock may jump; the monotonic clock does not."""

    wall: float = 1e9
    passed: float = 1000.0

    def time(self) -> float:
        return self.wall

    def monotonic(self) -> float:
        return self.passed

    def go(self, seconds: float, jump: float = 0.0) -> None:
        self.passed += seconds
        self.wall += seconds + jump


class Store:
    """A store whose newest job has a given time."""

    def __init__(self, newest: float) -> None:
        self._newest = newest

    def jobs(self, **wanted: Any) -> tuple[list[Job], None]:
        return [Job("a", "solve", "{}", "{}", "successful", created=self._newest)], None


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(job_store, "time", found)
    return found


def cleaner(newest: float) -> Cleaner:
    store: Any = Store(newest)
    return Cleaner(store, 365 * DAY, 1)


def test_a_service_in_use_forgets_by_age_from_the_start(clock: Clock) -> None:
    assert cleaner(clock.wall - 60).oldest_kept() == clock.wall - 365 * DAY


@pytest.mark.parametrize("jump_at_start", [True, False])
def test_after_a_jump_of_the_clock_nothing_is_forgotten_by_age_for_a_day(
    clock: Clock, jump_at_start: bool
) -> None:
    found = cleaner(clock.wall - (400 * DAY if jump_at_start else 0.0))
    if not jump_at_start:
        found.oldest_kept()
        clock.go(600.0, jump=400 * DAY)
    for _ in range(3):
        assert found.oldest_kept() == 0.0
        clock.go(DAY / 4)
    clock.go(DAY)
    assert found.oldest_kept() == clock.wall - 365 * DAY

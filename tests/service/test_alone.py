"""A task alone in its process tells how far it came."""

from __future__ import annotations

import time
from collections.abc import Callable

from inverse_service.service.jobs.outcome import Outcome
from inverse_service.service.jobs.single_call import run_alone

MEMORY = 1024


def counting(count: int, report: Callable[[str], None] | None = None) -> Outcome:
    for k in range(count):
        if report is not None:
            report(f"step {k}")
            time.sleep(0.15)
    return Outcome("done", count)


def test_reports_of_a_task_come_out_in_order_and_then_its_outcome() -> None:
    said: list[str] = []
    found = run_alone(counting, (3,), 30.0, MEMORY, said.append)
    assert found.value == 3
    assert said == ["step 0", "step 1", "step 2"]


def test_without_a_listener_a_task_gets_no_further_argument() -> None:
    assert run_alone(counting, (3,), 30.0, MEMORY).value == 3


def test_a_task_that_reports_all_the_time_is_stopped_at_its_deadline() -> None:
    said: list[str] = []
    assert run_alone(counting, (10_000,), 0.6, MEMORY, said.append).status == "deadline"
    assert said

"""A search ends at its deadline and says what it had tried."""

from __future__ import annotations

import time

import pytest

from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.search.deadline import OutOfTime, check, until, within
from inverse_service.inverse_problem.search.ladder import search
from inverse_service.mechanics.reading import read_system


def test_an_inner_deadline_cannot_outlive_the_outer_one() -> None:
    with until(time.monotonic() - 1), until(time.monotonic() + 100), pytest.raises(OutOfTime):
        check()


def test_processor_time_ends_a_search_and_waiting_does_not() -> None:
    with until(time.monotonic() + 100, seconds=0.2):
        time.sleep(0.3)
        check()
        began = time.thread_time()
        while time.thread_time() < began + 0.3:
            pass
        with until(time.monotonic() + 100), pytest.raises(OutOfTime):
            check()


def test_outside_any_deadline_nothing_ends() -> None:
    check()


def test_a_search_in_vain_ends_soon_after_its_deadline() -> None:
    equations = {
        "x": "y'*z'*sin(x + y*z) - x'*log(1 + w^2)",
        "y": "exp(x - z)*w'^2/(1 + x^2 + y^2) - y",
        "z": "cos(w*x)*x'*y' + z'*w'*tan(y)",
        "w": "sqrt(1 + x^2)*x'*z' - w'*exp(-y*z)",
    }
    analysis = analyse(read_system(list(equations), equations))
    began = time.monotonic()
    outcome = search(analysis, True, 1, began + 1.0, lambda _: None)
    assert outcome.found is None
    assert time.monotonic() - began < 6.0


def test_work_ends_a_search_too_and_counts_for_the_blocks_around() -> None:
    with within(10):
        check(4)
        with within(100):
            check(6)
            with pytest.raises(OutOfTime):
                check()
        with pytest.raises(OutOfTime):
            check()
    check(1_000)


def test_the_smaller_amount_of_work_ends_first() -> None:
    with within(1_000):
        with within(2), pytest.raises(OutOfTime):
            check(3)
        check()


def test_the_same_work_gives_the_same_outcome() -> None:
    """Ended in the middle, a search has tried the same families each time."""
    equations = {"x": "-y'^3*x'", "y": "x'^2*sin(x*y)", "z": "x'*y'*exp(z)"}
    analysis = analyse(read_system(list(equations), equations))
    outcomes = []
    for _ in range(2):
        reports: list[str] = []
        with within(30_000):
            outcomes.append((search(analysis, False, 1, time.monotonic() + 60.0, reports.append), reports))
    assert outcomes[0] == outcomes[1]
    with within(150_000):
        longer = search(analysis, False, 1, time.monotonic() + 60.0, lambda _: None)
    assert len(longer.tried) > len(outcomes[0][0].tried)

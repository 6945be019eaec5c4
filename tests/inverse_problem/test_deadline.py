"""A search ends at its deadline and says what it had tried."""

from __future__ import annotations

import itertools
import time
from typing import Any

import pytest

from inverse_service.deadline import OutOfTime, check, now, until, within
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.ladder import search
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.reading import read_system
from inverse_service.service.documents.documents import solve_document


def test_an_inner_deadline_cannot_outlive_the_outer_one() -> None:
    with until(now() - 1), until(now() + 100), pytest.raises(OutOfTime):
        check()


@pytest.mark.slow
def test_processor_time_ends_a_search_and_waiting_does_not() -> None:
    with until(now() + 0.2):
        time.sleep(0.3)
        check()
        began = now()
        while now() < began + 0.3:
            pass
        with until(now() + 100), pytest.raises(OutOfTime):
            check()


def test_outside_any_deadline_nothing_ends() -> None:
    check()


@pytest.mark.slow
def test_a_search_in_vain_ends_soon_after_its_deadline() -> None:
    equations = {
        "x": "y'*z'*sin(x + y*z) - x'*log(1 + w^2)",
        "y": "exp(x - z)*w'^2/(1 + x^2 + y^2) - y",
        "z": "cos(w*x)*x'*y' + z'*w'*tan(y)",
        "w": "sqrt(1 + x^2)*x'*z' - w'*exp(-y*z)",
    }
    analysis = analyze(read_system(list(equations), equations))
    began = now()
    outcome = search(analysis, True, 1, began + 1.0, lambda _: None)
    assert outcome.found is None
    assert now() - began < 6.0


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


@pytest.mark.slow
def test_the_same_work_gives_the_same_outcome() -> None:
    """Ended in the middle, a search has tried the same families each time."""
    equations = {"x": "-y'^3*x'", "y": "x'^2*sin(x*y)", "z": "x'*y'*exp(z)"}
    system = read_system(list(equations), equations)
    outcomes = []
    for _ in range(2):
        reports: list[str] = []
        analysis = analyze(system)  # which keeps what it has computed
        with within(6_000):
            outcomes.append((search(analysis, False, 1, now() + 60.0, reports.append), reports))
    assert outcomes[0] == outcomes[1]
    with within(150_000):
        longer = search(analyze(system), False, 1, now() + 60.0, lambda _: None)
    assert len(longer.tried) > len(outcomes[0][0].tried)


DISK = {
    "coordinates": ["x", "y", "z"],
    "lagrangian": "(x'^2+y'^2+z'^2)/2",
    "constraints": ["z' - y*x'"],
}
ASKED: list[dict[str, Any]] = [
    {"equations": {"x": "-y - c*x'", "y": "x - 2*y*x'"}, "parameters": ["c"], "special_cases": True},
    {"equations": {"x": "-x*y^2 - x'", "y": "-y*x^2 - y'"}, "kinds": ["natural", "rayleigh"], "clock": "search"},
    DISK | {"associated": "first"},
    DISK | {"associated": "any"},
    {"coordinates": ["x", "y", "z"], "constraints": ["z' - y*x'"], "motion": {"x": "0", "y": "-y*x'"}},
]


@pytest.mark.slow
@pytest.mark.parametrize("document", ASKED, ids=["system", "kinds", "associated", "any associated", "motion"])
def test_no_load_of_the_machine_changes_an_answer(document: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """The answers with a clock on which each look is an hour later are those of a quiet machine."""
    quiet = solve_document(document, SolveOptions(time_limit=60))
    hours = itertools.count(0, 3600)
    monkeypatch.setattr("time.monotonic", lambda: float(next(hours)))
    busy = solve_document(document, SolveOptions(time_limit=60))
    for one in (quiet, busy):
        del one["provenance"]
    assert busy == quiet

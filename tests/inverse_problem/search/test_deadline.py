"""A search ends at its deadline and says what it had tried."""

from __future__ import annotations

import time

import pytest

from inverse_service.inverse_problem.analysis import analyse
from inverse_service.inverse_problem.search.deadline import OutOfTime, check, until, within
from inverse_service.inverse_problem.search.ladder import search
from inverse_service.mechanics.reading import read_system


def test_an_inner_deadline_cannot_outlive_the_outer_one() -> None:
    with until(time.monotonic() - 1), until(time.monotonic() + 100), pytest.raises(OutOfTime):
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


def test_processor_time_ends_a_search_too() -> None:
    with within(0.0):
        burnt = sum(range(200_000))
        with pytest.raises(OutOfTime):
            check()
    assert burnt
    check()

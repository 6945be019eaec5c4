"""What a solution holds for each question, and how it ends where mathematics ends."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from inverse_service.algebra.real_point import are_positive, table_at
from inverse_service.certificate.checker import CheckResult
from inverse_service.errors import CertificateRefused
from inverse_service.expressions.tree import Symbol, add, multiply, number, power
from inverse_service.inverse_problem import confirming
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.search import ladder
from inverse_service.inverse_problem.search.protocol import SearchOutcome
from inverse_service.inverse_problem.solutions import Solution, SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system

OSCILLATOR = {"x": "-x"}
DAMPED = {"x": "-x-2*x*y-c*x'", "y": "-y-x^2+y^2-c*y'"}
ROTATION = {"x": "x*y'", "y": "y*x'^2"}


def solved(
    equations: dict[str, str], parameters: tuple[str, ...] = (), **options: bool | int | float | None
) -> Solution:
    return solve(read_system(list(equations), equations, parameters), SolveOptions(**options))  # type: ignore[arg-type]


def test_a_variational_system_has_a_lagrangian_its_space_and_a_checked_certificate() -> None:
    answer = solved(OSCILLATOR).autonomous
    assert answer is not None
    assert answer.verdict == "variational"
    assert answer.lagrangian is not None
    assert answer.checked == "valid"
    assert answer.space is not None
    assert answer.space.dimensions == (1, 2, 3)


def test_an_autonomous_lagrangian_answers_the_second_question_too() -> None:
    solution = solved(OSCILLATOR)
    assert solution.autonomous is solution.with_time


def test_a_lagrangian_without_time_found_late_answers_both_questions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the first search runs out of time and the search with t finds one that holds no t."""
    whole = ladder.search

    def hurried(analysis: Analysis, with_time: bool, *rest: Any, **more: Any) -> SearchOutcome:
        return whole(analysis, with_time, *rest, **more) if with_time else SearchOutcome(None, ())

    monkeypatch.setattr(ladder, "search", hurried)
    solution = solved({"x": "x*y'", "y": "-x*x'"})
    assert solution.autonomous is not None
    assert solution.autonomous is solution.with_time
    assert solution.autonomous.lagrangian is not None
    assert solution.autonomous.certificate is not None
    assert solution.autonomous.certificate["question"] == "autonomous"
    assert solution.autonomous.checked == "valid"


def test_the_two_questions_may_have_two_answers() -> None:
    solution = solved(DAMPED, ("c",))
    assert solution.autonomous is not None
    assert solution.with_time is not None
    assert solution.autonomous.verdict == "not_variational"
    assert solution.with_time.verdict == "variational"
    assert solution.autonomous.checked == solution.with_time.checked == "valid"


@pytest.mark.parametrize(("asked", "answered"), [(None, (True, True)), (False, (True, False)), (True, (False, True))])
def test_only_what_is_asked_is_answered(asked: bool | None, answered: tuple[bool, bool]) -> None:
    solution = solved(ROTATION, time_dependent=asked)
    assert (solution.autonomous is not None, solution.with_time is not None) == answered


def test_a_system_that_contains_time_has_one_answer_whatever_is_asked() -> None:
    for asked in (None, False, True):
        solution = solved({"x": "-t*x", "y": "-y"}, time_dependent=asked)
        assert solution.autonomous is None
        assert solution.with_time is not None
        assert solution.with_time.verdict == "variational"


def test_a_refused_system_has_conditions_and_an_explanation() -> None:
    solution = solved(ROTATION)
    assert solution.conditions is not None
    assert len(solution.conditions.Phi) == 2
    assert solution.autonomous is not None
    assert solution.autonomous.explanation
    assert solution.autonomous.lagrangian is None


@pytest.mark.parametrize("force", ["log(x-x)*y", "atan(1/(x-x))*y", "sqrt(-1-x^2)*y"])
def test_what_cannot_be_reduced_is_undetermined_with_the_reason_in_each_answer(force: str) -> None:
    solution = solved({"x": force, "y": "x*x'"})
    for answer in (solution.autonomous, solution.with_time):
        assert answer is not None
        assert answer.verdict == "undetermined"
        assert " " in answer.reason
        assert answer.certificate is None


def test_no_time_is_an_outcome_and_no_exception() -> None:
    answer = solved(ROTATION, time_limit=0.0).autonomous
    assert answer is not None
    assert answer.verdict == "undetermined"
    assert "time limit" in answer.reason


def test_a_certificate_that_the_checker_finds_invalid_is_a_fault_and_never_an_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(confirming, "check_certificate", lambda *_, **__: CheckResult("invalid", ("wrong rows",)))
    with pytest.raises(CertificateRefused, match="wrong rows"):
        solved(ROTATION)


def test_a_certificate_that_the_checker_cannot_judge_is_undetermined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(confirming, "check_certificate", lambda *_, **__: CheckResult("incomplete", ("no time",)))
    answer = solved(ROTATION).autonomous
    assert answer is not None
    assert answer.verdict == "undetermined"
    assert "no time" in answer.reason


def test_the_seed_repeats_a_run_and_is_written_down() -> None:
    first, second = (solved(ROTATION, seed=5) for _ in range(2))
    assert first.provenance["seed"] == 5
    assert first.provenance["points"] == second.provenance["points"]
    assert first.provenance["points"] != solved(ROTATION, seed=6).provenance["points"]


def test_accelerations_too_long_for_a_certificate_are_undetermined_with_the_reason() -> None:
    """The five-fold pendulum on a cart, solved for its accelerations, is of this kind: a limit, no fault."""
    system = read_system(["x"], {"x": "-x"})
    long = add(*(multiply(number(k), power(Symbol("x"), k)) for k in range(1, 9_000)))
    answer = solve(replace(system, accelerations=(long,)), SolveOptions()).autonomous
    assert answer is not None
    assert answer.verdict == "undetermined"
    assert "60,000 characters" in answer.reason


def test_the_lagrangian_of_predators_and_prey_holds_where_both_are_positive() -> None:
    """y = (a x - x')/(b x) is positive for x' < a x; what y is stands in the explanation."""
    system = read_system(None, ["x' = a*x - b*x*y", "y' = -c*y + d*x*y"], ["a", "b", "c", "d"])
    answer = solve(system, SolveOptions()).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    for rate in ("-1", "0.5"):
        here = dict.fromkeys(["x", "a", "b", "c", "d"], "1") | {"x'": rate}
        assert are_positive(answer.lagrangian.positive, table_at(here))
    assert "give y = (a*x - x')/(x*b);" in answer.explanation[0].text

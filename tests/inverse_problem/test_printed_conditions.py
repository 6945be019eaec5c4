"""Conditions are written out where they are shown, and are then those of the system itself."""

from __future__ import annotations

from dataclasses import replace

import pytest

from inverse_service.inverse_problem.explanation import negative
from inverse_service.inverse_problem.explanation.wording import with_conditions
from inverse_service.inverse_problem.hamiltonisation.nonholonomic_study import associated_systems, motion_report, study
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.nonholonomic.constraint_reading import read_nonholonomic
from inverse_service.mechanics.reading import read_system

SYSTEMS = [{"x": "-x^3+x*x'"}, {"x": "y*x'^2", "y": "x*y'"}]


@pytest.mark.parametrize("equations", SYSTEMS)
def test_a_solution_without_conditions_differs_in_nothing_else(equations: dict[str, str]) -> None:
    system = read_system(list(equations), equations)
    plain, asked = solve(system, SolveOptions(conditions=False)), solve(system, SolveOptions())
    assert plain.conditions is None
    assert asked.conditions is not None
    assert with_conditions(plain).conditions == asked.conditions
    assert plain.autonomous == asked.autonomous
    assert replace(plain, conditions=asked.conditions, provenance={}) == replace(asked, provenance={})


@pytest.mark.parametrize("wanted", [True, False])
def test_of_associated_systems_only_the_main_one_has_its_conditions(wanted: bool) -> None:
    """The knife edge: the first is not variational, the second and third are."""
    text = "(x'^2 + y'^2 + phi'^2)/2"
    system = read_nonholonomic(["x", "y", "phi"], text, ["sin(phi)*x' - cos(phi)*y'"])
    report = motion_report(system)
    found = study(report, associated_systems(report, None), SolveOptions(conditions=wanted))
    solutions = [answer.solution for answer in found.answers if answer.solution is not None]
    assert len(solutions) == 3
    main = found.answers[found.main].solution
    assert main is not None
    assert (main.conditions is not None) == wanted
    assert [s is not main and s.conditions is None for s in solutions].count(True) == 2
    if wanted:
        assert main.conditions == with_conditions(main).conditions


def test_conditions_that_exclude_a_lagrangian_are_argued_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """They exclude L(t, q, q') with L(q, q'): both answers have the same steps, and each a certificate of its own."""
    asked: list[object] = []
    explain = negative.explain_negative
    monkeypatch.setattr(negative, "explain_negative", lambda *given: asked.append(given[1]) or explain(*given))
    found = solve(read_system(["x", "y"], {"x": "x*y'", "y": "y*x'^2"}), SolveOptions(conditions=False))
    assert found.autonomous is not None
    assert found.with_time is not None
    assert found.autonomous.verdict == found.with_time.verdict == "not_variational"
    assert len(asked) == 1
    assert found.autonomous.explanation == found.with_time.explanation != ()
    questions = [answer.certificate["question"] for answer in (found.autonomous, found.with_time) if answer.certificate]
    assert questions == ["autonomous", "time_dependent"]


def test_a_differential_consequence_is_argued_for_each_question(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    explain = negative.explain_negative
    monkeypatch.setattr(negative, "explain_negative", lambda *given: asked.append(given[1]) or explain(*given))
    # every algebraic condition lets it through
    system = read_system(["x", "y"], {"x": "x'^2*y'", "y": "2*y' + 2*x'^2*y'"})
    found = solve(system, SolveOptions(conditions=False))
    assert found.with_time is not None
    assert found.with_time.verdict == "not_variational"
    assert asked == [None, None]

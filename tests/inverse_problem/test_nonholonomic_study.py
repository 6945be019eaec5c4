"""The study of a nonholonomic system where something is too large, not defined, or zero on the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from inverse_service import catalogue
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.refusals import LIMITS
from inverse_service.expressions.tree import ZERO, Expression
from inverse_service.inverse_problem.hamiltonisation.nonholonomic_study import (
    AssociatedAnswer,
    MotionReport,
    associated_systems,
    motion_report,
    study,
)
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.nonholonomic.associated_systems import with_multiples
from inverse_service.mechanics.nonholonomic.constraint_reading import read_multiples, read_nonholonomic

PARTICLE = catalogue.document("nonholonomic-particle")
TWO_FREE = {
    "coordinates": ["x", "y", "z"],
    "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
    "constraints": ["z' - y*x' - x*y'^1 + x*x'"],
}


def report_of(document: dict[str, Any] = PARTICLE) -> MotionReport:
    return motion_report(read_nonholonomic(**document))


def multiples_of(document: dict[str, Any], texts: dict[str, str]) -> Sequence[Expression]:
    return read_multiples(texts, read_nonholonomic(**document), ())


def test_a_motion_that_has_no_time_is_refused_with_a_sentence() -> None:
    with pytest.raises(LimitError, match="too large to be written out"):
        motion_report(read_nonholonomic(**PARTICLE), time_limit=-1.0)


def test_associated_systems_that_are_too_large_say_so_and_are_no_systems() -> None:
    report = report_of(catalogue.document("vertically-rolling-disk"))
    report.exact.geometry.ring.field.budget.deadline = 0.0
    found = associated_systems(report, None)[1:]
    assert [one.system for one in found] == [None] * 2
    assert all("too large to be written out" in one.explanation for one in found)
    done = study(report, found, SolveOptions(time_limit=1.0))
    assert [answer.answer for answer in done.answers] == [None] * 2
    assert done.main == 0


def test_multiples_of_a_system_that_is_not_defined_are_refused() -> None:
    report = report_of(TWO_FREE)
    assert associated_systems(report, "second")[0].system is None
    family = multiples_of(TWO_FREE, {"x": "z' - y*x' - x*y' + x*x'"})
    with pytest.raises(InputError, match="second system is not defined"):
        associated_systems(report, "second", [family])
    (first,) = associated_systems(report, "first", [family])
    assert first.system is not None


def test_what_is_not_zero_on_the_constraints_is_no_multiple() -> None:
    report, name = report_of(), PARTICLE["coordinates"][0]
    family = multiples_of(PARTICLE, {name: "1"})
    with pytest.raises(InputError, match="does not vanish") as refused:
        associated_systems(report, "first", [family])
    assert refused.value.pointer == f"/multiples/{name}"
    with pytest.raises(InputError, match="does not vanish") as refused:
        associated_systems(report, "first", [family, family])
    assert refused.value.pointer == f"/multiples/0/{name}"


def test_multiples_of_nothing_change_nothing() -> None:
    (first,) = associated_systems(report_of(), "first")
    none = associated_systems(report_of(TWO_FREE), "second")[0]
    zeros = [ZERO] * 3
    assert with_multiples(none, zeros, "family 1") is none
    same = with_multiples(first, zeros, "family 1").system
    assert same is not None
    assert first.system is not None
    assert same.accelerations == first.system.accelerations


def test_a_coordinate_at_rest_keeps_its_zero_in_the_second_system() -> None:
    """z' = 0 has no free velocity to be replaced."""
    document = {
        "coordinates": ["x", "y", "z", "w"],
        "lagrangian": "(x'^2 + y'^2 + z'^2 + w'^2)/2",
        "constraints": ["z' + x*y'", "w'"],
    }
    (second,) = associated_systems(report_of(document), "second")
    assert second.system is not None
    assert to_text(second.system.accelerations[3]) == "0"


def test_three_turning_velocities_need_positive_masses() -> None:
    document = {
        "coordinates": ["x", "y", "z", "w"],
        "lagrangian": "(x'^2 + y'^2 + z'^2 - w'^2)/2",
        "constraints": ["z' + x*y'", "w' + sin(x)*y'"],
    }
    (third,) = associated_systems(report_of(document), "third")
    assert third.system is None
    assert "all masses have to be positive" in third.explanation


def test_too_many_constraints_are_refused() -> None:
    many = [f"x' - {k}*y'" for k in range(LIMITS.coordinates + 1)]
    with pytest.raises(LimitError, match=f"the limit is {LIMITS.coordinates}"):
        read_nonholonomic(["x", "y"], "x'^2/2 + y'^2/2", many)


def test_an_answer_without_a_system_has_no_answer() -> None:
    (none,) = associated_systems(report_of(TWO_FREE), "second")
    assert AssociatedAnswer(none, None).answer is None

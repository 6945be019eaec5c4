"""What is known from another question is confirmed even when the time is over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from unittest import mock

import pytest

from inverse_service.constrained import answering, lagrangian as on_constraints, reduced
from inverse_service.deadline import OutOfTime, now
from inverse_service.decision.solutions import Lagrangian, SolveOptions, Statement
from inverse_service.expressions import collecting, tree as ex
from inverse_service.mechanics import euler_lagrange
from inverse_service.mechanics.constrained_motion import (
    EquationsOfMotion,
    equations_of_motion,
    read_motion,
    read_nonholonomic,
)
from inverse_service.mechanics.second_order_system import ConstrainedMotion, read_system
from inverse_service.reading import declarations, names as nm, reader
from inverse_service.statements.questions import PLAIN, About, Question

NAMES = ("x", "y", "z")
ANY = Question(About.ANY)


def particle(potential: str = "0") -> EquationsOfMotion:
    declared = declarations.Declared(list(NAMES), (), {})
    return equations_of_motion(
        read_nonholonomic(declared, f"(x'^2+y'^2+z'^2)/2-{potential}", ["z'+x*y'"], "")
    )


def known_of(motion: EquationsOfMotion, text: str) -> answering.KnownLagrangian:
    tree = reader.read_formula(text, nm.Names(NAMES, (), {}))
    system = on_constraints.own_system(tree, motion, now() + 60)
    assert system is not None
    found = Lagrangian(tree, euler_lagrange.hessian(tree, NAMES), "known")
    return answering.KnownLagrangian("first", system, found, PLAIN, None)


def test_a_known_lagrangian_proves_a_yes_when_the_time_is_over() -> None:
    motion = particle()
    known = known_of(motion, "sqrt(1+x^2)*y'^2/(2*x')+x'^2/2+(z'+x*y')^2/2")
    told: list[tuple[Statement, ...]] = []
    answers = answering.answer_motion(motion, [known], deadline=now() - 1, tell=told.append)
    assert len(answers) == 2
    assert answers[0] is answers[1]  # an L(q, q') is an L(t, q, q')
    assert answers[0].verdict == "variational"
    assert isinstance(answers[0].lagrangian, answering.MotionLagrangian)
    assert answers[0].lagrangian.kind == "first"
    # It is told before anything else is decided.
    assert told[0][0].certificate == answers[0].certificate


def test_a_lagrangian_of_another_motion_proves_nothing() -> None:
    """The given L has forces of constraint, and with V = y no associated system is variational."""
    motion = particle("y")
    straight = Lagrangian(motion.system.lagrangian, (), "known")
    system = on_constraints.first_system(motion)
    false = answering.KnownLagrangian("first", system, straight, PLAIN, None)
    for answer in answering.answer_motion(motion, [false], deadline=now() - 1):
        assert answer.verdict != "variational"
        assert answer.lagrangian is None


def test_equal_systems_that_are_written_differently_are_solved_once() -> None:
    options = SolveOptions(time_dependent=False, time_limit=20)
    first, second = (
        reduced.solve_once(read_system(["x"], {"x": text}, ()), options)
        for text in ("x'^2/(1 + tan(x)^2)", "cos(x)^2*x'^2")
    )
    assert first is second


def test_where_nothing_is_proven_when_the_time_is_over_each_question_is_open() -> None:
    late = mock.patch.object(answering.existence, "analyze_motion", side_effect=OutOfTime)
    with late:
        answers = answering.answer_motion(particle("y"))
    assert [answer.verdict for answer in answers] == ["undetermined"] * 2
    assert len({answer.question for answer in answers}) == 2


def motion_of(
    names: Sequence[str], accelerations: Mapping[str, str], constraint: str
) -> ConstrainedMotion:
    return read_motion(declarations.Declared(list(names), (), {}), accelerations, [constraint])


@pytest.mark.parametrize(
    ("names", "accelerations", "constraint"),
    [
        ("xyz", {"x": "-(x+2*z)", "y": "-y"}, "z' = 3*x'"),
        ("xyz", {"x": "-(x+z)", "y": "-(x+z)"}, "z' = y'"),
        ("xyz", {"x": "-(x-3*z)*x'", "y": "(x-3*z)^2"}, "z' = 2*x'"),
    ],
)
def test_a_function_with_a_closed_equation_satisfies_it_along_the_motion(
    names: str, accelerations: Mapping[str, str], constraint: str
) -> None:
    """R'' = G(R, R') for a factor R of the forces, such as x + 2 z, which is no coordinate."""
    motion = motion_of(names, accelerations, constraint)
    found = list(on_constraints.closed_functions(motion, float("inf")))
    assert any(name not in names for one in found for name in one.functions)
    for one in found:
        rates = {name: motion.rate(tree) for name, tree in one.functions.items()}
        table: dict[ex.Expression, ex.Expression] = {
            ex.Symbol(name): tree for name, tree in one.functions.items()
        }
        table |= {ex.Velocity(name): rate for name, rate in rates.items()}
        for name, force in zip(one.system.coordinates, one.system.accelerations, strict=True):
            difference = motion.rate(rates[name]) - ex.substitute(force, table)
            assert collecting.collect(difference) == ex.ZERO


@pytest.mark.parametrize(
    ("acceleration", "constraint", "reduces"),
    [("-x", "y' = x*x'", True), ("-y", "y' = x*x'", False), ("-x", "y' = y*x'", False)],
)
def test_a_motion_reduces_where_the_others_occur_nowhere(
    acceleration: str, constraint: str, reduces: bool
) -> None:
    """Neither in the accelerations of the free coordinates, nor in the velocities of the others,
    which are quadratures then."""
    motion = motion_of("xy", {"x": acceleration}, constraint)
    assert (reduced.reduced_system(motion) is not None) is reduces


def test_the_yes_of_the_reduced_system_keeps_its_exceptions_and_its_proof() -> None:
    """An answer that was not confirmed is none for the motion."""
    proven = Statement(
        PLAIN, "variational", certificate={"n": 1}, checked="valid", exceptions=("a = 0",)
    )
    motion = particle()
    work = answering._Work(
        motion, (), (ANY,), proven, 1, now() + 60, lambda _: None, lambda _: None, tuple
    )
    found = answering._of_reduced(work, ANY)
    assert found is not None
    assert (found.checked, tuple(found.exceptions)) == ("valid", ("a = 0",))
    for doubted in (replace(proven, checked="incomplete"), replace(proven, certificate=None)):
        assert answering._of_reduced(replace(work, reduced=doubted), ANY) is None

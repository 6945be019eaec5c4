"""Which statement answers which question."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from inverse_service.decision.solutions import Lagrangian, Statement, implied
from inverse_service.expressions import tree as ex
from inverse_service.statements.questions import PLAIN, TIMED, About, Question, asked

QUESTIONS = [
    Question(about, timed, clock, kind)
    for about in About
    for timed in (False, True)
    for clock in ("", "1 + x^2")
    for kind in ("", "natural", "rayleigh")
]


def test_including_is_a_partial_order() -> None:
    """Reflexive, antisymmetric, transitive; an L that answers the innermost answers all."""
    inside = {(a, b) for a, b in itertools.product(QUESTIONS, repeat=2) if a.includes(b)}
    assert all((a, a) in inside for a in QUESTIONS)
    assert all(a == b for a, b in inside if (b, a) in inside)
    assert all((a, d) in inside for a, b in inside for c, d in inside if b == c)


@pytest.mark.parametrize(
    ("wide", "narrow"),
    [
        (TIMED, PLAIN),
        (PLAIN, Question(kind="natural")),
        (Question(About.ANY), Question(About.FIRST)),
        (Question(About.ANY, timed=True), Question(About.REDUCED)),
    ],
)
def test_a_yes_goes_up_and_a_no_goes_down(wide: Question, narrow: Question) -> None:
    yes, no = (
        lambda one: Statement(one, "variational"),
        lambda one: Statement(one, "not_variational"),
    )
    assert yes(narrow).answers(wide)
    assert no(wide).answers(narrow)
    assert not yes(wide).answers(narrow)
    assert not no(narrow).answers(wide)


@pytest.mark.parametrize(
    "other",
    [
        Question(kind="rayleigh"),  # its equations are no Euler-Lagrange equations
        Question(clock="1 + x^2"),
        Question(case=("a = 0",)),
        Question(About.REDUCED),
    ],
)
def test_other_equations_answer_nothing(other: Question) -> None:
    for verdict in ("variational", "not_variational"):
        assert not Statement(other, verdict).answers(PLAIN)
        assert not Statement(PLAIN, verdict).answers(other)


def test_what_is_open_answers_its_own_question_alone() -> None:
    open_one = Statement(TIMED, "undetermined")
    assert open_one.answers(TIMED)
    assert not open_one.answers(PLAIN)
    no = Statement(TIMED, "not_variational")
    assert implied(PLAIN, [Statement(PLAIN, "undetermined"), no]) is no


def test_a_yes_with_a_formula_is_better_than_one_without() -> None:
    tree = Lagrangian(ex.Velocity("x") ** 2 / 2, ((ex.ONE,),), "")
    timed, plain = Statement(TIMED, "variational"), Statement(PLAIN, "variational", lagrangian=tree)
    assert implied(TIMED, [timed, plain]) is plain
    own = replace(timed, lagrangian=tree)
    assert implied(TIMED, [plain, own]) is own
    assert implied(PLAIN, [own]) is None


def test_the_questions_of_a_document() -> None:
    assert asked(None, depends_on_time=False) == (PLAIN, TIMED)
    assert asked(False, depends_on_time=False) == (PLAIN,)
    assert asked(True, depends_on_time=False) == asked(False, depends_on_time=True) == (TIMED,)


def test_a_special_case_is_about_other_equations() -> None:
    assert Question(case=("a = 0",)).is_about_others
    assert not PLAIN.is_about_others

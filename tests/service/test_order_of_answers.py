"""The order in which people meet what was found: one function, and the same first statement at
every door.
"""

from __future__ import annotations

import itertools
import random
from typing import Any

import pytest

from inverse_service import check, solve
from inverse_service.expressions import tree as ex
from inverse_service.service.documents import sheets
from inverse_service.service.documents.stated import Stated, in_reading_order, statements_of
from inverse_service.service.jobs import tasks
from inverse_service.statements.order import Standing, in_order
from inverse_service.statements.questions import About, Question

VERDICTS = ("variational", "not_variational", "undetermined")
QUESTIONS = [Question(about, timed) for about in About for timed in (False, True)]
QUESTIONS += [Question(clock="x"), Question(kind="natural"), Question(case=("k = 0",))]
FORMS = {"variational": (None, 0, 1, 3), "not_variational": (None,), "undetermined": (None,)}
ALL = [
    Standing(question, verdict, cell, form)
    for question in QUESTIONS
    for verdict in VERDICTS
    for form in FORMS[verdict]
    for cell in (0, 1)
]


def before(one: Standing, other: Standing, timed: bool) -> bool:
    first, second = in_order([other, one], timed, lambda seen: seen)
    return (first, second) == (one, other)


@pytest.mark.parametrize("timed", [False, True])
def test_what_is_about_the_system_itself_comes_before_what_is_about_others(timed: bool) -> None:
    """A no about the equations as given is no reason to show an L of other equations in its
    place.
    """
    here = [one for one in ALL if one.cell == 0]
    own, others = (
        [one for one in here if one.question.is_about_others is kind] for kind in (False, True)
    )
    assert all(before(one, other, timed) for one, other in itertools.product(own, others))


@pytest.mark.parametrize("timed", [False, True])
def test_a_yes_with_a_simple_lagrangian_comes_first(timed: bool) -> None:
    """A yes before a no, a no before an open question; a yes with L before one without; simple L
    first.
    """
    own = [one for one in ALL if one.cell == 0 and not one.question.is_about_others]
    for one, other in itertools.permutations(own, 2):
        if VERDICTS.index(one.verdict) < VERDICTS.index(other.verdict):
            assert before(one, other, timed)
        elif one.verdict == other.verdict == "variational" and one.form is not None:
            assert not (other.form is None or one.form < other.form) or before(one, other, timed)


@pytest.mark.parametrize("timed", [False, True])
def test_of_two_alike_the_question_that_was_asked_comes_first(timed: bool) -> None:
    for verdict in VERDICTS:
        asked, other = (
            Standing(Question(timed=kind), verdict, 0, None) for kind in (timed, not timed)
        )
        assert before(asked, other, timed)


def test_the_order_does_not_depend_on_where_the_answers_are_written() -> None:
    """Questions differ, so no two statements are of one place: every arrangement is sorted into the
    same one.
    """
    found, generator = (
        [one for one in ALL if one.verdict == "variational" and one.form == 0],
        random.Random(1),
    )
    own = [one for one in found if not one.question.is_about_others]
    wanted = in_order(own, False, lambda seen: seen)
    for _ in range(20):
        generator.shuffle(own)
        assert in_order(own, False, lambda seen: seen) == wanted


def test_an_answer_that_brings_its_lagrangian_is_not_read_again() -> None:
    """F_0 is a constant of a set of a family alone, which no name of the result explains."""
    moving = ex.Velocity("x") ** 2
    found = [
        Stated(
            Question(timed=True, case=(f"k = {place}",)),
            {"verdict": "variational", "lagrangian": {"text": text}},
            formula=tree,
        )
        for place, (text, tree) in enumerate(
            [("t*x'^2", ex.TIME * moving), ("F_0*x'^2", ex.Symbol("F_0") * moving)]
        )
    ]
    assert in_reading_order(found, {"system": {"coordinates": ["x"]}}) == found[::-1]


def test_the_damped_oscillator_is_shown_with_its_exponential() -> None:
    """Bateman 1931: L = exp(t/10) (x'^2 - x^2)/2 is simpler than the L without t, an arctangent of
    x'/x.
    """
    first, second = solve({"equations": {"x": "-x - x'/10"}})["answers"]
    assert (first["with_time"], first["lagrangian"]["text"]) == (True, "exp(t/10)*(x'^2 - x^2)/2")
    assert (second["with_time"], "atan" in second["lagrangian"]["text"]) == (False, True)


def test_the_checker_states_first_what_people_are_shown() -> None:
    """Both answers are proven and stated: L(t, q, q') first, then the L without t."""
    statement = check(dict(solve({"equations": {"x": "-x - x'/10"}})))["statement"]
    assert statement["lagrangian"] == "exp(t/10)*(x'^2 - x^2)/2"
    first, second = statement["text"].split("\n")
    assert "L(t, q, q')" in first
    assert "L(q, q')" in second
    assert "atan" in second


@pytest.mark.parametrize(
    ("verdict", "proven", "is_asked_with_time", "timed"),
    [
        ("variational", "autonomous", False, False),
        ("variational", "time_dependent", False, True),
        ("not_variational", "autonomous", False, False),
        ("not_variational", "time_dependent", False, False),  # the no that was asked for follows
        ("variational", "autonomous", True, True),
        ("not_variational", "time_dependent", True, True),
        ("not_variational", "autonomous", True, False),  # it says nothing of an L(t, q, q')
    ],
)
def test_a_part_answers_a_question_that_its_proof_answers(
    verdict: str, proven: str, is_asked_with_time: bool, timed: bool
) -> None:
    part = {"verdict": verdict, "certificate": {"question": proven}}
    question = "L(t, q, q')" if is_asked_with_time else "L(q, q')"
    result = {"verdict": "undetermined", "question": question, "reduced": part}
    (found,) = [one for one in statements_of(result) if one.question.about is About.REDUCED]
    assert (found.verdict, found.question.timed) == (verdict, timed)


@pytest.mark.parametrize(
    ("motion", "asked", "wanted"),
    [
        # x'' = -x', y'' = -y' have an L(t, q, q') and, by x' log(x') - x, an L(q, q').
        ({"x": "-x'", "y": "-y'"}, True, {(True, "variational")}),
        ({"x": "-x'", "y": "-y'"}, False, {(False, "variational"), (True, "variational")}),
        ({"x": "-t*x", "y": "-y"}, None, {(True, "variational")}),
        # Decided without t alone: nothing is said of an L(t, q, q').
        ({"x": "-x'", "y": "x*y'^2 - y"}, False, {(False, "not_variational")}),
    ],
)
def test_an_answer_about_a_motion_is_one_to_the_question_that_was_asked(
    motion: dict[str, str], asked: bool | None, wanted: set[tuple[bool, str]]
) -> None:
    document: dict[str, Any] = {
        "coordinates": ["x", "y", "z"],
        "motion": motion,
        "constraints": ["z' = y*x'"],
    }
    if asked is not None:
        document["time_dependent_lagrangian"] = asked
    result = solve(document, time_limit=20)
    found = [one for one in result["answers"] if one["about"] == About.ANY]
    assert {(one["with_time"], one["verdict"]) for one in found} == wanted
    if wanted == {(False, "not_variational")}:
        assert "by any L(q, q')" in result["any_associated"]["statement"]
        sheet = sheets.sheet_of(result)
        assert "by any Lagrangian without the time" in "".join(map(str, sheet.sentence))
    is_timed = all(timed for timed, _ in wanted)
    assert result["question"] == ("L(t, q, q')" if is_timed else "L(q, q')")
    assert check(result)["verdict"] == "valid"


def test_the_options_of_a_document_are_those_of_its_result() -> None:
    asked = {"equations": "x'' = -x", "options": {"seed": 5}, "first_integrals": False}
    assert solve(asked)["provenance"]["seed"] == 5
    assert solve(asked | {"options": {}}, seed=7)["provenance"]["seed"] == 7


@pytest.mark.parametrize(
    ("result", "counted"),
    [
        # A motion on constraints: its first associated system has none, but another one has.
        (
            {"verdict": "not_variational", "answers": [{"about": "any", "verdict": "variational"}]},
            "variational",
        ),
        ({"verdict": "differs", "answers": [{"verdict": "variational"}]}, "differs"),
        ({"verdict": "undetermined", "answers": []}, "undetermined"),
        ({"format": "inverse-service/simulation/1"}, "done"),
        ([], "done"),
    ],
)
def test_a_result_is_counted_by_the_answer_that_people_are_shown(result: Any, counted: str) -> None:
    assert tasks.label_of(result) == counted

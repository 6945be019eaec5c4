"""The keys of a result that are older than `answers` are a view of its statements."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from api_schemas.result import LagrangianPart
from inverse_service.certificate.checker import CheckResult
from inverse_service.decision.solutions import SolveOptions
from inverse_service.errors import CertificateRefused
from inverse_service.service.documents import comparison, nonholonomic_documents, stated
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.older_keys import Told, result_of
from inverse_service.service.documents.stated import Stated
from inverse_service.statements.questions import About, Question

DOCUMENTS = Path(stated.__file__).parent
SYSTEM = {
    "coordinates": ["x"],
    "equations": {"x": "-x"},
    "latex": {},
    "parameters": [],
    "functions": {},
    "given": {},
}
L = LagrangianPart(text="x'^2/2 - x^2/2", latex="").model_dump()
YES: dict[str, Any] = {"verdict": "variational", "checked": "valid", "certificate": {"claim": 1}}
YES |= {"reason": "", "reason_code": ""}
YES |= {"lagrangian": L, "domain": ["x > 0"], "exceptions": [], "hamiltonian": None}
NO = {"verdict": "not_variational", "checked": "valid", "certificate": {"claim": 0}}
OPEN = {"verdict": "undetermined", "reason": "The time was over."}


def told(*statements: Stated, **beside: Any) -> Told:
    return Told(statements, {"system": SYSTEM, "branches": [], **beside})


CLOCKED = {"factor": "x", "equations": {"x": "-x^3"}, **YES}
CASES = {
    "one proof for both": told(
        Stated(Question(), NO), Stated(Question(timed=True), stated.following(NO, NO["verdict"]))
    ),
    "a proof for each": told(
        Stated(Question(), NO), Stated(Question(timed=True), YES, "/with_time")
    ),
    "L(t, q, q') alone": told(Stated(Question(timed=True), YES)),
    "cells with other verdicts": told(
        Stated(Question(), NO, "/branches/0", 0),
        Stated(Question(timed=True), YES, "/branches/0/with_time", 0),
        Stated(Question(), YES, "/branches/1", 1),
        branches=[{}, {}],
    ),
    "other questions": told(
        Stated(Question(), OPEN),
        Stated(Question(clock="x"), CLOCKED, "/with_clock"),
        Stated(Question(kind="natural"), NO, "/kinds/natural"),
        Stated(Question(case=("k = 0",)), {"decided": True, **YES}, "/left_out/1"),
        left_out=[{"where": {"text": f"k = {k}", "latex": ""}, "decided": False} for k in (1, 0)],
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_the_reader_finds_the_statements_where_the_view_has_put_them(case: Told) -> None:
    result = result_of(case)
    older = {key: value for key, value in result.items() if key != "answers"}
    found = stated.statements_of(older)
    assert stated.entries(found, older) == result["answers"]
    assert {(one.question, one.verdict, one.at, one.cell) for one in found} == {
        (one.question, one.verdict, one.at, one.cell) for one in case.statements
    }


def test_the_main_fields_are_those_of_the_first_cell_but_for_verdicts_that_differ() -> None:
    result = result_of(CASES["cells with other verdicts"])
    assert result["verdict"] == "differs"
    assert result["with_time"] == result["branches"][0]["with_time"]
    assert result["certificate"] == NO["certificate"]
    assert [one["verdict_with_time"] for one in result["branches"]] == ["variational", None]


def test_what_there_is_instead_repeats_a_statement() -> None:
    result = result_of(
        Told(CASES["a proof for each"].statements, {"system": SYSTEM}, instead="time")
    )
    assert result["instead"]["kind"] == "time"
    assert result["instead"]["lagrangian"]["text"] == L["text"]
    assert len(result["answers"]) == 2


def test_one_module_writes_the_documents_of_results() -> None:
    made = re.compile(
        r"\b(?:NonholonomicResult|ResultDocument|OtherAnswer|NonholonomicBranch|BranchPart"
        r"|ClockPart|KindPart|ReducedPart|LeftOutPart|InsteadPart)\("
    )
    files = [path for path in DOCUMENTS.glob("*.py") if path.name != "older_keys.py"]
    assert files
    assert [path.name for path in files if made.search(path.read_text(encoding="utf-8"))] == []


@pytest.mark.slow
def test_what_is_beside_says_nothing_of_an_associated_system(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The view writes the entries of `nonholonomic.associated` from their statements."""
    whole = list[Told]()
    monkeypatch.setattr(
        nonholonomic_documents, "result_of", lambda made: whole.append(made) or result_of(made)
    )
    document = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
        "constraints": ["z' + x*y'"],
        "associated": "search",
        "first_integrals": False,
    }
    result = solve_document(document, SolveOptions(time_limit=20))
    beside = whole[-1].beside["nonholonomic"]["associated"]
    stated_there = {one.at: one for one in whole[-1].statements if "/associated/" in one.at}
    assert stated_there
    for at in stated_there:
        place = int(at.rpartition("/")[2])
        assert beside[place].keys() == {"kind", "defined", "explanation"}
        shown = result["nonholonomic"]["associated"][place]
        assert shown["equations"] == stated_there[at].part["equations"]
        assert shown["verdict"] != "undetermined"


@pytest.fixture
def undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    """No system, and no motion, can be compared with its document."""
    found = CheckResult("incomplete", ("The powers are too large.",))
    for name in ("compared_with_document", "compared_claim"):
        monkeypatch.setattr(comparison, name, lambda *_: found)


@pytest.mark.usefixtures("undecided")
def test_answers_about_equations_that_cannot_be_compared_are_left_open() -> None:
    """No formula and no certificate stays with them; what is about other equations is not lost."""
    case = told(
        Stated(Question(), YES),
        Stated(Question(kind="natural"), YES, "/kinds/natural"),
        Stated(Question(clock="x"), CLOCKED, "/with_clock"),
    )
    found = comparison.checked(case, 1.0).statements
    assert [one.verdict for one in found] == ["undetermined", "undetermined", "variational"]
    for one in found[:2]:
        assert one.part["lagrangian"] is one.part["certificate"] is one.part["checked"] is None
    assert found[2].part == CLOCKED


@pytest.mark.usefixtures("undecided")
def test_an_answer_about_a_motion_that_cannot_be_compared_takes_no_other_with_it() -> None:
    motion = Stated(Question(About.ANY), {**YES, "statement": "Yes."}, "/any_associated")
    reduced = Stated(Question(About.REDUCED), YES, "/reduced")
    found = comparison.checked(told(motion, reduced), 1.0).statements
    assert [one.verdict for one in found] == ["undetermined", "variational"]
    assert found[0].part["lagrangian"] is found[0].part["certificate"] is None
    assert found[0].part["reason_code"] == "check"
    assert found[1].part == YES


def test_a_definite_answer_without_the_agreement_of_the_checker_does_not_leave() -> None:
    for at, question in (("", Question()), ("/reduced", Question(About.REDUCED))):
        with pytest.raises(CertificateRefused):
            comparison.checked(told(Stated(question, {**YES, "checked": "incomplete"}, at)), 1.0)

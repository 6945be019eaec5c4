"""A solution of the engine becomes the result document of the contract, field by field."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

import inverse_service
from inverse_service.errors import CertificateRefused
from inverse_service.expressions.tree import TIME, Symbol, Velocity, divide, multiply, negate, number, power
from inverse_service.inverse_problem.solutions import (
    Answer,
    Conditions,
    Hamiltonian,
    Lagrangian,
    Solution,
    SolutionSpace,
    Step,
)
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import documents
from inverse_service.service.documents.accepting import to_schema
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.translate import main_and_other, to_result

DOCUMENT = {"name": "oscillator", "coordinates": ["x"], "equations": {"x": "-x"}, "parameters": ["k"]}
CANONICAL = {"coordinates": ["x"], "equations": {"x": "-x"}, "parameters": ["k"]}
LOGARITHM = {**DOCUMENT, "equations": {"x": "log(-1 - x^2)"}}
X, V, P = Symbol("x"), Velocity("x"), Symbol("p_x")
ONE = number(1)
SYSTEM = SecondOrderSystem(("x",), (negate(X),), ("k",), (), "oscillator")
TIMED = SecondOrderSystem(("x",), (multiply(TIME, X),), (), (), "")
YES = Answer(
    "variational",
    lagrangian=Lagrangian(divide(power(V, 2), number(2)), ((ONE,),), (V,), "constant", (X,)),
    hamiltonian=Hamiltonian(divide(power(P, 2), number(2)), (V,), False, (), (P,), "", ()),
    space=SolutionSpace(2, (1, 2), (0, 1), True, "one function"),
    certificate={"kind": "lagrangian", "rows": ((1, 2),)},
    checked="valid",
    explanation=(Step("because", "x"),),
)
NO = Answer("not_variational", certificate={}, checked="valid")
OPEN = Answer("undetermined", reason="why")
CONDITIONS = Conditions(((number(2),),), ((number(0),),), (((number(0),),),))


def test_every_field_of_the_contract_is_filled() -> None:
    solution = Solution(SYSTEM, YES, YES, CONDITIONS, {"seed": 1})
    found = to_result(solution, to_schema(DOCUMENT)).model_dump(mode="json")
    assert found["format"] == "inverse-service/result/1"
    assert (found["verdict"], found["verdict_with_time"], found["with_time"]) == ("variational", "variational", None)
    assert found["question"] == "L(q, q')"
    assert found["system"]["coordinates"] == ["x"]
    assert found["system"]["equations"] == {"x": "-x"}
    assert found["system"]["given"] == DOCUMENT
    assert found["lagrangian"]["domain"] == ["x' != 0", "x > 0"]
    assert found["multiplier"] == [["1"]]
    assert found["hamiltonian"]["momenta"] == {"p_x": "x'"}
    assert found["solution_space"]["dimensions"] == [1, 2]
    assert found["conditions"] == {"Phi": [["2"]], "nabla_Phi": [["0"]], "R": [[["0"]]]}
    assert found["certificate"] == {"kind": "lagrangian", "rows": [[1, 2]]}
    assert found["explanation"] == [{"text": "because", "latex": "x", "parts": []}]
    assert found["provenance"]["program"] == "inverse-service"


def test_a_different_answer_with_time_stands_beside_the_main_one() -> None:
    found = to_result(Solution(SYSTEM, NO, YES, None), to_schema(DOCUMENT))
    assert (found.verdict, found.verdict_with_time) == ("not_variational", "variational")
    assert found.with_time is not None
    assert found.with_time.lagrangian is not None


@pytest.mark.parametrize(
    ("solution", "asked", "main", "other"),
    [
        (Solution(SYSTEM, NO, YES, None), None, NO, YES),
        (Solution(SYSTEM, NO, YES, None), True, YES, None),
        (Solution(SYSTEM, NO, None, None), False, NO, None),
        (Solution(SYSTEM, None, YES, None), True, YES, None),
        (Solution(TIMED, None, YES, None), None, YES, None),
        (Solution(TIMED, None, YES, None), False, YES, None),
    ],
)
def test_the_question_asked_has_the_main_fields(
    solution: Solution, asked: bool | None, main: Answer, other: Answer | None
) -> None:
    assert main_and_other(solution, asked) == (main, other)


def test_no_answer_at_all_is_a_fault() -> None:
    with pytest.raises(ValueError, match="neither"):
        main_and_other(Solution(SYSTEM, None, None, None), None)


def proven(answer: Answer, **certificate: Any) -> Answer:
    """The answer with a certificate about the system, or with another one."""
    return dataclasses.replace(answer, certificate={"system": CANONICAL, **certificate})


class Found:
    """What a checker would say."""

    def __init__(self, verdict: str) -> None:
        self.verdict, self.reasons = verdict, ("a row is missing",)


def test_an_answer_that_the_checker_refuses_never_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "check_result", lambda result, time_limit: Found("invalid"))
    unchecked = Answer("not_variational", certificate={})
    with pytest.raises(CertificateRefused):
        documents.checked(to_result(Solution(SYSTEM, unchecked, None, None), to_schema(DOCUMENT)), 1.0)


def test_an_answer_that_the_checker_cannot_confirm_is_undetermined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "check_result", lambda result, time_limit: Found("incomplete"))
    solution = Solution(SYSTEM, proven(YES), proven(Answer("not_variational")), None)
    found = documents.checked(to_result(solution, to_schema(DOCUMENT)), 1.0)
    assert (found["verdict"], found["verdict_with_time"]) == ("variational", "undetermined")
    assert "a row is missing" in found["with_time"]["reason"]


def test_the_checker_is_shown_the_other_answer_as_if_it_were_the_main_one(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = []
    monkeypatch.setattr(documents, "check_result", lambda result, time_limit: shown.append(result) or Found("valid"))
    unchecked = proven(Answer("variational"), kind="other")
    documents.checked(to_result(Solution(SYSTEM, proven(NO), unchecked, None), to_schema(DOCUMENT)), 1.0)
    assert [(result["verdict"], result["certificate"]["kind"]) for result in shown] == [("variational", "other")]


@pytest.mark.parametrize("equation", ["x", "-x*k"])
def test_an_answer_about_another_system_never_leaves(equation: str) -> None:
    system = {**CANONICAL, "equations": {"x": equation}}
    answer = proven(NO, system=system)
    with pytest.raises(CertificateRefused, match="not what was given"):
        documents.checked(to_result(Solution(SYSTEM, answer, answer, None), to_schema(DOCUMENT)), 1.0)


def test_what_could_not_be_compared_is_undetermined() -> None:
    answer = proven(NO, near={"x": "1"}, system={**CANONICAL, "equations": {"x": "log(-1 - x^2)"}})
    found = documents.checked(to_result(Solution(SYSTEM, answer, answer, None), to_schema(LOGARITHM)), 1.0)
    assert (found["verdict"], found["verdict_with_time"]) == ("undetermined", "undetermined")
    assert "No point was found" in found["reason"]


def test_where_nothing_exists_with_time_either_one_certificate_proves_both() -> None:
    main = Answer("not_variational", certificate={"question": "autonomous"})
    time = Answer("not_variational", certificate={"question": "time_dependent"})
    found = to_result(Solution(SYSTEM, main, time, None), to_schema(DOCUMENT))
    assert found.certificate == {"question": "time_dependent"}
    assert found.with_time is None


def test_an_undetermined_answer_needs_no_certificate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(documents, "check_result")
    found = documents.checked(to_result(Solution(SYSTEM, OPEN, OPEN, None), to_schema(DOCUMENT)), 1.0)
    assert (found["verdict"], found["reason"], found["checked"]) == ("undetermined", "why", None)


def test_a_question_not_asked_has_no_verdict() -> None:
    assert to_result(Solution(SYSTEM, OPEN, None, None), to_schema(DOCUMENT)).verdict_with_time is None


def test_a_hamiltonian_holds_only_where_its_lagrangian_does() -> None:
    """x'' = -sqrt(1 + cos x): both divide by sin x."""
    found = inverse_service.solve("x'' = -sqrt(1 + cos(x))")
    for part in ("lagrangian", "hamiltonian"):
        assert {"sin(x) != 0", "x > -pi", "x < pi"} <= set(found[part]["domain"])
    assert check_plain(found.to_dict())["verdict"] == "valid"

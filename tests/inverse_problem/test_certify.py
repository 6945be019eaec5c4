"""The checker confirms certificates of decisions and rejects corrupted ones."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from inverse_service.certificate.checker import Cell, check_certificate
from inverse_service.decision import certify
from inverse_service.decision.deciding import Decision, analyze, decide
from inverse_service.errors import LimitError
from inverse_service.expressions import collecting, tree as ex
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse
from inverse_service.statements.questions import PLAIN, narrowest
from tests.generator import random_right_sides, random_systems


def certificate(
    equations: dict[str, str], time_dependent: bool = False, parameters: tuple[str, ...] = ()
) -> dict[str, Any]:
    system = read_system(list(equations), equations, parameters)
    analysis = analyze(system)
    return certify.of_decision(
        analysis, decide(system, narrowest(time_dependent), analysis=analysis)
    )


HENON_HEILES = {"x": "-x-2*x*y", "y": "-y-x^2+y^2"}
ROTATION = {"x": "x*y'", "y": "y*x'^2"}
ROOTS = {"x": "sqrt(1+sin(x)^2)*y'", "y": "log(x)*x'"}


def test_certificates_are_json_and_name_the_question() -> None:
    for time_dependent, question in ((False, "autonomous"), (True, "time_dependent")):
        found = certificate(HENON_HEILES, time_dependent)
        assert json.loads(json.dumps(found)) == found
        assert found["question"] == question


def test_a_condition_of_the_checker_may_be_longer_than_what_people_type() -> None:
    """Its text is our own: a limit on texts of people ended the question."""
    text = "*".join("x" for _ in range(4050)) + " + 1"
    with pytest.raises(LimitError):
        parse(text, Names(("x",)))
    (found,) = certify.where_of(Cell(domain=(f"{text} != 0",)), Names(("x",))).nonzero
    assert found == ex.Symbol("x") ** 4050 + 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "equations", [HENON_HEILES, ROTATION, ROOTS, {"x": "0"}, {"x": "-sin(x)*x'^2", "y": "-y"}]
)
@pytest.mark.parametrize("time_dependent", [False, True])
def test_the_checker_confirms_what_was_decided(
    equations: dict[str, str], time_dependent: bool
) -> None:
    found = check_certificate(certificate(equations, time_dependent), seed=3)
    assert found.verdict == "valid", found.reasons


Corruption = Callable[[dict[str, Any]], None]


def drop_a_row(found: dict[str, Any]) -> None:
    del found["rows"][len(found["rows"]) // 2]


def drop_all_rows(found: dict[str, Any]) -> None:
    found["rows"] = []


def repeat_one_row(found: dict[str, Any]) -> None:
    found["rows"] = [found["rows"][0]] * len(found["rows"])


def flip_the_claim(found: dict[str, Any]) -> None:
    found["claim"] = "variational" if found["claim"] == "not_variational" else "not_variational"


def change_the_system(found: dict[str, Any]) -> None:
    found["system"]["equations"]["x"] = "-x"
    found["system"]["equations"]["y"] = "-y"


def raise_a_dimension(found: dict[str, Any]) -> None:
    found["dimensions"][-1] += 1


def lower_the_characters(found: dict[str, Any]) -> None:
    found["symbol"]["characters"][0] += 1


def take_another_degree(found: dict[str, Any]) -> None:
    found["degree"] += 1


@pytest.mark.parametrize(
    "corrupt", [drop_a_row, drop_all_rows, repeat_one_row, flip_the_claim, change_the_system]
)
def test_a_corrupted_proof_of_nonexistence_is_refused(corrupt: Corruption) -> None:
    right = certificate(ROTATION)
    wrong = copy.deepcopy(right)
    corrupt(wrong)
    assert check_certificate(right, seed=3).verdict == "valid"
    assert check_certificate(wrong, seed=3).verdict == "invalid"


@pytest.mark.parametrize(
    "corrupt",
    [
        flip_the_claim,
        change_the_system,
        raise_a_dimension,
        lower_the_characters,
        take_another_degree,
    ],
)
def test_a_corrupted_proof_of_existence_is_refused(corrupt: Corruption) -> None:
    wrong = certificate(HENON_HEILES)
    corrupt(wrong)
    assert check_certificate(wrong, seed=3).verdict == "invalid"


def test_no_row_used_is_superfluous() -> None:
    """Every row of a traced combination is needed: without any one of them the proof fails."""
    right = certificate({"x": "x*y", "y": "0"})
    assert check_certificate(right, seed=3).verdict == "valid"
    for k in range(len(right["rows"])):
        wrong = copy.deepcopy(right)
        del wrong["rows"][k]
        assert check_certificate(wrong, seed=3).verdict == "invalid"


@pytest.mark.parametrize(
    ("lagrangian", "verdict"), [("x'*y'-x*y", "valid"), ("x'*y'+x*y", "invalid")]
)
def test_a_lagrangian_is_its_own_certificate(lagrangian: str, verdict: str) -> None:
    analysis = analyze(read_system(["x", "y"], {"x": "-x", "y": "-y"}))
    tree = parse(lagrangian, Names(("x", "y"), ()))
    assert (
        check_certificate(certify.of_lagrangian(analysis, tree, PLAIN), seed=3).verdict == verdict
    )


def test_an_undetermined_decision_has_no_certificate() -> None:
    analysis = analyze(read_system(["x"], {"x": "-x"}))
    with pytest.raises(ValueError, match="definite"):
        certify.of_decision(analysis, Decision("undetermined", False, 0))


def test_the_real_point_of_the_domain_is_written_down() -> None:
    near = certificate(ROOTS)["near"]
    assert set(near) == {"x", "y", "x'", "y'", "t"}
    assert float(near["x"]) > 0


# Functions that a decision over a prime field must not treat as independent; the checker uses real
# numbers.
RELATED = [
    {"x": "-x-2*x*y+(sin(atan(1/x))-cos(atan(x)))*x'*y'^2", "y": "-y-x^2+y^2"},
    {"x": "sqrt(x-y)*sqrt(x+y)*y'", "y": "sqrt(x^2-y^2)*x'+log(x-y)+log(x+y)"},
    {"x": "exp(sqrt((x-y)^2))*y'", "y": "exp(x-y)*x'"},
    {"x": "sin(2*x)*y'", "y": "sin(x)*cos(x)*x'^2"},
]


@pytest.mark.slow
@pytest.mark.parametrize("equations", RELATED)
def test_the_checker_confirms_verdicts_on_functions_that_are_related(
    equations: dict[str, str],
) -> None:
    found = check_certificate(certificate(equations), seed=5)
    assert found.verdict == "valid", found.reasons


@pytest.mark.slow
def test_sixty_random_right_hand_sides_are_decided_and_confirmed() -> None:
    seen = []
    for given in random_right_sides(60, seed=41):
        found = certificate(given.equations)
        checked = check_certificate(found, seed=7)
        assert checked.verdict == "valid", (given.equations, checked.reasons)
        seen.append(found["claim"])
    assert seen.count("not_variational") > 45


@pytest.mark.slow
def test_existence_is_confirmed_for_systems_with_a_known_lagrangian() -> None:
    for given in random_systems(12, seed=42):
        found = certificate(given.equations, given.time_dependent)
        assert found["claim"] == "variational", given.equations
        assert check_certificate(found, seed=7).verdict == "valid", given.equations


def test_inverse_sines_hide_the_root_of_one_minus_their_square() -> None:
    names = Names(("x",), (), {})
    for text, hidden in (("asin(2*x)", "1 - 4*x^2"), ("x*acos(x)", "1 - x^2")):
        (found,) = certify._hidden_radicands([parse(text, names)])
        assert collecting.collect(found - parse(hidden, names)) == ex.ZERO


def test_of_claims_on_one_side_the_first_that_is_settled_is_taken() -> None:
    said = {"whole": "incomplete", "left": "incomplete", "right": "valid", "last": "valid"}

    def judged(certificate: str, **_: object) -> SimpleNamespace:
        return SimpleNamespace(verdict=said[certificate])

    analysis = SimpleNamespace(proofs={})
    with (
        mock.patch.object(certify.checker, "check_certificate", judged),
        mock.patch.object(certify, "_hinted", return_value=["left", "right", "last"]),
    ):
        proof = certify.prove(analysis, "whole", 1.0)  # type: ignore[arg-type]
    assert (proof.certificate, proof.found.verdict) == ("right", "valid")

"""A motion on constraints that is given as it is, without a Lagrangian."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from typing import Any

import pytest

from inverse_service import check, solve
from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.comparison import compared_claim
from inverse_service.service.documents.documents import parse_document, solve_document, understand_document

INCLINED = {
    "coordinates": ["phi", "x", "y"],
    "motion": {"phi": "0", "x": "-tan(phi)*phi'*x' + g*cos(phi)^2"},
    "constraints": ["y' = tan(phi)*x'"],
    "parameters": ["g"],
}


def test_the_accelerations_of_all_coordinates_are_understood() -> None:
    found = parse_document(INCLINED)
    assert set(found["equations"]) == {"phi", "x", "y"}
    assert understand_document(INCLINED)["given"] == INCLINED


@pytest.mark.slow
def test_the_answer_is_about_the_motion_alone() -> None:
    found = solve_document(INCLINED, SolveOptions(time_limit=300))
    assert found["verdict"] == "undetermined"
    assert "any_associated" in found["reason"]
    assert found["nonholonomic"] is None
    answer = found["any_associated"]
    assert (answer["verdict"], answer["checked"]) == ("variational", "valid")
    assert answer["statement"] == "This motion can be given a Hamiltonian, by an associated system."
    assert answer["freedom"] == "2 functions of 1 variable"
    assert len(answer["lagrangian"]["transverse_momenta"]) == 1
    assert check_plain(found)["verdict"] == "valid"
    assert check_plain(found, INCLINED | {"motion": {"phi": "0", "x": "0"}})["verdict"] == "invalid"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"motion": {"phi": "0"}}, "free velocities"),
        ({"motion": {"phi": "0", "q": "1"}}, "not a coordinate"),
        ({"motion": {"phi": "0", "x": "y''"}}, "acceleration"),
        ({"motion": {"x": "0", "y": "0"}, "constraints": ["y' = tan(phi)*x'"]}, "do not determine"),
        ({"special_cases": True}, "special cases"),
    ],
)
def test_what_does_not_fit_together_is_refused_in_one_sentence(change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        solve_document(INCLINED | change, SolveOptions(time_limit=10))


KNIFE = {
    "coordinates": ["phi", "x", "y"],
    "lagrangian": "(x'^2 + y'^2 + phi'^2)/2 + x",
    "constraints": ["y' = tan(phi)*x'"],
    "associated": "any",
}


def changed(result: dict[str, Any], part: str, name: str, text: str) -> dict[str, Any]:
    other = copy.deepcopy(result)
    other["any_associated"]["certificate"]["system"][part][name] = text
    return other


@pytest.mark.slow
def test_a_result_about_another_motion_is_refused_by_the_check() -> None:
    found = solve_document(KNIFE, SolveOptions(time_limit=300))
    assert found["any_associated"]["verdict"] == "variational"
    assert check_plain(found)["verdict"] == "valid"
    assert check_plain(found, {**KNIFE, "lagrangian": "(x'^2 + y'^2 + phi'^2)/2"})["verdict"] == "invalid"
    open_motion = found["any_associated"] | {"verdict": "undetermined", "verdict_with_time": "undetermined"}
    open_motion |= {"certificate": None, "lagrangian": None}
    assert check_plain(found | {"any_associated": open_motion})["verdict"] == "incomplete"
    assert check_plain(found | {"verdict": "not_variational"})["verdict"] != "valid"
    motion = {key: KNIFE[key] for key in ("coordinates", "lagrangian", "constraints")}
    certificate = found["any_associated"]["certificate"]
    assert compared_claim(motion, certificate).verdict == "valid"
    for part, name, text in (("velocities", "y", "tan(phi)*x'+1"), ("equations", "x", "0"), ("equations", "phi", "x")):
        other = changed(found, part, name, text)
        assert compared_claim(motion, other["any_associated"]["certificate"]).verdict == "invalid"
        assert check_plain(other)["verdict"] == "invalid"


@pytest.mark.slow
def test_a_coordinate_that_depends_on_others_may_stand_before_them() -> None:
    """The potential contains z, so y is taken for the dependent one."""
    made = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2+y'^2+z'^2)/2-z^2",
        "constraints": ["z' = -x*y'"],
        "associated": "any",
    }
    found = solve_document(made, SolveOptions(time_limit=600))["any_associated"]
    assert found["certificate"]["system"]["coordinates"] == ["x", "z", "y"]
    assert (found["verdict"], found["checked"]) == ("not_variational", "valid")


@pytest.mark.slow
def test_both_kinds_of_document_about_one_motion_have_one_answer() -> None:
    given = {
        "coordinates": ["x", "y", "z"],
        "motion": {"x": "0", "y": "-x*x'*y'/(1+x^2)"},
        "constraints": ["z' = -x*y'"],
    }
    made = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2+y'^2+z'^2)/2",
        "constraints": ["z' = -x*y'"],
        "associated": "any",
    }
    answers = [solve_document(each, SolveOptions(time_limit=300))["any_associated"] for each in (given, made)]
    assert [one["verdict"] for one in answers] == ["variational"] * 2
    assert answers[0]["freedom"] == answers[1]["freedom"] == "2 functions of 3 variables"


@pytest.mark.slow
def test_a_sleigh_cannot_be_given_a_hamiltonian_and_says_so_first() -> None:
    sleigh = {
        "coordinates": ["phi", "x", "y"],
        "lagrangian": "((x'-a*sin(phi)*phi')^2+(y'+a*cos(phi)*phi')^2)/2+J*phi'^2/2",
        "constraints": ["y'*cos(phi) = sin(phi)*x'"],
        "parameters": ["a", "J"],
        "associated": "any",
    }
    found = solve_document(sleigh, SolveOptions(time_limit=600))["any_associated"]
    assert (found["verdict"], found["verdict_with_time"], found["checked"]) == ("not_variational",) * 2 + ("valid",)
    assert found["statement"] == "This motion cannot be given a Hamiltonian, by any associated system."
    assert found["certificate"]["question"] == "time_dependent"  # it covers L(q, q') too
    assert any("2-form that does has a vertical vector" in step["text"] for step in found["explanation"])


@pytest.mark.slow
def test_the_sleigh_is_settled_in_whatever_order_its_coordinates_are_named() -> None:
    """Chaplygin's sleigh with a moment of inertia about its mass has no Lagrangian among all associated systems."""
    document = {
        "lagrangian": "(x'^2 + y'^2)/2 + (J + a^2)*phi'^2/2 + a*phi'*(y'*cos(phi) - x'*sin(phi))",
        "constraints": ["y'*cos(phi) - x'*sin(phi)"],
        "parameters": ["a", "J"],
        "associated": "any",
    }
    for coordinates in (["x", "y", "phi"], ["y", "phi", "x"]):
        found = solve_document({**document, "coordinates": coordinates}, SolveOptions(time_limit=300.0))[
            "any_associated"
        ]
        assert (found["verdict"], found["checked"]) == ("not_variational", "valid")


@pytest.mark.slow
def test_a_document_that_asks_for_a_search_gets_what_decides_all_at_once() -> None:
    asked = {key: KNIFE[key] for key in ("coordinates", "lagrangian", "constraints")}
    asked |= {"associated": "search", "search": {"families": ["products"]}, "time_dependent_lagrangian": False}
    found = solve_document(asked, SolveOptions(time_limit=600))
    assert len(found["nonholonomic"]["associated"]) == 3
    assert found["any_associated"]["verdict"] == "variational"


@pytest.mark.slow
@pytest.mark.parametrize("potential", ["sqrt(x)", "x^(4/3)"])
def test_where_a_motion_is_defined_is_part_of_its_proof(potential: str) -> None:
    free = f"(x'^2 + y'^2 + z'^2)/2 - {potential}"
    result = solve({"lagrangian": free, "constraints": "z' = y*x'", "associated": "any"})
    answer = result["any_associated"]
    assert answer["certificate"]["conditions"] == ["x > 0"]
    assert answer["statement"] == "This motion cannot be given a Hamiltonian, by any associated system, where x > 0."
    assert check(dict(result))["verdict"] == "valid"


def test_a_yes_on_one_side_says_on_which() -> None:
    """The particle is free where x > 0 only; on the other side no Lagrangian has its motion."""
    found = solve({"lagrangian": "(x'^2 + y'^2 + z'^2)/2 - abs(x) + x", "constraints": "z' = y*x'"})["any_associated"]
    assert found["certificate"]["conditions"] == ["x > 0"]
    assert found["statement"].endswith("by the second associated system, where x > 0.")


def test_a_constraint_with_the_time_is_answered_where_brackets_are_taken_along_a_solution() -> None:
    """In a process of its own, as this once wrote where nothing was its own."""
    moving = {
        "coordinates": ["x", "y", "z", "w"],
        "lagrangian": "(x'^2 + y'^2 + z'^2 + w'^2)/2",
        "constraints": ["w' = t*y*x'"],
        "associated": "any",
    }
    asked = [sys.executable, "-m", "inverse_service", "solve", "-"]
    done = subprocess.run(asked, input=json.dumps(moving), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)["any_associated"]
    assert (answer["verdict_with_time"], answer["checked"]) == ("variational", "valid")

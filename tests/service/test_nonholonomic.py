"""Nonholonomic documents from end to end: results, certificates, refusals, and every way in."""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any

import pytest

from inverse_service import catalogue
from inverse_service.certificate.checker import check_certificate, check_text
from inverse_service.errors import InputError
from inverse_service.inverse_problem.hamiltonisation.nonholonomic_study import associated_systems, motion_report
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.nonholonomic.constraint_reading import read_nonholonomic
from inverse_service.service.documents.documents import look, parse_document, solve_document, understand_document
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.service.documents.text_page import text_page

FIVE = ("nonholonomic-particle", "knife-edge", "vertically-rolling-disk", "mobile-robot", "two-wheeled-carriage")
WITH_POTENTIAL = ("mobile-robot-with-potential", "inclined-knife-edge", "generic-class-with-potential")


@lru_cache
def solved(name: str, associated: str | None = None) -> dict[str, Any]:
    document = catalogue.document(name) | ({} if associated is None else {"associated": associated})
    return solve_document(document, SolveOptions(time_limit=600))


def part_of(result: dict[str, Any], kind: str) -> dict[str, Any]:
    return next(one for one in result["nonholonomic"]["associated"] if one["kind"] == kind)


@pytest.mark.slow
@pytest.mark.parametrize("name", FIVE)
def test_bare_lagrangian_and_constraints_give_the_whole_answer(name: str) -> None:
    result = solved(name)
    part = result["nonholonomic"]
    assert (result["verdict"], result["checked"], part["main"]) == ("variational", "valid", "second")
    verdicts = {one["kind"]: (one["verdict"], one["checked"]) for one in part["associated"]}
    assert verdicts == {
        "first": ("not_variational", "valid"),
        "second": ("variational", "valid"),
        "third": ("variational", "valid"),
    }
    assert part["paper_class"]["member"]
    assert not part["integrable"]["holonomic"]
    assert part["measure_density"]["status"] == "found"
    assert part["first_integrals"][0]["name"] == "energy"
    assert len(result["hamiltonian"]["constraints"]) == len(part["constraints"])
    assert not result["hamiltonian"]["implicit"]
    labels = [one["label"] for one in part["hamiltonisation"] if one["associated"] == "second"]
    assert len(labels) == (2 if name in FIVE[2:] else 1)
    assert all(one["holds"] and one["checked"] == "valid" for one in part["hamiltonisation"])
    assert all(one["trajectory"]["difference"] < 1e-7 for one in part["hamiltonisation"])


@pytest.mark.slow
def test_roots_of_positive_sums_are_one_root_in_all_that_is_shown() -> None:
    document = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
        "constraints": ["z' = y^2*x'/2"],
    }
    result = solve_document(document, SolveOptions())
    part = result["nonholonomic"]
    shown = [result["lagrangian"]["text"], result["hamiltonian"]["text"], part["measure_density"]["density"]["text"]]
    shown += [one["text"] for one in part["first_integrals"] if "sqrt" in one["text"]]
    assert len(shown) == 4
    assert all("sqrt(y^4 + 4)" in text and "2*y + 2" not in text for text in shown)


@pytest.mark.slow
@pytest.mark.parametrize("name", FIVE[:2])
def test_the_latex_page_has_what_the_page_of_text_has(name: str) -> None:
    result = solved(name)
    part, motion = result["nonholonomic"], result["any_associated"]
    found = motion["lagrangian"]
    shown = [found, found["on_constraints"], *found["transverse_momenta"], motion["hamiltonian"], *motion["image"]]
    shown += [*part["equations_of_motion"]["multipliers"], part["measure_density"]["density"], *part["first_integrals"]]
    text, latex = text_page(result, False), latex_page(result, False)
    assert len(shown) > 6
    assert all(one["text"] in text and one["latex"] in latex.replace(r" \\ & \quad ", "") for one in shown)
    assert latex.count("Independent check: valid.") >= 2
    assert all(part[each]["statement"][:26] in latex for each in ("paper_class", "integrable"))


@pytest.mark.slow
@pytest.mark.parametrize("name", FIVE[:3])
def test_the_checker_accepts_the_result_and_no_other_lagrangian(name: str) -> None:
    result = solved(name)
    assert check_text(json.dumps(result)).verdict == "valid"
    other = part_of(result, "third")["lagrangian"]["text"]
    forged = result | {"certificate": result["certificate"] | {"lagrangian": other}}
    assert check_text(json.dumps(forged)).verdict == "invalid"


@pytest.mark.slow
@pytest.mark.parametrize("name", WITH_POTENTIAL)
@pytest.mark.parametrize("kind", ["first", "second"])
def test_with_a_potential_first_and_second_have_negative_certificates(name: str, kind: str) -> None:
    one = part_of(solved(name), kind)
    assert (one["verdict"], one["checked"]) == ("not_variational", "valid")
    assert one["certificate"]["system"]["equations"] == one["equations"]
    assert check_certificate(one["certificate"], time_limit=20).verdict == "valid"
    broken = one["certificate"] | {"rows": []}
    assert check_certificate(broken, time_limit=20).verdict != "valid"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["first", "second", "third"])
def test_the_main_fields_answer_the_system_asked_for(kind: str) -> None:
    result = solved("knife-edge", kind)
    assert result["nonholonomic"]["main"] == kind
    assert [one["kind"] for one in result["nonholonomic"]["associated"]] == [kind]
    assert result["system"]["equations"] == part_of(result, kind)["equations"]
    assert result["verdict"] == ("not_variational" if kind == "first" else "variational")
    assert result["system"]["given"]["associated"] == kind


DISK = catalogue.document("vertically-rolling-disk")


@pytest.mark.slow
def test_multiples_of_the_constraints_are_added() -> None:
    turn = {"x": "-phi'*(y' - R*sin(phi)*theta')", "y": "phi'*(x' - R*cos(phi)*theta')"}
    result = solve_document(DISK | {"multiples": turn}, SolveOptions(time_limit=300))
    third = solved("vertically-rolling-disk", "third")
    assert result["verdict"] == "variational"
    assert result["nonholonomic"]["main"] == "family 1"
    assert result["nonholonomic"]["hamiltonisation"][0]["holds"]
    assert third["verdict"] == "variational"


@pytest.mark.slow
def test_a_list_of_multiples_is_a_list_of_systems_with_their_own_parameters() -> None:
    turn = {"x": "-phi'*(y' - R*sin(phi)*theta')", "y": "phi'*(x' - R*cos(phi)*theta')"}
    families = [{"x": "mu*(x' - R*cos(phi)*theta')"}, turn]
    document = DISK | {"multiples": families, "parameters": ["M", "I", "J", "R", "mu"]}
    part = solve_document(document, SolveOptions(time_limit=300))["nonholonomic"]
    assert [(one["kind"], one["verdict"]) for one in part["associated"]] == [
        ("family 1", "not_variational"),
        ("family 2", "variational"),
    ]
    assert "mu" in part["associated"][0]["equations"]["x"]


SPHERE = {
    "coordinates": ["x", "y", "z"],
    "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
    "constraints": ["x*x' + y*y' + z*z'"],
}


@pytest.mark.slow
def test_integrable_constraints_are_said_to_be_so() -> None:
    part = solve_document(SPHERE, SolveOptions(time_limit=300))["nonholonomic"]
    assert part["integrable"]["holonomic"]
    assert "holonomic in disguise" in part["integrable"]["statement"]
    assert part["integrable"]["integrals"][0]["text"] == "(x^2 + y^2 + z^2)/2"
    assert not part["paper_class"]["member"]
    undefined = {one["kind"] for one in part["associated"] if not one["defined"]}
    assert undefined == {"second", "third"}
    assert all(one["explanation"] for one in part["associated"])


REFUSALS: dict[str, tuple[dict[str, Any], str, str]] = {
    "third outside the class": (SPHERE | {"associated": "third"}, "/associated", "paper's class"),
    "second of a constraint with two velocities": (SPHERE | {"associated": "second"}, "/associated", "several free"),
    "a multiple that is none": (DISK | {"multiples": {"x": "x' - R*theta'"}}, "/multiples/x", "does not vanish"),
    "a multiple for no coordinate": (DISK | {"multiples": {"q": "0"}}, "/multiples/q", "not a coordinate"),
    "an acceleration in a multiple": (DISK | {"multiples": {"x": "x''"}}, "/multiples/x", "acceleration"),
    "an unknown kind": (DISK | {"associated": "fourth"}, "/associated", "first"),
    "an unknown key": (DISK | {"color": 1}, "/color", "nonholonomic system"),
    "both kinds": ({"coordinates": ["x"], "lagrangian": "x'^2", "equations": {"x": "0"}}, "/equations", "one or the"),
    "no Lagrangian": ({"coordinates": ["x", "y"], "constraints": ["x'"]}, "/lagrangian", "missing"),
    "a constraint that is a number": (SPHERE | {"constraints": [1]}, "/constraints/0", "formula"),
    "a redundant constraint": (SPHERE | {"constraints": ["x' - y'", "y' - x'"]}, "/constraints/1", "redundant"),
    "a quadratic constraint": (SPHERE | {"constraints": ["x'^2 - y'^2"]}, "/constraints/0", "not linear"),
    "a misspelt name": (SPHERE | {"constraints": ["x' - yy"]}, "/constraints/0", "not declared"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSALS)
def test_a_bad_document_gets_one_clear_sentence_with_its_place(name: str) -> None:
    document, pointer, word = REFUSALS[name]
    with pytest.raises(InputError) as caught:
        solve_document(document, SolveOptions(time_limit=20))
    places = getattr(caught.value, "places", ())
    found = places[0] if places else caught.value
    assert found.pointer == pointer
    assert word in found.detail


def test_what_was_understood_shows_lagrangian_constraints_and_motion() -> None:
    answer = parse_document(DISK)
    assert answer["equations"]["x"]["text"] == "-R*sin(phi)*phi'*theta'"
    assert [one["text"] for one in answer["constraints"]] == DISK["constraints"]
    assert answer["lagrangian"]["mathml"].startswith("<math")
    assert understand_document(DISK)["equations"]["y"] == "R*cos(phi)*phi'*theta'"
    look(DISK)
    with pytest.raises(InputError):
        look({"constraints": ["x'"]})


@pytest.mark.slow
def test_pages_show_the_motion_and_the_hamiltonisation() -> None:
    page = text_page(solved("nonholonomic-particle"), explain=False)
    assert "  z' = -x*y'" in page
    assert "  constraint p_z = 0" in page
    assert "first: not variational (independent check: valid)" in page
    latex = latex_page(solved("nonholonomic-particle"), explain=False)
    assert latex.count("\\begin{document}") == 1
    assert "\\[ p_{z} = 0 \\]" in latex


BAD_FORMULAS = (
    *(
        "",
        "'",
        "x'^",
        "1/0",
        "x'/(x-x)",
        "e^(e^(e^x'))",
        "sqrt(-1)*x'",
        "log(-1)*x' + y'",
        "0*x'",
        "y' = x' = 1",
        "x' =;",
    ),
    *(";;;", "diff(x, t)", "A(x)*x'", "x'^(1/2)", "x'*y'", "tan(pi/2)*x'", "sin(x')", "\\frac{x'}{", "x''", "q'"),
)


@pytest.mark.parametrize("kind", ["second", "third"])
def test_a_sleigh_without_this_associated_system_is_told_what_to_ask(kind: str) -> None:
    document = {
        "lagrangian": "m/2*(x'^2 + y'^2) + J/2*phi'^2",
        "constraints": ["x'*sin(phi) - y'*cos(phi) + a*phi'"],
        "parameters": ["m", "J", "a"],
        "associated": kind,
    }
    with pytest.raises(InputError, match=f'The {kind} system is .*Ask for "any"') as caught:
        solve_document(document, SolveOptions(time_limit=60))
    assert caught.value.pointer == "/associated"


@pytest.mark.slow
@pytest.mark.parametrize("key", ["lagrangian", "constraints", "multiples"])
def test_bad_formulas_are_refused_or_understood_and_never_a_fault(key: str) -> None:
    refused = 0
    for formula in BAD_FORMULAS:
        document = dict(DISK) | {
            key: {"lagrangian": formula, "constraints": [formula], "multiples": {"x": formula}}[key]
        }
        try:
            parse_document(document)
        except InputError as error:
            refused += 1
            places = getattr(error, "places", ()) or (error,)
            assert all(0 < len(place.detail) < 400 for place in places)
    assert refused > len(BAD_FORMULAS) // 2


def test_a_long_motion_leaves_time_for_its_associated_systems() -> None:
    report = motion_report(read_nonholonomic(**DISK), time_limit=2.0)
    assert report.exact.geometry.ring.field.budget.deadline == float("inf")
    assert all(one.system is not None for one in associated_systems(report, None))

"""Where the paper is wrong, and where it is right, on its own systems."""

from __future__ import annotations

import pytest

from inverse_service import catalogue
from inverse_service.certificate.checker import check_certificate
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.explanation.hierarchy import smallest_sufficient_set
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse


def catalogue_system(name: str) -> SecondOrderSystem:
    found = catalogue.document(name)
    return read_system(found["coordinates"], found["equations"], found.get("parameters", ()), found.get("functions"))


def verdicts(system: SecondOrderSystem) -> tuple[str, str]:
    return decide(system, False).verdict, decide(system, True).verdict


@pytest.mark.parametrize("name", ["extension-counterexample", "extension-literal-counterexample"])
def test_the_counterexample_to_proposition_3_is_variational(name: str) -> None:
    assert verdicts(catalogue_system(name)) == ("variational", "variational")


@pytest.mark.parametrize(
    ("lagrangian", "verdict"),
    [
        ("(r1'^2+r2'^2-r2^2+(s'-r2')^2)/2", "valid"),
        ("(r1'^2+r2'^2-r2^2+(s'+r2')^2)/2", "invalid"),
        ("(r1'^2+r2'^2+r2^2+(s'-r2')^2)/2", "invalid"),
        ("(r2'^2-r2^2+(s'-r2')^2)/2", "invalid"),
    ],
)
def test_the_lagrangian_of_the_counterexample_stands_and_its_neighbors_fall(lagrangian: str, verdict: str) -> None:
    system = catalogue_system("extension-counterexample")
    tree = parse(lagrangian, Names(system.coordinates, ()))
    assert check_certificate(certify.of_lagrangian(analyze(system), tree, False)).verdict == verdict


@pytest.mark.parametrize("name", ["extension", "generic-class-with-potential-second", "inclined-knife-edge-second"])
def test_proposition_3_holds_for_generic_functions_and_in_mechanical_cases(name: str) -> None:
    assert verdicts(catalogue_system(name)) == ("not_variational", "not_variational")


def test_proposition_3_without_potential_is_the_variational_case_of_proposition_1() -> None:
    assert verdicts(catalogue_system("extension-without-potential")) == ("variational", "variational")


@pytest.mark.parametrize("name", ["generic-class-one-first", "generic-class-two-first", "generic-class-three-first"])
def test_generic_proposition_1_1_no_first_associated_system_is_variational(name: str) -> None:
    assert verdicts(catalogue_system(name)) == ("not_variational", "not_variational")


@pytest.mark.parametrize("name", ["generic-class-one-second", "generic-class-two-second"])
def test_generic_proposition_1_2_every_second_associated_system_is_variational(name: str) -> None:
    assert verdicts(catalogue_system(name)) == ("variational", "variational")


def test_hills_lunar_problem_is_variational() -> None:
    assert verdicts(catalogue_system("hill-lunar")) == ("variational", "variational")


DIFFERENTIAL = {
    "mathematics, section 1": {"x": "x'^2*y'", "y": "2*y'+2*x'^2*y'"},
    "IIIa 1": {"x": "2*x'/y'+2*x'", "y": "2*x'^2/y'+x'/y'"},
    "IIIa 3, renamed": {"v": "2*v'+2*u'^2*v'", "u": "u'^2*v'"},
}


@pytest.mark.parametrize("name", DIFFERENTIAL)
def test_what_every_algebraic_condition_lets_through_is_refused_by_differential_ones(name: str) -> None:
    equations = DIFFERENTIAL[name]
    system = read_system(list(equations), equations)
    assert smallest_sufficient_set(analyze(system)) is None
    found = decide(system, True)
    assert verdicts(system) == ("not_variational", "not_variational")
    assert check_certificate(certify.of_decision(analyze(system), found)).verdict == "valid"

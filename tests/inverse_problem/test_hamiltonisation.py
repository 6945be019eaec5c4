"""Propositions 1 and 2 for the five systems of the paper, and what the report says of wrong claims."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import catalogue
from inverse_service.expressions.tree import Expression, Symbol, Velocity, add, multiply, number, subtract
from inverse_service.inverse_problem.hamiltonisation.hamiltonise import (
    Hamiltonisation,
    hamiltonise,
    rank_at_point,
    vanish,
)
from inverse_service.inverse_problem.hamiltonisation.nonholonomic_study import MotionReport, motion_report
from inverse_service.mechanics.nonholonomic.associated_systems import Kind, associated
from inverse_service.mechanics.nonholonomic.constraint_reading import read_nonholonomic
from inverse_service.mechanics.nonholonomic.paper_lagrangians import PaperLagrangian, propose_lagrangians
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

# (system, place of the proposal): L, H and the constraints, with all constants C of the paper equal to 1.
PROPOSITIONS: dict[tuple[str, int], tuple[str, str, tuple[str, ...]]] = {
    ("nonholonomic-particle", 0): (
        "x'^2/2 + sqrt(1 + x^2)/2*(y'^2/x' + z'^2/(x*x'))",
        "(p_x + (p_y^2 + x*p_z^2)/(2*sqrt(1 + x^2)))^2/2",
        ("p_z + p_y",),
    ),
    ("knife-edge", 0): (
        "J*phi'^2/2 + (x'^2 - y'^2/tan(phi))/(2*cos(phi)*phi')",
        "(p_phi + cos(phi)/2*(p_x^2 - tan(phi)*p_y^2))^2/(2*J)",
        ("p_y + p_x",),
    ),
    ("vertically-rolling-disk", 0): (
        "J*phi'^2/2 + (theta'^2 - x'^2/(R*cos(phi)) - y'^2/(R*sin(phi)))/(2*phi')",
        "(p_phi + (p_theta^2 - R*cos(phi)*p_x^2 - R*sin(phi)*p_y^2)/2)^2/(2*J)",
        ("p_x + p_theta", "p_y + p_theta"),
    ),
    ("vertically-rolling-disk", 1): (
        "J*phi'^2/2 + I*theta'^2/2 - (x'^2/(R*cos(phi)) + y'^2/(R*sin(phi)))/(2*phi')",
        "p_theta^2/(2*I) + (p_phi - (R*cos(phi)*p_x^2 + R*sin(phi)*p_y^2)/2)^2/(2*J)",
        ("p_y - p_x", "p_theta + I/J*(p_phi - (R*cos(phi)*p_x^2 + R*sin(phi)*p_y^2)/2)*p_x"),
    ),
    ("mobile-robot", 1): (
        "I*theta'^2/2 + 3*J*psi'^2/2 - (x'^2/(R*cos(theta)) + y'^2/(R*sin(theta)))/(2*theta')",
        "p_psi^2/(6*J) + (p_theta - (R*cos(theta)*p_x^2 + R*sin(theta)*p_y^2)/2)^2/(2*I)",
        ("p_y - p_x", "p_psi + 3*J/I*(p_theta - (R*cos(theta)*p_x^2 + R*sin(theta)*p_y^2)/2)*p_x"),
    ),
    ("two-wheeled-carriage", 0): (
        "I*phi'^2/2 + (sigma'^2 + 2*x'^2/(R*cos(phi)) + 2*y'^2/(R*sin(phi)))/(2*phi')",
        "(p_phi + (p_sigma^2 + R/2*cos(phi)*p_x^2 + R/2*sin(phi)*p_y^2)/2)^2/(2*I)",
        ("p_x + p_sigma", "p_y + p_sigma"),
    ),
}


def report_of(name: str) -> MotionReport:
    return motion_report(read_nonholonomic(**catalogue.document(name)))


def system_of(report: MotionReport, kind: Kind) -> SecondOrderSystem:
    found = associated(report.exact, report.member, report.reason, kind).system
    assert found is not None
    return found


def proposal_of(report: MotionReport, kind: str, place: int) -> PaperLagrangian:
    assert report.member is not None
    return propose_lagrangians(report.member, kind)[place]


def read(text: str, document: dict[str, Any]) -> Expression:
    momenta = tuple(f"p_{name}" for name in document["coordinates"])
    names = Names(tuple(document["coordinates"]), (*document.get("parameters", ()), *momenta))
    return read_formula(text, names)


@pytest.mark.parametrize(("name", "place"), PROPOSITIONS)
def test_lagrangian_hamiltonian_and_constraints_are_those_of_the_propositions(name: str, place: int) -> None:
    document, report = catalogue.document(name), report_of(name)
    proposal = proposal_of(report, "second", place)
    known = [read(text, document) for text in (*PROPOSITIONS[name, place][:2], *PROPOSITIONS[name, place][2])]
    found = [proposal.lagrangian, proposal.transform.hamiltonian, *proposal.images]
    assert len(found) == len(known)
    coordinates = document["coordinates"]
    names: list[Symbol | Velocity] = [*map(Symbol, coordinates), *map(Velocity, coordinates)]
    names += [Symbol(each) for each in document.get("parameters", ())] + [Symbol(f"p_{each}") for each in coordinates]
    assert vanish([subtract(a, b) for a, b in zip(found, known, strict=True)], names) is True
    assert vanish([subtract(a, multiply(number(2), b)) for a, b in zip(found, known, strict=True)], names) is False


FIVE = ("nonholonomic-particle", "knife-edge", "vertically-rolling-disk", "mobile-robot", "two-wheeled-carriage")
CLASS = [
    pytest.param(name, kind, place, marks=[pytest.mark.slow] if (name, kind) == ("generic-class-two", "third") else [])
    for name in (*FIVE, "generic-class-one", "generic-class-two")
    for kind, place in (("second", 0), ("second", 1), ("third", 0))
    if place == 0 or name in FIVE[2:]
]


def made(name: str, kind: Kind, place: int, **changes: Any) -> Hamiltonisation:
    report = report_of(name)
    proposal = proposal_of(report, kind, place)
    given = {"known": proposal.transform, "known_images": proposal.images} | changes
    return hamiltonise(report.motion, system_of(report, kind), proposal.lagrangian, 1, **given)


@pytest.mark.parametrize(("name", "kind", "place"), CLASS)
def test_the_flow_of_h_on_the_constraints_is_the_motion(name: str, kind: Kind, place: int) -> None:
    found = made(name, kind, place)
    assert [statement.verdict for statement in found.statements] == ["holds"] * 5
    assert found.holds
    assert found.comparison is not None
    assert found.comparison.difference < 1e-7
    assert found.comparison.constraint < 1e-9
    assert found.comparison.energy < 1e-8


@pytest.mark.parametrize("name", ["knife-edge", "nonholonomic-particle"])
def test_the_constraint_of_the_third_system_is_that_a_momentum_vanishes(name: str) -> None:
    (image,) = made(name, "third", 0).images
    assert image == Symbol({"knife-edge": "p_y", "nonholonomic-particle": "p_z"}[name])


def test_without_help_the_same_legendre_transform_is_found() -> None:
    found = made("nonholonomic-particle", "second", 0, known=None, known_images=())
    assert found.holds
    assert found.images == (add(Symbol("p_y"), Symbol("p_z")),)


def test_a_wrong_constraint_in_phase_space_fails() -> None:
    found = made("nonholonomic-particle", "second", 0, known_images=(subtract(Symbol("p_z"), Symbol("p_y")),))
    assert found.statements[3].verdict == "fails"
    assert not found.holds
    assert found.comparison is not None
    assert found.comparison.constraint > 1e-3


def test_one_constraint_given_twice_is_not_the_image() -> None:
    image = add(Symbol("p_x"), Symbol("p_theta"))
    found = made("vertically-rolling-disk", "second", 0, known_images=(image, multiply(number(2), image)))
    assert found.statements[3].verdict == "fails"


def test_the_lagrangian_of_another_system_fails() -> None:
    report = report_of("knife-edge")
    wrong = proposal_of(report, "third", 0)
    found = hamiltonise(report.motion, system_of(report, "second"), wrong.lagrangian, 1, wrong.transform, wrong.images)
    assert found.statements[1].verdict == "fails"
    assert not found.holds


def test_a_system_that_does_not_hold_the_motion_fails() -> None:
    report = report_of("knife-edge")
    system = system_of(report, "second")
    moved = SecondOrderSystem(system.coordinates, (Symbol("x"), *system.accelerations[1:]), system.parameters)
    proposal = proposal_of(report, "second", 0)
    found = hamiltonise(report.motion, moved, proposal.lagrangian, 1, proposal.transform, proposal.images)
    assert found.statements[0].verdict == "fails"


def test_a_degenerate_lagrangian_has_no_report() -> None:
    report = report_of("knife-edge")
    found = hamiltonise(report.motion, system_of(report, "second"), Velocity("phi"))
    assert found.transform is None
    assert not found.holds


def test_identities_keep_the_relations_of_functions() -> None:
    x = Symbol("x")
    names = Names(("x",))
    square = read_formula("sin(2*x)^2 - 4*sin(x)^2*(1 - sin(x)^2)", names)
    assert vanish([square], [x]) is True
    assert vanish([add(square, read_formula("x^3", names))], [x]) is False
    assert vanish([], [x]) is True
    rows = [[read_formula(text, names) for text in row] for row in (("1", "x"), ("x", "x^2"))]
    assert rank_at_point(rows, [x]) == 1
    rows[1][1] = read_formula("x^2 + 1", names)
    assert rank_at_point(rows, [x]) == 2

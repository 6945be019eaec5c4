"""Associated systems: the catalogue's are found by structure, in any order and under any names."""

from __future__ import annotations

import itertools
import re
from typing import Any

import pytest

from inverse_service import catalogue
from inverse_service.certificate.checker import check_certificate
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    ONE,
    ZERO,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    substitute,
    subtract,
)
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.hamiltonisation.hamiltonise import vanish
from inverse_service.mechanics.nonholonomic.associated_systems import KINDS, AssociatedSystem, Kind, associated
from inverse_service.mechanics.nonholonomic.constraint_reading import read_nonholonomic
from inverse_service.mechanics.nonholonomic.geometry import frames, geometry
from inverse_service.mechanics.nonholonomic.motion import eliminate_multipliers, written
from inverse_service.mechanics.nonholonomic.paper_class import PaperClass, recognized, rotation
from inverse_service.mechanics.nonholonomic.paper_lagrangians import propose_lagrangians
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from tests.mechanics.nonholonomic_examples import EXAMPLES

FIVE = ("nonholonomic-particle", "knife-edge", "vertically-rolling-disk", "mobile-robot", "two-wheeled-carriage")
KNOWN = [
    name for name in catalogue.names()
    if catalogue.entry(name).get("associated_with") and name.rsplit("-", 1)[1] in KINDS
]  # fmt: skip


def member_of(document: dict[str, Any]) -> PaperClass:
    member, reason = recognized(geometry(read_nonholonomic(**document)))
    assert member is not None, reason
    return member


def system_of(document: dict[str, Any], kind: Kind) -> AssociatedSystem:
    parts = geometry(read_nonholonomic(**document))
    member, reason = recognized(parts)
    return associated(eliminate_multipliers(parts, member.frame if member else frames(parts)[0]), member, reason, kind)


def variables(system: SecondOrderSystem) -> list[Symbol | Velocity]:
    names = system.coordinates
    return [*map(Symbol, names), *map(Velocity, names), *map(Symbol, system.parameters)]


def same(left: SecondOrderSystem, right: SecondOrderSystem) -> bool:
    """Whether both have the same accelerations, whatever the order of the coordinates."""
    table = dict(zip(right.coordinates, right.accelerations, strict=True))
    pairs = zip(left.coordinates, left.accelerations, strict=True)
    return vanish([subtract(f, table[name]) for name, f in pairs], variables(left)) is True


def catalogued(name: str) -> SecondOrderSystem:
    document = catalogue.document(name)
    return read_system(
        document.get("coordinates"), document["equations"], document.get("parameters", ()), document.get("functions")
    )


@pytest.mark.parametrize("name", KNOWN)
def test_the_systems_of_the_catalogue_follow_from_lagrangian_and_constraints(name: str) -> None:
    kind = name.rsplit("-", 1)[1]
    document = catalogue.document(catalogue.entry(name)["associated_with"])
    found = system_of(document, next(each for each in KINDS if each == kind)).system
    assert found is not None
    known = catalogued(name)
    assert same(found, known)
    shifted = SecondOrderSystem(
        known.coordinates, (add(known.accelerations[0], Symbol(known.coordinates[0])), *known.accelerations[1:])
    )
    assert not same(found, shifted)


@pytest.mark.parametrize("name", FIVE[:2])
def test_the_class_is_recognized_in_every_order_of_the_coordinates(name: str) -> None:
    document = catalogue.document(name)
    found = system_of(document, "second").system
    assert found is not None
    for order in itertools.permutations(document["coordinates"]):
        changed = document | {"coordinates": list(order)}
        other = system_of(changed, "second").system
        assert other is not None
        assert same(found, other)
        member = member_of(changed)
        assert order[member.r1] == document["coordinates"][0]


@pytest.mark.parametrize("name", FIVE)
def test_the_class_is_recognized_under_other_names(name: str) -> None:
    document = catalogue.document(name)
    names = {old: f"q_{k}" for k, old in enumerate(document["coordinates"])}

    def renamed(text: str) -> str:
        return re.sub(r"[A-Za-z_]+", lambda match: names.get(match.group(), match.group()), text)

    changed = document | {
        "name": "",
        "coordinates": list(names.values()),
        "lagrangian": renamed(document["lagrangian"]),
        "constraints": [renamed(text) for text in document["constraints"]],
    }
    member, plain = member_of(changed), member_of(document)
    assert (member.r1, member.r2, member.frame.dependent) == (plain.r1, plain.r2, plain.frame.dependent)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"lagrangian": "(x'^2 + y'^2 + z'^2)/2 + x'*y'/2"}, "mixed"),
        ({"lagrangian": "(x'^2 + (1 + x^2)*y'^2 + z'^2)/2"}, "position"),
        ({"lagrangian": "(x'^2 + y'^2 + z'^2)/2 + x*y'"}, "linear"),
        ({"constraints": ["z' + y*y'"]}, "form"),
        ({"constraints": ["z' + x*y' + 1"]}, "velocity-free"),
        ({"constraints": ["z' + x*y' + y*x'"]}, "form"),
        ({"coordinates": ["x", "y", "z", "w"], "lagrangian": "(x'^2 + y'^2 + z'^2 + w'^2)/2"}, "3 free velocities"),
    ],
)
def test_outside_the_class_the_reason_is_given(change: dict[str, Any], word: str) -> None:
    plain = catalogue.document("nonholonomic-particle")
    member, reason = recognized(geometry(read_nonholonomic(**plain | change)))
    assert member is None
    assert word in reason
    third = system_of(plain | change, "third")
    assert third.system is None
    assert reason in third.explanation


ALL = {name: catalogue.document(name) for name in catalogue.names("nonholonomic")} | EXAMPLES


@pytest.mark.parametrize("name", ALL)
def test_every_associated_system_holds_the_motion(name: str) -> None:
    parts = geometry(read_nonholonomic(**ALL[name]))
    member, reason = recognized(parts)
    exact = eliminate_multipliers(parts, member.frame if member else frames(parts)[0])
    motion = written(exact)
    table: dict[Expression, Expression] = {
        Velocity(s): rate for s, rate in zip(motion.dependent, motion.dependent_velocities, strict=True)
    }
    for kind in KINDS:
        system = associated(exact, member, reason, kind).system
        assert system is not None or kind != "first"
        if system is not None:
            pairs = zip(system.accelerations, motion.accelerations, strict=True)
            assert vanish([subtract(substitute(f, table), a) for f, a in pairs], variables(system)) is True


ROTATIONS = (
    *("nonholonomic-particle", "vertically-rolling-disk", "generic-class-two"),
    pytest.param("generic-class-three", marks=pytest.mark.slow),
)


@pytest.mark.parametrize("name", ROTATIONS)
def test_the_third_system_is_a_rotation_with_a_constant_direction(name: str) -> None:
    member = member_of(ALL[name])
    turned = rotation(member)
    masses = [member.geometry.tree(mass) for mass in member.masses]
    size, r1 = range(len(masses)), Symbol(turned.driver)
    skew = [
        add(multiply(masses[i], turned.generator[i][j]), multiply(masses[j], turned.generator[j][i]))
        for i in size for j in size
    ]  # fmt: skip
    coupled = turned.turning
    s, m, inverse = turned.form, turned.generator, turned.inverse
    moved = [
        add(differentiate(s[i][j], r1), *(multiply(s[i][k], m[k][j]) for k in coupled))
        for i in coupled
        for j in coupled
    ]
    unit = [
        subtract(add(*(multiply(s[i][k], inverse[k][j]) for k in coupled)), ONE if i == j else ZERO)
        for i in coupled
        for j in coupled
    ]
    names: list[Symbol | Velocity] = [*map(Symbol, member.geometry.system.coordinates)]
    names += map(Symbol, member.geometry.system.parameters)
    assert any(entry != ZERO for row in turned.generator for entry in row)
    assert vanish([*skew, *moved, *unit], names) is True


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("nonholonomic-particle", (1, 1)),
        ("vertically-rolling-disk", (2, 1)),
        ("generic-class-one", (1, 1)),
        ("generic-class-two", (1, 1)),
        ("inclined-knife-edge", (0, 0)),
    ],
)
def test_the_checker_confirms_the_lagrangians_of_the_class(name: str, counts: tuple[int, int]) -> None:
    member = member_of(ALL[name])
    found = {kind: propose_lagrangians(member, kind) for kind in KINDS}
    assert (len(found["first"]), len(found["second"]), len(found["third"])) == (0, *counts)
    for kind in KINDS[1:]:
        system = system_of(ALL[name], kind).system
        assert system is not None
        for proposal in found[kind]:
            certificate = certify.of_lagrangian(analyze(system), proposal.lagrangian, with_time=False)
            assert check_certificate(certificate, time_limit=20).verdict == "valid"


@pytest.mark.parametrize("kind", ["second", "third"])
def test_lagrangians_that_are_too_large_are_not_proposed(kind: str) -> None:
    member = member_of(ALL["vertically-rolling-disk"])
    assert propose_lagrangians(member, kind)
    member.geometry.ring.field.budget.deadline = 0.0
    assert propose_lagrangians(member, kind) == ()

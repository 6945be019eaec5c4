"""Families of associated systems: what they hold, and which members are variational."""

from __future__ import annotations

import functools
import itertools

import pytest

from inverse_service.errors import InputError
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Velocity, substitute, subtract
from inverse_service.inverse_problem.decision.analysis import variables_of
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.families.family_search import (
    BUILDERS,
    FamilyOptions,
    FamilySearch,
    covered,
    search_families,
)
from inverse_service.inverse_problem.families.shared import SharedLetters
from inverse_service.inverse_problem.hamiltonisation.identities import vanish
from inverse_service.linear_pde.deciding import Limits
from inverse_service.mechanics.nonholonomic.associated_families import Member, Source, accelerations, members
from inverse_service.mechanics.nonholonomic.associated_systems import KINDS, associated
from inverse_service.mechanics.nonholonomic.geometry import frames, geometry
from inverse_service.mechanics.nonholonomic.motion import ExactMotion, exact_motion, written
from inverse_service.mechanics.nonholonomic.paper_class import recognised
from inverse_service.mechanics.nonholonomic.reading import read_nonholonomic
from inverse_service.mechanics.second_order_system import SecondOrderSystem

DOCUMENTS: dict[str, tuple[list[str], str, list[str], list[str]]] = {
    "particle": (["x", "y", "z"], "1/2*(x'^2 + y'^2 + z'^2)", ["z' + x*y'"], []),
    "knife edge": (
        ["phi", "x", "y"], "m/2*(x'^2 + y'^2) + J/2*phi'^2", ["x'*sin(phi) - y'*cos(phi)"], ["m", "J"],
    ),
    "disk": (
        ["phi", "theta", "x", "y"],
        "M/2*(x'^2 + y'^2) + I/2*theta'^2 + J/2*phi'^2",
        ["x' - R*cos(phi)*theta'", "y' - R*sin(phi)*theta'"],
        ["M", "I", "J", "R"],
    ),
    "robot": (
        ["theta", "psi", "x", "y"],
        "m/2*(x'^2 + y'^2) + I/2*theta'^2 + 3/2*J*psi'^2 - 10*sin(psi)",
        ["x' - R*cos(theta)*psi'", "y' - R*sin(theta)*psi'"],
        ["m", "I", "J", "R"],
    ),
    "two free velocities in one constraint": (
        ["x", "y", "z"], "1/2*(x'^2 + y'^2 + z'^2)", ["z' - y*x' - x^2*y'"], [],
    ),
    "affine constraint": (["x", "y", "z"], "1/2*(x'^2 + y'^2 + z'^2)", ["z' - x*y' - 1"], []),
}  # fmt: skip


@functools.cache
def motion_of(name: str) -> tuple[ExactMotion, tuple[tuple[str, SecondOrderSystem], ...]]:
    parts = geometry(read_nonholonomic(*DOCUMENTS[name]))
    member, reason = recognised(parts)
    motion = exact_motion(parts, member.frame if member else frames(parts)[0])
    kinds = [(kind, associated(motion, member, reason, kind).system) for kind in KINDS]
    return motion, tuple((kind, system) for kind, system in kinds if system is not None)


@functools.cache
def found(name: str) -> tuple[FamilySearch, FamilyOptions]:
    motion, known = motion_of(name)
    carried = 2 if len(motion.geometry.system.constraints) == 1 else 0
    options = FamilyOptions(("products", "forces", "mixtures"), depth=1, most=30, carried=carried)
    return search_families(motion, options, known), options


def some_members(name: str, family: str) -> tuple[list[Member], Source]:
    source = Source.of(motion_of(name)[0])
    return list(itertools.islice(members(BUILDERS[family](source, 2), 60), 60)), source


@pytest.mark.parametrize("family", BUILDERS)
@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_member_is_the_motion_on_the_constraints(name: str, family: str) -> None:
    taken, source = some_members(name, family)
    motion = written(motion_of(name)[0])
    rates = zip(motion.dependent, motion.dependent_velocities, strict=True)
    table = {Velocity(coordinate): rate for coordinate, rate in rates}
    system = motion.system
    empty = SecondOrderSystem(system.coordinates, (), system.parameters, system.functions)
    differences = [
        subtract(substitute(f, table), a)
        for member in taken[::7]
        for f, a in zip(accelerations(member, source.letters.trees), motion.accelerations, strict=True)
    ]
    assert vanish(differences, list(variables_of(empty)), 1) is True
    assert len(set(taken)) == len(taken)
    assert len(taken) > 1 or (family == "ratios" and not source.ratios())


@pytest.mark.parametrize("name", ["particle", "knife edge", "disk"])
def test_the_second_and_the_third_system_are_found_without_being_named(name: str) -> None:
    kinds = {kind for member in found(name)[0].variational for kind in member.kinds}
    assert kinds == {"second", "third"}


@pytest.mark.parametrize("name", ["particle", "knife edge"])
def test_each_variational_member_is_carried_to_phase_space(name: str) -> None:
    for member in found(name)[0].variational:
        assert member.answer is not None
        assert member.answer.checked == "valid"
        assert member.hamiltonisation is not None
        assert member.hamiltonisation.holds
        assert member.hamiltonisation.images


@pytest.mark.parametrize("name", DOCUMENTS)
@pytest.mark.parametrize("family", ["products", "forces"])
def test_shared_decisions_are_those_of_single_systems(name: str, family: str) -> None:
    taken, source = some_members(name, family)
    system = motion_of(name)[0].geometry.system
    empty = SecondOrderSystem(system.coordinates, (), system.parameters, system.functions)
    shared = SharedLetters.of(empty, source.letters.trees)
    for member in taken[:4]:
        alone = decide(shared.member_system(member), False).verdict
        assert shared.verdict(member, False, 1, Limits()) == alone


def test_the_robot_with_a_potential_has_no_variational_member_here() -> None:
    search, options = found("robot")
    assert not search.variational
    assert all(count.not_variational == count.members for count in search.families)
    assert "different systems" in covered(search, options)


def test_the_third_system_of_the_knife_edge_is_a_rotation() -> None:
    texts = [[to_text(f) for f in member.system.accelerations] for member in found("knife edge")[0].variational]
    assert ["0", "-phi'*y'", "phi'*x'"] in texts


def test_counts_add_up_and_a_limit_is_kept() -> None:
    motion, _ = motion_of("disk")
    options = FamilyOptions(("ratios",), depth=3, most=25, processes=2, carried=0)
    search = search_families(motion, options)
    (count,) = search.families
    assert count.members == count.decided == 25 < count.size == 7**4
    assert count.variational + count.not_variational + count.undetermined == 25
    assert "the first 25 of 2401 choices" in covered(search, options)


def test_a_time_limit_leaves_members_undecided_and_says_so() -> None:
    motion, _ = motion_of("disk")
    options = FamilyOptions(("ratios",), depth=3, most=2000, time_limit=0.5, processes=1)
    search = search_families(motion, options)
    assert search.families[0].decided < search.families[0].members


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(InputError, match="products"):
        search_families(motion_of("particle")[0], FamilyOptions(("quotients",)))

"""Invariant measures, first integrals and integrable constraints, each tested by what defines it."""

from __future__ import annotations

import contextlib
import random
from typing import Any

import pytest
from mpmath import mp, mpf

from inverse_service import catalogue
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Arbitrary,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    substitute,
    walk,
)
from inverse_service.mechanics.first_integrals import first_integrals
from inverse_service.mechanics.nonholonomic.constraint_reading import read_nonholonomic
from inverse_service.mechanics.nonholonomic.geometry import frames, geometry
from inverse_service.mechanics.nonholonomic.integrals import (
    Integrability,
    integrability,
    measure_density,
)
from inverse_service.mechanics.nonholonomic.motion import (
    EliminatedMotion,
    EquationsOfMotion,
    eliminate_multipliers,
    written,
)
from tests.mechanics.nonholonomic_examples import EXAMPLES

DOCUMENTS = {name: catalogue.document(name) for name in catalogue.names("nonholonomic")} | EXAMPLES
WITHOUT_MEASURE = {"Chaplygin sleigh": "does_not_exist", "integrating factor": "not_found"}


def point_for(trees: list[Expression], seed: int) -> dict[Expression, Any]:
    source = random.Random(seed)
    leaves = {node for tree in trees for node in walk(tree) if isinstance(node, Symbol | Velocity | Arbitrary)}
    return {leaf: mpf(source.randrange(10**6, 10**7)) / 10**7 for leaf in sorted(leaves, key=repr)}


def exact(document: dict[str, Any]) -> EliminatedMotion:
    parts = geometry(read_nonholonomic(**document))
    return eliminate_multipliers(parts, frames(parts)[0])


def along(motion: EquationsOfMotion, tree: Expression) -> Expression:
    """The derivative of a function of (t, q, u) along the motion."""
    rates = dict(zip(motion.dependent, motion.dependent_velocities, strict=True))
    terms = [differentiate(tree, TIME)]
    for name in motion.system.coordinates:
        terms.append(multiply(differentiate(tree, Symbol(name)), rates.get(name, Velocity(name))))
    for name, f in zip(motion.free, motion.free_accelerations, strict=True):
        terms.append(multiply(differentiate(tree, Velocity(name)), f))
    return add(*terms)


def vanishes(tree: Expression) -> bool:
    """Whether the tree is zero at two points at which it is real."""
    values = []
    with mp.workdps(40):
        for seed in range(1, 40):
            with contextlib.suppress(NoRealValue):
                values.append(abs(evaluate(tree, point_for([tree], seed))))
            if len(values) == 2:
                return all(value < mpf(10) ** -28 for value in values)
    raise AssertionError("no real point was found")


@pytest.mark.slow
@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_volume_with_the_density_is_invariant(name: str) -> None:
    motion = exact(DOCUMENTS[name])
    found = measure_density(motion)
    assert found.status == WITHOUT_MEASURE.get(name, "found")
    if found.status != "found":
        return
    assert found.velocities is not None
    reduced = written(motion)
    rates = dict(zip(reduced.dependent, reduced.dependent_velocities, strict=True))
    terms = [differentiate(found.velocities, TIME)]
    for coordinate in reduced.system.coordinates:
        flux = multiply(found.velocities, rates.get(coordinate, Velocity(coordinate)))
        terms.append(differentiate(flux, Symbol(coordinate)))
    for coordinate, f in zip(reduced.free, reduced.free_accelerations, strict=True):
        terms.append(differentiate(multiply(found.velocities, f), Velocity(coordinate)))
    assert found.velocities != ZERO
    assert vanishes(add(*terms))


@pytest.mark.parametrize(
    ("name", "density"),
    [
        ("nonholonomic-particle", "1/sqrt(x^2 + 1)"),
        ("knife-edge", "cos(phi)"),
        ("vertically-rolling-disk", "1"),
        ("generic-class-one", "1/sqrt(I_a*A(r1)^2 + I_2)"),
    ],
)
def test_the_density_is_the_one_of_the_paper(name: str, density: str) -> None:
    found = measure_density(exact(DOCUMENTS[name])).momenta
    assert found is not None
    assert to_text(found) == density


def test_only_the_balanced_sleigh_has_an_invariant_measure() -> None:
    assert measure_density(exact(EXAMPLES["balanced sleigh"])).status == "found"
    assert measure_density(exact(EXAMPLES["Chaplygin sleigh"])).status == "does_not_exist"


@pytest.mark.slow
@pytest.mark.parametrize("name", DOCUMENTS)
def test_first_integrals_are_constant(name: str) -> None:
    motion = written(exact(DOCUMENTS[name]))
    for integral in first_integrals(motion, motion.system.lagrangian):
        tree = substitute(integral.expression, motion.on_constraints)
        assert vanishes(along(motion, tree))
        moving = any(not vanishes(differentiate(tree, Velocity(free))) for free in motion.free)
        assert moving == (integral.name != "function of position")


@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("vertically-rolling-disk", ["energy", "momentum of phi"]),
        ("nonholonomic-particle", ["energy", "momentum of x"]),
        ("Chaplygin sleigh", ["energy"]),
        ("half integrable", ["energy"]),
        ("skate on a turning table", ["momentum of phi"]),
        ("moving constraint", ["energy"]),
    ],
)
def test_the_energy_and_momenta_come_first(name: str, names: list[str]) -> None:
    motion = written(exact(DOCUMENTS[name]))
    found = [integral.name for integral in first_integrals(motion, motion.system.lagrangian)]
    assert found[: len(names)] == names


def found_in(name: str) -> Integrability:
    motion = exact(DOCUMENTS[name])
    return integrability(motion.geometry, motion.frame)


@pytest.mark.parametrize(
    ("name", "integrable", "growth"),
    [
        ("nonholonomic-particle", 0, (2, 3)),
        ("vertically-rolling-disk", 0, (2, 3, 4)),
        ("generic-class-three", 0, (2, 3, 4, 5)),
        ("rolling ball", 0, (3, 5)),
        ("one wheel", 1, (2,)),
        ("half integrable", 1, (2, 3)),
        ("sphere in velocities", 1, (2,)),
        ("integrating factor", 1, (2,)),
        ("moving constraint", 0, (1, 2)),
    ],
)
def test_holonomic_constraints_are_recognized(name: str, integrable: int, growth: tuple[int, ...]) -> None:
    found = found_in(name)
    assert (found.integrable, found.growth) == (integrable, growth)
    assert found.holonomic == (integrable == found.count)


@pytest.mark.parametrize("name", ["one wheel", "half integrable", "sphere in velocities", "integrating factor"])
def test_the_function_kept_by_integrable_constraints_is_constant(name: str) -> None:
    motion = written(exact(DOCUMENTS[name]))
    (integral,) = found_in(name).integrals
    assert vanishes(along(motion, integral))
    assert any(not vanishes(differentiate(integral, Symbol(q))) for q in motion.system.coordinates)

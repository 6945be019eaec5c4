"""The equations of motion obey d'Alembert's principle and the constraints; bad systems are refused by name."""

from __future__ import annotations

import random
from typing import Any

import pytest
from mpmath import mp, mpf

from inverse_service import catalogue
from inverse_service.algebra.rational_functions import TooLarge
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    TIME,
    Arbitrary,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    substitute,
    subtract,
    walk,
)
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual
from inverse_service.mechanics.nonholonomic.constraint_reading import read_nonholonomic
from inverse_service.mechanics.nonholonomic.geometry import frames, geometry
from inverse_service.mechanics.nonholonomic.motion import EquationsOfMotion, eliminate_multipliers, equations_of_motion
from tests.mechanics.nonholonomic_examples import EXAMPLES

DOCUMENTS = {name: catalogue.document(name) for name in catalogue.names("nonholonomic")} | EXAMPLES


def motion_of(document: dict[str, Any]) -> EquationsOfMotion:
    return equations_of_motion(read_nonholonomic(**document))


def principle(motion: EquationsOfMotion) -> list[Expression]:
    """E_i - lambda_a w^a_i for each i, w^a and dw^a/dt for each a, dependent velocities put in: all are to vanish."""
    system = motion.system
    names = system.coordinates
    left = euler_lagrange_residual(system.lagrangian, names, motion.accelerations)
    table: dict[Expression, Expression] = {
        Velocity(name): rate for name, rate in zip(motion.dependent, motion.dependent_velocities, strict=True)
    }
    trees = []
    for name, residual in zip(names, left, strict=True):
        forces = [
            multiply(factor, differentiate(w, Velocity(name)))
            for factor, w in zip(motion.multipliers, system.constraints, strict=True)
        ]
        trees.append(subtract(residual, add(*forces)))
    for w in system.constraints:
        rates = [multiply(differentiate(w, Symbol(name)), Velocity(name)) for name in names]
        pairs = zip(names, motion.accelerations, strict=True)
        rates += [multiply(differentiate(w, Velocity(name)), f) for name, f in pairs]
        trees += [w, add(*rates, differentiate(w, TIME))]
    return [substitute(tree, table) for tree in trees]


def point_for(trees: list[Expression], seed: int) -> dict[Expression, Any]:
    source = random.Random(seed)
    leaves = {node for tree in trees for node in walk(tree) if isinstance(node, Symbol | Velocity | Arbitrary)}
    return {leaf: mpf(source.randrange(10**6, 10**7)) / 10**7 for leaf in sorted(leaves, key=repr)}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_motion_obeys_d_alembert_and_the_constraints(name: str) -> None:
    motion = motion_of(DOCUMENTS[name])
    trees = principle(motion)
    assert any(any(isinstance(node, Velocity) for node in walk(tree)) for tree in trees)
    with mp.workdps(40):
        for seed in (1, 2):
            point = point_for(trees, seed)
            assert all(abs(evaluate(tree, point)) < mpf(10) ** -30 for tree in trees)


@pytest.mark.parametrize("name", DOCUMENTS)
def test_accelerations_contain_free_velocities_only(name: str) -> None:
    motion = motion_of(DOCUMENTS[name])
    trees = (*motion.accelerations, *motion.dependent_velocities, *motion.multipliers)
    found = {node.coordinate for tree in trees for node in walk(tree) if isinstance(node, Velocity)}
    assert found <= set(motion.free)
    assert sorted((*motion.free, *motion.dependent)) == sorted(motion.system.coordinates)


@pytest.mark.parametrize(
    ("name", "texts"),
    [
        ("vertically-rolling-disk", ["0", "0", "-R*sin(phi)*phi'*theta'", "R*cos(phi)*phi'*theta'"]),
        ("knife-edge", ["0", "-tan(phi)*phi'*x'", "phi'*x'"]),
        ("nonholonomic-particle", ["0", "-x*x'*y'/(x^2 + 1)", "-x'*y'/(x^2 + 1)"]),
    ],
)
def test_results_are_short(name: str, texts: list[str]) -> None:
    assert [to_text(f) for f in motion_of(DOCUMENTS[name]).accelerations] == texts


def test_values_of_parameters_are_put_in_exactly() -> None:
    document = catalogue.document("vertically-rolling-disk") | {"parameters": {"M": 1, "I": None, "J": "1/4", "R": 0.1}}
    system = read_nonholonomic(**document)
    assert system.parameters == ("I",)
    assert to_text(equations_of_motion(system).accelerations[2]) == "-sin(phi)*phi'*theta'/10"


def test_constraints_may_be_one_text_with_equations() -> None:
    document = catalogue.document("vertically-rolling-disk")
    one = read_nonholonomic(**document | {"constraints": "x' = R*cos(phi)*theta'; y' = R*sin(phi)*theta'"})
    assert equations_of_motion(one).accelerations == motion_of(document).accelerations


def test_a_coordinate_that_the_lagrangian_contains_stays_free() -> None:
    document = catalogue.document("inclined-knife-edge") | {"coordinates": ["phi", "y", "x"]}
    assert motion_of(document).free == ("phi", "x")


PLANE = {"coordinates": ["x", "y", "z"], "lagrangian": "(x'^2 + y'^2 + z'^2)/2"}
REFUSALS = {
    "a redundant constraint": ({"constraints": ["z' + x*y'", "2*z' = -2*x*y'"]}, "/constraints/1", "redundant"),
    "a hidden combination": (
        {"constraints": ["x' - y'", "y' - sin(x)^2*z'", "x' - (1 - cos(x)^2)*z'"]}, "/constraints/2", "redundant"
    ),
    "a contradiction": ({"constraints": ["z' + x*y'", "z' = 3 - x*y'"]}, "/constraints/1", "contradicts"),
    "a square of a velocity": ({"constraints": ["z'^2 - x'^2 - y'^2"]}, "/constraints/0", "not linear"),
    "the sign of a velocity": ({"constraints": ["z' = sqrt(x'^2)"]}, "/constraints/0", "not linear"),
    "no velocity": ({"constraints": ["x^2 + y^2 + z^2 - 1"]}, "/constraints/0", "no velocity"),
    "zero": ({"constraints": ["x' - x'"]}, "/constraints/0", "zero identically"),
    "too many": ({"constraints": ["x'", "y'", "z'"]}, "/constraints", "no freedom"),
    "none": ({"constraints": []}, "/constraints", "no constraints"),
    "an acceleration": ({"constraints": ["x'' + y'"]}, "/constraints/0", "acceleration"),
    "an unknown name": ({"constraints": ["x' + q*y'"]}, "/constraints/0", "not declared"),
    "a division by zero": ({"constraints": ["x' + y'/(sin(x)^2 + cos(x)^2 - 1)"]}, "", "divides by zero"),
    "a fourth power": ({"lagrangian": "x'^4 + y'^2 + z'^2", "constraints": ["x'"]}, "/lagrangian", "not quadratic"),
    "no kinetic energy": ({"lagrangian": "x^2", "constraints": ["x'"]}, "/lagrangian", "no velocity"),
    "a velocity without mass": (
        {"lagrangian": "x'^2/2", "constraints": ["z' - x*y'"]}, "/lagrangian", "singular on the constraints"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSALS)
def test_a_bad_system_is_refused_by_name(name: str) -> None:
    change, pointer, word = REFUSALS[name]
    with pytest.raises(InputError) as caught:
        motion_of(PLANE | change)
    assert caught.value.pointer == pointer
    assert word in caught.value.detail
    assert caught.value.detail.rstrip(".").count(". ") == 0


def test_a_thirteenth_coordinate_is_refused_with_the_limit() -> None:
    names = [f"q{k}" for k in range(13)]
    with pytest.raises(LimitError, match="limit is 12"):
        read_nonholonomic(names, "q0'^2", ["q1'"])


def test_a_large_system_is_refused_when_its_time_is_over() -> None:
    names = [f"q{k}" for k in range(8)]
    kinetic = " + ".join(f"exp(sin({names[k - 1]})*{names[k]} + {k})*{names[k]}'^2" for k in range(8))
    mixed = " + ".join(f"(1 + cos({names[k - 1]})^2*{names[k]}^3)*{names[k]}'*{names[k - 2]}'" for k in range(8))
    system = read_nonholonomic(names, f"{kinetic} + {mixed}", ["q0' + sin(q1*q2)*q3' + q4*q5*q6'"])
    parts = geometry(system, time_limit=1.0)
    with pytest.raises(TooLarge):
        eliminate_multipliers(parts, frames(parts)[0])

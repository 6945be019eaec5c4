"""Lagrangians of linear systems with constant damping: eigenvalues as numpy has them, multipliers
that grow with t, and which systems count as linear.
"""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from inverse_service.decision import deciding
from inverse_service.expressions import calculus, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import euler_lagrange
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.search import linear_systems, material as mt
from inverse_service.statements.questions import TIMED


def system_of(**equations: str) -> SecondOrderSystem:
    return read_system([*equations], equations)


def material_of(system: SecondOrderSystem) -> mt.Material:
    return mt.gather_material(deciding.analyze(system), TIMED)


@pytest.mark.parametrize(
    "rows",
    [
        [[0, 1], [1, 0]],
        [[1, 2], [-3, 4]],
        [[2, 1], [0, 2]],
        [[0, 1], [-5, -1]],
        [[1, 0, 2], [0, 3, 0], [2, 0, -1]],
        [[0, 1, 0], [0, 0, 1], [-2, 1, 2]],
        [[0, 1, 0], [0, 0, 1], [5, -3, -1]],
    ],
)
def test_eigenvalues_are_those_of_the_matrix(rows: list[list[int]]) -> None:
    """a and a +- sqrt(d) are roots of the characteristic polynomial; all of them are there."""
    trees = [[ex.number(entry) for entry in row] for row in rows]
    found = list[complex]()
    for a, d in linear_systems.eigenvalues_of(trees):
        mean, spread = (complex(calculus.evaluate(part, {})) for part in (a, d))
        found += [mean] if d == ex.ZERO else [mean + spread**0.5, mean - spread**0.5]
    for value in np.linalg.eigvals(np.array(rows, dtype=float)):
        assert min(abs(value - one) for one in found) < 1e-6
    for one in found:
        assert abs(np.linalg.det(np.array(rows) - one * np.eye(len(rows)))) < 1e-9


@pytest.mark.parametrize(
    "system",
    [
        system_of(x="y'", y="0"),
        system_of(x="y'", y="z'", z="0"),
        system_of(x="-x'", y="x' - y'"),
        system_of(x="y' - x", y="-y"),
        system_of(x="-2*x' - x", y="-y"),
        system_of(
            x="3*x + 2*y' - y", y="0", z="x' + x + 3*y"
        ),  # g [N, Phi] is not symmetric by itself
    ],
    ids=lambda system: str(system.accelerations),
)
def test_each_proposal_is_a_lagrangian_of_the_system(system: SecondOrderSystem) -> None:
    variables = [*system.variables, ex.TIME]
    proposed = [*islice(linear_systems.propose(material_of(system), 1), 4)]
    assert proposed
    for tree in proposed:
        sums = euler_lagrange.euler_lagrange_sums(tree, system.coordinates, system.accelerations)
        assert real_branch.vanish(sums, list(dict.fromkeys(variables)), 1) is True


@pytest.mark.parametrize(
    ("force", "linear"),
    [("-x - 3*y' + t*y", True), ("-x^2", False), ("-x'^2", False), ("x*y", False), ("1/x", False),
     ("sqrt(x)", False), ("t*x'", False), ("t^2*x", True), ("sin(t) - x", True), ("sin(x)", False)],
)  # fmt: skip
def test_what_is_linear(force: str, linear: bool) -> None:
    assert linear_systems.is_linear(material_of(system_of(x=force, y="-y"))) is linear

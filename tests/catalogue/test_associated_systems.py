"""On the constraints every associated system has the accelerations of the nonholonomic motion.

The motion comes from Lagrange and d'Alembert, derived here from Lagrangian and constraints alone:
M q'' = Q(q, v) + a^T lambda and a q'' = -(d/dt a) v, with L = v^T M v / 2 - V and a(q) v = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import pytest
import sympy

from benchmarks.sympy_form import velocity
from inverse_service import catalogue
from tests.catalogue.symbolic import DIGITS, Point, Reader, opaque_atoms, random_point
from tests.generator.numbers import value

ASSOCIATED = [name for name in catalogue.names() if "associated_with" in catalogue.entry(name)]


@dataclass(frozen=True)
class Motion:
    """Mass matrix (n, n), forces Q (n), constraint matrix a (m, n), -(d/dt a) v (m)."""

    mass: sympy.Matrix
    forces: sympy.Matrix
    constraints: sympy.Matrix
    drift: sympy.Matrix


def motion(document: dict[str, Any]) -> Motion:
    reader = Reader(document)
    q = sympy.Matrix([sympy.Symbol(x) for x in reader.coordinates])
    v = sympy.Matrix([velocity(x) for x in reader.coordinates])
    lagrangian = reader(document["lagrangian"])
    momenta = sympy.Matrix([lagrangian.diff(speed) for speed in v])
    forces = sympy.Matrix([lagrangian.diff(x) for x in q]) - momenta.jacobian(q) * v
    left = sympy.Matrix([reader(formula) for formula in document["constraints"]])
    a = left.jacobian(v)
    assert (left - a * v).expand() == sympy.zeros(*left.shape), "linear in the velocities"
    return Motion(momenta.jacobian(v), forces, a, -(left.jacobian(q) * v))


def on_constraints(found: Motion, document: dict[str, Any], point: Point) -> None:
    """Express the last velocities by the others with the constraints."""
    names = document["coordinates"]
    a = numbers(found.constraints, point)
    m, n = a.rows, a.cols
    free = mpmath.matrix([point[velocity(x)] for x in names[: n - m]])
    dependent = mpmath.lu_solve(a[:, n - m :], -(a[:, : n - m] * free))
    point.update({velocity(x): dependent[i] for i, x in enumerate(names[n - m :])})


def numbers(matrix: sympy.Matrix, point: Point) -> mpmath.matrix:
    return mpmath.matrix(
        [[value(matrix[i, j], point) for j in range(matrix.cols)] for i in range(matrix.rows)]
    )


def constrained_accelerations(found: Motion, point: Point) -> mpmath.matrix:
    """q'' of the motion with the multipliers eliminated."""
    n, m = found.mass.rows, found.constraints.rows
    whole = mpmath.zeros(n + m)
    a = numbers(found.constraints, point)
    whole[:n, :n], whole[n:, :n], whole[:n, n:] = numbers(found.mass, point), a, -a.T
    right = mpmath.matrix([*numbers(found.forces, point), *numbers(found.drift, point)])
    return mpmath.lu_solve(whole, right)[:n]


def defect(name: str, seed: int, constrained: bool = True) -> mpmath.mpf:
    """Largest difference of the accelerations at a random point, on the constraints or off them."""
    document = catalogue.document(name)
    original = catalogue.document(catalogue.entry(name)["associated_with"])
    assert document["coordinates"] == original["coordinates"]
    found, reader = motion(original), Reader(original)
    f = [reader(document["equations"][x]) for x in document["coordinates"]]
    expressions = [*f, *found.mass, *found.forces, *found.constraints, *found.drift]
    speeds = {velocity(x) for x in document["coordinates"]}
    point = random_point(opaque_atoms(expressions) | speeds, seed)
    if constrained:
        on_constraints(found, original, point)
    right = constrained_accelerations(found, point)
    return max(abs(value(a, point) - right[i]) for i, a in enumerate(f))


@pytest.mark.parametrize("name", ASSOCIATED)
def test_the_nonholonomic_motion_solves_the_associated_system(name: str) -> None:
    with mpmath.workdps(DIGITS):
        assert max(defect(name, seed) for seed in (1, 2)) < 1e-30


@pytest.mark.parametrize(
    "name", [name for name in ASSOCIATED if name.endswith(("second", "third"))]
)
def test_off_the_constraints_it_is_another_system(name: str) -> None:
    with mpmath.workdps(DIGITS):
        assert defect(name, 1, constrained=False) > 1e-6

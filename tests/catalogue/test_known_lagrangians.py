"""Every Lagrangian that the catalogue lists belongs to its system: residual zero, Hessian regular."""

from __future__ import annotations

from typing import Any

import mpmath
import pytest
import sympy

from benchmarks.sympy_form import velocity
from inverse_service import catalogue
from tests.catalogue.symbolic import DIGITS, Reader, opaque_atoms, random_point, value

TIME = sympy.Symbol("t")
LISTED = [
    (name, number)
    for name in catalogue.names()
    for number in range(len(catalogue.entry(name)["expected"]["lagrangians"]))
]


def euler_lagrange(document: dict[str, Any], formula: str, seed: int) -> tuple[mpmath.mpf, mpmath.mpf, bool]:
    """(relative residual along f, |det of the Hessian|, whether t occurs) at a random point."""
    reader = Reader(document)
    lagrangian = reader(formula)
    q, v = [sympy.Symbol(x) for x in reader.coordinates], [velocity(x) for x in reader.coordinates]
    f = [reader(document["equations"][x]) for x in reader.coordinates]
    momenta = [lagrangian.diff(speed) for speed in v]
    hessian = sympy.Matrix(momenta).jacobian(v)
    drift = [p.diff(TIME) + sum(p.diff(a) * b for a, b in zip(q, v, strict=True)) for p in momenta]
    force = [lagrangian.diff(a) - d for a, d in zip(q, drift, strict=True)]
    point = random_point(opaque_atoms([*hessian, *force, *f, lagrangian]), seed)
    M = mpmath.matrix([[value(hessian[i, j], point) for j in range(len(q))] for i in range(len(q))])
    b = [value(term, point) for term in force]
    left = M * mpmath.matrix([value(a, point) for a in f])
    scale = 1 + max(map(abs, b))
    return max(abs(x - y) for x, y in zip(left, b, strict=True)) / scale, abs(mpmath.det(M)), lagrangian.has(TIME)


@pytest.mark.parametrize(("name", "number"), LISTED)
def test_a_listed_lagrangian_has_the_equations_of_its_system(name: str, number: int) -> None:
    entry = catalogue.entry(name)
    with mpmath.workdps(DIGITS):
        defect, determinant, timed = euler_lagrange(entry["document"], entry["expected"]["lagrangians"][number], 1)
    assert defect < 1e-30
    assert determinant > 1e-12
    assert timed or entry["expected"]["verdict"] == "variational"


def test_the_test_sees_a_wrong_lagrangian() -> None:
    with mpmath.workdps(DIGITS):
        defect, _, _ = euler_lagrange(catalogue.document("sho"), "x'^2/2 - x^2/3", 1)
        _, determinant, _ = euler_lagrange(catalogue.document("isotropic-oscillator-2d"), "(x' + y')^2 - (x + y)^2", 1)
    assert defect > 1e-3
    assert determinant == 0


def test_the_free_lagrangian_printed_in_the_paper_for_the_particle_is_listed() -> None:
    listed = catalogue.entry("nonholonomic-particle-second")["expected"]["lagrangians"]
    reader = Reader(catalogue.document("nonholonomic-particle-second"))
    printed = reader("x'^2/2 + sqrt(1+x^2)/2*(y'^2/x' + z'^2/(x*x'))")
    assert any(sympy.expand(reader(formula) - printed) == 0 for formula in listed)

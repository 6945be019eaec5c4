"""Symmetries and invariant curves of one equation of second order, from textbooks; multipliers."""

from __future__ import annotations

import pytest

from inverse_service.decision import deciding
from inverse_service.expressions import calculus, tree as ex
from inverse_service.expressions.printing import to_text
from inverse_service.field import real_branch
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.search import invariant_curves, material as mt, moving_matrix, two_symmetries
from inverse_service.statements.questions import PLAIN, TIMED

X, V = ex.Symbol("y"), ex.Velocity("y")


def read(equation: str) -> SecondOrderSystem:
    parameters = [name for name in ("a", "r") if name in equation]
    functions = {"f": ["t"]} if "f(t)" in equation else {}
    functions |= {"h": ["t", "y"]} if "h(t" in equation else {}
    return read_system(["y"], {"y": equation}, parameters, functions)


@pytest.mark.parametrize(
    ("equation", "count"),
    [
        ("0", 6),  # affine maps of the plane; all eight are projective
        ("y^3", 2),  # d/dt and t d/dt - y d/dy
        ("exp(y)", 2),  # d/dt and t d/dt - 2 d/dy
        ("t*y", 1),  # y d/dy
        ("6*y^2 + t", 0),  # the first equation of Painleve
        ("(y'^2 + 1)^2/(t*y' - y)", 2),  # rotation and scaling
        ("a*y'^2/y + y*sqrt(y'/y)", 2),  # d/dt and y d/dy
        ("-a*y' - a*t", 2),  # d/dy and d/dt - t d/dy
    ],
)
def test_affine_symmetries_are_as_many_as_in_books(equation: str, count: int) -> None:
    (force,) = read(equation).accelerations
    found = two_symmetries.symmetries(force, X, V)
    assert len(found) == count


# Kamke 6.33 and 6.39 (y = s'/s makes this one linear), 6.167, and one with a power of t y' - y.
CURVES = {
    "-(y+3*f(t))*y' + y^3 - y^2*f(t) - y*(diff(f(t),t)+2*f(t)^2)": ("1", "-1/2"),
    "-(3*y+f(t))*y' - y^3 - y^2*f(t)": ("-3",),
    "(-a*diff(f(t),t)*y^3 - y^4*f(t)^2 - y^2*y'*(a+2)*f(t) + y'^2*(a-1))/(a*y)": ("-(a + 2)",),
    "h(t,y)*(y' - y/t)^r": ("-r",),
    "6*y^2 + t": (),
    "y^3": (),
}


@pytest.mark.parametrize("equation", CURVES)
def test_the_multiplier_of_a_curve_solves_its_equation(equation: str) -> None:
    material = mt.gather_material(deciding.analyze(read(equation)), TIMED)
    (force,) = material.analysis.system.accelerations
    found = list(invariant_curves.curves(material))
    assert [to_text(one.p) for one in found] == [*CURVES[equation]]
    for one in found:
        factor, slopes = V - one.curve, [calculus.differentiate(one.curve, q) for q in (ex.TIME, X)]
        cofactor = (force - slopes[0] - V * slopes[1]) / factor
        rest = one.p * cofactor + one.s * V / X + one.rate + calculus.differentiate(force, V)
        assert real_branch.vanishes(rest)


def assert_lagrangian(tree: ex.Expression, system: SecondOrderSystem) -> None:
    sums = euler_lagrange_sums(tree, system.coordinates, system.accelerations)
    assert real_branch.vanish(sums, deciding.variables_of(system))


@pytest.mark.parametrize(
    "equation", ["a*y'^2/y + y*sqrt(y'/y)", "-y'^2/y - y*exp(-y'/y)", "y'^3/y^2 + y"]
)
def test_a_homogeneous_equation_has_the_lagrangian_of_its_symmetries(equation: str) -> None:
    material = mt.gather_material(deciding.analyze(read(equation)), TIMED)
    (found,) = two_symmetries.propose_homogeneous(material, 1)
    assert_lagrangian(found, material.analysis.system)


ROOT = "sqrt(1 - x'^2 - y'^2)"


@pytest.mark.parametrize(
    ("x", "y"),
    [
        ("x'*y'", "x'^2"),
        (f"{ROOT}*(x*(x'^2 - 1) + y*x'*y')", f"{ROOT}*(y*(y'^2 - 1) + x*x'*y')"),  # of a spring
        ("x*y'^2 - 1/x^2 - 3*y'^2", "-2*x'*y'/x"),  # a Schwarzschild orbit: f, G have no root
    ],
)
def test_a_multiplier_that_moves_gives_its_lagrangian(x: str, y: str) -> None:
    system = read_system(["x", "y"], {"x": x, "y": y}, [], {})
    material = mt.gather_material(deciding.analyze(system), PLAIN)
    (found,) = moving_matrix.propose(material, 1)
    assert_lagrangian(found, system)

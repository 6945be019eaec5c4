"""Symmetries and invariant curves of one equation of second order, from textbooks; multipliers;
norms of the velocities.
"""

from __future__ import annotations

import pytest

from inverse_service.decision import deciding
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.expressions.printing import to_text
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.search import (
    families,
    invariant_curves,
    material as mt,
    moving_matrix,
    one_coordinate,
    plane_sprays,
    two_symmetries,
)
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
    "equation",
    [
        "a*y'^2/y + y*sqrt(y'/y)", "-y'^2/y - y*exp(-y'/y)", "y'^3/y^2 + y", "y/t^2 + y'^2/y",
        "sqrt(y^2 + t^2*y'^2)/t^2", "y/t^2 - 2*y'/t + t*y'^3/y^2",
    ],
)  # fmt: skip
def test_a_homogeneous_equation_has_the_lagrangian_of_its_symmetries(equation: str) -> None:
    material = mt.gather_material(deciding.analyze(read(equation)), TIMED)
    (found,) = two_symmetries.propose_homogeneous(material, 1)
    assert_lagrangian(found, material.analysis.system)


@pytest.mark.parametrize(
    "force", ["y^2", "y'*y/t^2", "y'/t + y/t^3", "y'^2/y + 1/t^2", "t*y'^2/y", "exp(t*y'/y)*y/t"]
)
def test_another_degree_in_y_or_t_is_not_homogeneous(force: str) -> None:
    """f = x phi(v/x) has the degree 1 in (x, v); f = x phi(t v/x)/t^2 also -2 where t counts 1 and
    v -1.
    """
    material = mt.gather_material(deciding.analyze(read(force)), TIMED)
    assert not two_symmetries.is_homogeneous(material)
    assert two_symmetries.propose_homogeneous(material, 1) == []


@pytest.mark.parametrize(
    ("force", "counts"),
    [
        # L = y'^2/2 + 2 a/(y (1 - y')^2), Gerber 1898 on a line
        ("-2*a*(1 - y')*(1 - 3*y')/(y*(12*a + y*(1 - y')^4))", {3}),
        # L = y'^2/2 - a sqrt(1 - y'^2)/y, Phipps 1990 on a line
        ("a*(1 - y'^2)/(y*(a + y*(1 - y'^2)^(3/2)))", {3}),
        # L = (y - a) y'^2/(2 y) - a/y, Weber 1846 on a line
        ("a*(2 - y'^2)/(2*y*(y - a))", {1, 2}),
        ("y'^3 - y", set()),
    ],
)
def test_powers_of_the_factors_of_a_force_are_a_multiplier(force: str, counts: set[int]) -> None:
    """For L = v^2/2 - V(y, v), d2L/dv2 is the denominator of f times powers of other factors."""
    material = mt.gather_material(deciding.analyze(read(force)), PLAIN)
    found = one_coordinate._powers_of_factors(material)
    assert {len(one.moving) for one in found} == counts
    (f,) = material.analysis.system.accelerations
    for one in found:
        rates = [
            e * (V * calculus.differentiate(p, X) + f * calculus.differentiate(p, V)) / p
            for p, e in one.moving
        ]
        assert real_branch.vanishes(ex.add(*rates, calculus.differentiate(f, V)))
        lagrangian = one_coordinate.lagrangian_of_multiplier(material, one)
        assert lagrangian is not None
        assert_lagrangian(lagrangian, material.analysis.system)


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


R = "sqrt(x'^2+y'^2)"
# The equations of a norm times exp(k.q), by SymPy, with the norm squared.
SPRAYS = {
    "exp(2*c*y)*(2*sqrt(x'^2+y'^2) + x')^2": (  # Randers 1941
        f"-c*y'*(2*{R}*y'^2 + 6*x'^3 + 7*x'*y'^2)/(3*x'^2 + 4*y'^2)",
        f"c*(3*{R}*x'^3 + 7*{R}*x'*y'^2 + 6*x'^4 + 2*x'^2*y'^2 - 6*y'^4)/(2*(3*x'^2 + 4*y'^2))",
    ),
    "exp(x + 3*y)*(x'^2 + y'^2)^3/(x'^2*y'^2)": (
        "-x'^2*(x'^4 + 5*x'^2*y'^2 + 18*x'*y'^3 - 2*y'^4)/(2*(2*x'^4 + x'^2*y'^2 + 2*y'^4))",
        "3*y'^2*(2*x'^4 - 2*x'^3*y' - 5*x'^2*y'^2 - y'^4)/(2*(2*x'^4 + x'^2*y'^2 + 2*y'^4))",
    ),
}


@pytest.mark.parametrize("norm", SPRAYS)
def test_forces_of_degree_two_give_the_norm(norm: str) -> None:
    x, y = SPRAYS[norm]
    system = read_system(["x", "y"], {"x": x, "y": y}, ["c"] if "c*" in x else [], {})
    material = mt.gather_material(deciding.analyze(system), PLAIN)
    assert plane_sprays.accepts(material)
    (found,) = plane_sprays.propose(material, 1)
    assert_lagrangian(found, system)


@pytest.mark.parametrize(
    ("x", "y"),
    [
        ("-x'^2*y", "0"),  # holds a coordinate
        ("-x'", "y'^2"),  # another degree
        ("x'*y'", "x'^2 + 5*y'^2"),  # no k
        ("-x'^2*sqrt(x'^2+y'^2)/y'", "-x'*sqrt(x'^2+2*y'^2)"),  # two roots
    ],
)
def test_other_forces_give_none(x: str, y: str) -> None:
    system = read_system(["x", "y"], {"x": x, "y": y}, [], {})
    material = mt.gather_material(deciding.analyze(system), PLAIN)
    assert not (plane_sprays.accepts(material) and [*plane_sprays.propose(material, 1)])


@pytest.mark.parametrize(
    ("force", "factors"),
    [
        ("-3*x' - 2*x/3 - 2*x'^2/x", {"x + 3*x'": "-3/2", "2*x + 3*x'": "-3"}),
        ("-x'^2/x - 3*x' - x", {"x + 2*x'": "-3/2", "x + x'": "-3"}),
    ],
)
def test_a_multiplier_of_another_coordinate_is_one_of_this_one(
    force: str, factors: dict[str, str]
) -> None:
    """y'' = -3 y' - 2 y has (y' + y)^(-3/2) and (y' + 2 y)^(-3); y = x^3 gives the first equation,
    and each multiplier with a power of x. Along each the derivative of log g is -df/dx'."""
    system = read_system(["x"], {"x": force})
    known = mt.gather_material(deciding.analyze(system), PLAIN)
    found = one_coordinate._last_multipliers(known, families.find_factors(known), 1)
    single = {
        to_text(base): to_text(exponent)
        for each in found
        if len(each.moving) == 1
        for base, exponent in each.moving
    }
    assert factors.items() <= single.items()
    x, v, (f,) = ex.Symbol("x"), ex.Velocity("x"), system.accelerations
    for each in found:
        parts = [(tm.monomial_tree(each.factor), ex.ONE), *each.moving]
        rates = [
            exponent * weight * calculus.differentiate(base, letter) / base
            for base, exponent in parts
            for letter, weight in ((x, v), (v, f))
        ]
        whole = ex.add(calculus.differentiate(f, v), *rates)
        assert exact_field.factored([whole], [x, v], exact_field.Budget.short()) == [ex.ZERO]

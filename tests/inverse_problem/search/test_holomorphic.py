"""Complex systems get the parts of complex Lagrangians, and others get nothing."""

from __future__ import annotations

import mpmath
import pytest

from inverse_service.algebra.real_point import find_real_point
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.inverse_problem.decision.analysis import analyze, variables_of
from inverse_service.inverse_problem.search.holomorphic import ComplexTree, NotAnalytic, continued, real_systems
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual, hessian
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse
from tests.inverse_problem.search.given import proposed

NAME = "real and imaginary parts of complex Lagrangians"
HOLOMORPHIC = {
    "the group aff(C)": {"x": "-w'*y'-x'*z'", "y": "w'*x'-y'*z'", "z": "0", "w": "0"},
    "a complex square": {"x": "-x^2+y^2", "y": "-2*x*y"},
    "z'' = -z z'": {"x": "-x*x'+y*y'", "y": "-x*y'-y*x'"},
    "z'' = -exp z, turned": {"x": "-exp(y)*sin(x)", "y": "-exp(y)*cos(x)"},
}
MAGNETIC_DRAG = {
    "unit drag": {"x": "x*y'-x'", "y": "-x*x'-y'"},
    "drag that grows": {"x": "x*y'-y^2*x'", "y": "-x*x'-y^2*y'"},
}


def material_of(equations: dict[str, str]) -> Material:
    return gather(analyze(read_system(list(equations), equations)), False)


def assert_is_lagrangian(system: SecondOrderSystem, tree: Expression) -> None:
    point = find_real_point([tree, *system.accelerations], variables_of(system), 11)
    assert point is not None
    with mpmath.workdps(60):
        for residual in euler_lagrange_residual(tree, system.coordinates, system.accelerations):
            assert abs(evaluate(residual, point)) < mpmath.mpf(10) ** -30
        form = hessian(tree, system.coordinates)
        matrix = mpmath.matrix([[evaluate(entry, point) for entry in row] for row in form])
        assert abs(mpmath.det(matrix)) > mpmath.mpf(10) ** -15


@pytest.mark.parametrize("name", HOLOMORPHIC)
def test_functions_and_squares_of_negatives_are_written_by_their_parity(name: str) -> None:
    texts = [to_text(tree) for tree in proposed(material_of(HOLOMORPHIC[name]), NAME)]
    assert texts
    assert not any(sign in text for text in texts for sign in ("cos(-", "sin(-", "(-w')^2"))


@pytest.mark.parametrize("name", HOLOMORPHIC)
def test_both_parts_of_a_complex_lagrangian_are_lagrangians(name: str) -> None:
    material = material_of(HOLOMORPHIC[name])
    found = proposed(material, NAME)
    assert found
    for tree in found:
        assert_is_lagrangian(material.analysis.system, tree)


@pytest.mark.parametrize("name", MAGNETIC_DRAG)
def test_drag_in_a_magnetic_field_has_a_complex_logarithm(name: str) -> None:
    material = material_of(MAGNETIC_DRAG[name])
    found = proposed(material, "logarithms and arctangents of two velocities")
    assert found
    for tree in found:
        assert_is_lagrangian(material.analysis.system, tree)


@pytest.mark.parametrize("equations", [{"x": "x*y", "y": "x"}, {"x": "x^2+y^2", "y": "0"}])
def test_nothing_is_proposed_for_systems_that_are_not_complex(equations: dict[str, str]) -> None:
    assert not list(real_systems(material_of(equations), 1))
    assert not proposed(material_of(equations), "logarithms and arctangents of two velocities")


@pytest.mark.parametrize(
    "text", ["exp(x)", "log(x)", "sin(x)", "cos(x)", "sinh(x)", "cosh(x)", "x^3", "x^(-2)", "sqrt(x)", "x^(-2/3)"]
)
def test_functions_are_continued_as_complex_arithmetic_does(text: str) -> None:
    tree = parse(text, Names(("x",)))
    z = continued(tree, {Symbol("x"): ComplexTree(Symbol("x"), Symbol("y"))})
    with mpmath.workdps(40):
        a, b = mpmath.mpf(3) / 7, mpmath.mpf(2) / 5
        table: dict[Expression, mpmath.mpf] = {Symbol("x"): a, Symbol("y"): b}
        found = mpmath.mpc(evaluate(z.real, table), evaluate(z.imaginary, table))
        functions = {name: getattr(mpmath, name) for name in ("exp", "log", "sin", "cos", "sinh", "cosh", "sqrt")}
        powers = {"x^3": 3, "x^(-2)": -2, "x^(-2/3)": mpmath.mpf(-2) / 3}
        point = mpmath.mpc(a, b)
        wanted = mpmath.power(point, powers[text]) if text in powers else functions[text.split("(")[0]](point)
        assert abs(found - wanted) < mpmath.mpf(10) ** -35


def test_functions_without_formulas_are_refused() -> None:
    with pytest.raises(NotAnalytic):
        continued(parse("atan(x)", Names(("x",))), {Symbol("x"): ComplexTree(Symbol("x"), Symbol("y"))})

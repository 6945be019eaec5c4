"""Momenta, Hessian, and Euler-Lagrange residual agree with known equations of motion."""

from __future__ import annotations

import pytest

from inverse_service.expressions.tree import ONE, ZERO, Expression, Velocity
from inverse_service.field.real_branch import vanishes
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual, hessian, momenta
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

MOTIONS = {
    "free": ("x'^2/2", ["x"], ["0"]),
    "oscillator": ("m*x'^2/2 - k*x^2/2", ["x"], ["-k*x/m"]),
    "damped": ("exp(k*t)*(x'^2 - x^2)/2", ["x"], ["-k*x' - x"]),
    "drag": ("x'*log(x') - k*x", ["x"], ["-k*x'"]),
    "kepler": ("m*(x'^2 + x^2*y'^2)/2 + k/x", ["x", "y"], ["x*y'^2 - k/(m*x^2)", "-2*x'*y'/x"]),
    "magnetic": ("(x'^2 + y'^2)/2 + k*x*y'", ["x", "y"], ["k*y'", "-k*x'"]),
    "driven": ("x'^2/2 + x*cos(k*t)", ["x"], ["cos(k*t)"]),
    "ratio": ("x'^2/2 + A(x)*y'^2/(2*x')", ["x", "y"], ["0", "-A'(x)*x'*y'/A(x)"]),
}


def read(texts: list[str], names: list[str]) -> list[Expression]:
    return [parse(text, Names(tuple(names), ("m", "k"), {"A": ("x",)})) for text in texts]


@pytest.mark.parametrize("name", MOTIONS)
def test_the_residual_vanishes_along_the_motion(name: str) -> None:
    lagrangian, names, equations = MOTIONS[name]
    residuals = euler_lagrange_residual(read([lagrangian], names)[0], names, read(equations, names))
    assert len(residuals) == len(names)
    assert all(residual == ZERO or vanishes(residual) for residual in residuals)


@pytest.mark.parametrize("name", MOTIONS)
def test_the_residual_of_another_motion_does_not_vanish(name: str) -> None:
    lagrangian, names, equations = MOTIONS[name]
    wrong = read([f"{text} + {names[0]}'" for text in equations], names)
    residuals = euler_lagrange_residual(read([lagrangian], names)[0], names, wrong)
    assert not all(residual == ZERO or vanishes(residual) for residual in residuals)


def test_the_residual_of_polynomials_is_exactly_zero() -> None:
    names = ["x", "y"]
    lagrangian = read(["(x'^2 + y'^2)/2 - x^2*y + k*(x*y' - y*x')/2"], names)[0]
    accelerations = read(["k*y' - 2*x*y", "-k*x' - x^2"], names)
    assert euler_lagrange_residual(lagrangian, names, accelerations) == (ZERO, ZERO)


def test_the_hessian_is_symmetric_and_exact() -> None:
    names = ["x", "y"]
    found = hessian(read(["x'^2/2 + y*x'*y' + y'^3"], names)[0], names)
    assert found == (
        (ONE, read(["y"], names)[0]),
        (read(["y"], names)[0], read(["6*y'"], names)[0]),
    )


def test_momenta_of_a_free_particle_are_its_velocities() -> None:
    names = ["x", "y"]
    assert momenta(read(["(x'^2 + y'^2)/2"], names)[0], names) == (Velocity("x"), Velocity("y"))


def test_no_coordinates_have_no_equations() -> None:
    assert momenta(ONE, []) == ()
    assert hessian(ONE, []) == ()
    assert euler_lagrange_residual(ONE, [], []) == ()


def test_missing_accelerations_are_refused() -> None:
    with pytest.raises(ValueError, match="shorter"):
        euler_lagrange_residual(Velocity("x"), ["x"], [])

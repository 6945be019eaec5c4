"""What a Lagrangian in closed form would give, where one exists and none was found."""

from __future__ import annotations

import pytest
import sympy

from inverse_service.constrained.closed_forms import needed
from inverse_service.expressions.tree import Expression
from inverse_service.mechanics.constrained_motion import (
    EquationsOfMotion,
    equations_of_motion,
    read_nonholonomic,
)
from inverse_service.reading import declarations, names as nm, reader

NAMES = ("x", "y", "z")
SLOPED = "z'-x*y*(x'+y')"


def particle(constraint: str) -> EquationsOfMotion:
    declared = declarations.Declared(list(NAMES), (), {})
    return equations_of_motion(read_nonholonomic(declared, "(x'^2+y'^2+z'^2)/2", [constraint], ""))


def trees(*texts: str) -> list[Expression]:
    return [reader.read_formula(text, nm.Names(NAMES, (), {})) for text in texts]


def test_a_reduced_motion_of_two_coordinates_lacks_one_integral() -> None:
    step = needed(particle(SLOPED), trees("(x'^2+y'^2+z'^2)/2", "x'-y'", "t*(x'-y')-x+y"))
    assert step is not None
    assert "F_1 = (x'^2 + y'^2 + (x*y*(x' + y'))^2)/2 and F_2 = x' - y'" in step.text
    assert "general solution of dy/dx = y'/x'" in step.text


def test_it_is_what_the_two_integrals_leave() -> None:
    """With w = x - y, s = x + y and N^2 = 1 + 2 (x y)^2, w' and N s' are constant, and they alone
    are known of ds/dw = (c/p)/N(s, w): the two integrals are functions of these.
    """
    x, y, u, v = sympy.symbols("x y u v")
    scale = 2 * x**2 * y**2 + 1
    force = -x * y * (u + v) * (x * v + y * u)  # times 1/scale
    speed, twice = u - v, scale * (u + v) ** 2
    for integral in (speed, twice, speed**2 + twice - 2 * (u**2 + v**2 + (x * y * (u + v)) ** 2)):
        rate = u * sympy.diff(integral, x) + v * sympy.diff(integral, y)
        turned = force * (sympy.diff(integral, u) + sympy.diff(integral, v))
        assert sympy.expand(scale * rate + turned) == 0
    assert sympy.expand(speed**2 + twice - 2 * (u**2 + v**2 + (x * y * (u + v)) ** 2)) == 0


@pytest.mark.parametrize(
    "known",
    [
        ["(x'^2+y'^2+z'^2)/2"],
        ["x'-y'", "(x'-y')^2"],
        ["(x'^2+y'^2+z'^2)/2", "x'-y'", "x*x'"],  # a further one is known
    ],
)
def test_nothing_is_said_without_as_many_integrals_as_determine_the_velocities(
    known: list[str],
) -> None:
    assert needed(particle(SLOPED), trees(*known)) is None


def test_integrals_of_other_coordinates_allow_a_form_of_the_coordinates() -> None:
    """The equations of x and y hold z, so that a closed 2-form of x, y, z may take the place of the
    integral.
    """
    step = needed(particle("z'-z*x'"), trees("(x'^2+y'^2+z'^2)/2", "y'"))
    assert step is not None
    assert "closed 2-form of the coordinates" in step.text


def test_a_constraint_that_is_a_rate_leaves_one_function() -> None:
    """The pendulum x x' + y y' + z z' = 0: l + lambda rho' with Gamma(lambda) = dl/drho."""
    step = needed(
        particle("x*x'+y*y'+z*z'"), trees("(x'^2+y'^2+z'^2)/2", "x^2+y^2+z^2", "x*y'-y*x'")
    )
    assert step is not None
    assert step.text.startswith("rho_1 = x^2 + y^2 + z^2 does not change along the motion")


def test_the_function_that_is_left_makes_a_lagrangian() -> None:
    """On a circle of radius rho without a force, lambda = rho phi phi' changes at the rate
    dl/drho = rho phi'^2, and l + lambda rho' has both Euler-Lagrange equations on rho' = 0.
    """
    rho, phi, u, v = sympy.symbols("rho phi rho_1 phi_1")
    lagrangian = rho**2 * v**2 / 2 + rho * phi * v * u
    for q, rate in ((rho, u), (phi, v)):
        momentum = sympy.diff(lagrangian, rate)
        along = sympy.diff(momentum, rho) * u + sympy.diff(momentum, phi) * v
        assert (along - sympy.diff(lagrangian, q)).subs(u, 0) == 0
    assert sympy.hessian(lagrangian, (u, v)).det() == -(rho**2) * phi**2


def test_a_place_that_moves_in_time_is_no_level_set() -> None:
    """x' = 1: x - t is constant, x is not."""
    step = needed(particle("x'-1"), trees("x-t", "y'", "z'"))
    assert step is None or "rho" not in step.text

"""Lagrangians found along the constraints, accepted by three programs: the checker, SymPy, and 40 digits."""

from __future__ import annotations

import random
from typing import Any

import mpmath
import pytest
import sympy

from benchmarks.sympy_form import SympyExpression, to_sympy, velocity
from inverse_service.certificate.checker import check_certificate
from inverse_service.deadline import now
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.constrained import motion_certificate
from inverse_service.inverse_problem.constrained.ansatz import find_lagrangians
from inverse_service.inverse_problem.constrained.existence import analyze_motion
from inverse_service.inverse_problem.constrained.lagrangian import (
    closed_coordinates,
    closed_functions,
    jet_of,
    lagrangian_of_closed,
    own_system,
)
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from tests.inverse_problem.constrained.motions import BLADE, disk, given, heisenberg, knife_edge, motion_of, particle

INCLINED = {
    "coordinates": ["phi", "x", "y"],
    "lagrangian": "m*(x'^2+y'^2)/2+J*phi'^2/2+m*g*x",
    "constraints": BLADE,
    "parameters": ["m", "J", "g"],
}
BALL = {
    "coordinates": ["theta", "phi", "psi", "x", "y"],
    "lagrangian": "(x'^2+y'^2)/2+(theta'^2+phi'^2+psi'^2+2*phi'*psi'*cos(theta))/5",
    "constraints": ["x'-theta'*sin(psi)+phi'*sin(theta)*cos(psi)", "y'+theta'*cos(psi)+phi'*sin(theta)*sin(psi)"],
}
FOUND: dict[str, dict[str, Any]] = {
    "particle": particle("0"),
    "knife edge": knife_edge("0"),
    "Heisenberg": heisenberg("0"),
    "Heisenberg, x^2 + y^2": heisenberg("x^2+y^2"),
    "knife edge on an inclined plane": INCLINED,
    "disk on an incline": disk("-x"),
    "particle, x": particle("x"),
}


def found(document: dict[str, Any]) -> tuple[ConstrainedMotion, Expression]:
    motion = motion_of(document)
    return motion, find_lagrangians(motion, False, 1, float("inf"))[0].expression


def residuals(motion: ConstrainedMotion, lagrangian: Expression) -> list[SympyExpression]:
    """The Euler-Lagrange expressions on the constraints, with the accelerations of the motion, by SymPy."""
    tree = to_sympy(lagrangian)
    on = {velocity(name): to_sympy(w) for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)}
    rates = {sympy.Symbol(name): on.get(velocity(name), velocity(name)) for name in motion.coordinates}
    rates |= {velocity(n): to_sympy(f) for n, f in zip(motion.free, motion.free_accelerations, strict=True)}
    rates |= {velocity(n): sum(sympy.diff(on[velocity(n)], v) * r for v, r in rates.items()) for n in motion.dependent}
    rows = []
    for name in motion.coordinates:
        momentum = sympy.diff(tree, velocity(name))
        rate = sum(sympy.diff(momentum, variable) * r for variable, r in rates.items())
        rows.append((rate - sympy.diff(tree, sympy.Symbol(name))).subs(on))
    return rows


@pytest.mark.parametrize("name", FOUND)
def test_three_programs_accept_what_is_found(name: str) -> None:
    motion, lagrangian = found(FOUND[name])
    certificate = motion_certificate.of_lagrangian(analyze_motion(motion), lagrangian, False)
    assert check_certificate(certificate, seed=1).verdict == "valid"
    rows = residuals(motion, lagrangian)
    assert all(sympy.simplify(row) == 0 for row in rows)
    generator = random.Random(name)
    point = {symbol: mpmath.mpf(generator.uniform(0.5, 1.5)) for row in residual_symbols(motion) for symbol in row}
    with mpmath.workdps(60):
        values = [sympy.lambdify(list(point), row, "mpmath")(*point.values()) for row in rows]
    assert all(abs(value) < mpmath.mpf(10) ** -40 for value in values)


def residual_symbols(motion: ConstrainedMotion) -> list[list[SympyExpression]]:
    names = [*motion.coordinates, *motion.parameters]
    return [[sympy.Symbol(name) for name in names], [velocity(name) for name in motion.free]]


def test_the_inclined_knife_edge_needs_velocities_to_the_power_minus_three() -> None:
    motion, lagrangian = found(INCLINED)
    tree, omega = to_sympy(lagrangian), velocity("phi")
    assert sympy.simplify(tree * omega**3).subs(omega, 0) != 0
    assert len(jet_of(lagrangian, motion).transverse_momenta) == 1


def test_the_own_equations_of_a_lagrangian_have_the_motion_on_the_constraints() -> None:
    motion, lagrangian = found(FOUND["Heisenberg"])
    system = own_system(lagrangian, motion, float("inf"))
    assert system is not None
    on = {velocity(name): to_sympy(w) for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)}
    table = dict(zip(system.coordinates, system.accelerations, strict=True))
    for name, force in zip(motion.free, motion.free_accelerations, strict=True):
        assert sympy.simplify(to_sympy(table[name]).subs(on) - to_sympy(force)) == 0


def test_the_oscillator_with_the_frequency_of_a_turning_blade_has_the_motion_of_a_knife_edge_in_a_bowl() -> None:
    """V = x^2 + y^2: xi = x cos(phi) + y sin(phi) has xi'' = -(2 + phi'^2) xi, so its action is kept; by hand."""
    motion = motion_of(knife_edge("x^2+y^2"))
    names = Names(motion.coordinates, (), {})
    xi, rate = "(x*cos(phi)+y*sin(phi))", "(x'*cos(phi)+y'*sin(phi)+(y*cos(phi)-x*sin(phi))*phi')"
    text = f"phi'^2/2+{rate}^2/(2*sqrt(2+phi'^2))-sqrt(2+phi'^2)*{xi}^2/2+(x'*sin(phi)-y'*cos(phi))^2/2"
    certificate = motion_certificate.of_lagrangian(analyze_motion(motion), read_formula(text, names), False)
    assert check_certificate(certificate, seed=1).verdict == "valid"


def test_a_rolling_ball_is_hamiltonised_by_its_reduced_system() -> None:
    """Its angular velocity is constant: geodesics of the rotations, whatever the prolongation leaves open."""
    motion = motion_of(BALL)
    lagrangian = lagrangian_of_closed(motion, closed_coordinates(motion), False, 1, 60.0)
    assert lagrangian is not None
    certificate = motion_certificate.of_lagrangian(analyze_motion(motion), lagrangian.expression, False)
    assert check_certificate(certificate, seed=1).verdict == "valid"


def test_a_factor_of_the_force_is_a_coordinate_with_an_equation_of_its_own() -> None:
    """xi = x cos(phi) + y sin(phi) of the knife edge in a bowl: xi'' = -(2 + phi'^2) xi, found and carried back."""
    motion = motion_of(knife_edge("x^2+y^2"))
    (closed,) = closed_functions(motion, float("inf"))
    names = Names(("phi", "R_1"), (), {})
    xi = read_formula("x*cos(phi)+y*sin(phi)", Names(motion.coordinates, (), {}))
    assert sympy.simplify(to_sympy(closed.functions["R_1"]) - to_sympy(xi)) == 0
    for force, text in zip(closed.system.accelerations, ("0", "-R_1*(2+phi'^2)"), strict=True):
        assert sympy.expand(to_sympy(force) - to_sympy(read_formula(text, names))) == 0
    lagrangian = lagrangian_of_closed(motion, [closed], False, 1, 60.0)
    assert lagrangian is not None
    certificate = motion_certificate.of_lagrangian(analyze_motion(motion), lagrangian.expression, False)
    assert check_certificate(certificate, seed=1).verdict == "valid"


TRAILER = {
    "coordinates": ["phi", "psi", "x", "y"],
    "lagrangian": "(x'^2+y'^2+phi'^2+psi'^2)/2",
    "constraints": [*BLADE, "psi'-sin(phi-psi)*(x'*cos(phi)+y'*sin(phi))"],
}


def test_a_certificate_names_a_point_at_which_its_lagrangian_is_defined() -> None:
    """That of a trailer has log(psi' - phi'), which the point drawn for the motion alone has no value of."""
    motion = motion_of(TRAILER)
    names = Names(motion.coordinates, (), {})
    text = (
        "(psi'-phi')*log(psi'-phi')-psi'*log(psi')-phi*cos(psi-phi)*(psi'-phi')/(sin(psi-phi)*(2-cos(psi-phi)^2))"
        "+(x'-cos(phi)*psi'/sin(phi-psi))^2/2+(y'-sin(phi)*psi'/sin(phi-psi))^2/2"
    )
    for form in (text, text.replace("log(psi'-phi')", "log(phi'-psi')")):
        certificate = motion_certificate.of_lagrangian(analyze_motion(motion), read_formula(form, names), False)
        assert check_certificate(certificate, seed=1).verdict == "valid"


@pytest.mark.slow
def test_a_trailer_is_hamiltonised() -> None:
    motion = motion_of(TRAILER)
    lagrangian = lagrangian_of_closed(motion, closed_coordinates(motion), False, 1, 60.0)
    assert lagrangian is not None
    certificate = motion_certificate.of_lagrangian(analyze_motion(motion), lagrangian.expression, False)
    assert check_certificate(certificate, seed=1).verdict == "valid"


def test_an_ansatz_holds_the_letters_of_constraints_that_the_accelerations_are_free_of() -> None:
    motion = given({"x": "-x'^2", "y": "0"}, {"z": "x'*exp(x)"})
    assert find_lagrangians(motion, False, 1, float("inf"))


def test_there_is_no_lagrangian_of_a_reduced_system_where_none_reduces_or_none_has_one() -> None:
    for document in (particle("z"), particle("y^2")):
        motion = motion_of(document)
        assert lagrangian_of_closed(motion, closed_coordinates(motion), False, 1, 60.0) is None


@pytest.mark.slow
def test_where_there_is_none_nothing_is_found() -> None:
    assert find_lagrangians(motion_of(particle("x^2")), False, 1, float("inf")) == []


@pytest.mark.parametrize("seconds", [-1.0, 0.0, 0.02, 0.05, 0.1, 0.2])
def test_a_deadline_at_any_moment_raises_nothing(seconds: float) -> None:
    motion = motion_of(particle("x^2"))
    assert find_lagrangians(motion, False, 1, now() + seconds) == []

"""w'' = 0, x'' = w' A x': a regular Lagrangian for every constant A with exponents that are square roots."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search import constant_velocity, reductions
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system
from tests.inverse_problem.search.forty_digits import defects, legendre_defects

NAME = "velocities carried by a constant one"
CARRIED = {
    "one eigenvalue": {"x": "-x'*w'", "w": "0"},
    "a Jordan block": {"x": "u'*(-x'-y')", "y": "u'*(-y'-z')", "z": "u'*(-w'-z')", "w": "-u'*w'", "u": "0"},
    "a nilpotent matrix": {"x": "-s'*y'", "y": "-s'*z'", "z": "0", "s": "0"},
    "complex eigenvalues": {"x": "w'*(2*x'-y')", "y": "w'*(x'+2*y')", "w": "0"},
    "irrational eigenvalues": {"x": "w'*(x'+y')", "y": "w'*(x'-y')", "w": "0"},
    "symbolic entries": {"x": "a*w'*x'+w'*y'", "y": "b*w'*y'", "w": "0"},
    "the carrier between": {"x": "-w'*y'", "w": "0", "y": "3*w'*x'"},
}
WITH_FUNCTIONS = {
    "irrational powers of w": {"x": "w'*y'/w", "y": "2*w'*x'/w", "w": "0"},
    "an exponential of a sine": {"x": "w'*cos(w)*(x'+y')", "y": "w'*cos(w)*(x'-y')", "w": "0"},
    "two functions in one block": {"x": "w'*(w+a/w)*y'", "y": "3*w'*(w+a/w)*x'", "w": "0"},
    "a Jordan block in a logarithm": {"x": "w'*(x'+y')/(1+w)", "y": "w'*y'/(1+w)", "w": "0"},
    "blocks with different functions": {"x": "w'*y'/w", "y": "5*w'*x'/w", "u": "-b*w*w'*u'", "z": "0", "w": "0"},
}
OTHERS = [
    {"x": "-x'*w'", "w": "w'"},
    {"x": "-x'*w'*w", "w": "0"},
    {"x": "-x'*w'/(x+w)", "w": "0"},
    {"x": "w'*y'", "y": "w'*w*x'", "w": "0"},
    {"x": "w'*y'*exp(w^2)", "y": "w'*x'*exp(w^2)", "w": "0"},
    {"x": "-x'^2", "w": "0"},
    {"x": "-w'*x'-x", "w": "0"},
    {"x": "0", "w": "0"},
    {"x": "0"},
]


def material(equations: dict[str, str]) -> Material:
    return gather(analyze(read_system(list(equations), equations, ["a", "b"])), with_time=False)


@pytest.mark.parametrize("name", [*CARRIED, *WITH_FUNCTIONS])
def test_the_lagrangian_and_its_hamiltonian_hold_to_forty_digits(name: str) -> None:
    equations = {**CARRIED, **WITH_FUNCTIONS}[name]
    system = read_system(list(equations), equations, ["a", "b"])
    answer = solve(system, SolveOptions(time_dependent=False)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.lagrangian.family == NAME
    for residual, determinant in defects(system, answer.lagrangian):
        assert residual < 1e-25
        assert determinant > 1e-25
    assert answer.hamiltonian is not None
    assert not answer.hamiltonian.implicit
    assert max(legendre_defects(system, answer.lagrangian, answer.hamiltonian)) < 1e-25


@pytest.mark.parametrize("equations", OTHERS)
def test_other_systems_are_left_to_other_methods(equations: dict[str, str]) -> None:
    assert not constant_velocity.applies(material(equations))


TIMED = {
    "an oscillator": {"w": "0", "x": "-(2+w'^2)*x"},
    "a negative rate": {"w": "0", "x": "(2+w'^2)*x"},
    "two rates, a parameter": {"w": "0", "x": "-(a^2+w'^2)*(x+x*y)", "y": "-(a^2+w'^2)*(y+x^2/2)", "z": "w'*sin(z)"},
    "a free coordinate beside": {"w": "0", "x": "-x^3/(1+w'^2)", "z": "0"},
}
NOT_TIMED = [
    {"w": "0", "x": "-(2+w'^2)*x-x^3"},
    {"w": "0", "x": "-(2+w^2)*x"},
    {"w": "0", "x": "-(2+w'^2)*x*w"},
    {"w": "0", "x": "-(1+w'^2)*x'"},
    {"w": "0", "x": "-(2+w'^2)*y", "y": "-(3+w'^2)*x"},
    {"w": "1", "x": "-(2+w'^2)*x"},
    {"w": "0", "x": "-x"},
]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if "two" in name else name for name in TIMED]
)
def test_forces_times_a_function_of_a_constant_velocity_are_slowed_down_by_its_root(name: str) -> None:
    equations = TIMED[name]
    system = read_system(list(equations), equations, ["a"])
    answer = solve(system, SolveOptions(time_dependent=False, conditions=False)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.lagrangian.family == "forces times a function of a constant velocity"
    for residual, determinant in defects(system, answer.lagrangian):
        assert residual < 1e-25
        assert determinant > 1e-25


@pytest.mark.parametrize("equations", NOT_TIMED)
def test_other_forces_are_left_alone(equations: dict[str, str]) -> None:
    assert reductions.timed(material(equations)) is None

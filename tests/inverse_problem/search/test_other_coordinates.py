"""Systems in other coordinates are brought back to the short ones, and their Lagrangians carried over."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.other_coordinates import shorter, size, suggested, transformed
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system
from tests.generator import disguised, random_system
from tests.inverse_problem.search.forty_digits import defects, legendre_defects, same_value

# x'' = x' x, y'' = 2 y' in (3 X + 4 Y, 3 Y - 4 X), and w'' = 0, s'' = w' s' cos(w)/sin(w) with w = u + 2 s^2.
ROTATED = {
    "X": "(3*(3*X'+4*Y')*(3*X+4*Y) - 8*(3*Y'-4*X'))/25",
    "Y": "(4*(3*X'+4*Y')*(3*X+4*Y) + 6*(3*Y'-4*X'))/25",
}
SHEARED = {
    "u": "-4*s'^2 - 4*s*(u'+4*s*s')*s'*cos(u+2*s^2)/sin(u+2*s^2)",
    "s": "(u'+4*s*s')*s'*cos(u+2*s^2)/sin(u+2*s^2)",
}
# x'' = x x', y'' = 0 with x = r cos(a), y = r sin(a).
POLAR = {
    "r": "r*a'^2 + r*cos(a)^2*(r'*cos(a)-r*sin(a)*a')",
    "a": "-2*r'*a'/r - cos(a)*sin(a)*(r'*cos(a)-r*sin(a)*a')",
}
STRETCHED = {"x": "-x'^2 - 3*exp(2*x)*sqrt(1-exp(2*x)*x'^2)^3"}

SYSTEMS = {"rotation": ROTATED, "shear": SHEARED, "polar": POLAR, "exponential": STRETCHED}
SHORT = {
    "rotation": {"X": "X*X'", "Y": "2*Y'"},
    "shear": {"u": "0", "s": "u'*s'*cos(u)/sin(u)"},
    "polar": {"r": "r*r'", "a": "0"},
    "exponential": {"x": "-3*x^3*sqrt(1-x'^2)^3"},
}


def material(equations: dict[str, str]) -> Material:
    return gather(analyze(read_system(list(equations), equations)), with_time=False)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_the_change_is_seen_in_the_equations_and_makes_them_short(kind: str) -> None:
    given = material(SYSTEMS[kind])
    found = [transformed(given.analysis.system, change) for change in suggested(given) if change.name == kind]
    short = read_system(list(SHORT[kind]), SHORT[kind])
    assert any(one and all(map(same_value, one.accelerations, short.accelerations)) for one in found)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_a_disguised_system_gets_a_lagrangian_and_a_hamiltonian(kind: str) -> None:
    system = read_system(list(SYSTEMS[kind]), SYSTEMS[kind])
    solution = solve(system, SolveOptions())
    answer = solution.autonomous
    assert answer is not None
    assert answer.checked == "valid"
    assert answer.lagrangian is not None
    assert answer.hamiltonian is not None
    assert not answer.hamiltonian.implicit
    assert max(residual for residual, _ in defects(system, answer.lagrangian)) < 1e-25
    assert min(determinant for _, determinant in defects(system, answer.lagrangian)) > 1e-25
    assert max(legendre_defects(system, answer.lagrangian, answer.hamiltonian)) < 1e-25


# Systems of the generator in other coordinates whose right sides are longer in each single form than as given, or
# hold quotients of the new velocities.
LONG = {30: "shear", 84: "polar", 91: "polar", 93: "polar"}


@pytest.mark.parametrize("index", LONG)
def test_long_equations_are_brought_back(index: int) -> None:
    given = disguised(random_system(index, 34), 34)
    whole = gather(analyze(read_system(given.coordinates, given.equations)), given.time_dependent)
    change, system = shorter(whole)[0]
    assert change.name == LONG[index]
    assert 2 * size(system.accelerations) < size(whole.analysis.system.accelerations)


def test_an_angle_outside_sine_and_cosine_is_no_polar_angle() -> None:
    given = material({"r": "r*a'^2", "a": "-2*r'*a'/r - a*sin(a)"})
    assert not [change for change in suggested(given) if change.name == "polar"]


def test_nothing_is_suggested_for_equations_without_sums_and_functions() -> None:
    assert not suggested(material({"x": "-x*x'", "y": "x'*y'"}))


def test_a_potential_that_is_real_elsewhere_than_f_is_checked_where_it_is_real() -> None:
    """f holds 1/y, L log(y): the checker is sent to y > 0."""
    for seed in range(3):
        answer = solve(read_system(["y"], {"y": "-sqrt(1-y'^2)^3/y"}), SolveOptions(time_dependent=False, seed=seed))
        assert answer.autonomous is not None
        assert answer.autonomous.lagrangian is not None

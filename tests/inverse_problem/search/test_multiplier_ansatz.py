"""Multipliers found in the span of kinetic terms satisfy the Helmholtz conditions, all of them are found."""

from __future__ import annotations

import pytest

from inverse_service.algebra.point import evaluate
from inverse_service.expressions.tree import Symbol, Velocity
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.search.ladder import _sampler
from inverse_service.inverse_problem.search.linear_ansatz import LagrangianSpace
from inverse_service.inverse_problem.search.multiplier_ansatz import connection_and_endomorphism, solve_multiplier
from inverse_service.mechanics.conditions import conditions
from tests.inverse_problem.search.given import material, monomial_of

# Equations, kinetic terms, dimension of the space of multipliers in their span (worked out by hand).
CASES = [
    ({"x": "-x", "y": "-y"}, ["x'^2", "y'^2", "x'*y'"], 3),
    ({"x": "-x", "y": "-4*y"}, ["x'^2", "y'^2", "x'*y'"], 2),
    ({"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, ["x'^2", "y'^2", "x'*y'"], 1),
    ({"x": "0", "y": "0"}, ["x'^2", "y'^2", "x'*y'", "x'^3", "y'^2/x'", "x*y'^2"], 5),
    ({"x": "0", "y": "-x*x'*y'/(1+x^2)"}, ["x'^2", "sqrt(1+x^2)*y'^2/x'", "y'^2", "y'^2/x'"], 2),
    ({"x": "-sin(x)*x'^2"}, ["exp(-2*cos(x))*x'^2", "x'^2", "exp(-cos(x))*x'"], 1),
    ({"x": "-x*y'", "y": "x'*y"}, ["x'^2", "y'^2", "x'*y'"], 0),
]


def multipliers(equations: dict[str, str], kinetic: list[str], seed: int = 3) -> LagrangianSpace:
    keys = [monomial_of(text) for text in kinetic]
    return solve_multiplier(_sampler(material(equations), keys), keys, seed)


@pytest.mark.parametrize(("equations", "kinetic", "dimension"), CASES)
def test_the_space_has_its_dimension(equations: dict[str, str], kinetic: list[str], dimension: int) -> None:
    found = multipliers(equations, kinetic)
    # A term that is linear in the velocities has no multiplier, so it solves the conditions by itself.
    useful = [one for one in found.combinations if any(key != monomial_of("exp(-cos(x))*x'") for key in one)]
    assert len(useful) == dimension


@pytest.mark.parametrize(("equations", "kinetic", "dimension"), CASES)
def test_another_prime_and_other_points_find_the_same(
    equations: dict[str, str], kinetic: list[str], dimension: int
) -> None:
    assert multipliers(equations, kinetic, 3).combinations == multipliers(equations, kinetic, 4).combinations


def test_all_constant_multipliers_are_found() -> None:
    """Where g is constant in every solution the decision knows their number."""
    equations = {"x": "-x-2*x*y", "y": "-y-x^2+y^2"}
    decided = decide(material(equations).analysis.system, False)
    assert decided.space is not None
    assert len(multipliers(equations, ["x'^2", "y'^2", "x'*y'"]).combinations) == decided.space.dimensions[0]


@pytest.mark.parametrize("equations", [{"x": "-x*y'^2 + x'*y", "y": "x'^3/y"}, {"x": "-exp(x)*y", "y": "sin(x)*y'^2"}])
def test_connection_and_endomorphism_are_those_of_the_exact_conditions(equations: dict[str, str]) -> None:
    """N = -1/2 df/dv and Phi, the exact trees evaluated at the same point."""
    here = material(equations)
    sampler = _sampler(here, [monomial_of(f"{name}'^2") for name in equations])
    point = sampler.points(5).point(0)
    connection, endomorphism = connection_and_endomorphism(sampler, point)
    exact = conditions(here.analysis.system).Phi
    assert exact is not None
    for i, row in enumerate(exact):
        for j, entry in enumerate(row):
            assert endomorphism[i][j] % point.prime == evaluate(entry, point)
    if "exp(x)" not in equations["x"]:
        x, y = (point.variable(Symbol(name)) for name in "xy")
        v, w = (point.variable(Velocity(name)) for name in "xy")
        half, inverse = pow(2, -1, point.prime), pow(y, -1, point.prime)
        expected = [[-half * y, x * w], [-half * 3 * v * v * inverse, 0]]
        assert connection == [[value % point.prime for value in row] for row in expected]

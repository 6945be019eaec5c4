"""What is added to the terms of an ansatz can cancel their residuals, and nothing else is added."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.search.closure import closed, is_admissible, potentials
from inverse_service.inverse_problem.search.ladder import _sampler
from inverse_service.inverse_problem.search.linear_ansatz import solve_ansatz
from inverse_service.inverse_problem.search.motion_terms import split_velocities
from tests.inverse_problem.search.given import material, monomial_of

# Equations, kinetic terms of a Lagrangian, and a potential or linear term that has to go with them.
CASES = [
    ({"x": "-sin(x)"}, ["x'^2"], "cos(x)"),
    ({"x": "-exp(2*x)"}, ["x'^2"], "exp(2*x)"),
    ({"x": "-1/x^2"}, ["x'^2"], "1/x"),
    ({"x": "-1/x"}, ["x'^2"], "log(x)"),
    ({"x": "-x*y^2", "y": "-y*x^2"}, ["x'^2", "y'^2"], "x^2*y^2"),
    ({"x": "x*y'", "y": "-x*x'"}, ["x'^2", "y'^2"], "x^2*y'"),
    ({"x": "-a*x"}, ["x'^2"], "a*x^2"),
    ({"x": "-A'(x)"}, ["x'^2"], "A(x)"),
]


@pytest.mark.parametrize(("equations", "kinetic", "wanted"), CASES)
def test_the_closure_holds_what_cancels_the_residuals(
    equations: dict[str, str], kinetic: list[str], wanted: str
) -> None:
    here = material(equations)
    terms = closed(here, [monomial_of(text) for text in kinetic], 1, 100)
    assert monomial_of(wanted) in terms
    kept = [key for key in terms if is_admissible(here, key)]
    space = solve_ansatz(_sampler(here, kept), kept, 3)
    assert any(monomial_of(kinetic[0]) in one and monomial_of(wanted) in one for one in space.combinations)


def test_the_seeds_come_first_and_the_bound_is_kept() -> None:
    here = material({"x": "-sin(x)*y*x'^2", "y": "-cos(x)*y^2*x'^2 + x*y"})
    seeds = [monomial_of("x'^2"), monomial_of("y'^2"), monomial_of("x'*y'")]
    for bound in (0, 5, 17):
        terms = closed(here, seeds, 3, bound)
        assert terms[:3] == seeds
        assert len(terms) <= 3 + bound
        assert len(set(terms)) == len(terms)


def test_only_the_shapes_of_the_seeds_and_linear_terms_are_admitted() -> None:
    here = material({"x": "-sin(x)*x'^2", "y": "-x'^2*y"})
    seeds = [monomial_of("x'^2"), monomial_of("y'^2/x'")]
    allowed = [frozenset(), *(split_velocities(monomial_of(text))[1] for text in ("x'^2", "y'^2/x'", "x'", "y'"))]
    assert {split_velocities(key)[1] for key in closed(here, seeds, 3, 200)} <= set(allowed)


def test_potentials_are_read_off_the_forces_with_the_factor_of_the_kinetic_term() -> None:
    """x'' = -sin(y) and y'' = -x cos(y) have the potential x sin(y)."""
    here = material({"x": "-sin(y)", "y": "-x*cos(y)"})
    found = potentials(here, [monomial_of("exp(x')")], 50)
    assert monomial_of("x*sin(y)") in found
    assert monomial_of("x*sin(y)*x'") in found
    assert all(split_velocities(key)[1] in {frozenset(), *map(monomial_of, ("x'", "y'"))} for key in found)


def test_constants_are_no_terms_and_time_only_where_it_is_asked_for() -> None:
    autonomous, timed = material({"x": "-x"}), material({"x": "-x"}, with_time=True)
    assert not is_admissible(autonomous, monomial_of("1"))
    assert not is_admissible(autonomous, monomial_of("exp(t)*x'^2"))
    assert is_admissible(timed, monomial_of("exp(t)*x'^2"))
    assert is_admissible(autonomous, monomial_of("a*x'^2"))

"""The solutions of an ansatz are all Lagrangians in its span, and nothing else."""

from __future__ import annotations

import pytest
import sympy

from benchmarks.sympy_form import to_sympy
from inverse_service.inverse_problem.search.terms import tree_of
from inverse_service.mechanics.reading import read_system
from tests.inverse_problem.search.forty_digits import motion_of, same_value
from tests.inverse_problem.search.given import lagrangians, monomial_of

# Equations, candidates, dimension of the space of Lagrangians that they span (worked out by hand).
CASES = [
    # x'^2 - x^2; x x' and x' are total derivatives
    ({"x": "-x"}, ["x'^2", "x^2", "x*x'", "x'", "x'^3", "x^4"], 3),
    # every function of x'
    ({"x": "0"}, ["x'^2", "x'^3", "1/x'", "x'*log(x')", "x", "x*x'^2"], 4),
    # only the sum of both oscillators' parts, one by one; x'y' - 4xy is none
    ({"x": "-x", "y": "-4*y"}, ["x'^2", "y'^2", "x^2", "y^2", "x'*y'", "x*y"], 2),
    ({"x": "-x", "y": "-y"}, ["x'^2", "y'^2", "x^2", "y^2", "x'*y'", "x*y"], 3),
    # a magnetic field: x y' or y x', which differ by a total derivative
    ({"x": "y'", "y": "-x'"}, ["x'^2", "y'^2", "x*y'", "y*x'", "x'*y'"], 2),
    # the particle of the paper
    ({"x": "0", "y": "-x*x'*y'/(1+x^2)"}, ["x'^2", "sqrt(1+x^2)*y'^2/x'", "y'^2", "y'^2/x'"], 2),
    # an arbitrary function
    ({"x": "-A'(x)/A(x)*x'^2/2"}, ["A(x)*x'^2", "x'^2", "A(x)^2*x'^2"], 1),
    # a parameter
    ({"x": "-a*x"}, ["x'^2", "x^2", "a*x^2", "x'^2/a"], 2),
    # not variational in this span
    ({"x": "-x-x'"}, ["x'^2", "x^2", "x'^4", "x^2*x'^2"], 0),
]


@pytest.mark.parametrize(("equations", "candidates", "dimension"), CASES)
def test_the_space_has_its_dimension(equations: dict[str, str], candidates: list[str], dimension: int) -> None:
    assert len(lagrangians(equations, candidates).combinations) == dimension


@pytest.mark.parametrize(("equations", "candidates", "dimension"), CASES)
def test_each_combination_satisfies_the_euler_lagrange_equations(
    equations: dict[str, str], candidates: list[str], dimension: int
) -> None:
    functions = {"A": ["x"]} if "A" in equations["x"] else {}
    motion = motion_of(read_system(list(equations), equations, ["a"], functions))
    for combination in lagrangians(equations, candidates).combinations:
        lagrangian = to_sympy(tree_of(combination))
        for q, v in zip(motion.q, motion.v, strict=True):
            p = lagrangian.diff(v)
            along = [p.diff(a) * b for a, b in zip((*motion.q, *motion.v), (*motion.v, *motion.f), strict=True)]
            assert same_value(sum(along), lagrangian.diff(q) + sympy.Integer(0))


def test_combinations_are_independent_and_each_has_a_candidate_to_itself() -> None:
    equations, candidates, _ = CASES[3]
    combinations = lagrangians(equations, candidates).combinations
    for k, one in enumerate(combinations):
        others = {key for j, other in enumerate(combinations) if j != k for key in other}
        assert set(one) - others


def test_with_time_the_damped_oscillator_has_a_lagrangian() -> None:
    found = lagrangians({"x": "-x-a*x'"}, ["exp(a*t)*x'^2", "exp(a*t)*x^2", "x'^2", "x^2"], with_time=True)
    (combination,) = found.combinations
    assert set(combination) == {monomial_of("exp(a*t)*x'^2"), monomial_of("exp(a*t)*x^2")}


def test_a_coefficient_that_is_no_small_rational_is_left_out() -> None:
    assert lagrangians({"x": "-sqrt(2)*x"}, ["x'^2", "x^2"]).combinations == ()
    assert len(lagrangians({"x": "-sqrt(2)*x"}, ["x'^2", "sqrt(2)*x^2"]).combinations) == 1

"""Generated systems get a Lagrangian and a Hamiltonian, tested here by numbers that are not the solver's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import mpmath
import pytest

from inverse_service.expressions.tree import Symbol, multiply
from inverse_service.inverse_problem.solutions import Answer, SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from tests.generator import GeneratedSystem, random_systems
from tests.inverse_problem.search.forty_digits import POINTS, defects, legendre_defects

SMALL = mpmath.mpf(10) ** -25
Solved = tuple[GeneratedSystem, SecondOrderSystem, Answer]


def solved(given: GeneratedSystem) -> Solved:
    """The answer to the question that the known Lagrangian answers."""
    system = read_system(given.coordinates, given.equations, name=given.id)
    solution = solve(system, SolveOptions(time_dependent=given.time_dependent))
    answer = solution.with_time if given.time_dependent else solution.autonomous or solution.with_time
    assert answer is not None
    return given, system, answer


@lru_cache
def sample() -> tuple[Solved, ...]:
    return tuple(map(solved, random_systems(20, seed=31)))


def assert_euler_lagrange(systems: Sequence[Solved]) -> None:
    for given, system, answer in systems:
        if answer.lagrangian is None:
            continue
        found = defects(system, answer.lagrangian)
        assert len(found) == POINTS, given.id
        for residual, determinant in found:
            assert residual < SMALL, given.id
            assert determinant > SMALL, given.id


def assert_legendre(systems: Sequence[Solved]) -> None:
    for given, system, answer in systems:
        if answer.lagrangian is not None and answer.hamiltonian is not None:
            found = legendre_defects(system, answer.lagrangian, answer.hamiltonian)
            assert len(found) == POINTS, given.id
            assert max(found) < SMALL, (given.id, found)


def share_without(systems: Sequence[Solved]) -> tuple[float, Counter[str]]:
    """Which part has no closed form, and of which families."""
    missing = Counter(given.family for given, _, answer in systems if answer.lagrangian is None)
    return missing.total() / len(systems), missing


def share_implicit(systems: Sequence[Solved]) -> float:
    """Which part of those with L has no H in closed form."""
    with_lagrangian = [answer for _, _, answer in systems if answer.lagrangian is not None]
    closed = [a for a in with_lagrangian if a.hamiltonian is not None and not a.hamiltonian.implicit]
    return 1 - len(closed) / len(with_lagrangian)


@pytest.mark.slow
def test_all_are_variational_and_nearly_all_have_a_closed_form() -> None:
    assert {answer.verdict for _, _, answer in sample()} == {"variational"}
    share, missing = share_without(sample())
    assert share <= 0.05, missing


def test_each_lagrangian_has_the_equations_of_its_system_and_a_regular_hessian() -> None:
    assert_euler_lagrange(sample())


def test_each_hamiltonian_is_the_energy_in_its_momenta() -> None:
    assert_legendre(sample())


@pytest.mark.slow
def test_forty_systems_of_up_to_four_coordinates() -> None:
    systems = list(map(solved, random_systems(40, seed=35)))
    assert {answer.verdict for _, _, answer in systems} == {"variational"}
    share, missing = share_without(systems)
    assert share <= 0.05, missing
    assert_euler_lagrange(systems)
    assert_legendre(systems)


@pytest.mark.nightly
def test_a_thousand_systems() -> None:
    systems = list(map(solved, random_systems(1000, seed=32)))
    assert {answer.verdict for _, _, answer in systems} == {"variational"}
    share, missing = share_without(systems)
    assert share <= 0.01, missing
    assert_euler_lagrange(systems)
    assert_legendre(systems)
    assert share_implicit(systems) <= 0.1


def test_a_wrong_lagrangian_and_a_wrong_hamiltonian_are_seen() -> None:
    system = read_system(["x", "y"], {"x": "-x*y^2", "y": "-y*x^2"})
    answer = solve(system, SolveOptions(time_dependent=False)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.hamiltonian is not None
    wrong = replace(answer.lagrangian, expression=multiply(Symbol("x"), answer.lagrangian.expression))
    singular = replace(answer.lagrangian, expression=Symbol("x"))
    energy = replace(answer.hamiltonian, expression=answer.lagrangian.expression)
    assert max(residual for residual, _ in defects(system, wrong)) > 1e-3
    assert max(determinant for _, determinant in defects(system, singular)) == 0
    assert max(legendre_defects(system, answer.lagrangian, energy)) > 1e-3

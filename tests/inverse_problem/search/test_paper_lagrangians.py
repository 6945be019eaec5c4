"""The Lagrangians and Hamiltonians of the paper come out of the solver for arbitrary functions A(r1).

Mestdag, Bloch, Fernandez, "Hamiltonization and geometric integration of nonholonomic mechanical
systems" (2009): second associated systems with one, two and three constraints, with
N = (I_2 + sum I_b A_b^2)^(-1/2),

    L1 = I_1 r1'^2/2 + (C_2 r2'^2/r1' + sum C_b s_b'^2/(A_b r1'))/(2 N)
    H1 = (p_1 + N/2 (p_2^2/C_2 + sum A_b p_b^2/C_b))^2/(2 I_1)

and, where N is constant, L2 with r2'^2/2 in place of r2'^2/r1'.
"""

from __future__ import annotations

from functools import lru_cache

import pytest
import sympy

from benchmarks.sympy_form import to_sympy, velocity
from inverse_service import catalogue
from inverse_service.inverse_problem.solutions import Answer, SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from tests.inverse_problem.search.forty_digits import defects, legendre_defects, same_value

COUNTS = {"one": "A", "two": "AB", "three": "ABC"}
R1 = sympy.Symbol("r1")


@lru_cache
def solved(name: str) -> tuple[SecondOrderSystem, Answer]:
    document = catalogue.document(name)
    system = read_system(
        document["coordinates"], document["equations"], document.get("parameters", ()), document.get("functions")
    )
    answer = solve(system, SolveOptions(time_dependent=False)).autonomous
    assert answer is not None
    return system, answer


def generic(count: str) -> tuple[SecondOrderSystem, Answer]:
    return solved(f"generic-class-{count}-second")


def root(functions: str) -> sympy.Expr:
    """1/N."""
    moments = [sympy.Symbol(f"I_{name.lower()}") * sympy.Function(name)(R1) ** 2 for name in functions]
    return sympy.sqrt(sympy.Symbol("I_2") + sum(moments))


def parts_of_first(functions: str) -> list[sympy.Expr]:
    """The terms of L1, each of which has a constant of its own."""
    rate = velocity("r1")
    sliding = [velocity(f"s_{name.lower()}" if len(functions) > 1 else "s") for name in functions]
    ratios = [s**2 / sympy.Function(name)(R1) for name, s in zip(functions, sliding, strict=True)]
    return [rate**2 / 2, *(root(functions) * w / (2 * rate) for w in (velocity("r2") ** 2, *ratios))]


@pytest.mark.parametrize("count", COUNTS)
def test_the_first_lagrangian_is_found_for_arbitrary_functions(count: str) -> None:
    _, answer = generic(count)
    assert answer.checked == "valid"
    assert answer.lagrangian is not None
    assert same_value(answer.lagrangian.expression, sum(parts_of_first(COUNTS[count])))


@pytest.mark.parametrize("count", COUNTS)
def test_the_first_lagrangian_and_hamiltonian_hold_to_forty_digits(count: str) -> None:
    system, answer = generic(count)
    assert answer.lagrangian is not None
    assert answer.hamiltonian is not None
    for residual, determinant in defects(system, answer.lagrangian):
        assert residual < 1e-30
        assert determinant > 1e-12
    assert not answer.hamiltonian.implicit
    assert max(legendre_defects(system, answer.lagrangian, answer.hamiltonian)) < 1e-30


@pytest.mark.parametrize("count", COUNTS)
def test_the_first_hamiltonian_is_that_of_the_paper(count: str) -> None:
    _, answer = generic(count)
    assert answer.hamiltonian is not None
    p1, p2, *sliding = (sympy.Symbol(symbol.name) for symbol in answer.hamiltonian.symbols)
    functions = COUNTS[count]
    squares = [sympy.Function(name)(R1) * p**2 for name, p in zip(functions, sliding, strict=True)]
    expected = (p1 + (p2**2 + sum(squares)) / root(functions) / 2) ** 2 / 2
    assert same_value(answer.hamiltonian.expression, expected)


@pytest.mark.parametrize("count", COUNTS)
def test_each_term_has_a_constant_of_its_own(count: str) -> None:
    """The explanation shows L as a sum of C_k times terms; they are the terms of the paper."""
    _, answer = generic(count)
    formulas = [step.latex for step in answer.explanation if "C_{1}" in step.latex]
    assert len(formulas) == 1
    assert all(f"C_{{{k}}}" in formulas[0] for k in range(1, len(COUNTS[count]) + 3))
    assert f"C_{{{len(COUNTS[count]) + 3}}}" not in formulas[0]


@pytest.mark.parametrize("count", COUNTS)
def test_the_constants_are_free(count: str) -> None:
    """Other weights of the terms, as the solver's own Lagrangian is tested: a Lagrangian again."""
    system, answer = generic(count)
    assert answer.lagrangian is not None
    parts = parts_of_first(COUNTS[count])
    weighted = sum((k + 2) * part for k, part in enumerate(parts))
    assert max(residual for residual, _ in defects(system, answer.lagrangian, weighted)) < 1e-30


def disk_parts() -> tuple[sympy.Expr, sympy.Expr, sympy.Expr]:
    """(phi'^2/2, theta'^2/2, the rest) of L2 for the vertically rolling disk, where N is constant."""
    phi, rate, theta, x, y = sympy.Symbol("phi"), *map(velocity, ("phi", "theta", "x", "y"))
    return rate**2 / 2, theta**2 / 2, (x**2 / sympy.cos(phi) + y**2 / sympy.sin(phi)) / (2 * rate)


def test_the_second_lagrangian_is_found_for_the_disk() -> None:
    _, answer = solved("vertically-rolling-disk-second")
    assert answer.lagrangian is not None
    every = (answer.lagrangian, *answer.other_lagrangians)
    assert any(same_value(one.expression, sum(disk_parts())) for one in every)


def test_the_second_hamiltonian_is_that_of_the_paper() -> None:
    _, answer = solved("vertically-rolling-disk-second")
    assert answer.lagrangian is not None
    assert answer.hamiltonian is not None
    assert same_value(answer.lagrangian.expression, sum(disk_parts()))
    p1, p2, p3, p4 = (sympy.Symbol(symbol.name) for symbol in answer.hamiltonian.symbols)
    phi = sympy.Symbol("phi")
    expected = p2**2 / 2 + (p1 + (sympy.cos(phi) * p3**2 + sympy.sin(phi) * p4**2) / 2) ** 2 / 2
    assert same_value(answer.hamiltonian.expression, expected)


def test_the_value_comparison_sees_a_difference() -> None:
    assert not same_value(to_sympy(generic("one")[1].lagrangian.expression), parts_of_first("A")[0])  # type: ignore[union-attr]

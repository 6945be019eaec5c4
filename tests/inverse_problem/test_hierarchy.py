"""Which algebraic conditions suffice, on systems whose verdict is known."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from inverse_service.algebra.exact_ring import sum_of
from inverse_service.algebra.rational_functions import Budget, Quotient
from inverse_service.catalogue import document, entry, names
from inverse_service.errors import IrreducibleAtoms
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.explanation.hierarchy import (
    ConditionName,
    all_singular,
    equation_terms,
    hierarchy,
    kernel,
    local_motion,
    smallest_sufficient_set,
    tensors_at,
    unique_direction,
    unknowns,
)
from inverse_service.mechanics.conditions import (
    MotionInRing,
    connection,
    curvature,
    jacobi_endomorphism,
    motion_in_ring,
    nabla_of_curvature,
)
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

P = 2**31 - 1


def system(equations: dict[str, str]) -> SecondOrderSystem:
    return read_system(list(equations), equations)


def catalogue_system(name: str) -> SecondOrderSystem:
    found = document(name)
    parameters = list(found.get("parameters", []))
    return read_system(found["coordinates"], found["equations"], parameters, found.get("functions", {}))


def chosen_names(name: str) -> list[str] | None:
    found = smallest_sufficient_set(analyze(catalogue_system(name)))
    return None if found is None else [condition.name for condition in found.conditions]


def small_systems(verdict: str, largest: int) -> list[str]:
    return [
        name
        for name in names()
        if entry(name)["expected"]["verdict"] == verdict and len(document(name)["coordinates"]) <= largest
    ]


# What the algebraic conditions let through: two that only differential consequences refuse, and two
# that have a Lagrangian with time, to which the algebraic conditions are the same.
UNDECIDED = {
    "iiia-differential-obstruction-1",
    "iiia-differential-obstruction-3",
    "damped-henon-heiles",
    "damped-double-pendulum",
}


@pytest.mark.parametrize("name", small_systems("not_variational", 3))
def test_the_hierarchy_decides_every_negative_system_of_up_to_three_coordinates_but_four(name: str) -> None:
    assert (chosen_names(name) is None) == (name in UNDECIDED)


@pytest.mark.parametrize("name", ["lie-a4-7", "lie-a4-9-b-1", "lie-a5-37", "lie-a5-20-a-1", "vertical-disk-first"])
def test_the_hierarchy_decides_larger_negative_systems(name: str) -> None:
    assert chosen_names(name) is not None


def test_no_variational_system_of_up_to_three_coordinates_is_refused() -> None:
    for name in small_systems("variational", 3):
        assert smallest_sufficient_set(analyze(catalogue_system(name)), depth=2) is None, name


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("douglas-iiib", ["Phi", "nabla Phi"]),
        ("two-masses-quadratic-damper", ["Phi", "nabla Phi", "nabla^2 Phi"]),
        ("lie-a4-9-b-1", ["R"]),
        ("lie-a4-7", ["Phi", "R"]),
    ],
)
def test_the_smallest_set_is_named(name: str, expected: list[str]) -> None:
    assert chosen_names(name) == expected


@pytest.mark.parametrize("name", ["knife-edge-first", "lie-a4-7", "three-d-4"])
def test_no_equation_of_the_set_can_be_left_out(name: str) -> None:
    analysis = analyze(catalogue_system(name))
    found = smallest_sufficient_set(analysis)
    assert found is not None
    depth = max(condition.order for condition in found.conditions) - 2
    table = tensors_at(local_motion(analysis, 7, depth + 2), depth)
    assert all_singular(table.kernel(found.equations), table.size, table.prime)
    for left_out in found.equations:
        rest = [name for name in found.equations if name != left_out]
        assert not all_singular(table.kernel(rest), table.size, table.prime)


def test_one_coordinate_has_no_algebraic_condition() -> None:
    analysis = analyze(system({"x": "-x^3 - x'"}))
    assert tensors_at(local_motion(analysis, 1, 4), 2).rows == {}
    assert smallest_sufficient_set(analysis) is None


def test_free_motion_leaves_every_g() -> None:
    table = tensors_at(local_motion(analyze(system({"x": "0", "y": "0", "z": "0"})), 1, 4), 2)
    assert len(table.kernel(list(table.rows))) == len(unknowns(3)) == 6


def test_the_values_do_not_depend_on_how_atoms_are_written() -> None:
    # sin 2u taken as independent of sin u and cos u would refuse this pendulum on a sphere.
    written = system({"a": "sin(2a)*b'^2/2 - sin(a)", "b": "-2*a'*b'*cot(a)"})
    assert smallest_sufficient_set(analyze(written), depth=2) is None


def test_a_denominator_that_is_identically_zero_is_refused() -> None:
    with pytest.raises(IrreducibleAtoms):
        local_motion(analyze(system({"x": "y'/(sin(2x) - 2*sin(x)*cos(x))", "y": "0"})), 1, 2)


def test_the_determinant_test_knows_spaces_of_singular_matrices() -> None:
    # All matrices (0 a; a b) with a = 0, and (a b; b c) with one row and column only.
    assert all_singular([(0, 0, 1)], 2, P)
    assert not all_singular([(0, 1, 0), (0, 0, 1)], 2, P)
    assert all_singular([], 2, P)


def test_the_kernel_is_orthogonal_to_the_rows() -> None:
    rows = [(1, 2, 3), (2, 4, 7)]
    basis = kernel(rows, 3, P)
    assert len(basis) == 1
    assert all(sum(a * b for a, b in zip(row, basis[0], strict=True)) % P == 0 for row in rows)


def test_the_unique_direction_of_a_natural_system_is_found() -> None:
    found = unique_direction(analyze(catalogue_system("henon-heiles")), seed=1)
    assert found is not None
    assert [condition.name for condition in found.conditions] == ["Phi", "nabla Phi"]


WITH_LAGRANGIAN = [
    name
    for name in names()
    if len(document(name)["coordinates"]) in (2, 3, 4) and entry(name)["expected"]["lagrangians"]
]


def with_multiplier(name: str, orders: int) -> tuple[MotionInRing, list[list[Quotient]]]:
    """The motion, and the velocity Hessian of the first Lagrangian listed in the catalogue."""
    given = catalogue_system(name)
    functions = dict(given.functions)
    parameters = tuple(document(name).get("parameters", ()))
    tree = parse(entry(name)["expected"]["lagrangians"][0], Names(given.coordinates, parameters, functions))
    exact = motion_in_ring(given, orders, Budget(), trees=[tree])
    value = exact.ring.value(tree)
    by = exact.motion.by_velocity
    return exact, [[by_j(by_i(value)) for by_j in by] for by_i in by]


def residuals(exact: MotionInRing, g: Sequence[Sequence[Quotient]], depth: int) -> dict[str, list[Quotient]]:
    """Every equation of the hierarchy with the entries of g put in."""
    found: dict[str, list[Quotient]] = {}
    for condition, tensor in hierarchy(exact.motion, depth).items():
        for terms in equation_terms(condition, tensor, exact.motion.size).values():
            values = [coefficient.scaled(sign) * g[i][j] for (i, j), sign, coefficient in terms]
            found.setdefault(condition.name, []).append(sum_of(exact.motion.zero, values))
    return found


@pytest.mark.parametrize("name", WITH_LAGRANGIAN)
def test_the_hessian_of_a_known_lagrangian_fulfils_the_whole_hierarchy(name: str) -> None:
    exact, g = with_multiplier(name, 5)
    found = residuals(exact, g, 2)
    assert {name for name, values in found.items() if not all(value.is_zero for value in values)} == set()


def test_nabla_r_with_the_other_sign_of_n_refuses_a_known_multiplier() -> None:
    exact, g = with_multiplier("vertical-disk-fernandez-bloch-lv", 5)
    motion = exact.motion
    n = connection(motion)
    opposite = tuple(tuple(-entry for entry in row) for row in n)
    bend = curvature(motion, jacobi_endomorphism(motion))
    for sign, holds in ((n, True), (opposite, False)):
        tensor = nabla_of_curvature(motion, sign, bend)
        terms = equation_terms(ConditionName("nabla R", 4, True), tensor, 4)
        parts = [[c.scaled(s) * g[i][j] for (i, j), s, c in equation] for equation in terms.values()]
        assert any(not part.is_zero for equation in parts for part in equation)
        assert all(sum_of(motion.zero, equation).is_zero for equation in parts) == holds

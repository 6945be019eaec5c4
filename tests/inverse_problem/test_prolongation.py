"""The rows of the prolonged Helmholtz system against the Helmholtz conditions of a known multiplier."""

from __future__ import annotations

import functools
import itertools
import math
import random
from typing import cast

import numpy as np
import pytest
from flint import nmod_mat

from inverse_service.decision.deciding import LocalSystem, RowName, equations, local_system
from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.field import point as ps
from inverse_service.field.echelon import Echelon, Flags, SparseRows
from inverse_service.field.modular import safe_prime
from inverse_service.field.point import Expansion, Point, Series, SeriesRing
from inverse_service.linear_pde import equations as room
from inverse_service.linear_pde.equations import Prolongation, advance, count_of_degree, start, unknown_names
from inverse_service.mechanics.reading import read_system

P = safe_prime(6)


def local_of(equations_of: dict[str, str], order: int, with_time: bool) -> LocalSystem:
    system = read_system(list(equations_of), equations_of)
    velocities = [Velocity(name) for name in system.coordinates]
    positions = [Symbol(name) for name in system.coordinates]
    variables = [*([TIME] if with_time else []), *positions, *velocities]
    expansion = Expansion(Point(P, 5), variables, order + 2)
    speeds, forces = ([expansion.expand(tree) for tree in trees] for trees in (velocities, system.accelerations))
    return local_system(expansion.ring, speeds, forces)


def prolongation_of(equations_of: dict[str, str], order: int, with_time: bool = False) -> Prolongation:
    prolongation = start(equations(local_of(equations_of, order, with_time)))
    for _ in range(order + 1):
        advance(prolongation)
    return prolongation


def random_lagrangian(ring: SeriesRing, prolongation: Prolongation, seed: int) -> tuple[Series, list[int]]:
    """A series with v-degree >= 2 in each term, and its coefficients in the order of the unknowns."""
    generator = random.Random(seed)
    total, values = ring.constant(0), []
    for degree in range(prolongation.order + 1):
        for _, exponents in unknown_names(prolongation.unknowns, degree):
            values.append(generator.randrange(P))
            term = ring.constant(values[-1])
            for index, e in enumerate(exponents):
                for _ in range(e):
                    term = ps.multiply(term, ring.variable(index, 0))
            total = ps.add(total, term)
    return total, values


def matrix_product(left: list[list[Series]], right: list[list[Series]]) -> list[list[Series]]:
    def entry(row: list[Series], column: tuple[Series, ...]) -> Series:
        return functools.reduce(ps.add, map(ps.multiply, row, column))

    return [[entry(row, column) for column in zip(*right, strict=True)] for row in left]


def helmholtz(local: LocalSystem, g: list[list[Series]], kind: str, i: int, j: int) -> Series:
    """Gamma(g_ij) - (g N)_ij - (g N)_ji, or (g Phi)_ij - (g Phi)_ji, as truncated series."""
    length, n = len(g[0][0]), local.dimension
    if kind == "H3":
        endomorphism = [[entry[:length] for entry in row] for row in local.endomorphism]
        product = matrix_product(g, endomorphism)
        return ps.subtract(product[i][j], product[j][i])
    total = ps.scale(g[0][0][:-1], 0)
    for a, component in enumerate(local.field):
        total = ps.add(total, ps.multiply(component[: length - 1], ps.derivative(g[i][j], a)))
    connection = [[local.connection[k][m][: length - 1] for m in range(n)] for k in range(n)]
    product = matrix_product([[entry[:-1] for entry in row] for row in g], connection)
    return ps.subtract(ps.subtract(total, product[i][j]), product[j][i])


CASES = [
    ({"x": "-x^3+x*x'"}, False),
    ({"x": "y*x'^2-x", "y": "x*y'+x^2"}, False),
    ({"x": "t*x'-x^2", "y": "t*y"}, True),
    ({"x": "y'*z", "y": "x'*z'", "z": "x*y"}, False),
]


@pytest.mark.parametrize(("system", "with_time"), CASES)
def test_rows_are_the_taylor_coefficients_of_the_helmholtz_conditions(
    system: dict[str, str], with_time: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    order, recorded, insert = 2, list[list[tuple[int, int]]](), Echelon.insert

    def record(echelon: Echelon, rows: SparseRows, expected: Flags, in_order: bool) -> Flags:
        pairs = list(zip(rows.columns.tolist(), rows.values.tolist(), strict=True))
        recorded.extend(pairs[a:b] for a, b in itertools.pairwise(rows.starts[: len(expected) + 1].tolist()))
        return insert(echelon, rows, expected, in_order)

    monkeypatch.setattr(Echelon, "insert", record)
    prolongation = prolongation_of(system, order, with_time)
    local = local_of(system, order, with_time)
    n, first = local.dimension, prolongation.size - local.dimension
    ring = SeriesRing(P, local.ring.size, order + 2)
    lagrangian, values = random_lagrangian(ring, prolongation, 1)
    g = [[ps.derivative(ps.derivative(lagrangian, first + i), first + j) for j in range(n)] for i in range(n)]
    names = [(block.kind, i, j) for block in equations(local).equations for i, j in block.indices]
    residues = {name: ps.terms(helmholtz(local, g, *name)) for name in names}
    assert len(recorded) == prolongation.echelon.inserted
    for number, row in enumerate(recorded):
        *name, alpha = prolongation.row_name(number)
        assert sum(values[column] * x for column, x in row) % P == residues[tuple(name)].get(alpha, 0)


def satisfied(prolongation: Prolongation, terms: dict[tuple[int, ...], int]) -> bool:
    """Whether a Lagrangian, given by its Taylor coefficients, solves all rows."""
    degrees = range(prolongation.order + 1)
    names = [exponents for degree in degrees for _, exponents in unknown_names(prolongation.unknowns, degree)]
    values = [terms.get(exponents, 0) for exponents in names]
    rows = prolongation.echelon.rows_within(0, prolongation.echelon.width).values()
    return all(sum(values[c] * x for c, x in row.items()) % P == 0 for row in rows)


def lagrangian_terms(text: str, names: list[str], order: int) -> dict[tuple[int, ...], int]:
    """Taylor coefficients of a Lagrangian about the point used by `prolongation_of`."""
    tree = read_system(names, {name: text if name == names[0] else "0" for name in names}).accelerations[0]
    variables = [*map(Symbol, names), *map(Velocity, names)]
    return dict(ps.terms(Expansion(Point(P, 5), variables, order).expand(tree)))


KNOWN = [
    ({"x": "-x^3"}, "x'^2/2", True),
    ({"x": "-x'^2/x"}, "x^2*x'^2/2", True),
    ({"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, "x'^2+y'^2", True),
    ({"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, "x'^2-y'^2", False),
    ({"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, "x'^2+2*y'^2", False),
    ({"x": "0", "y": "0"}, "x'^3*y'+y'^4/x'", True),
    ({"x": "-x", "y": "-y"}, "x'*y'", True),
    ({"x": "x*y'^2", "y": "-2*x'*y'/x"}, "x'^2+x^2*y'^2", True),
    ({"x": "x*y'^2", "y": "-2*x'*y'/x"}, "x'^2+y'^2", False),
]


@pytest.mark.parametrize(("system", "lagrangian", "expected"), KNOWN)
def test_hessians_of_lagrangians_solve_all_rows_and_others_do_not(
    system: dict[str, str], lagrangian: str, expected: bool
) -> None:
    prolongation = prolongation_of(system, 3)
    assert satisfied(prolongation, lagrangian_terms(lagrangian, list(system), 5)) == expected


@pytest.mark.parametrize(("n", "with_time"), [(1, False), (2, False), (2, True), (3, False)])
def test_unknowns_are_the_monomials_of_velocity_degree_two_and_more(n: int, with_time: bool) -> None:
    names = ["x", "y", "z"][:n]
    prolongation = prolongation_of(dict.fromkeys(names, "0"), 2, with_time)
    size = 2 * n + with_time
    for degree in range(3):
        block = np.array([exponents for _, exponents in unknown_names(prolongation.unknowns, degree)])
        positions, total = size - n, degree + 2
        below = sum(math.comb(n - 1 + v, v) * math.comb(positions - 1 + total - v, total - v) for v in (0, 1))
        assert len(block) == math.comb(size - 1 + total, total) - below
        assert (block[:, size - n :].sum(axis=1) >= 2).all()
    assert prolongation.width(2) == sum(count_of_degree(prolongation.unknowns, d) for d in range(3))
    assert prolongation.width(0) == n * (n + 1) // 2


@pytest.mark.parametrize(("n", "with_time"), [(1, False), (2, False), (2, True), (3, False)])
def test_every_row_has_its_own_name_of_the_right_degree(n: int, with_time: bool) -> None:
    names, order = ["x", "y", "z"][:n], 2
    prolongation = prolongation_of(dict.fromkeys(names, "x"), order, with_time)
    found = [prolongation.row_name(number) for number in range(prolongation.echelon.inserted)]
    size = 2 * n + with_time
    below = [math.comb(size + d, d) for d in (order - 1, order)]
    assert len(set(found)) == len(found) == n * (n + 1) // 2 * below[0] + n * (n - 1) // 2 * below[1]
    for kind, i, j, alpha in cast(list[RowName], found):
        assert len(alpha) == size
        assert sum(alpha) <= (order - 1 if kind == "H2" else order)
        assert i <= j if kind == "H2" else i < j
    with pytest.raises(IndexError):
        prolongation.row_name(len(found))


def test_dimensions_fall_with_the_order_and_rise_with_the_degree() -> None:
    system = {"x": "y*x'^2-x", "y": "x*y'+x^2"}
    tables = [prolongation_of(system, order) for order in (1, 2, 3)]
    for low, high in itertools.pairwise(tables):
        assert all(low.dimension(d) >= high.dimension(d) for d in range(low.order + 1))
    assert all(tables[2].dimension(d) <= tables[2].dimension(d + 1) for d in range(3))


def reduced(echelon: Echelon, width: int) -> list[int]:
    """The unique reduced form of the consequences on the first `width` columns."""
    rows = list(echelon.rows_within(0, width).values())
    matrix = nmod_mat(len(rows), width, echelon.prime)
    for i, row in enumerate(rows):
        for column, value in row.items():
            matrix[i, column] = value
    return [int(x) for x in matrix.rref()[0].entries()]


@pytest.mark.slow
@pytest.mark.parametrize(("equations_of", "with_time"), CASES)
def test_rows_foreseen_to_depend_on_others_change_nothing(
    equations_of: dict[str, str], with_time: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The consequences are the same, and as many rows depend on others."""
    foreseen = prolongation_of(equations_of, 4, with_time)
    expected = room._expected
    monkeypatch.setattr(room, "_expected", lambda *given: np.zeros_like(expected(*given)))
    plain = prolongation_of(equations_of, 4, with_time)
    counts = [{k: int(v.sum()) for k, v in found.dependent.items()} for found in (foreseen, plain)]
    assert counts[0] == counts[1]
    width = plain.width(4)
    assert reduced(foreseen.echelon, width) == reduced(plain.echelon, width)


def test_the_cases_have_rows_that_depend_on_others() -> None:
    found = [prolongation_of(equations_of, 4, with_time).dependent for equations_of, with_time in CASES]
    assert sum(any(flags.any() for flags in dependent.values()) for dependent in found) >= 3

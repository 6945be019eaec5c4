"""The rows of the prolonged Helmholtz system agree with the Helmholtz conditions of a known
multiplier.
"""

from __future__ import annotations

import itertools
import math
import random
from typing import cast

import numpy as np
import pytest
from flint import nmod_mat, nmod_mpoly, nmod_mpoly_ctx

from inverse_service.decision.deciding import HelmholtzAt, RowName, analyze
from inverse_service.expressions.tree import (
    TIME,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
)
from inverse_service.field.dense_series import SeriesProgram, constants_at, exponents_of_degree, run
from inverse_service.field.echelon import Echelon, Flags, SparseRows
from inverse_service.field.modular import Point, safe_prime
from inverse_service.linear_pde import equations as room
from inverse_service.linear_pde.equations import (
    Prolongation,
    advance,
    count_of_degree,
    start,
    unknown_names,
)
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import narrowest

P = safe_prime(6)


def card_of(equations_of: dict[str, str], with_time: bool) -> HelmholtzAt:
    system = read_system(list(equations_of), equations_of)
    return HelmholtzAt(analyze(system), narrowest(with_time), draw=lambda _: Point(P, 5))


def prolongation_of(
    equations_of: dict[str, str], order: int, with_time: bool = False
) -> Prolongation:
    prolongation = start(card_of(equations_of, with_time).at(0, order))
    for _ in range(order + 1):
        advance(prolongation)
    return prolongation


class Polynomials:
    """Polynomial formulas about the point of the prolongations, and the tensors of a system of
    them.
    """

    def __init__(self, equations_of: dict[str, str], with_time: bool) -> None:
        system = read_system(list(equations_of), equations_of)
        velocities = [Velocity(name) for name in system.coordinates]
        self.variables = [*[TIME] * with_time, *map(Symbol, system.coordinates), *velocities]
        self.context = nmod_mpoly_ctx.get([f"d{k}" for k in range(len(self.variables))], modulus=P)
        self.n = len(velocities)
        f = [self.of(tree) for tree in system.accelerations]
        self.field = [*[self.context.constant(1)] * with_time, *map(self.of, velocities), *f]
        span, v = range(self.n), len(self.variables) - self.n
        slopes = [[part.derivative(v + j) for j in span] for part in f]
        half = pow(2, -1, P)
        self.N = [[entry * -half for entry in row] for row in slopes]
        self.Phi = [
            [
                self.along(slopes[i][j])
                - f[i].derivative(v - self.n + j) * 2
                - sum(slopes[i][k] * slopes[k][j] for k in span) * half
                for j in span
            ]
            for i in span
        ]

    def of(self, tree: Expression) -> nmod_mpoly:
        match tree:
            case Number(value):
                return self.context.constant(value.numerator * pow(value.denominator, -1, P) % P)
            case Sum(terms):
                return sum(map(self.of, terms))
            case Product(factors):
                return math.prod(map(self.of, factors))
            case Power(base, Number(exponent)):
                return self.of(base) ** int(exponent)
        step = self.context.gen(self.variables.index(tree)) if tree in self.variables else 0
        return self.context.constant(Point(P, 5).variable(tree)) + step  # type: ignore[arg-type]

    def along(self, polynomial: nmod_mpoly) -> nmod_mpoly:
        return sum(part * polynomial.derivative(a) for a, part in enumerate(self.field))

    def helmholtz(self, g: list[list[nmod_mpoly]], kind: str, i: int, j: int) -> nmod_mpoly:
        """Gamma(g_ij) - (g N)_ij - (g N)_ji, or (g Phi)_ij - (g Phi)_ji."""
        T = self.N if kind == "H2" else self.Phi
        left, right = (sum(g[a][k] * T[k][b] for k in range(self.n)) for a, b in ((i, j), (j, i)))
        return self.along(g[i][j]) - left - right if kind == "H2" else left - right


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
        recorded.extend(
            pairs[a:b] for a, b in itertools.pairwise(rows.starts[: len(expected) + 1].tolist())
        )
        return insert(echelon, rows, expected, in_order)

    monkeypatch.setattr(Echelon, "insert", record)
    prolongation = prolongation_of(system, order, with_time)
    exact, generator = Polynomials(system, with_time), random.Random(1)
    names = [
        index for d in range(order + 1) for _, index in unknown_names(prolongation.unknowns, d)
    ]
    values = [generator.randrange(P) for _ in names]
    lagrangian, first = (
        exact.context.from_dict(dict(zip(names, values, strict=True))),
        prolongation.size - exact.n,
    )
    g = [
        [lagrangian.derivative(first + i).derivative(first + j) for j in range(exact.n)]
        for i in range(exact.n)
    ]
    residues = {name: exact.helmholtz(g, *name).to_dict() for name in dict.fromkeys(
        prolongation.row_name(number)[:3] for number in range(len(recorded)))}  # fmt: skip
    assert len(recorded) == prolongation.echelon.inserted
    for number, row in enumerate(recorded):
        *name, alpha = prolongation.row_name(number)
        expected = int(residues[tuple(name)].get(alpha, 0)) * (1 << 64) % P
        assert sum(values[column] * x for column, x in row) % P == expected


def satisfied(prolongation: Prolongation, terms: dict[tuple[int, ...], int]) -> bool:
    """Whether a Lagrangian, given by its Taylor coefficients, solves all rows."""
    degrees = range(prolongation.order + 1)
    names = [
        exponents
        for degree in degrees
        for _, exponents in unknown_names(prolongation.unknowns, degree)
    ]
    values = [terms.get(exponents, 0) for exponents in names]
    rows = prolongation.echelon.rows_within(0, prolongation.echelon.width).values()
    return all(sum(values[c] * x for c, x in row.items()) % P == 0 for row in rows)


def lagrangian_terms(text: str, names: list[str], order: int) -> dict[tuple[int, ...], int]:
    """Taylor coefficients of a Lagrangian about the point used by `prolongation_of`."""
    tree = read_system(
        names, {name: text if name == names[0] else "0" for name in names}
    ).accelerations[0]
    program = SeriesProgram([*map(Symbol, names), *map(Velocity, names)], order)
    register, instructions = program.expand(tree), program.listed
    found = run(program, instructions, constants_at(program, Point(P, 5)), P, order).numbers(
        register
    )
    rows = [
        row
        for degree in range(order + 1)
        for row in exponents_of_degree(2 * len(names), degree).tolist()
    ]
    return {tuple(row): value for row, value in zip(rows, found, strict=True)}


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
def test_unknowns_are_the_monomials_of_velocity_degree_two_and_more(
    n: int, with_time: bool
) -> None:
    names = ["x", "y", "z"][:n]
    prolongation = prolongation_of(dict.fromkeys(names, "0"), 2, with_time)
    size = 2 * n + with_time
    for degree in range(3):
        block = np.array(
            [exponents for _, exponents in unknown_names(prolongation.unknowns, degree)]
        )
        positions, total = size - n, degree + 2
        below = sum(
            math.comb(n - 1 + v, v) * math.comb(positions - 1 + total - v, total - v)
            for v in (0, 1)
        )
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
    assert (
        len(set(found)) == len(found) == n * (n + 1) // 2 * below[0] + n * (n - 1) // 2 * below[1]
    )
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
    """The consequences and the number of dependent rows are the same."""
    foreseen = prolongation_of(equations_of, 4, with_time)
    expected = room.expected_room
    monkeypatch.setattr(room, "expected_room", lambda *given: np.zeros_like(expected(*given)))
    plain = prolongation_of(equations_of, 4, with_time)
    counts = [{k: int(v.sum()) for k, v in found.dependent.items()} for found in (foreseen, plain)]
    assert counts[0] == counts[1]
    width = plain.width(4)
    assert reduced(foreseen.echelon, width) == reduced(plain.echelon, width)


def test_the_cases_have_rows_that_depend_on_others() -> None:
    found = [
        prolongation_of(equations_of, 4, with_time).dependent for equations_of, with_time in CASES
    ]
    assert sum(any(flags.any() for flags in dependent.values()) for dependent in found) >= 3

"""Predicted dependent rows are omitted only if they are dependent, for any prediction."""

from __future__ import annotations

import random

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.question import Question, Tools
from inverse_service.certificate.series import Elimination, Expansion, Row
from tests.certificate.documents import changed, existence, system

ORDER = 2
# A mechanical system, one with a large symbol, one whose equations are not rational, one with t.
NAMES = ["henon-heiles", "free-pair", "spherical-pendulum", "damped-henon-heiles", "lie-A4,7"]


def expansion(name: str) -> Expansion:
    question = Question(
        Tools(random.Random(1), float("inf")), system(name), timed=name == "damped-henon-heiles"
    )
    question.prepare(lambda ring: None)
    return question.modulo(ORDER + 2, lambda ring: ring, 1)[0]


def every_row(ring: Expansion) -> list[Row]:
    return [name for degree in range(ORDER + 1) for name in ring.rows(degree)]


def eliminated(ring: Expansion) -> Elimination:
    """The elimination of all rows, one by one."""
    elimination = Elimination(ring.arithmetic, ring.shift)
    for name in every_row(ring):
        elimination.insert(ring.row(*name))
    return elimination


def extended(ring: Expansion, idle: set[Row]) -> Elimination:
    elimination = Elimination(ring.arithmetic, ring.shift)
    for degree in range(ORDER + 1):
        ring.extend(elimination, degree, idle)
    return elimination


def ranks(ring: Expansion, elimination: Elimination) -> list[int]:
    degrees = [pivot >> ring.shift for pivot in elimination.pivots]
    return [degrees.count(degree) for degree in range(ORDER + 3)]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_false_prediction_omits_no_row(name: str) -> None:
    """The prediction is no row, every row, or any half of the rows."""
    ring = expansion(name)
    expected, rows, chance = ranks(ring, eliminated(ring)), every_row(ring), random.Random(3)
    assert sum(expected) < len(rows)
    for idle in (set(), set(rows), {row for row in rows if chance.random() < 0.5}):
        assert ranks(ring, extended(ring, idle)) == expected


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_remembered_as_idle_only_if_they_follow(name: str) -> None:
    """The remaining rows have the rank of all rows, which equals their number."""
    ring, idle = expansion(name), set[Row]()
    expected = ranks(ring, extended(ring, idle))
    kept = [row for row in every_row(ring) if row not in idle]
    elimination = Elimination(ring.arithmetic, ring.shift)
    for row in kept:
        elimination.insert(ring.row(*row))
    assert ranks(ring, elimination) == expected
    assert len(kept) == sum(expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES[:-1])
def test_a_random_solution_solves_every_row_and_not_its_neighbor(name: str) -> None:
    ring = expansion(name)
    columns = [key for degree in range(ORDER + 1) for key in ring.unknowns(degree)]
    elimination = eliminated(ring)
    solution = elimination.solution(columns)
    free = [key for key in columns if key not in elimination.order]
    assert free
    for name_of_row in every_row(ring):
        row = ring.row(*name_of_row)
        assert ring.solved(row, solution)
        assert not ring.solved({**row, free[0]: row.get(free[0], 0) + 1}, solution)


def test_a_solution_in_the_low_columns_is_drawn_again_each_time() -> None:
    ring = expansion("free-pair")
    elimination, columns = eliminated(ring), ring.unknowns(0)
    first, second = elimination.solution(columns), elimination.solution(columns)
    assert set(first) == set(second) == set(columns)
    assert first != second


@pytest.mark.parametrize("size", ["1", "1e-40", "1e40"])
def test_a_series_is_measured_by_its_own_size(size: str) -> None:
    """L = s v^2/2 solves the rows of x'' = -x, s (v^2/2 + x v^2) does not, however small s is."""
    series = {"order": 2, "point": {"x": "3", "x'": "5"}, "terms": [[[0, 2], size]]}
    document = existence("oscillator", 2, [1, 2], [1, 1, 1], series=series)
    assert check_certificate(document, seed=1).verdict == "valid"
    wrong = changed(document, "series.terms", [[[0, 2], size], [[1, 2], size]])
    found = check_certificate(wrong, seed=1)
    assert found.verdict == "invalid"
    assert "does not solve" in found.reasons[0]


@pytest.mark.parametrize("name", NAMES[:-1])
def test_a_random_solution_satisfies_every_row(name: str) -> None:
    """Those too that lost their part of highest degree; it is free in all columns without a pivot."""
    ring = expansion(name)
    elimination = eliminated(ring)
    columns = [key for degree in range(ORDER + 1) for key in ring.unknowns(degree)]
    solution = elimination.solution(columns)
    assert {*columns} - {*elimination.pivots} <= {*solution}
    assert all(ring.solved(ring.row(*row), solution) for row in every_row(ring))


def test_a_row_that_loses_its_highest_degree_leaves_the_combination_below() -> None:
    """x + a, 2 x + y + b, and 5 x + 2 y + c leave c - a - 2 b."""
    ring = expansion("free-pair")
    (a, b, c, *_), (x, y, *_) = ring.unknowns(0), ring.unknowns(1)
    elimination = Elimination(ring.arithmetic, ring.shift)
    assert elimination.insert({x: 1, a: 1})
    assert elimination.insert({x: 2, y: 1, b: 1})
    assert elimination.insert({x: 5, y: 2, c: 1})
    assert {elimination.pivots[-1], *elimination.rows[-1]} == {a, b, c}
    assert not elimination.insert({a: -1, b: -2, c: 1})
    assert elimination.insert({a: -1, b: -2, c: 2})

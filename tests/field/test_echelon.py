"""The sparse echelon form has the rank and the row space of the dense one, and can be traced."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest
from flint import nmod_mat

from inverse_service.field import echelon as room
from inverse_service.field.echelon import MOST, Echelon, Flags, SparseRows
from inverse_service.field.modular import safe_prime
from tests.values import slow

P = safe_prime(4)
Rows = list[dict[int, int]]


def random_rows(count: int, width: int, density: float, seed: int) -> Rows:
    """Sparse rows, among them zero rows, copies, and sums of others."""
    generator = random.Random(f"{count}/{width}/{density}/{seed}")
    rows: Rows = []
    for _ in range(count):
        kind = generator.random()
        if rows and kind < 0.15:
            rows.append(dict(generator.choice(rows)))
        elif rows and kind < 0.3:
            a, b, k = generator.choice(rows), generator.choice(rows), generator.randrange(P)
            rows.append({c: (a.get(c, 0) + k * b.get(c, 0)) % P for c in {*a, *b}})
        else:
            rows.append(
                {c: generator.randrange(1, P) for c in range(width) if generator.random() < density}
            )
    return rows


def insert(
    echelon: Echelon, rows: Rows, expected: Flags | None = None, most: int | None = None
) -> Flags:
    starts = np.cumsum([0, *map(len, rows)]).astype(np.int64)
    columns = np.array([c for row in rows for c in row], np.int64)
    values = np.array([x for row in rows for x in row.values()], np.uint64)
    return echelon.insert(SparseRows(starts, columns, values), expected, most)


def echelon_of(rows: Rows, width: int) -> Echelon:
    echelon = Echelon(P)
    echelon.widen(width)
    insert(echelon, rows)
    return echelon


def dense(rows: Rows, width: int) -> nmod_mat:
    return nmod_mat(len(rows), width, [row.get(c, 0) for row in rows for c in range(width)], P)


def reduced(rows: Rows, width: int) -> tuple[list[int], int]:
    """The unique reduced row echelon form without its zero rows, and the rank."""
    if not rows or not width:
        return [], 0
    matrix, rank = dense(rows, width).rref()
    return [int(x) for x in matrix.entries()[: rank * width]], rank


SHAPES = [
    (0, 0),
    (0, 5),
    (1, 1),
    (5, 1),
    (1, 5),
    (3, 3),
    (12, 7),
    (7, 12),
    (40, 40),
    (90, 60),
    (60, 300),
]


@pytest.mark.parametrize(("count", "width"), SHAPES)
@pytest.mark.parametrize("density", [0.0, 0.05, 0.3, 1.0])
def test_rank_and_row_space_are_those_of_the_dense_form(
    count: int, width: int, density: float
) -> None:
    rows = random_rows(count, width, density, 1)
    echelon = echelon_of(rows, width)
    basis = list(echelon.rows_within(0, width).values())
    assert reduced(basis, width) == reduced(rows, width)
    assert echelon.count == echelon.ranks_within([width])[0] == len(basis)


@pytest.mark.parametrize("seed", range(4))
def test_rows_end_in_their_pivot_which_is_one_and_no_pivot_is_shared(seed: int) -> None:
    echelon = echelon_of(random_rows(30, 40, 0.1, seed), 40)
    pivots = [max(row) for row in echelon.rows_within(0, 40).values()]
    assert len(set(pivots)) == len(pivots) > 5
    for row in echelon.rows_within(0, 40).values():
        assert row[max(row)] == 1
        assert all(0 < x < P for x in row.values())


@pytest.mark.parametrize("seed", range(4))
def test_consequences_on_the_first_columns_are_all_there(seed: int) -> None:
    """The rows within k columns span what the row space has with zeros from column k on."""
    rows = random_rows(25, 30, 0.2, seed)
    echelon, rank = echelon_of(rows, 30), reduced(rows, 30)[1]
    for width in range(1, 30):
        right = [{c - width: x for c, x in row.items() if c >= width} for row in rows]
        assert echelon.ranks_within([width])[0] == rank - reduced(right, 30 - width)[1]


def in_span(target: dict[int, int], rows: Rows, width: int) -> bool:
    return reduced([*rows, target], width)[1] == reduced(rows, width)[1]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_a_consequence_is_a_combination_of_exactly_the_rows_traced(seed: int) -> None:
    rows, width = random_rows(30, 25, 0.15, seed), 25
    echelon = echelon_of(rows, width)
    basis = echelon.rows_within(0, width)
    assert basis
    for number, row in basis.items():
        used = [rows[k] for k in echelon.trace({number: 1})]
        assert in_span(row, used, width)
        # the traced rows are independent, so each of them is needed
        assert reduced(used, width)[1] == len(used)
        assert all(not in_span(row, used[:k] + used[k + 1 :], width) for k in range(len(used)))


def test_a_combination_of_basis_rows_is_traced_too() -> None:
    rows, width = random_rows(30, 25, 0.15, 9), 25
    echelon = echelon_of(rows, width)
    basis = echelon.rows_within(0, width)
    weights = {number: 3 * number + 1 for number in basis}
    total = {
        c: sum(weights[k] * row.get(c, 0) for k, row in basis.items()) % P for c in range(width)
    }
    used = [rows[k] for k in echelon.trace(weights)]
    assert in_span(total, used, width)
    assert all(not in_span(total, used[:k] + used[k + 1 :], width) for k in range(len(used)))


def test_nothing_is_traced_to_nothing() -> None:
    assert echelon_of(random_rows(5, 5, 0.5, 1), 5).trace({}) == []


def test_entries_of_one_column_in_a_row_are_added_up() -> None:
    echelon = Echelon(P)
    echelon.widen(2)
    columns, values = np.array([0, 1, 1, 0], np.int64), np.array([5, 2, 7, P - 5], np.uint64)
    echelon.insert(SparseRows(np.array([0, 4], np.int64), columns, values))
    assert echelon.rows_within(0, 2) == {0: {1: 1}}


@pytest.mark.parametrize("seed", [0, *(slow(one) for one in (1, 2, 3))])
def test_growing_widths_give_the_same_row_space_as_all_at_once(seed: int) -> None:
    generator, rows, echelon = random.Random(seed), [], Echelon(P)
    for width in (0, 1, 4, 4, 9, 30, 80, 600, 1500):
        echelon.widen(width)
        more = random_rows(generator.randrange(0, 25), width, min(0.2, 20 / (width + 1)), seed)
        insert(echelon, more)
        rows += more
        basis = echelon.rows_within(0, width)
        assert reduced(list(basis.values()), width) == reduced(rows, width)
        assert echelon.inserted == len(rows)
        for number, row in basis.items():
            assert in_span(row, [rows[k] for k in echelon.trace({number: 1})], width)


def test_arrays_grow_when_they_are_full() -> None:
    rows = random_rows(150, 170, 1.0, 2)
    echelon = echelon_of(rows, 170)
    assert reduced(list(echelon.rows_within(0, 170).values()), 170) == reduced(rows, 170)
    assert len(echelon.form.basis.columns) > 4096


@pytest.mark.parametrize("seed", range(6))
def test_rows_marked_dependent_are_those_that_do_not_raise_the_rank(seed: int) -> None:
    rows, echelon = random_rows(40, 25, 0.15, seed), Echelon(P)
    echelon.widen(25)
    dependent = insert(echelon, rows)
    ranks = [reduced(rows[:k], 25)[1] for k in range(len(rows) + 1)]
    assert dependent.tolist() == [a == b for a, b in itertools.pairwise(ranks)]
    assert dependent.any()
    assert not dependent.all()


@pytest.mark.parametrize("seed", range(6))
def test_rows_rightly_expected_to_depend_leave_the_very_same_basis(seed: int) -> None:
    rows, plain, told = random_rows(40, 60, 0.1, seed), Echelon(P), Echelon(P)
    plain.widen(60)
    told.widen(60)
    dependent = insert(plain, rows)
    assert insert(told, rows, dependent).tolist() == dependent.tolist()
    assert told.rows_within(0, 60) == plain.rows_within(0, 60)
    assert all(told.trace({k: 1}) == plain.trace({k: 1}) for k in range(plain.count))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_rows_wrongly_expected_to_depend_are_inserted_all_the_same(seed: int) -> None:
    """A single independent row among those expected to depend is detected."""
    rows, plain = random_rows(40, 60, 0.1, seed), Echelon(P)
    plain.widen(60)
    dependent = insert(plain, rows)
    for wrong in np.flatnonzero(~dependent).tolist():
        expected, told = dependent.copy(), Echelon(P)
        expected[wrong] = True
        told.widen(60)
        found = insert(told, rows, expected)
        assert told.count == plain.count == np.count_nonzero(~found)
        basis = list(told.rows_within(0, 60).values())
        assert reduced(basis, 60) == reduced(rows, 60)


def test_all_rows_may_be_expected_to_depend() -> None:
    rows, echelon = random_rows(30, 25, 0.2, 3), Echelon(P)
    echelon.widen(25)
    insert(echelon, rows, np.ones(len(rows), np.bool_))
    assert echelon.count == reduced(rows, 25)[1] > 0
    assert insert(echelon, rows, np.ones(len(rows), np.bool_)).all()


@pytest.mark.parametrize("most", [0, 1, 3, 1000])
@pytest.mark.parametrize("seed", range(6))
def test_rows_may_be_put_off_without_changing_what_follows_from_all(
    seed: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The row space is the same, the rows kept are a basis of it, the rest depend on them."""
    monkeypatch.setattr(room, "MOST", most)
    rows, echelon = random_rows(60, 40, 0.12, seed), Echelon(P)
    echelon.widen(40)
    parts = [rows[:25], rows[25:]]
    dependent = np.concatenate([insert(echelon, part, most=MOST) for part in parts])
    kept = [row for row, flag in zip(rows, dependent, strict=True) if not flag]
    assert (
        reduced(list(echelon.rows_within(0, 40).values()), 40)
        == reduced(rows, 40)
        == reduced(kept, 40)
    )
    assert len(kept) == echelon.count < len(rows)
    assert sorted(
        {k for number in range(echelon.count) for k in echelon.trace({number: 1})}
    ) == sorted(np.flatnonzero(~dependent).tolist())


@pytest.mark.parametrize("seed", range(4))
def test_rows_are_cut_to_the_columns_of_their_pivots(seed: int) -> None:
    echelon = echelon_of(random_rows(30, 40, 0.15, seed), 40)
    inverse = pow(1 << 64, -1, P)
    for first, width in [(0, 40), (10, 30), (39, 40), (7, 7)]:
        cut = echelon.cut_rows(first, width)
        rows = echelon.rows_within(first, width).values()
        whole = [{c - first: x for c, x in row.items() if c >= first} for row in rows]
        found = []
        for a, b in itertools.pairwise(cut.starts.tolist()):
            values = [x * inverse % P for x in cut.values[a:b].tolist()]
            found.append(dict(zip(cut.columns[a:b].tolist(), values, strict=True)))
        assert found == whole
        assert len(cut.starts) - 1 == len(whole)

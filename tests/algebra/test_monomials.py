"""Monomials of a degree, and their keys, which add as exponents do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from inverse_service.algebra.monomials import MonomialKeys, exponents_of_degree, keys_of


@pytest.mark.parametrize(("size", "degree"), [(1, 0), (1, 6), (2, 0), (2, 3), (5, 4), (17, 2), (17, 0)])
def test_every_monomial_of_the_degree_is_there_once(size: int, degree: int) -> None:
    table = exponents_of_degree(size, degree)
    assert table.shape == (math.comb(degree + size - 1, size - 1), size)
    assert (table.sum(axis=1) == degree).all()
    assert (table >= 0).all()
    assert len({tuple(row) for row in table.tolist()}) == len(table)


@pytest.mark.parametrize("size", [1, 2, 4, 9, 17])
def test_keys_are_distinct_nonnegative_and_add_as_exponents_do(size: int) -> None:
    monomials = MonomialKeys(size)
    rows = np.concatenate([exponents_of_degree(size, degree) for degree in range(3)])
    keys = keys_of(monomials, rows)
    assert len(set(keys.tolist())) == len(rows)
    assert (keys >= 0).all()
    assert [monomials.key(row) for row in rows.tolist()] == keys.tolist()
    assert (keys_of(monomials, rows + rows[::-1]) == keys + keys[::-1]).all()


def test_the_largest_degree_fits_and_one_more_does_not() -> None:
    monomials = MonomialKeys(17)
    assert monomials.key([monomials.largest_degree, 0]) < monomials.key([0, 1])
    assert monomials.key([monomials.largest_degree + 1, 0]) == monomials.key([0, 1])


def test_the_shared_table_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        exponents_of_degree(3, 2)[0, 0] = 9

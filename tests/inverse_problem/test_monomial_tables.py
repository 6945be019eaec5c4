"""The tables of monomials say where products and derivatives of monomials stand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from inverse_service.algebra.monomials import exponents_of_degree
from inverse_service.inverse_problem.decision.monomial_tables import (
    entry_columns,
    known_places,
    products_of_degree,
    raised_unknowns,
    row_tables,
    unknown_exponents,
    width_below,
)

# (variables, place of the first velocity): n = 1 and 2 and 3 without and with t
SIZES = [(2, 1), (3, 2), (4, 2), (5, 3), (6, 3)]


@pytest.mark.parametrize(("size", "first"), SIZES)
@pytest.mark.parametrize("degree", range(4))
def test_raised_unknowns_are_those_of_one_degree_more(size: int, first: int, degree: int) -> None:
    block, above, step = (
        unknown_exponents(size, first, degree),
        unknown_exponents(size, first, degree + 1),
        raised_unknowns(size, first, degree),
    )
    for m, a in itertools.product(range(len(block)), range(size)):
        raised = above[step.places[m, a]]
        assert (raised - block[m]).tolist() == [int(k == a) for k in range(size)]
        assert step.factors[m, a] == raised[a]


@pytest.mark.parametrize(("size", "first"), SIZES)
@pytest.mark.parametrize("degree", range(4))
def test_a_coefficient_of_g_is_a_multiple_of_one_of_the_lagrangian(size: int, first: int, degree: int) -> None:
    """The second derivative of c v_i v_j m by v_i and v_j is the factor times c m."""
    unknowns = np.concatenate([unknown_exponents(size, first, d) for d in range(degree + 1)])
    table = entry_columns(size, first, degree)
    pairs = list(itertools.combinations_with_replacement(range(first, size), 2))
    assert table.columns.shape == (len(pairs), len(exponents_of_degree(size, degree)))
    assert table.columns.min() >= width_below(size, first, degree)
    for p, (i, j) in enumerate(pairs):
        for m, exponents in enumerate(exponents_of_degree(size, degree).tolist()):
            e, factor = unknowns[table.columns[p, m]].tolist(), 1
            for k in (i, j):
                factor *= e[k]
                e[k] -= 1
            assert (e, factor) == (exponents, table.factors[p, m])


@pytest.mark.parametrize("size", [1, 2, 5])
def test_products_stand_where_they_are_said_to_stand(size: int) -> None:
    for low, high in itertools.product(range(4), repeat=2):
        table = products_of_degree(size, low, high)
        left, right = exponents_of_degree(size, high), exponents_of_degree(size, low)
        product = exponents_of_degree(size, low + high)[table]
        assert (product == left[:, None] + right[None, :]).all()


@pytest.mark.parametrize("size", [1, 2, 5])
def test_each_monomial_knows_its_place(size: int) -> None:
    for degree in (2, 0, 3):
        for place, row in enumerate(exponents_of_degree(size, degree).tolist()):
            assert known_places(size)[tuple(row)] == place


def test_tables_are_kept_and_cannot_be_changed() -> None:
    assert row_tables(4, 2, 2) is row_tables(4, 2, 2)
    for table in (raised_unknowns(4, 2, 1).places, entry_columns(4, 2, 1).factors, unknown_exponents(4, 2, 1)):
        with pytest.raises(ValueError, match="read-only"):
            table[0, 0] = 9

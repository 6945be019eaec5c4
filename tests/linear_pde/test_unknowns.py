"""The tables of monomials give the indices of products and derivatives of monomials."""

from __future__ import annotations

import itertools
import math

import pytest

from inverse_service.decision import helmholtz
from inverse_service.field import dense_series
from inverse_service.linear_pde import equations as pde

# (variables, index of the first velocity): n = 1, 2, 3 without and with t
SIZES = [(2, 1), (3, 2), (4, 2), (5, 3), (6, 3)]


# One function of order 2 in the last displacements, and several of orders 0, 1 and 2 together.
MIXED = pde.Unknowns(
    3,
    (pde.Function(1), pde.Function(0), pde.Function(2, 1)),
    ((0, (0,)), (0, (2,)), (1, ()), (2, (1, 1)), (2, (1, 2))),
)
ALL = [*(helmholtz.unknowns_of(size - first, size) for size, first in SIZES), MIXED]


def names_below(unknowns: pde.Unknowns, degree: int) -> list[tuple[int, tuple[int, ...]]]:
    return [name for d in range(degree) for name in pde.unknown_names(unknowns, d)]


@pytest.mark.parametrize("unknowns", ALL)
@pytest.mark.parametrize("degree", range(4))
def test_raised_unknowns_are_those_of_one_degree_more(unknowns: pde.Unknowns, degree: int) -> None:
    block, above = pde.unknown_names(unknowns, degree), pde.unknown_names(unknowns, degree + 1)
    step = pde.raised_unknowns(unknowns, degree)
    for m, a in itertools.product(range(len(block)), range(unknowns.size)):
        function, raised = above[step.places[m, a]]
        assert function == block[m][0]
        assert [x - y for x, y in zip(raised, block[m][1], strict=True)] == [
            int(k == a) for k in range(unknowns.size)
        ]
        assert step.factors[m, a] == raised[a]


@pytest.mark.parametrize("unknowns", ALL)
@pytest.mark.parametrize("degree", range(4))
def test_a_coefficient_of_an_entry_is_a_multiple_of_one_of_its_function(
    unknowns: pde.Unknowns, degree: int
) -> None:
    """The derivative of c x_a x_b … m by x_a, x_b, … is the factor times c m."""
    names, table = names_below(unknowns, degree + 1), pde.entry_columns(unknowns, degree)
    assert table.columns.shape == (
        len(unknowns.entries),
        len(dense_series.exponents_of_degree(unknowns.size, degree)),
    )
    assert table.columns.min() >= pde.width_below(unknowns, degree)
    for p, (number, by) in enumerate(unknowns.entries):
        for m, exponents in enumerate(
            dense_series.exponents_of_degree(unknowns.size, degree).tolist()
        ):
            function, found = names[table.columns[p, m]]
            e, factor = list(found), 1
            for k in by:
                factor *= e[k]
                e[k] -= 1
            assert (function, e, factor) == (number, exponents, table.factors[p, m])


@pytest.mark.parametrize("unknowns", ALL)
def test_a_derivative_at_the_point_is_a_multiple_of_one_unknown(unknowns: pde.Unknowns) -> None:
    for number, function in enumerate(unknowns.functions):
        last = unknowns.size - 1
        for by in (
            (last,) * function.order,
            (last,) * (function.order + 1),
            (0, *(last,) * (function.order + 1)),
        ):
            column, factor = pde.column_of(unknowns, (number, by))
            exponents = [by.count(a) for a in range(unknowns.size)]
            assert names_below(unknowns, 4)[column] == (number, tuple(exponents))
            assert factor == math.prod(map(math.factorial, exponents))


@pytest.mark.parametrize("size", [1, 2, 5])
def test_products_stand_where_they_are_said_to_stand(size: int) -> None:
    for low, high in itertools.product(range(4), repeat=2):
        table = dense_series.products_of_degree(size, low, high)
        left, right = (
            dense_series.exponents_of_degree(size, high),
            dense_series.exponents_of_degree(size, low),
        )
        product = dense_series.exponents_of_degree(size, low + high)[table]
        assert (product == left[:, None] + right[None, :]).all()


def test_tables_are_kept_and_cannot_be_changed() -> None:
    assert pde.row_tables(MIXED, 2) is pde.row_tables(MIXED, 2)
    table = pde.unknown_exponents(3, pde.Function(1), 1)
    for array in (pde.raised_unknowns(MIXED, 1).places, pde.entry_columns(MIXED, 1).factors, table):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 9

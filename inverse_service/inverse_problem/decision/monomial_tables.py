"""Where monomials stand: tables that depend on the numbers of variables and the degree alone, made once.

Monomials of one degree are numbered as in `exponents_of_degree`. The unknowns of degree d are the
coefficients in L of the monomials of total degree d + 2 with v-degree >= 2; those of lower degree come first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.monomials import (
    MonomialKeys,
    exponents_of_degree,
    keys_of,
    places_among,
    products_of_degree,
    raised_places,
)

Integers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]
Exponents = npt.NDArray[np.int8]
_KEPT = 256


def _frozen(array: npt.NDArray[np.generic]) -> None:
    array.setflags(write=False)


@lru_cache(maxsize=_KEPT)
def unknown_exponents(size: int, first_velocity: int, degree: int) -> Exponents:
    """Exponents of the unknowns of one degree, (count, size)."""
    table = exponents_of_degree(size, degree + 2)
    kept: Exponents = table[table[:, first_velocity:].sum(axis=1) >= 2]
    _frozen(kept)
    return kept


def width_below(size: int, first_velocity: int, degree: int) -> int:
    """The number of unknowns of lower degree."""
    return sum(len(unknown_exponents(size, first_velocity, d)) for d in range(degree))


@dataclass(frozen=True, slots=True)
class Raised:
    """x_a m for the unknown monomials m of one degree: its place among those of the next, its exponent of x_a.

    Both of shape (count, size). d_a of x_a m is the exponent times m.
    """

    places: Integers
    factors: Integers


@lru_cache(maxsize=_KEPT)
def raised_unknowns(size: int, first_velocity: int, degree: int) -> Raised:
    """The monomials x_a m, m of this degree, as unknowns."""
    block = unknown_exponents(size, first_velocity, degree)
    above = unknown_exponents(size, first_velocity, degree + 1)
    steps = np.array([1 << (MonomialKeys(size).bits * a) for a in range(size)], np.int64)
    places = places_among(size, above, keys_of(MonomialKeys(size), block)[:, None] + steps)
    factors = block.astype(np.int64) + 1
    _frozen(places)
    _frozen(factors)
    return Raised(places, factors)


@dataclass(frozen=True, slots=True)
class EntryColumns:
    """The coefficient of a monomial m of one degree in g_ij: the factor times the unknown of v_i v_j m.

    Pair p of i <= j, monomial m: column columns[p, m], factors[p, m], both (pairs, monomials).
    """

    columns: Integers
    factors: Integers


@lru_cache(maxsize=_KEPT)
def entry_columns(size: int, first_velocity: int, degree: int) -> EntryColumns:
    """The table for the monomials of this degree."""
    monomials = MonomialKeys(size)
    table = exponents_of_degree(size, degree)
    block = unknown_exponents(size, first_velocity, degree)
    keys, e = keys_of(monomials, table), table.astype(np.int64)
    pairs = [(i, j) for i in range(first_velocity, size) for j in range(i, size)]
    steps = np.array([[(1 << monomials.bits * i) + (1 << monomials.bits * j)] for i, j in pairs], np.int64)
    columns = places_among(size, block, keys + steps) + width_below(size, first_velocity, degree)
    factors = np.array([(e[:, j] + 1) * (e[:, i] + (2 if i == j else 1)) for i, j in pairs])
    _frozen(columns)
    _frozen(factors)
    return EntryColumns(columns, factors)


class KnownPlaces(dict[tuple[int, ...], int]):
    """The place of a monomial among those of its degree, found once for each exponents."""

    def __missing__(self, exponents: tuple[int, ...]) -> int:
        table = exponents_of_degree(len(exponents), sum(exponents))
        self.update((tuple(row), place) for place, row in enumerate(table.tolist()))
        return self[exponents]


@lru_cache(maxsize=64)
def known_places(size: int) -> KnownPlaces:
    """The table in `size` variables, kept for the life of the process."""
    return KnownPlaces()


@dataclass(frozen=True, slots=True)
class RowTables:
    """All that the rows of one degree need, put end to end for the compiled loop.

    Of the monomials of degree d there are counts[d]. Products with a coefficient of degree c begin at
    product_starts[c], as `products_of_degree`(degree - c, c); columns and factors of `entry_columns`(d) at
    column_starts[d]; places and exponents of x_a m, m of degree d, at raised_starts[d].
    """

    counts: Integers
    product_starts: Integers
    products: Places
    column_starts: Integers
    columns: Integers
    factors: Integers
    raised_starts: Integers
    raised: Integers
    exponents: Integers


@lru_cache(maxsize=_KEPT)
def row_tables(size: int, first_velocity: int, degree: int) -> RowTables:
    """The tables for the rows of this degree."""
    counts = np.array([len(exponents_of_degree(size, d)) for d in range(degree + 2)], np.int64)
    products = [products_of_degree(size, degree - d, d).ravel() for d in range(degree + 1)]
    entries = [entry_columns(size, first_velocity, d) for d in range(degree + 2)]
    raised = [raised_places(size, d).ravel() for d in range(degree + 1)]
    exponents = [exponents_of_degree(size, d).ravel().astype(np.int64) + 1 for d in range(degree + 1)]
    return RowTables(
        counts,
        _starts(products),
        np.concatenate(products),
        _starts([table.columns for table in entries]),
        np.concatenate([table.columns.ravel() for table in entries]),
        np.concatenate([table.factors.ravel() for table in entries]),
        _starts(raised),
        np.concatenate(raised),
        np.concatenate(exponents),
    )


def _starts(parts: list[npt.NDArray[np.generic]] | list[Places] | list[Integers]) -> Integers:
    return np.cumsum([0, *(part.size for part in parts)]).astype(np.int64)

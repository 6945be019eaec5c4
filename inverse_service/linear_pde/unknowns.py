"""The unknown functions of a linear system, and tables of their Taylor coefficients.

An unknown y of order k counts modulo polynomials of degree < k in the displacements from `first` on: only its
derivatives of order k by these occur. Its coefficient of a monomial of degree d + k has degree d. So
g_ij = d2L/dv_i dv_j is one unknown L of order 2 from the velocities on, and dl one of order 1.
Columns: by degree, then by function, then by monomial.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from inverse_service.field.monomials import (
    MonomialKeys,
    exponents_of_degree,
    freeze,
    keys_of,
    places_among,
    products_of_degree,
    raised_places,
)

Integers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]
Exponents = npt.NDArray[np.int8]
_KEPT = 256

# A derivative of an unknown: which function, by which displacements.
Derivative = tuple[int, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class Function:
    """An unknown function modulo polynomials of degree < `order` in the displacements from `first` on."""

    order: int
    first: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Unknown functions of `size` displacements, and those derivatives of them that the equations contain.

    `entries` are of the order of their functions; equations contain them and their first derivatives.
    Tables are kept for each object, so equal questions should share one.
    """

    size: int
    functions: tuple[Function, ...]
    entries: tuple[Derivative, ...]
    most: int = field(init=False)  # the highest order of a function

    def __post_init__(self) -> None:
        object.__setattr__(self, "most", max(function.order for function in self.functions))


@lru_cache(maxsize=_KEPT)
def unknown_exponents(size: int, function: Function, degree: int) -> Exponents:
    """The monomials of one unknown function of one degree, (count, size)."""
    table = exponents_of_degree(size, degree + function.order)
    kept: Exponents = table[table[:, function.first :].sum(axis=1) >= function.order]
    freeze([kept])
    return kept


@lru_cache(maxsize=_KEPT)
def starts_of_functions(unknowns: Unknowns, degree: int) -> tuple[int, ...]:
    """Where the unknowns of each function begin among those of this degree; last, how many there are."""
    counts = [len(unknown_exponents(unknowns.size, function, degree)) for function in unknowns.functions]
    return tuple(sum(counts[:k]) for k in range(len(counts) + 1))


def count_of_degree(unknowns: Unknowns, degree: int) -> int:
    """The number of unknowns of one degree."""
    return starts_of_functions(unknowns, degree)[-1]


@lru_cache(maxsize=_KEPT)
def width_below(unknowns: Unknowns, degree: int) -> int:
    """The number of unknowns of lower degree."""
    return sum(count_of_degree(unknowns, d) for d in range(degree))


def column_of(unknowns: Unknowns, derivative: Derivative) -> tuple[int, int]:
    """The unknown that a derivative is a multiple of at the point, and the multiple."""
    number, by = derivative
    function, powers = unknowns.functions[number], Counter(by)
    degree = len(by) - function.order
    exponents = [powers[a] for a in range(unknowns.size)]
    place = unknown_exponents(unknowns.size, function, degree).tolist().index(exponents)
    column = width_below(unknowns, degree) + starts_of_functions(unknowns, degree)[number] + place
    return column, math.prod(map(math.factorial, exponents))


def unknown_names(unknowns: Unknowns, degree: int) -> list[tuple[int, tuple[int, ...]]]:
    """(function, exponents) of each unknown of one degree."""
    tables = [unknown_exponents(unknowns.size, function, degree) for function in unknowns.functions]
    return [(k, tuple(row)) for k, table in enumerate(tables) for row in table.tolist()]


class Raised(NamedTuple):
    """x_a m for the unknown monomials m of one degree: its place among those of the next, its exponent of x_a.

    Both of shape (count, size). d_a of x_a m is the exponent times m.
    """

    places: Integers
    factors: Integers


@lru_cache(maxsize=_KEPT)
def raised_unknowns(unknowns: Unknowns, degree: int) -> Raised:
    """The monomials x_a m of each function, m of this degree, as unknowns."""
    size, monomials = unknowns.size, MonomialKeys(unknowns.size)
    steps = np.array([1 << (monomials.bits * a) for a in range(size)], np.int64)
    places, factors = [], []
    for function, start in zip(unknowns.functions, starts_of_functions(unknowns, degree + 1), strict=False):
        block = unknown_exponents(size, function, degree)
        above = unknown_exponents(size, function, degree + 1)
        places.append(places_among(size, above, keys_of(monomials, block)[:, None] + steps) + start)
        factors.append(block.astype(np.int64) + 1)
    found = Raised(np.concatenate(places), np.concatenate(factors))
    freeze(found)
    return found


@dataclass(frozen=True, slots=True)
class EntryColumns:
    """The coefficient of a monomial m of one degree in an entry: the factor times an unknown.

    Entry p, monomial m: column columns[p, m], factors[p, m], both (entries, monomials).
    """

    columns: Integers
    factors: Integers


@lru_cache(maxsize=_KEPT)
def entry_columns(unknowns: Unknowns, degree: int) -> EntryColumns:
    """The table for the monomials of this degree."""
    size, monomials = unknowns.size, MonomialKeys(unknowns.size)
    table = exponents_of_degree(size, degree)
    keys, e, ones = keys_of(monomials, table), table.astype(np.int64), np.ones(len(table), np.int64)
    starts, below = starts_of_functions(unknowns, degree), width_below(unknowns, degree)
    columns = []
    for number, entries in groupby(unknowns.entries, key=lambda entry: entry[0]):
        block = unknown_exponents(size, unknowns.functions[number], degree)
        steps = np.array([[sum(1 << (monomials.bits * a) for a in by)] for _, by in entries], np.int64)
        columns.append(places_among(size, block, keys + steps) + starts[number] + below)
    # The derivative by x_a, x_b, … of the monomial: each takes its exponent down.
    factors = [
        math.prod((e[:, a] + by[: k + 1].count(a) for k, a in enumerate(by)), start=ones) for _, by in unknowns.entries
    ]
    found = EntryColumns(np.concatenate(columns), np.array(factors))
    freeze((found.columns, found.factors))
    return found


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


class RowTables(NamedTuple):
    """All that the rows of one degree need, put end to end for the compiled loop.

    There are `size` displacements, and counts[d] monomials of degree d. Products with a coefficient of degree c begin
    at product_starts[c], as `products_of_degree`(degree - c, c); columns and factors of `entry_columns`(d) at
    column_starts[d]; places and exponents of x_a m, m of degree d, at raised_starts[d].
    """

    size: int
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
def row_tables(unknowns: Unknowns, degree: int) -> RowTables:
    """The tables for the rows of this degree."""
    size = unknowns.size
    counts = np.array([len(exponents_of_degree(size, d)) for d in range(degree + 2)], np.int64)
    products = [products_of_degree(size, degree - d, d).ravel() for d in range(degree + 1)]
    entries = [entry_columns(unknowns, d) for d in range(degree + 2)]
    raised = [raised_places(size, d).ravel() for d in range(degree + 1)]
    exponents = [exponents_of_degree(size, d).ravel().astype(np.int64) + 1 for d in range(degree + 1)]
    found = RowTables(
        size,
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
    freeze(found)
    return found


def _starts(parts: list[npt.NDArray[np.generic]] | list[Places] | list[Integers]) -> Integers:
    return np.cumsum([0, *(part.size for part in parts)]).astype(np.int64)

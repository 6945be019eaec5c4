"""The unknown functions of a linear system, tables of their Taylor coefficients, and the rows of
prolonged equations.

An unknown y of order k counts modulo polynomials of degree < k in the displacements from `first`
on: only its derivatives of order k by these occur. Its coefficient of a monomial of degree d + k
has degree d. So g_ij = d2L/dv_i dv_j is one unknown L of order 2 from the velocities on, and dl one
of order 1. Columns: by degree, then by function, then by monomial.

Compiled loops write the entries of the prolonged rows, many products of a term and an unknown at a
time.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from inverse_service.field import modular
from inverse_service.field.dense_series import (
    MonomialKeys,
    Registers,
    SparseSeries,
    exponents_of_degree,
    freeze,
    keys_of,
    places_among,
    products_of_degree,
    raised_places,
)
from inverse_service.field.echelon import MOST, Echelon, Flags, SparseRows, Words
from inverse_service.field.modular import Field, compiled, multiply
from inverse_service.kernels.machine_code.argument_kinds import Kept

Integers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]
Exponents = npt.NDArray[np.int8]
_KEPT = 256

# A derivative of an unknown: which function, by which displacements.
Derivative = tuple[int, tuple[int, ...]]
NO_DERIVATIVE = -1
# The initial room for the entries of a row, and for the rows of a prolongation.
ENTRIES, _ROWS = 32, 256
# (kind, *indices, alpha): which equation, which Taylor coefficient of it.
RowName = tuple[str | int | tuple[int, ...], ...]
Indices = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Function:
    """An unknown function modulo polynomials of degree < `order` in the displacements from `first`
    on.
    """

    order: int
    first: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Unknown functions of `size` displacements, and those derivatives of them that the equations
    contain.

    `entries` are of the order of their functions; equations contain them and their first
    derivatives. Tables are cached per object, so equal questions should share one.
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
    """The first index of each function's unknowns among those of this degree, followed by their
    total number.
    """
    counts = [
        len(unknown_exponents(unknowns.size, function, degree)) for function in unknowns.functions
    ]
    return tuple(sum(counts[:k]) for k in range(len(counts) + 1))


def count_of_degree(unknowns: Unknowns, degree: int) -> int:
    """The number of unknowns of one degree."""
    return starts_of_functions(unknowns, degree)[-1]


@lru_cache(maxsize=_KEPT)
def width_below(unknowns: Unknowns, degree: int) -> int:
    """The number of unknowns of lower degree."""
    return sum(count_of_degree(unknowns, d) for d in range(degree))


def column_of(unknowns: Unknowns, derivative: Derivative) -> tuple[int, int]:
    """(column, factor): at the point, the derivative is the factor times this unknown."""
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
    """x_a m for the unknown monomials m of one degree: its place among those of the next, its
    exponent of x_a.

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
    for function, start in zip(
        unknowns.functions, starts_of_functions(unknowns, degree + 1), strict=False
    ):
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
        steps = np.array(
            [[sum(1 << (monomials.bits * a) for a in by)] for _, by in entries], np.int64
        )
        columns.append(places_among(size, block, keys + steps) + starts[number] + below)
    # The derivative of the monomial by x_a, x_b, …: each lowers its exponent.
    factors = [
        math.prod((e[:, a] + by[: k + 1].count(a) for k, a in enumerate(by)), start=ones)
        for _, by in unknowns.entries
    ]
    found = EntryColumns(np.concatenate(columns), np.array(factors))
    freeze((found.columns, found.factors))
    return found


class RowTables(NamedTuple):
    """The tables for the rows of one degree, concatenated for the compiled loop.

    There are `size` displacements, and counts[d] monomials of degree d. Products with a coefficient
    of degree c begin at product_starts[c], as `products_of_degree`(degree - c, c); columns and
    factors of `entry_columns`(d) at column_starts[d]; places and exponents of x_a m, m of degree d,
    at raised_starts[d].
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
    exponents = [
        exponents_of_degree(size, d).ravel().astype(np.int64) + 1 for d in range(degree + 1)
    ]
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


@dataclass(frozen=True, slots=True)
class Term:
    """A summand of one equation: sign * series * entry, or sign * series * d_a entry; the series
    has a register.
    """

    equation: int
    entry: int
    derivative: int
    register: int
    negative: bool = False


@dataclass(frozen=True, slots=True)
class TermTable:
    """The terms of all equations of a kind: equation, series, sign, entry, d_a in the columns of
    `terms`.
    """

    unknowns: Unknowns
    equations: int
    series: Kept[SparseSeries]
    terms: Integers

    def __post_init__(self) -> None:
        freeze([self.terms])


def term_table(
    unknowns: Unknowns, terms: Sequence[Term], equations: int, registers: Registers, most: int
) -> TermTable:
    """The table of the terms, with their series to degree `most` after a run."""
    used = dict.fromkeys(term.register for term in terms)
    places = {register: place for place, register in enumerate(used)}
    rows = [(t.equation, places[t.register], t.negative, t.entry, t.derivative) for t in terms]
    series = registers.coefficients(np.array([*used], np.int64), most)
    return TermTable(unknowns, equations, series, np.array(rows, np.int64).reshape(-1, 5))


@compiled
def _emit(
    fill: bool, degree: int, series: SparseSeries, terms: Integers, tables: RowTables, small: Words, field: Field,
    rows: SparseRows,
) -> None:  # fmt: skip
    """Count or fill in the entries of term * (d_a) entry in the rows of one degree, for all terms.

    The entries of row k are counted in starts[k + 1]; then starts[k], their sum before row k, is
    where its next entry goes, and in the end where row k + 1 begins.
    """
    monomials, ends = tables.counts, rows.starts
    for t in range(len(terms)):
        first_row, pair, along = terms[t, 0] * monomials[degree], terms[t, 3], terms[t, 4]
        for c in range(series.starts[terms[t, 1]], series.starts[terms[t, 1] + 1]):
            if series.degrees[c] > degree:
                break
            # Coefficient m of the series times coefficient m' of (d_a) entry, for all m' of this
            # degree.
            low = degree - series.degrees[c]
            count = monomials[low]
            start = tables.product_starts[series.degrees[c]] + series.places[c] * count
            if not fill:
                for k in range(start, start + count):
                    ends[first_row + tables.products[k] + 1] += 1
                continue
            value = field.prime - series.values[c] if terms[t, 2] else series.values[c]
            for k in range(count):
                if along < 0:
                    entry = tables.column_starts[low] + pair * count + k
                    factor = tables.factors[entry]
                else:
                    above = tables.raised_starts[low] + k * tables.size + along
                    entry = (
                        tables.column_starts[low + 1]
                        + pair * monomials[low + 1]
                        + tables.raised[above]
                    )
                    factor = tables.factors[entry] * tables.exponents[above]
                row = first_row + tables.products[start + k]
                place = ends[row]
                rows.columns[place] = tables.columns[entry]
                rows.values[place] = multiply(value, small[factor], field)
                ends[row] = place + 1


@compiled
def _emit_rows(
    number: int, degree: int, series: SparseSeries, terms: Integers, tables: RowTables, small: Words, field: Field,
    rows: SparseRows,
) -> int:  # fmt: skip
    """Write the `number` rows of one degree if there is room for their entries; return the number
    of entries.
    """
    starts = rows.starts
    starts[: number + 1] = 0
    _emit(False, degree, series, terms, tables, small, field, rows)
    for k in range(1, number + 1):
        starts[k] += starts[k - 1]
    entries = int(starts[number])
    if entries <= len(rows.columns):
        _emit(True, degree, series, terms, tables, small, field, rows)
        for k in range(number, 0, -1):
            starts[k] = starts[k - 1]
        starts[0] = 0
    return entries


def rows_of_degree(
    table: TermTable, degree: int, prime: int, room: Kept[SparseRows] | None = None
) -> Kept[SparseRows]:
    """The coefficients of all monomials of one degree, equation by equation, in this room or a
    larger one.
    """
    tables = row_tables(table.unknowns, degree)
    # A factor is a product of order + 1 exponents of a monomial whose degree is larger by as much.
    most = table.unknowns.most + 1
    small = modular.small_numbers(prime, (degree + most + 1) ** most)
    number = table.equations * int(tables.counts[degree])
    given = (
        number,
        degree,
        table.series.struct,
        table.terms,
        tables,
        small,
        modular.field_of(prime),
    )
    if room is None or len(room.struct.starts) <= number:
        room = _room(number, ENTRIES * number)
    while (entries := _emit_rows(*given, room.struct)) > len(room.struct.columns):
        room = _room(number, entries)
    return room


def _room(number: int, entries: int) -> Kept[SparseRows]:
    starts = np.empty(number + 1, np.int64)
    return Kept(SparseRows(starts, np.empty(entries, np.int64), np.empty(entries, np.uint64)))


@dataclass(frozen=True, slots=True)
class Equations:
    """The equations of one kind: their indices, their order, and all their terms."""

    kind: str
    indices: tuple[Indices, ...]
    order: int
    table: TermTable


@dataclass(frozen=True, slots=True)
class LocalEquations:
    """A system at a point modulo a prime; `order` is the highest order to which its series allow
    prolongation.
    """

    unknowns: Unknowns
    prime: int
    equations: tuple[Equations, ...]


@dataclass(slots=True)
class Prolongation:
    """The echelon form of all rows up to `order`, columns in ascending degree.

    `dependent` marks, for each kind and degree, the rows that depend on previous rows; `expected`
    marks those that did at another point. `rows` are the rows inserted last.
    """

    local: LocalEquations
    echelon: Echelon
    order: int = -1
    row_blocks: list[tuple[Equations, int]] = field(default_factory=list)
    dependent: dict[tuple[str, int], Flags] = field(default_factory=dict)
    expected: Mapping[tuple[str, int], Flags] = field(default_factory=dict)
    rows: Kept[SparseRows] = field(default_factory=lambda: _room(_ROWS, _ROWS * ENTRIES))

    @property
    def unknowns(self) -> Unknowns:
        return self.local.unknowns

    @property
    def size(self) -> int:
        return self.local.unknowns.size

    def width(self, degree: int) -> int:
        """The number of unknowns of degree <= `degree`."""
        return width_below(self.local.unknowns, degree + 1)

    def dimension(self, degree: int) -> int:
        """D_degree(order): the dimension of the projection of the solutions to degrees <=
        degree.
        """
        return self._dimensions([self.width(degree)])[0]

    @property
    def dimensions(self) -> tuple[int, ...]:
        """D_0, …, D_order."""
        return self._dimensions([self.width(degree) for degree in range(self.order + 1)])

    def _dimensions(self, widths: list[int]) -> tuple[int, ...]:
        return tuple(
            width - rank
            for width, rank in zip(widths, self.echelon.ranks_within(widths), strict=True)
        )

    def row_name(self, number: int) -> RowName:
        """The name of an original row."""
        for block, degree in self.row_blocks:
            exponents = exponents_of_degree(self.size, degree)
            if number < len(block.indices) * len(exponents):
                equation, monomial = divmod(number, len(exponents))
                return (block.kind, *block.indices[equation], tuple(exponents[monomial].tolist()))
            number -= len(block.indices) * len(exponents)
        raise IndexError("no such row")


def start(
    local: LocalEquations, expected: Mapping[tuple[str, int], Flags] | None = None
) -> Prolongation:
    """A prolongation without rows; `advance` adds order 0, 1, … `expected` marks rows that were
    dependent elsewhere.
    """
    return Prolongation(local, Echelon(local.prime), expected=expected or {})


def advance(prolongation: Prolongation) -> None:
    """Add one order: the rows of degree r - 1 of equations of order 1, and of degree r of equations
    of order 0.
    """
    prolongation.order += 1
    order = prolongation.order
    prolongation.echelon.widen(prolongation.width(order))
    for block in prolongation.local.equations:
        degree = order - block.order
        if degree < 0 or not block.indices:
            continue
        prolongation.rows = rows_of_degree(
            block.table, degree, prolongation.local.prime, prolongation.rows
        )
        expected = expected_room(prolongation, block, degree)
        found = prolongation.echelon.insert(prolongation.rows.struct, expected, MOST)
        prolongation.dependent[block.kind, degree] = found
        prolongation.row_blocks.append((block, degree))


def expected_room(prolongation: Prolongation, block: Equations, degree: int) -> Flags:
    """Predict the rows that depend on previous ones, from another point or from the degree below.

    Near a generic point a dependence holds identically; its derivative d_a makes the row of alpha +
    e_a depend on rows that come before it, since their order is one of shifts. So dependence passes
    from alpha to higher alpha of the same equation.
    """
    known = prolongation.expected.get((block.kind, degree))
    if known is not None:
        return known
    below = prolongation.dependent.get((block.kind, degree - 1))
    flags = np.zeros(
        (len(block.indices), len(exponents_of_degree(prolongation.size, degree))), np.bool_
    )
    if below is not None and below.any():
        equations, monomials = np.nonzero(below.reshape(len(block.indices), -1))
        flags[equations[:, None], raised_places(prolongation.size, degree - 1)[monomials]] = True
    return flags.reshape(-1)

"""Entries of the prolonged rows, many products of a term and an unknown at a time, compiled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from inverse_service.algebra import modular
from inverse_service.algebra.echelon import Echelon, Flags
from inverse_service.algebra.echelon_kernels import SparseRows, Words
from inverse_service.algebra.modular import Field, compiled, multiply
from inverse_service.algebra.monomials import exponents_of_degree, freeze, raised_places
from inverse_service.algebra.series_kernels import SparseSeries
from inverse_service.algebra.truncated_series import Series
from inverse_service.linear_pde.unknowns import RowTables, Unknowns, known_places, row_tables, width_below
from inverse_service.machine_code.kernels import Kept

Integers = npt.NDArray[np.int64]
Exponents = npt.NDArray[np.int8]
NO_DERIVATIVE = -1
# Of a row, before they are counted.
_ENTRIES = 32


@dataclass(frozen=True, slots=True)
class Term:
    """A summand of one equation: sign * series * entry, or sign * series * d_a entry."""

    equation: int
    entry: int
    derivative: int
    series: Series
    negative: bool = False


@dataclass(frozen=True, slots=True)
class TermTable:
    """The terms of all equations of a kind: equation, series, sign, entry, d_a in the columns of `terms`."""

    unknowns: Unknowns
    equations: int
    series: Kept[SparseSeries]
    terms: Integers

    def __post_init__(self) -> None:
        freeze([self.terms])


def term_table(unknowns: Unknowns, terms: Sequence[Term], equations: int, most: int) -> TermTable:
    """The terms, their series to degree `most`."""
    place_of = known_places(unknowns.size)
    places: list[int] = []
    values: list[int] = []
    degrees: list[int] = []
    starts, numbers = [0], dict[int, int]()
    rows = []
    for term in terms:
        if id(term.series) not in numbers:
            numbers[id(term.series)] = len(numbers)
            for degree, component in enumerate(term.series[: most + 1]):
                if component:
                    table = component.to_dict()
                    places += [place_of[exponents] for exponents in table]
                    values += map(int, table.values())
                    degrees += [degree] * len(table)
            starts.append(len(places))
        rows.append((term.equation, numbers[id(term.series)], term.negative, term.entry, term.derivative))
    found = (np.array(starts, np.int64), np.array(places, np.int64), np.array(values, np.uint64))
    series = SparseSeries(*found, np.array(degrees, np.int64))
    return TermTable(unknowns, equations, Kept(series), np.array(rows, np.int64).reshape(-1, 5))


@compiled
def _emit(
    fill: bool, degree: int, series: SparseSeries, terms: Integers, tables: RowTables, small: Words, field: Field,
    rows: SparseRows,
) -> None:  # fmt: skip
    """Entries of term * (d_a) entry in the rows of one degree, for all terms; counted or filled in.

    The entries of row k are counted in starts[k + 2]; then starts[k + 1], their sum before row k, is where its next
    entry goes, and in the end where row k + 1 begins.
    """
    monomials, ends = tables.counts, rows.starts
    for t in range(len(terms)):
        first_row, pair, along = terms[t, 0] * monomials[degree], terms[t, 3], terms[t, 4]
        for c in range(series.starts[terms[t, 1]], series.starts[terms[t, 1] + 1]):
            if series.degrees[c] > degree:
                break
            # Coefficient m of the series times coefficient m' of (d_a) entry, for all m' of this degree.
            low = degree - series.degrees[c]
            count = monomials[low]
            start = tables.product_starts[series.degrees[c]] + series.places[c] * count
            if not fill:
                for k in range(start, start + count):
                    ends[first_row + tables.products[k] + 2] += 1
                continue
            value = field.prime - series.values[c] if terms[t, 2] else series.values[c]
            for k in range(count):
                if along < 0:
                    entry = tables.column_starts[low] + pair * count + k
                    factor = tables.factors[entry]
                else:
                    above = tables.raised_starts[low] + k * tables.size + along
                    entry = tables.column_starts[low + 1] + pair * monomials[low + 1] + tables.raised[above]
                    factor = tables.factors[entry] * tables.exponents[above]
                row = first_row + tables.products[start + k] + 1
                place = ends[row]
                rows.columns[place] = tables.columns[entry]
                rows.values[place] = multiply(value, small[factor], field)
                ends[row] = place + 1


@compiled
def _emit_rows(
    degree: int, series: SparseSeries, terms: Integers, tables: RowTables, small: Words, field: Field, rows: SparseRows
) -> int:
    """All rows of one degree, where there is room for their entries; the number of these."""
    starts = rows.starts
    starts[:] = 0
    _emit(False, degree, series, terms, tables, small, field, rows)
    for k in range(1, len(starts)):
        starts[k] += starts[k - 1]
    if starts[-1] <= len(rows.columns):
        _emit(True, degree, series, terms, tables, small, field, rows)
    return int(starts[-1])


def rows_of_degree(table: TermTable, degree: int, prime: int) -> SparseRows:
    """The coefficients of all monomials of one degree, equation after equation."""
    tables = row_tables(table.unknowns, degree)
    # A factor is a product of one exponent more than the order, of a monomial of that much more degree.
    most = table.unknowns.most + 1
    small = modular.small_numbers(prime, (degree + most + 1) ** most)
    given = (degree, table.series.struct, table.terms, tables, small, modular.field_of(prime))
    starts = np.empty(table.equations * int(tables.counts[degree]) + 2, np.int64)
    room = _ENTRIES * len(starts)
    while True:
        rows = SparseRows(starts, np.empty(room, np.int64), np.empty(room, np.uint64))
        needed = _emit_rows(*given, rows)
        if needed <= room:
            return rows._replace(starts=starts[:-1])
        room = needed


# (kind, *indices, alpha): which equation, which Taylor coefficient of it.
RowName = tuple[str | int | tuple[int, ...], ...]
Indices = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Equations:
    """The equations of one kind: their indices, their order, and the terms of all."""

    kind: str
    indices: tuple[Indices, ...]
    order: int
    table: TermTable


@dataclass(frozen=True, slots=True)
class LocalEquations:
    """A system at a point modulo a prime; `order` is how far its series let it be prolonged."""

    unknowns: Unknowns
    prime: int
    equations: tuple[Equations, ...]


@dataclass(slots=True)
class Prolongation:
    """The echelon form of all rows up to `order`, columns in ascending degree.

    `dependent` marks, for each kind and degree, the rows that depend on those before; `expected` those that
    did elsewhere.
    """

    local: LocalEquations
    echelon: Echelon
    order: int = -1
    row_blocks: list[tuple[Equations, int]] = field(default_factory=list)
    dependent: dict[tuple[str, int], Flags] = field(default_factory=dict)
    expected: Mapping[tuple[str, int], Flags] = field(default_factory=dict)

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
        """D_degree(order): the dimension of the projection of the solutions to degrees <= degree."""
        width = self.width(degree)
        return width - self.echelon.rank_within(width)

    def row_name(self, number: int) -> RowName:
        """The name of an original row."""
        for block, degree in self.row_blocks:
            exponents = exponents_of_degree(self.size, degree)
            if number < len(block.indices) * len(exponents):
                equation, monomial = divmod(number, len(exponents))
                return (block.kind, *block.indices[equation], tuple(exponents[monomial].tolist()))
            number -= len(block.indices) * len(exponents)
        raise IndexError("no such row")


def start(local: LocalEquations, expected: Mapping[tuple[str, int], Flags] | None = None) -> Prolongation:
    """No rows yet; `advance` makes order 0, 1, … `expected` marks rows that depended on others elsewhere."""
    return Prolongation(local, Echelon(local.prime), expected=expected or {})


def advance(prolongation: Prolongation) -> None:
    """One order more: the rows of degree r - 1 of equations of order 1, of degree r of those of order 0."""
    prolongation.order += 1
    order = prolongation.order
    prolongation.echelon.widen(prolongation.width(order))
    for block in prolongation.local.equations:
        degree = order - block.order
        if degree < 0 or not block.indices:
            continue
        rows = rows_of_degree(block.table, degree, prolongation.local.prime)
        expected = _expected(prolongation, block, degree)
        found = prolongation.echelon.insert(rows, expected, in_order=False)
        prolongation.dependent[block.kind, degree] = found
        prolongation.row_blocks.append((block, degree))


def _expected(prolongation: Prolongation, block: Equations, degree: int) -> Flags | None:
    """Which rows will depend on those before them: those that did elsewhere, or by the degree below.

    Near a generic point a dependence holds identically; its derivative d_a makes the row of alpha + e_a
    depend on rows that come before it, since their order is one of shifts. So the dependent alpha
    of one equation go on upwards.
    """
    known = prolongation.expected.get((block.kind, degree))
    below = prolongation.dependent.get((block.kind, degree - 1))
    if known is not None or below is None or not below.any():
        return known
    above = raised_places(prolongation.size, degree - 1)
    flags = np.zeros((len(block.indices), len(exponents_of_degree(prolongation.size, degree))), np.bool_)
    equations, monomials = np.nonzero(below.reshape(len(block.indices), -1))
    flags[equations[:, None], above[monomials]] = True
    return flags.reshape(-1)

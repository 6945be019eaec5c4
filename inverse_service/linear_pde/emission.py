"""Entries of the prolonged rows, many products of a term and an unknown at a time, compiled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from inverse_service.field import modular
from inverse_service.field.echelon import Echelon, Flags
from inverse_service.field.echelon_kernels import SparseRows, Words
from inverse_service.field.modular import Field, compiled, multiply
from inverse_service.field.monomials import exponents_of_degree, freeze, raised_places
from inverse_service.field.series_kernels import SparseSeries
from inverse_service.field.truncated_series import Series
from inverse_service.kernels.machine_code.kernels import Kept
from inverse_service.linear_pde.unknowns import RowTables, Unknowns, known_places, row_tables, width_below

Integers = npt.NDArray[np.int64]
Exponents = npt.NDArray[np.int8]
NO_DERIVATIVE = -1
# Of a row, before they are counted; and of a prolongation, before it needs more.
_ENTRIES, _ROWS = 32, 256


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

    The entries of row k are counted in starts[k + 1]; then starts[k], their sum before row k, is where its next
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
                    ends[first_row + tables.products[k] + 1] += 1
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
    """The `number` rows of one degree, where there is room for their entries; how many entries these are."""
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


def rows_of_degree(table: TermTable, degree: int, prime: int, room: Kept[SparseRows] | None = None) -> Kept[SparseRows]:
    """The coefficients of all monomials of one degree, equation after equation, in this room or a larger one."""
    tables = row_tables(table.unknowns, degree)
    # A factor is a product of one exponent more than the order, of a monomial of that much more degree.
    most = table.unknowns.most + 1
    small = modular.small_numbers(prime, (degree + most + 1) ** most)
    number = table.equations * int(tables.counts[degree])
    given = (number, degree, table.series.struct, table.terms, tables, small, modular.field_of(prime))
    if room is None or len(room.struct.starts) <= number:
        room = _room(number, _ENTRIES * number)
    while (entries := _emit_rows(*given, room.struct)) > len(room.struct.columns):
        room = _room(number, entries)
    return room


def _room(number: int, entries: int) -> Kept[SparseRows]:
    starts = np.empty(number + 1, np.int64)
    return Kept(SparseRows(starts, np.empty(entries, np.int64), np.empty(entries, np.uint64)))


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
    did elsewhere. `rows` are those inserted last.
    """

    local: LocalEquations
    echelon: Echelon
    order: int = -1
    row_blocks: list[tuple[Equations, int]] = field(default_factory=list)
    dependent: dict[tuple[str, int], Flags] = field(default_factory=dict)
    expected: Mapping[tuple[str, int], Flags] = field(default_factory=dict)
    rows: Kept[SparseRows] = field(default_factory=lambda: _room(_ROWS, _ROWS * _ENTRIES))

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
        return self._dimensions([self.width(degree)])[0]

    @property
    def dimensions(self) -> tuple[int, ...]:
        """D_0, …, D_order."""
        return self._dimensions([self.width(degree) for degree in range(self.order + 1)])

    def _dimensions(self, widths: list[int]) -> tuple[int, ...]:
        return tuple(width - rank for width, rank in zip(widths, self.echelon.ranks_within(widths), strict=True))

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
        prolongation.rows = rows_of_degree(block.table, degree, prolongation.local.prime, prolongation.rows)
        expected = _expected(prolongation, block, degree)
        found = prolongation.echelon.insert(prolongation.rows.struct, expected, in_order=False)
        prolongation.dependent[block.kind, degree] = found
        prolongation.row_blocks.append((block, degree))


def _expected(prolongation: Prolongation, block: Equations, degree: int) -> Flags:
    """Which rows will depend on those before them: those that did elsewhere, or by the degree below.

    Near a generic point a dependence holds identically; its derivative d_a makes the row of alpha + e_a
    depend on rows that come before it, since their order is one of shifts. So the dependent alpha
    of one equation go on upwards.
    """
    known = prolongation.expected.get((block.kind, degree))
    if known is not None:
        return known
    below = prolongation.dependent.get((block.kind, degree - 1))
    flags = np.zeros((len(block.indices), len(exponents_of_degree(prolongation.size, degree))), np.bool_)
    if below is not None and below.any():
        equations, monomials = np.nonzero(below.reshape(len(block.indices), -1))
        flags[equations[:, None], raised_places(prolongation.size, degree - 1)[monomials]] = True
    return flags.reshape(-1)

"""A linear system about a point, prolonged order by order, as rows modulo a prime.

An equation sum s_k y_k + sum s_ka d_a y_k = 0, s_k and s_ka Taylor series and y_k entries of `Unknowns`, is of order 1,
or of order 0 where no derivative of an entry occurs. The rows of order r are its coefficients of all displacement
monomials of degree r - order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from inverse_service.algebra.echelon import Echelon, Flags
from inverse_service.algebra.monomials import exponents_of_degree, raised_places
from inverse_service.linear_pde.emission import TermTable, rows_of_degree
from inverse_service.linear_pde.unknowns import Unknowns, width_below

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
        found = prolongation.echelon.insert(rows.starts, rows.columns, rows.values, expected, in_order=False)
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

"""The elimination of g_11, g_12, … by hand: chosen conditions solved one after the other, exactly.

Every pivot is checked modulo a prime: the minor of the used equations and solved unknowns must not
vanish at the random point, so that no coefficient whose vanishing went unrecognised is divided by.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from flint import nmod_mat

from inverse_service.explanation.hierarchy import EquationName, PointwiseConditions, unknowns
from inverse_service.field.exact_ring import sum_of
from inverse_service.field.rational_functions import Quotient, common_factor
from inverse_service.mechanics.quotient_matrices import determinant

Unknown = tuple[int, int]
Linear = Mapping[Unknown, Quotient]


@dataclass(frozen=True, slots=True)
class Solved:
    """One equation used: as it is, what is left of it with the known unknowns, and what it gives.

    The coefficients of `reduced` are content times polynomials without a common factor, that of
    `pivot` being content * divisor; `pivot` equals the combination `value` of other entries.
    """

    name: EquationName
    original: Linear
    reduced: Linear
    content: Quotient
    pivot: Unknown
    divisor: Quotient
    value: Linear


@dataclass(frozen=True, slots=True)
class Elimination:
    """All steps, and the entries that are still expressed by free ones."""

    solved: tuple[Solved, ...]
    values: Mapping[Unknown, Linear]

    def entry(self, unknown: Unknown, one: Quotient) -> Linear:
        """An entry of g as a combination of free entries."""
        return self.values.get(unknown, {unknown: one})


def eliminate(equations: Mapping[EquationName, Linear], table: PointwiseConditions) -> Elimination:
    """Solve the simplest equation left, again and again, until g is seen to be singular or none is left."""
    left = dict(equations)
    solved: list[Solved] = []
    values: dict[Unknown, Linear] = {}
    while left and vanishing_block(values, table.size) is None:
        reduced = {name: substituted(row, values) for name, row in left.items()}
        choice = _choose(reduced, solved, table)
        if choice is None:
            break
        name, pivot = choice
        step = _solve(name, left.pop(name), reduced[name], pivot)
        solved.append(step)
        values = {unknown: substituted(row, {pivot: step.value}) for unknown, row in values.items()}
        values[pivot] = step.value
    return Elimination(tuple(solved), values)


def substituted(row: Linear, values: Mapping[Unknown, Linear]) -> dict[Unknown, Quotient]:
    """The combination with known unknowns replaced, zero coefficients left out."""
    parts = [(unknown, coefficient) for unknown, coefficient in row.items() if unknown not in values]
    known = [(values[unknown], coefficient) for unknown, coefficient in row.items() if unknown in values]
    return collected([*parts, *((other, c * factor) for value, c in known for other, factor in value.items())])


def collected(terms: Iterable[tuple[Unknown, Quotient]]) -> dict[Unknown, Quotient]:
    """The terms of one equation by unknown, zero coefficients left out."""
    parts: dict[Unknown, list[Quotient]] = {}
    for unknown, coefficient in terms:
        parts.setdefault(unknown, []).append(coefficient)
    sums = {unknown: sum_of(summands[0].field.constant(0), summands) for unknown, summands in parts.items()}
    return {unknown: total for unknown, total in sums.items() if not total.is_zero}


def _choose(
    reduced: Mapping[EquationName, Linear], solved: Sequence[Solved], table: PointwiseConditions
) -> tuple[EquationName, Unknown] | None:
    """The shortest equation and in it the unknown of the simplest coefficient that is a true pivot."""
    order = sorted(reduced, key=lambda name: (len(reduced[name]), _length(reduced[name])))
    for name in order:
        row = reduced[name]
        for unknown in sorted(row, key=lambda u: (_weight(row[u]), u[0] == u[1], u)):
            if _minor([*solved], name, unknown, table):
                return name, unknown
    return None


def _length(row: Linear) -> int:
    return sum(map(_weight, row.values()))


def _weight(coefficient: Quotient) -> int:
    """A measure of size; rational numbers weigh nothing."""
    if coefficient.constant_value is not None:
        return 0
    return len(coefficient.numerator) + sum(power for _, power in coefficient.exponents)


def _minor(solved: Sequence[Solved], name: EquationName, unknown: Unknown, table: PointwiseConditions) -> int:
    """The determinant of the equations used so far in the unknowns solved for, at the random point."""
    position = {pair: column for column, pair in enumerate(unknowns(table.size))}
    columns = [position[step.pivot] for step in solved] + [position[unknown]]
    rows = [table.rows[step.name] for step in solved] + [table.rows[name]]
    flat = [row[column] for row in rows for column in columns]
    return int(nmod_mat(len(rows), len(rows), flat, table.prime).det())


def _solve(name: EquationName, original: Linear, row: Linear, pivot: Unknown) -> Solved:
    content = common_factor(list(row.values()))
    equation = {unknown: coefficient / content for unknown, coefficient in row.items()}
    divisor = equation[pivot]
    value = {other: -(c / divisor) for other, c in equation.items() if other != pivot}
    return Solved(name, original, row, content, pivot, divisor, value)


def vanishing_block(values: Mapping[Unknown, Linear], n: int) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Rows and columns, together more than n, whose common entries are all zero: then det g = 0."""
    zero = {unknown for unknown, row in values.items() if not row}
    for size in range(1, n + 1):
        for rows in itertools.combinations(range(n), size):
            columns = tuple(c for c in range(n) if all((min(r, c), max(r, c)) in zero for r in rows))
            if size + len(columns) > n:
                return rows, columns
    return None


def remaining_determinant(
    elimination: Elimination, n: int, symbols: Mapping[Unknown, Quotient], one: Quotient
) -> Quotient:
    """det g of what remains (n <= 4)."""

    def entry(i: int, j: int) -> Quotient:
        row = elimination.entry((min(i, j), max(i, j)), one)
        return sum_of(one - one, [c * symbols[unknown] for unknown, c in row.items()])

    return determinant([[entry(i, j) for j in range(n)] for i in range(n)], one)

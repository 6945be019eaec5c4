"""(H2) and (H3), differentiated at a point: linear equations in g and its derivatives there.

    H2_ij  Gamma(g_ij) - sum_k (g_ik N^k_j + g_jk N^k_i) = 0     i <= j
    H3_ij  sum_k (g_ik Phi^k_j - g_jk Phi^k_i) = 0               i <  j

Each holds identically, so its derivative by the variables x = (t?, q, v) of a multi-index alpha vanishes at
the point too. By (H1) the derivatives of g_ij by velocities are symmetric: each is named once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement, product

from flint import nmod_mat

from inverse_service.algebra.point import Point, Variable
from inverse_service.algebra.truncated_series import Series
from inverse_service.inverse_problem.decision.analysis import Analysis, moving_variables
from inverse_service.inverse_problem.decision.local_system import LocalSystem, RowName, local_system
from inverse_service.inverse_problem.explanation.hierarchy import kernel, unknowns

Exponents = tuple[int, ...]
Coefficients = Mapping[Exponents, int]


@dataclass(frozen=True, slots=True, order=True)
class DerivativeOfEntry:
    """The derivative of g_ij by the variables counted in `by`; i <= j <= every velocity in `by`."""

    i: int
    j: int
    by: Exponents

    @property
    def degree(self) -> int:
        return sum(self.by)


Row = Mapping[DerivativeOfEntry, int]


def variables_of_question(analysis: Analysis, with_time: bool) -> tuple[Variable, ...]:
    """(t?, q, v), in the order of the multi-indices."""
    return moving_variables(analysis.system, with_time or analysis.system.depends_on_time)


def row_names(n: int, size: int, order: int) -> Iterator[RowName]:
    """H2 with derivatives to order - 1, H3 to `order`, the lowest derivatives first."""
    for degree in range(order + 1):
        for alpha in _multi_indices(size, degree):
            yield from (("H3", i, j, alpha) for i, j in unknowns(n) if i < j)
        for alpha in _multi_indices(size, degree) if degree < order else ():
            yield from (("H2", i, j, alpha) for i, j in unknowns(n))


def _multi_indices(size: int, degree: int) -> list[Exponents]:
    chosen = combinations_with_replacement(range(size), degree)
    return [tuple(places.count(k) for k in range(size)) for places in chosen]


def rows_at(
    analysis: Analysis, with_time: bool, order: int, point: Point, names: Iterable[RowName] | None = None
) -> dict[RowName, Row]:
    """The named rows, or all of the order, at a point with its atoms, modulo its prime.

    SingularPoint where f has no series.
    """
    timed = with_time or analysis.system.depends_on_time
    local = local_system(*analysis.series(point, timed, order + 2))
    table = _Table(local)
    wanted = row_names(local.dimension, local.ring.size, order) if names is None else names
    return {name: table.row(name) for name in wanted}


class _Table:
    """The series of Gamma, N and Phi as tables of coefficients."""

    def __init__(self, local: LocalSystem) -> None:
        self.first, self.prime = local.ring.size - local.dimension, local.ring.prime
        self.field = [_coefficients(series) for series in local.field]
        self.matrices = {
            "H2": [[_coefficients(entry) for entry in row] for row in local.connection],
            "H3": [[_coefficients(entry) for entry in row] for row in local.endomorphism],
        }

    def row(self, name: RowName) -> Row:
        kind, i, j, alpha = name
        row: dict[DerivativeOfEntry, int] = {}
        parts = list(product(*(range(a + 1) for a in alpha)))
        for factor, left, right, sign, by in self._terms(kind, i, j):
            for beta in parts:
                value = factor.get(beta)
                if value is None:
                    continue
                left_over = [a - b for a, b in zip(alpha, beta, strict=True)]
                weight = math.prod(map(math.perm, alpha, beta))
                if by is not None:
                    left_over[by] += 1
                unknown = self._unknown(left, right, left_over)
                row[unknown] = (row.get(unknown, 0) + sign * weight * value) % self.prime
        return {unknown: value for unknown, value in row.items() if value}

    def _terms(self, kind: str, i: int, j: int) -> Iterator[tuple[Coefficients, int, int, int, int | None]]:
        """(factor, i, k, sign, a) for sign factor d_a g_ik, without a derivative where a is None."""
        matrix = self.matrices[kind]
        if kind == "H2":
            yield from ((factor, i, j, 1, a) for a, factor in enumerate(self.field))
        for k, line in enumerate(matrix):
            yield line[j], i, k, 1 if kind == "H3" else -1, None
            yield line[i], j, k, -1, None

    def _unknown(self, i: int, j: int, by: list[int]) -> DerivativeOfEntry:
        velocities = sorted([i, j, *(k - self.first for k in range(self.first, len(by)) for _ in range(by[k]))])
        counts = tuple(velocities[2:].count(k) for k in range(len(by) - self.first))
        return DerivativeOfEntry(velocities[0], velocities[1], (*by[: self.first], *counts))


def _coefficients(series: Series) -> Coefficients:
    terms = (component.to_dict().items() for component in series)
    return {tuple(map(int, exponents)): int(value) for part in terms for exponents, value in part}


def rank_of_derivatives(rows: Mapping[RowName, Row], prime: int) -> int:
    """The rank of the part of the rows that belongs to derivatives of g."""
    lines = _derivatives(rows)
    return nmod_mat(len(lines), len(rows), [entry for line in lines for entry in line], prime).rank()


def cancelling(rows: Mapping[RowName, Row], prime: int) -> Iterator[Mapping[RowName, int]]:
    """A basis of the factors with which rows add up to one without derivatives of g, those of few rows first."""
    for factors in kernel(_derivatives(rows), len(rows), prime):
        yield {name: factor for name, factor in zip(rows, factors, strict=True) if factor}


def _derivatives(rows: Mapping[RowName, Row]) -> list[tuple[int, ...]]:
    """One line for each derivative of g, one column for each row."""
    derivatives = sorted({unknown for row in rows.values() for unknown in row if unknown.degree})
    return [tuple(row.get(unknown, 0) for row in rows.values()) for unknown in derivatives]


def consequence(rows: Mapping[RowName, Row], factors: Mapping[RowName, int], n: int, prime: int) -> tuple[int, ...]:
    """The coefficients over `unknowns` of the rows times these factors."""
    total = dict.fromkeys(unknowns(n), 0)
    for name, factor in factors.items():
        for unknown, value in rows[name].items():
            if not unknown.degree:
                total[unknown.i, unknown.j] += factor * value
    return tuple(value % prime for value in total.values())

"""Which values the multiplier can take at a rational point: what the Helmholtz conditions there leave of g(p)."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import cast

from flint import nmod_mat

from inverse_service.algebra.modular import safe_prime
from inverse_service.algebra.point import Point, number_value
from inverse_service.algebra.semidefinite import Matrix, kernel
from inverse_service.algebra.series import SingularPoint
from inverse_service.expressions.tree import Symbol, Velocity
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.decision.local_system import RowName
from inverse_service.inverse_problem.decision.power_series import prolonged, reconstructed
from inverse_service.inverse_problem.kinds.helmholtz import matrix_of, unknowns_of
from inverse_service.linear_pde.involution import consequences
from inverse_service.linear_pde.unknowns import column_of

Near = Mapping[Symbol | Velocity, Fraction]


def values_at(
    analysis: Analysis, near: Near, with_time: bool, order: int
) -> tuple[list[Matrix] | None, tuple[RowName, ...]]:
    """A basis of the g that the rows to this order leave at the point, and the rows that say so."""
    rows: list[tuple[RowName, ...]] = []

    def residues(seed: int) -> tuple[int, dict[tuple[int, int], int] | None]:
        prime = safe_prime(seed)
        values = {name: number_value(value, prime) for name, value in near.items()}
        prolongation = prolonged(analysis, Point(prime, seed, variables=values), with_time, order)
        within = consequences(prolongation, 0)
        used = sorted({row for basis in within for row in prolongation.echelon.trace({basis: 1})})
        rows.append(tuple(cast(RowName, prolongation.row_name(row)) for row in used))
        reduced, rank = _table(within, prolongation.width(0), prime).rref()
        width = reduced.ncols()
        return prime, {(i, j): int(reduced[i, j]) for i in range(rank) for j in range(width)} | {(-1, 0): rank}

    try:
        found = reconstructed(residues)
    except SingularPoint:
        return None, ()
    if found is None:
        return None, ()
    n, size = len(analysis.system.coordinates), 2 * len(analysis.system.coordinates) + with_time
    unknowns = unknowns_of(n, size)
    places = [[column_of(unknowns, entry) for entry in row] for row in matrix_of(n, size).entries]
    width = n * (n + 1) // 2
    table = [[found[i, j] for j in range(width)] for i in range(int(found[-1, 0]))]
    basis = kernel(table, width) if table else [[Fraction(int(i == j)) for j in range(width)] for i in range(width)]
    return [tuple(tuple(v[column] * factor for column, factor in row) for row in places) for v in basis], rows[0]


def _table(rows: Mapping[int, Mapping[int, int]], width: int, prime: int) -> nmod_mat:
    found = nmod_mat(max(len(rows), 1), width, prime)
    for i, row in enumerate(rows.values()):
        for column, value in row.items():
            found[i, column] = value
    return found

"""A vector k with g k = 0 for every g that is left, which makes det g = 0 a short identity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inverse_service.algebra.rational_functions import Quotient
from inverse_service.inverse_problem.explanation.elimination import Elimination


def null_vector(result: Elimination, n: int, one: Quotient) -> list[Quotient] | None:
    """A vector over the ring of the coefficients, without any entry of g; None where there is no such vector."""
    entries = {(i, j): result.entry((min(i, j), max(i, j)), one) for i in range(n) for j in range(n)}
    free = {unknown for row in entries.values() for unknown in row}
    pivots = dict[int, list[Quotient]]()
    for unknown in sorted(free):
        for i in range(n):
            _eliminate(pivots, [entries[i, j].get(unknown, one - one) for j in range(n)])
    if len(pivots) == n:
        return None
    last = max(column for column in range(n) if column not in pivots)
    return [_component(pivots, column, last, one) for column in range(n)]


def _eliminate(pivots: dict[int, list[Quotient]], row: Sequence[Quotient]) -> None:
    """Add the row to the reduced echelon form."""
    for column, known in pivots.items():
        row = _without(row, known, column)
    lead = next((column for column, value in enumerate(row) if not value.is_zero), None)
    if lead is None:
        return
    normal = [value / row[lead] for value in row]
    for column, known in pivots.items():
        pivots[column] = _without(known, normal, lead)
    pivots[lead] = normal


def _without(row: Sequence[Quotient], known: Sequence[Quotient], column: int) -> list[Quotient]:
    factor = row[column]
    return [*row] if factor.is_zero else [a - factor * b for a, b in zip(row, known, strict=True)]


def _component(pivots: Mapping[int, Sequence[Quotient]], column: int, free: int, one: Quotient) -> Quotient:
    if column in pivots:
        return -pivots[column][free]
    return one if column == free else one - one

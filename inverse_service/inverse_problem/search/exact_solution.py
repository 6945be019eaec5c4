"""Linear equations over the rationals, solved exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_mat


def solution(columns: Sequence[Mapping[Any, Fraction]], right: Mapping[Any, Fraction]) -> list[Fraction] | None:
    """x with sum_k x_k columns[k] = right, later columns where earlier ones do not suffice; None if there is none."""
    sides = [*columns, right]
    rows = list(dict.fromkeys(key for side in sides for key in side))
    entries = (side.get(key, Fraction(0)) for key in rows for side in sides)
    table = fmpq_mat(len(rows), len(sides), [fmpq(a.numerator, a.denominator) for a in entries])
    reduced, order = table.rref()
    found = [Fraction(0)] * len(columns)
    for i in range(order):
        pivot = next(k for k in range(len(sides)) if reduced[i, k])
        if pivot == len(columns):
            return None
        found[pivot] = Fraction(int(reduced[i, len(columns)].p), int(reduced[i, len(columns)].q))
    return found

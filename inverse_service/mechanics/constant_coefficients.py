"""Linear relations with constant coefficients among elements of an exact ring.

Constants are numbers and whatever depends on no variable of the ring: parameters, their functions and roots. What
multiplies a product of the other generators is one linear equation for the coefficients, over the field of constants.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from flint import fmpq

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.mechanics.quotient_matrices import reduced_rows


def null_vectors(ring: ExactRing, columns: Sequence[Sequence[Quotient]]) -> list[list[Quotient]]:
    """A basis of the constant c with sum_k c_k columns[k] = 0, entry by entry."""
    size, zero = len(columns), ring.constant(0)
    found = reduced_rows(_equations(ring, columns), range(size))
    basis = []
    for free in (k for k in range(size) if k not in found.pivots):
        vector = [ring.constant(int(k == free)) for k in range(size)]
        for row, pivot in zip(found.rows, found.pivots, strict=True):
            vector[pivot] = zero - row[free]
        basis.append(vector)
    return basis


def solution(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]], right: Sequence[Quotient]
) -> list[Quotient] | None:
    """Constant c with sum_k c_k columns[k] = right, free ones 0; None where there are none."""
    size = len(columns)
    found = reduced_rows(_equations(ring, [*columns, right]), range(size + 1))
    if size in found.pivots:
        return None
    values = dict(zip(found.pivots, found.rows, strict=True))
    return [values[k][size] if k in values else ring.constant(0) for k in range(size)]


def common_multiple(ring: ExactRing, elements: Iterable[Quotient]) -> Quotient:
    """The least product of listed denominators that clears those of all elements."""
    greatest: dict[int, int] = {}
    for element in elements:
        for index, exponent in element.exponents:
            greatest[index] = max(greatest.get(index, 0), exponent)
    return Quotient(ring.field, ring.field.expand(tuple(sorted(greatest.items()))), ())


def _equations(ring: ExactRing, columns: Sequence[Sequence[Quotient]]) -> list[list[Quotient]]:
    varying = sorted({index for table in ring.images for index in table})
    rows = []
    for entries in zip(*columns, strict=True):
        common = common_multiple(ring, entries)
        parts: dict[tuple[int, ...], list[dict[tuple[int, ...], fmpq]]] = {}
        for k, entry in enumerate(entries):
            for exponents, coefficient in (entry * common).numerator.terms():
                key = tuple(int(exponents[index]) for index in varying)
                rest = tuple(0 if index in varying else int(e) for index, e in enumerate(exponents))
                parts.setdefault(key, [{} for _ in columns])[k][rest] = coefficient
        rows += [
            [Quotient(ring.field, ring.field.context.from_dict(table), ()) for table in row] for row in parts.values()
        ]
    return rows

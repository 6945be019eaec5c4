"""Distributions of vector fields on (t, q): brackets, Frobenius, and the equations X_k(phi) = h_k.

A row is the components of a field in the variables (t or not, then q), followed by the value h that
a function phi is to have along it; h = 0 where only the distribution matters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

from inverse_service.algebra.exact_derivations import sum_of
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.mechanics.quotient_matrices import reduced_rows

Partial = Callable[[Quotient], Quotient]
Field = tuple[Quotient, ...]


@dataclass(frozen=True, slots=True)
class Closure:
    """The smallest involutive distribution that holds some fields.

    `rows` are its fields with a leading 1 in the columns `pivots`, each with its value last; `growth`
    are the ranks met; `consistent` is False where the brackets require a value of the zero field.
    """

    rows: tuple[Field, ...]
    pivots: tuple[int, ...]
    growth: tuple[int, ...]
    consistent: bool

    @property
    def rank(self) -> int:
        return len(self.rows)


def involutive_closure(partials: Sequence[Partial], fields: Sequence[Field]) -> Closure:
    """Brackets are added until nothing new appears, at most as many times as there are variables.

    With X(phi) = h and Y(phi) = k the bracket has the value X(k) - Y(h); where a combination of fields
    vanishes and its value does not, no phi exists (`consistent` False).
    """
    width = len(partials)
    found = reduced_rows(fields, range(width))
    growth = [len(found.rows)]
    consistent = all(row[width].is_zero for _, row in found.dropped)
    while True:
        brackets = [_bracket(partials, left, right) for left, right in combinations(found.rows, 2)]
        fresh = [row for row in brackets if not all(entry.is_zero for entry in row)]
        if not fresh:
            break
        found = reduced_rows([*found.rows, *fresh], range(width))
        consistent = consistent and all(row[width].is_zero for _, row in found.dropped)
        if len(found.rows) == growth[-1]:
            break
        growth.append(len(found.rows))
    return Closure(found.rows, found.pivots, tuple(growth), consistent)


def _bracket(partials: Sequence[Partial], left: Field, right: Field) -> Field:
    """[X, Y], and X(k) - Y(h) as the last entry."""
    return tuple(_along(partials, left, b) - _along(partials, right, a) for a, b in zip(left, right, strict=True))


def _along(partials: Sequence[Partial], field: Field, element: Quotient) -> Quotient:
    components = zip(field[:-1], partials, strict=True)
    terms = [component * partial(element) for component, partial in components if not component.is_zero]
    return sum_of(element - element, terms)


def gradient(partials: Sequence[Partial], closure: Closure) -> tuple[Quotient, ...] | None:
    """The differential of one phi, a closed form, in all variables; None where none is seen.

    phi is taken not to depend on the variables in whose direction no field of the closure leads.
    """
    if not closure.consistent:
        return None
    width = len(partials)
    slopes = dict(zip(closure.pivots, (row[width] for row in closure.rows), strict=True))
    zero = next((row[0] - row[0] for row in closure.rows), None)
    if zero is None:
        return None
    form = tuple(slopes.get(place, zero) for place in range(width))
    for i, j in combinations(range(width), 2):
        if not (partials[i](form[j]) - partials[j](form[i])).is_zero:
            return None
    return form

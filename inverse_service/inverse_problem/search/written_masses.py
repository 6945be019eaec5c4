"""Constants that equations were written with, m x'' + c x' + k x = 0, stay in the Lagrangian that is found for them.

A Lagrangian is given up to a constant factor. Where the Hessian g of a quadratic one is h M, with M_ij = dE_i/dq''_j of
the equations E = 0 as written, the constants that h has as a factor are divided out: e^(ct/m) (m x'^2 - k x^2)/2.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from inverse_service.errors import InputError
from inverse_service.expressions.tree import ONE, Expression, Symbol, Velocity
from inverse_service.inverse_problem.search.as_given import written_masses
from inverse_service.inverse_problem.search.motion import split_velocities
from inverse_service.inverse_problem.search.terms import (
    Monomial,
    Terms,
    TooManyTerms,
    monomial,
    multiply_terms,
    split_content,
    terms_of,
    times,
    tree_of,
)
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_MOST = 12  # coordinates; the comparison takes the fourth power of their number


def with_written_masses(
    lagrangian: Expression, system: SecondOrderSystem, given: Sequence[Expression]
) -> Expression | None:
    """A constant multiple of L whose Hessian has the constants of the equations as written.

    None where L is not quadratic in the velocities, its Hessian no multiple of dE_i/dq''_j, or nothing changes.
    """
    try:
        written = written_masses(system, given) if 0 < len(given) <= _MOST else None
        hessian = _hessian(terms_of(lagrangian), system.coordinates)
    except (TooManyTerms, InputError):
        return None
    if written is None or hessian is None or not _is_multiple(hessian, written):
        return None
    parameters: set[Expression] = {Symbol(name) for name in system.parameters}
    (number, wanted), (value, known) = _constant(written[0][0], parameters), _constant(hessian[0][0], parameters)
    factor, ratio = times(wanted, known, -1), abs(number / value)
    # The factor stays in one piece, so that it cancels: (m + M)/(m + M).
    return tree_of({times(key, factor): ratio * c for key, c in terms_of(lagrangian).items()}) if factor else None


def _hessian(terms: Terms, names: Sequence[str]) -> list[list[Terms]] | None:
    """d^2 L/dv_i dv_j; None where L is not of degree 2 in the velocities."""
    places = {Velocity(name): k for k, name in enumerate(names)}
    found: list[list[Terms]] = [[{} for _ in names] for _ in names]
    for key, value in terms.items():
        rest, moving = split_velocities(key)
        if any(v not in places or e not in (1, 2) for v, e in moving) or sum(e for _, e in moving) > 2:
            return None
        rates = [places[v] for v, e in moving if isinstance(v, Velocity) for _ in range(int(e))]
        if len(rates) == 2:
            i, j = rates
            found[i][j][rest] = found[j][i][rest] = value * (2 if i == j else 1)
    return found


def _is_multiple(left: Sequence[Sequence[Terms]], right: Sequence[Sequence[Terms]]) -> bool:
    """Whether left = h right with any function h."""
    first, other = left[0][0], right[0][0]
    pairs = [pair for rows in zip(left, right, strict=True) for pair in zip(*rows, strict=True)]
    return bool(first and other) and all(multiply_terms(a, other) == multiply_terms(first, b) for a, b in pairs)


def _constant(terms: Terms, parameters: set[Expression]) -> tuple[Fraction, Monomial]:
    """The factor of a sum that is made of numbers and parameters alone, a sum of parameters as one letter."""
    content, common, rest = split_content(terms)
    outside: Monomial = frozenset(item for item in common if item[0] in parameters)
    whole = rest != ONE and {letter for key in terms_of(rest) for letter, _ in key} <= parameters
    return content, times(outside, monomial(rest)) if whole else outside

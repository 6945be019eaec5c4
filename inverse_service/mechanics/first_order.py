"""First-order pairs q' = h(t, q, p), p' = F(t, q, p), h affine in p and solvable for it, as q'' = f(t, q, q').

With p = p(t, q, q') from the first equations, f = dh/dt + dh/dq q' + dh/dp F. Hamilton's equations of a regular
H quadratic in the momenta are such pairs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from inverse_service.errors import InputError
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    TIME,
    Acceleration,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    substitute,
    subtract,
    walk,
)
from inverse_service.mechanics.implicit_equations import solve_accelerations
from inverse_service.mechanics.linear_parts import linear_equation

NOT_PAIRS = (
    "these are first-order equations, and they are no pairs x' = h, p' = F with h affine in p and solvable for p: "
    "write equations of second order such as x'' = -x."
)


@dataclass(frozen=True, slots=True)
class Pairs:
    """The coordinates, and the acceleration of each."""

    coordinates: tuple[str, ...]
    accelerations: tuple[Expression, ...]


def from_pairs(
    equations: Sequence[tuple[Expression, Expression]], coordinates: Sequence[str], preferred: Sequence[str] = ()
) -> Pairs:
    """The second-order system of u' = …, one equation for each of `coordinates`; InputError where there is none.

    `preferred` are the names that are to be coordinates, where the writer said so; else they are those whose
    derivatives are momenta and nothing else (x' = v), else the first half in the order of the equations.
    """
    slopes = _slopes(equations, coordinates)
    order = tuple(slopes)
    half = len(order) // 2
    if len(order) != 2 * half or set(order) != set(coordinates):
        raise InputError(NOT_PAIRS, "/equations")
    plain = tuple(name for name in order if slopes[name] in {Symbol(other) for other in order if other != name})
    for chosen in (tuple(preferred), plain if len(plain) == half else (), order[:half]):
        if len(chosen) == half and set(chosen) <= set(order) and (found := _solved(slopes, chosen)):
            return found
        if chosen and chosen == tuple(preferred):
            break
    raise InputError(NOT_PAIRS, "/equations")


def _slopes(equations: Sequence[tuple[Expression, Expression]], coordinates: Sequence[str]) -> dict[str, Expression]:
    """What each derivative is, in the order of the equations; InputError for one that is not u' = … ."""
    found: dict[str, Expression] = {}
    for left, right in equations:
        side, other = (left, right) if isinstance(left, Velocity) else (right, left)
        if not isinstance(side, Velocity) or any(isinstance(node, Velocity) for node in walk(other)):
            raise InputError(NOT_PAIRS, "/equations")
        found[side.coordinate] = other
    return found


def _solved(slopes: Mapping[str, Expression], chosen: tuple[str, ...]) -> Pairs | None:
    """The system for these coordinates; None where their equations cannot be solved for the other names."""
    momenta = [name for name in slopes if name not in chosen]
    unknowns: dict[Expression, Expression] = {Symbol(name): Acceleration(name) for name in momenta}
    try:
        linear = [linear_equation(subtract(substitute(slopes[q], unknowns), Velocity(q))) for q in chosen]
        values = solve_accelerations(linear, momenta)
    except InputError:
        return None
    known: dict[Expression, Expression] = dict(zip(map(Symbol, momenta), values, strict=True))
    return Pairs(chosen, tuple(substitute(_along(slopes[q], slopes, chosen), known) for q in chosen))


def _along(slope: Expression, slopes: Mapping[str, Expression], chosen: Sequence[str]) -> Expression:
    """The time derivative of h(t, q, p) along the motion."""
    terms = [differentiate(slope, TIME)]
    for name, motion in slopes.items():
        rate = Velocity(name) if name in chosen else motion
        terms.append(multiply(differentiate(slope, Symbol(name)), rate))
    return add(*terms)

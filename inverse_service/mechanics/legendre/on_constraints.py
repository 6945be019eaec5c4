"""Constraints linear in the velocities, carried to phase space by v = v(t, q, p)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from inverse_service.expressions.collecting import collect, expand
from inverse_service.expressions.collecting_trees import merge_powers, terms_tree
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Apply,
    Arbitrary,
    Expression,
    Symbol,
    Velocity,
    is_exponential,
    multiply,
    powers_of,
    substitute,
    walk,
)
from inverse_service.mechanics.legendre.short_forms import quotient, simplified
from inverse_service.mechanics.legendre.transform import LegendreTransform

Table = dict[Expression, Expression]


@dataclass(frozen=True, slots=True)
class _PhaseSpace:
    """Velocities of pivots stay in `first` and are replaced by `last`; `harmless` trees vanish nowhere."""

    first: Table
    last: Table
    variables: frozenset[Expression]
    harmless: frozenset[Expression]


def constraint_images(
    constraints: Sequence[Expression], transform: LegendreTransform, coordinates: Sequence[str]
) -> tuple[Expression, ...]:
    """The constraints w(t, q, v) = 0 as functions of (t, q, p) that vanish at the same points.

    Denominators are cleared, and factors dropped that vanish nowhere on the domain of L: parameters,
    exponentials, what L divides by and what stands under its roots. Where the transform is implicit
    the constraints stay in the velocities. Values: one tree for each constraint.
    """
    if transform.velocities is None:
        return tuple(map(simplified, constraints))
    place = _phase_space(transform, transform.velocities, coordinates)
    return tuple(_image(constraint, place) for constraint in constraints)


def _phase_space(
    transform: LegendreTransform, velocities: Sequence[Expression], coordinates: Sequence[str]
) -> _PhaseSpace:
    rates = [Velocity(name) for name in coordinates]
    pivots = {node for rate in transform.chained for node in walk(rate) if isinstance(node, Velocity)}
    chained = zip(rates, transform.chained, strict=True)
    first: Table = {leaf: rate for leaf, rate in chained if leaf not in pivots}
    last: Table = dict(zip(rates, velocities, strict=True))
    variables: frozenset[Expression] = frozenset([*map(Symbol, coordinates), *transform.symbols, *rates, TIME])
    divisors = [substitute(tree, first) for tree in _divisors(transform.lagrangian)]
    harmless = frozenset(_key(factor) for tree in divisors for factor, _ in powers_of(quotient(tree)))
    return _PhaseSpace(first, last, variables, harmless)


def _divisors(lagrangian: Expression) -> Iterator[Expression]:
    """What L divides by or takes roots and logarithms of."""
    for monomial, _ in expand(lagrangian):
        for base, exponent in monomial:
            if exponent < 0 or exponent.denominator != 1:
                yield base
            if isinstance(base, Apply) and base.function == "log":
                yield base.argument


def _image(constraint: Expression, place: _PhaseSpace) -> Expression:
    """The numerator without its harmless factors; the pivots' velocities are put in at the end."""
    kept = []
    for factor, exponent in powers_of(quotient(substitute(constraint, place.first))):
        if factor == ZERO:
            return ZERO
        if exponent > 0 and not _is_harmless(factor, place):
            kept.append(collect(factor))
    return merge_powers(substitute(multiply(*kept), place.last))


def _is_harmless(factor: Expression, place: _PhaseSpace) -> bool:
    """Whether a factor is constant, an exponential, or known not to vanish."""
    if is_exponential(factor):
        return True
    nodes = set(walk(factor))
    moves = bool(nodes & place.variables) or any(isinstance(node, Arbitrary) for node in nodes)
    return not moves or _key(factor) in place.harmless


def _key(factor: Expression) -> Expression:
    """The tree in a form that is the same for trees that differ by a number."""
    terms = expand(factor)
    if not terms:
        return ZERO
    return terms_tree([(monomial, value / terms[0][1]) for monomial, value in terms])

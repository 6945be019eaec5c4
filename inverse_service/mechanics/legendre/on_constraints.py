"""Constraints linear in the velocities, carried to phase space by v = v(t, q, p)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from inverse_service.expressions import collecting, collecting_trees
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.legendre import short_forms
from inverse_service.mechanics.legendre.transform import LegendreTransform

Table = dict[ex.Expression, ex.Expression]


@dataclass(frozen=True, slots=True)
class _PhaseSpace:
    """Velocities of pivots stay in `first` and are replaced by `last`; `harmless` trees vanish nowhere."""

    first: Table
    last: Table
    variables: frozenset[ex.Expression]
    harmless: frozenset[ex.Expression]


def constraint_images(
    constraints: Sequence[ex.Expression], transform: LegendreTransform, coordinates: Sequence[str]
) -> tuple[ex.Expression, ...]:
    """The constraints w(t, q, v) = 0 as functions of (t, q, p) that vanish at the same points.

    Denominators are cleared, and factors dropped that vanish nowhere on the domain of L: parameters,
    exponentials, what L divides by and what stands under its roots. Where the transform is implicit
    the constraints stay in the velocities. Values: one tree for each constraint.
    """
    if transform.velocities is None:
        return tuple(map(short_forms.simplified, constraints))
    place = _phase_space(transform, transform.velocities, coordinates)
    return tuple(_image(constraint, place) for constraint in constraints)


def _phase_space(
    transform: LegendreTransform, velocities: Sequence[ex.Expression], coordinates: Sequence[str]
) -> _PhaseSpace:
    rates = [ex.Velocity(name) for name in coordinates]
    pivots = {node for rate in transform.chained for node in ex.walk(rate) if isinstance(node, ex.Velocity)}
    chained = zip(rates, transform.chained, strict=True)
    first: Table = {leaf: rate for leaf, rate in chained if leaf not in pivots}
    last: Table = dict(zip(rates, velocities, strict=True))
    variables: frozenset[ex.Expression] = frozenset([*map(ex.Symbol, coordinates), *transform.symbols, *rates, ex.TIME])
    divisors = [ex.substitute(tree, first) for tree in _divisors(transform.lagrangian)]
    harmless = frozenset(_key(factor) for tree in divisors for factor, _ in ex.powers_of(short_forms.quotient(tree)))
    return _PhaseSpace(first, last, variables, harmless)


def _divisors(lagrangian: ex.Expression) -> Iterator[ex.Expression]:
    """What L divides by or takes roots and logarithms of."""
    for monomial, _ in collecting.expand(lagrangian):
        for base, exponent in monomial:
            if exponent < 0 or exponent.denominator != 1:
                yield base
            if isinstance(base, ex.Apply) and base.function == "log":
                yield base.argument


def _image(constraint: ex.Expression, place: _PhaseSpace) -> ex.Expression:
    """The numerator without its harmless factors; the pivots' velocities are put in at the end."""
    kept = []
    for factor, exponent in ex.powers_of(short_forms.quotient(ex.substitute(constraint, place.first))):
        if factor == ex.ZERO:
            return ex.ZERO
        if exponent > 0 and not _is_harmless(factor, place):
            kept.append(collecting.collect(factor))
    return collecting_trees.merge_powers(ex.substitute(ex.multiply(*kept), place.last))


def _is_harmless(factor: ex.Expression, place: _PhaseSpace) -> bool:
    """Whether a factor is constant, an exponential, or known not to vanish."""
    if ex.is_exponential(factor):
        return True
    nodes = set(ex.walk(factor))
    moves = bool(nodes & place.variables) or any(isinstance(node, ex.Arbitrary) for node in nodes)
    return not moves or _key(factor) in place.harmless


def _key(factor: ex.Expression) -> ex.Expression:
    """The tree in a form that is the same for trees that differ by a number."""
    terms = collecting.expand(factor)
    if not terms:
        return ex.ZERO
    return collecting_trees.terms_tree([(monomial, value / terms[0][1]) for monomial, value in terms])

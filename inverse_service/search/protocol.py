"""The parts and results of the search, and the choice of additional Lagrangians to show.

Leaves propose Lagrangians. A reduction makes smaller systems, and `lift` transforms their Lagrangians back. The search
finds the Lagrangians of the smaller systems, limits the work, and verifies the lifted Lagrangians.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mpmath

from inverse_service import deadline
from inverse_service.decision import certify, deciding, solutions
from inverse_service.expressions import printing, tree as ex
from inverse_service.field import exact_field, real_point
from inverse_service.mechanics import euler_lagrange, writing
from inverse_service.search import terms

if TYPE_CHECKING:
    from inverse_service.mechanics.second_order_system import SecondOrderSystem
    from inverse_service.search.material import Material


_LONGEST_CHECK = 60.0  # seconds per described Lagrangian
# Two Hessians are compared at a point and where its coordinates and velocities are larger by this factor.
_TINY, _STEP = mpmath.mpf(10) ** -20, mpmath.mpf(129) / 128


@dataclass(frozen=True, slots=True)
class Found:
    """Regular Lagrangians of one family, simplest first; `parts` are the Lagrangians whose sum is the first one."""

    lagrangians: tuple[ex.Expression, ...]
    family: str
    parts: tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """The Lagrangians found, and each family tried with its number of candidates."""

    found: Found | None
    tried: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Leaf:
    """A method for the systems that it accepts; the most costly methods come last.

    `propose(material, seed)` returns regular Lagrangians, simplest first. The search verifies them unless the method is
    `exact`. `reason` explains in a sentence how such a Lagrangian is derived.
    """

    name: str
    cost: float
    accepts: Callable[[Material], bool]
    propose: Callable[[Material, int], Sequence[ex.Expression]]
    reason: str
    exact: bool = False


@dataclass(frozen=True, slots=True)
class Smaller:
    """Systems whose Lagrangians L(q, q'), or L(t, q, q') for those `with_time`, yield Lagrangians of the given system.

    `lift` takes the Lagrangians of each system, simplest first.
    """

    systems: tuple[SecondOrderSystem, ...]
    with_time: tuple[bool, ...]
    lift: Callable[[Sequence[Sequence[ex.Expression]]], Sequence[ex.Expression]]


def describe(analysis: deciding.Analysis, lagrangian: ex.Expression, family: str) -> solutions.Lagrangian:
    """Describe L: g = d2L/dv dv, the functions that must not vanish, and those that are positive on its domain."""
    names = analysis.system.coordinates
    rates = euler_lagrange.hessian(lagrangian, names)
    short = {entry: _compact(analysis, entry) for row in rates for entry in row}
    multiplier = tuple(tuple(short[entry] for entry in row) for row in rates)
    where = certify.where_proved(analysis, lagrangian, min(deadline.left(deadline.end(), 1.0), _LONGEST_CHECK))
    return solutions.Lagrangian(lagrangian, multiplier, where.nonzero, family, where.positive)


def _compact(analysis: deciding.Analysis, entry: ex.Expression) -> ex.Expression:
    """The entry as a sum of products or, if that is shorter, as one quotient; parameters are printed first."""
    held, count = set(ex.walk(entry)), 1 + 2 * len(analysis.system.coordinates)
    moving = [variable for variable in deciding.variables_of(analysis.system)[:count] if variable in held]
    return writing.shorten(terms.collected(entry), exact_field.Budget.short(), moving)


def is_multiple(
    first: ex.Expression, second: ex.Expression, names: Sequence[str], table: real_point.RealTable | None
) -> bool:
    """Whether the Hessians are constant multiples of each other at the real point and at a point near it."""
    if table is None:
        return first == second
    moving = {*map(ex.Symbol, names), *map(ex.Velocity, names)}
    with mpmath.workdps(30):
        beside = {leaf: value * _STEP if leaf in moving else value for leaf, value in table.items()}
        forms = [[euler_lagrange.hessian_at(tree, names, at) for tree in (first, second)] for at in (table, beside)]
        if any(form is None for pair in forms for form in pair):
            return False
        pairs = [entries for pair in forms for entries in zip(*pair, strict=True)]
        a, b = max(pairs, key=lambda pair: abs(pair[0]))
        return all(abs(x * b - y * a) < _TINY * (1 + abs(a * b)) for x, y in pairs)


def why_shown(
    shown: ex.Expression, other: ex.Expression, names: Sequence[str], table: real_point.RealTable | None
) -> str:
    """The advantage of another Lagrangian over the shown one; "" if it has none."""
    if len(printing.to_text(other)) < len(printing.to_text(shown)):
        return "shorter"
    if is_definite(other, names, table) and not is_definite(shown, names, table):
        return "positive definite"
    return "of another kind" if _kind(other, names) < _kind(shown, names) else ""


def is_definite(lagrangian: ex.Expression, names: Sequence[str], table: real_point.RealTable | None) -> bool:
    """Whether the Hessian is positive definite at the real point."""
    return euler_lagrange.inertia(euler_lagrange.hessian_at(lagrangian, names, table)) == (len(names), 0)


def _kind(lagrangian: ex.Expression, names: Sequence[str]) -> tuple[int, bool]:
    """Its `reading_class`, and whether its degree in the velocities exceeds 2."""
    moving = {*map(ex.Velocity, names)}
    is_higher = any(
        node in moving for row in euler_lagrange.hessian(lagrangian, names) for entry in row for node in ex.walk(entry)
    )
    return ex.reading_class(lagrangian, ex.TIME), is_higher

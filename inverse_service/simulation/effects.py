"""The parts of a Lagrangian that can be left out of a scene: potential, magnetic part, further terms.

L = T(q, v) + b_i(q) v^i - V(q):   kinetic part, "magnetic" (linear in v), "potential" (free of v)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import ZERO, Expression, Sum, Velocity, add, walk

KINETIC, POTENTIAL, MAGNETIC, CONSTRAINTS = "kinetic", "potential", "magnetic", "constraints"
BUILT_IN = (CONSTRAINTS, POTENTIAL, MAGNETIC, KINETIC)


@dataclass(frozen=True, slots=True)
class LagrangianParts:
    """L = kinetic + magnetic + potential, each zero where L has no such terms (`potential` is -V)."""

    kinetic: Expression
    magnetic: Expression
    potential: Expression


def lagrangian_parts(lagrangian: Expression, coordinates: Sequence[str]) -> LagrangianParts:
    """The terms of L by their kind; a term is taken as a whole."""
    whole = collect(lagrangian)
    kinds: dict[str, list[Expression]] = {KINETIC: [], MAGNETIC: [], POTENTIAL: []}
    for term in whole.terms if isinstance(whole, Sum) else (whole,):
        kinds[_kind(term, coordinates)].append(term)
    return LagrangianParts(*(add(*kinds[kind]) for kind in (KINETIC, MAGNETIC, POTENTIAL)))


def _kind(term: Expression, coordinates: Sequence[str]) -> str:
    rates = [Velocity(name) for name in coordinates if Velocity(name) in set(walk(term))]
    if not rates:
        return POTENTIAL
    slopes = [differentiate(term, rate) for rate in rates]
    linear = all(collect(differentiate(slope, rate)) == ZERO for slope in slopes for rate in rates)
    return MAGNETIC if linear else KINETIC


def with_effects(parts: LagrangianParts, terms: Mapping[str, Expression], named: Sequence[str]) -> Expression:
    """The Lagrangian of a scene: the kinetic part and what `named` lists; all else is not there at all."""
    chosen = [parts.kinetic]
    if MAGNETIC in named:
        chosen.append(parts.magnetic)
    if POTENTIAL in named:
        chosen.append(parts.potential)
    return collect(add(*chosen, *(tree for name, tree in terms.items() if name in named)))

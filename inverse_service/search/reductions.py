"""Reductions in the given coordinates: blocks that share none, damping taken away.

Along q'' = f_0 - c v the Euler-Lagrange expressions of e^(int c dt) L_0 are e^(int c dt) c (p - g v), with p = dL_0/dv
and g its Hessian, where L_0 is a Lagrangian of f_0: they vanish where p = g v, as for a kinetic energy that is
quadratic in v without linear terms (Bateman 1931 for one coordinate).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import partial

from inverse_service import bounds
from inverse_service.deadline import end
from inverse_service.decision.certify import walk_integrals
from inverse_service.decision.deciding import analyze, decide
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import (
    TIME,
    Apply,
    Expression,
    Integral,
    Symbol,
    Velocity,
    add,
    children,
    holds,
    number,
    rebuild,
    walk,
)
from inverse_service.field.exact_atoms import factored
from inverse_service.field.rational_functions import Budget, TooLarge
from inverse_service.linear_pde.involutive_form import Limits
from inverse_service.mechanics.second_order_system import SecondOrderSystem, connected
from inverse_service.search.factors import divergence_factor, hidden_damping, integrating_factor
from inverse_service.search.material import Material, coefficient
from inverse_service.search.protocol import Smaller
from inverse_service.search.quadratures import fresh_names
from inverse_service.search.terms import (
    Terms,
    TooManyTerms,
    monomial,
    monomial_tree,
    split_velocities,
    terms_of,
    tree_of,
)


def decoupled_blocks(system: SecondOrderSystem) -> list[SecondOrderSystem]:
    """The system as blocks: within one, coordinates occur in each other's equations, directly or by others."""
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    links = ({name} | _coordinates_in(f, system.coordinates) for name, f in pairs)
    return [_block(system, group) for group in connected(system.coordinates, links)]


def _coordinates_in(tree: Expression, names: Sequence[str]) -> set[str]:
    found = set()
    for node in walk(tree):
        if isinstance(node, Velocity):
            found.add(node.coordinate)
        elif isinstance(node, Symbol) and node.name in names:
            found.add(node.name)
    return found


def _block(system: SecondOrderSystem, group: Collection[str]) -> SecondOrderSystem:
    kept = [k for k, name in enumerate(system.coordinates) if name in group]
    coordinates = tuple(system.coordinates[k] for k in kept)
    return replace(system, coordinates=coordinates, accelerations=tuple(system.accelerations[k] for k in kept))


def _cancelled(material: Material) -> SecondOrderSystem:
    """The system, with f_i as it was factored where fewer coordinates occur in it: (u x - v x)/(u - v) is x."""
    system = material.analysis.system
    pairs = zip(system.accelerations, map(tree_of, material.motion.forces), strict=True)
    forces = tuple(min(pair, key=lambda tree: len(_coordinates_in(tree, system.coordinates))) for pair in pairs)
    return replace(system, accelerations=forces)


def is_decoupled(material: Material) -> bool:
    return len(decoupled_blocks(_cancelled(material))) > 1


def into_blocks(material: Material, seed: int) -> Iterator[Smaller]:
    """The blocks; the sum of their Lagrangians is one of the whole system."""
    blocks = tuple(decoupled_blocks(_cancelled(material)))
    system = material.analysis.system
    yield Smaller(blocks, material.motion.with_time, lambda found: [_sum_of(system, [trees[0] for trees in found])])


def _sum_of(system: SecondOrderSystem, trees: Sequence[Expression]) -> Expression:
    """The sum of Lagrangians of blocks, each of which may have called an integral of its own F."""
    fresh, used, found = fresh_names(system, *trees), set[str](), []
    for tree in trees:
        own = {node.name for node in walk_integrals(tree)}
        names = {name: next(fresh) for name in sorted(own & used)}
        used |= own
        found.append(_renamed(tree, names) if names else tree)
    return add(*found)


def _renamed(tree: Expression, names: Mapping[str, str]) -> Expression:
    named = replace(tree, name=names.get(tree.name, tree.name)) if isinstance(tree, Integral) else tree
    return rebuild(named, lambda part: _renamed(part, names))


def is_damped(material: Material) -> bool:
    """Whether L may depend on t, n > 1, each f_i holds its own velocity, and f is of degree 2 in them, as for T - V."""
    motion = material.motion
    if not motion.with_time or motion.size == 1:
        return False
    pairs = zip(motion.velocities, material.analysis.system.accelerations, strict=True)
    if not all(holds(f, v) for v, f in pairs):
        return False
    return _is_quadratic(material) or hidden_damping(material.analysis) is not None


def _is_quadratic(material: Material) -> bool:
    moving = [split_velocities(key)[1] for terms in material.motion.forces for key in terms]
    return all(isinstance(p, Velocity) and 0 < e <= 2 for part in moving for p, e in part)


def without_damping(material: Material, seed: int) -> Iterator[Smaller]:
    """f + c v for each c(t) that leaves a system with a Lagrangian; e^(int c dt) takes that back."""
    for rate, factor in _rates(material, seed):
        analysis = analyze(_undamped(material, rate))
        with_time, limits = analysis.system.depends_on_time, Limits(deadline=end())
        decision = decide(analysis.system, with_time, seed, limits, lambda _: None, analysis=analysis)
        if decision.verdict == "variational":
            yield Smaller((analysis.system,), with_time, partial(_damped, factor))


def _damped(factor: Expression, found: Sequence[Sequence[Expression]]) -> list[Expression]:
    return [factor * tree for tree in found[0]]


def _rates(material: Material, seed: int) -> Iterator[tuple[Expression, Expression]]:
    """(c, e^(int c dt)): the coefficient common to all -v_i in f_i, or what the divergence asks for."""
    hidden = None if _is_quadratic(material) else hidden_damping(material.analysis)
    if hidden is not None:
        yield number(hidden), Apply("exp", hidden * TIME)
        return
    common = _common_coefficient(material)
    factor = integrating_factor(material, common, TIME, seed) if common else None
    if common and factor:
        yield tree_of({key: -value for key, value in common.items()}), monomial_tree(factor)
        return
    whole = divergence_factor(material, seed)
    if whole:
        ((exponential, e),) = whole
        (argument,) = children(exponential)
        rate = tree_of({key - {(TIME, Fraction(1))}: value * e for key, value in terms_of(argument).items()})
        yield rate, Apply("exp", rate * TIME)


def _common_coefficient(material: Material) -> Terms | None:
    """The terms c with c v_i in every f_i as it is written, c without coordinates."""
    motion = material.motion
    shared: Terms | None = None
    for v, f in zip(motion.velocities, material.analysis.system.accelerations, strict=True):
        try:
            own = coefficient(terms_of(f), monomial(v))
        except TooManyTerms:
            return None
        plain = {k: c for k, c in own.items() if not any(holds(letter, *motion.coordinates) for letter, _ in k)}
        shared = plain if shared is None else {k: c for k, c in shared.items() if plain.get(k) == c}
    return shared


def _undamped(material: Material, rate: Expression) -> SecondOrderSystem:
    """q'' = f + c v."""
    system = material.analysis.system
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    without = tuple(collect(f + rate * Velocity(name)) for name, f in pairs)
    with suppress(TooLarge, ZeroDivisionError, KeyError, IrreducibleAtoms):
        leaves: list[Symbol | Velocity] = [*map(Symbol, system.coordinates), *map(Velocity, system.coordinates)]
        if not _is_quadratic(material):
            without = tuple(factored(without, leaves, Budget(bounds.TERMS, end())))
    return replace(system, accelerations=without)

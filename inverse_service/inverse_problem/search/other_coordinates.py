"""Lagrangians found in other coordinates and carried back.

A regular Lagrangian stays one under a change of coordinates. Where a change that f suggests makes f
shorter, the whole search is made for the system in the new coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.collecting_trees import merge_powers
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Apply,
    Expression,
    Number,
    Power,
    Symbol,
    Velocity,
    add,
    multiply,
    rebuild,
    substitute,
    walk,
)
from inverse_service.inverse_problem.search.coordinate_changes import Change, suggested
from inverse_service.inverse_problem.search.deadline import OutOfTime, check, end, within
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.protocol import Smaller
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_MOST_CHANGES = 2
# To write f in other coordinates; what takes longer is not the shorter system that is wanted.
_WORK_OF_A_CHANGE = 60_000
_TERMS, _WORK_TO_SIMPLIFY = 500, 150_000


def applies(material: Material) -> bool:
    """Whether f suggests other coordinates."""
    return bool(suggested(material))


def in_shorter_coordinates(material: Material, seed: int) -> Iterator[Smaller]:
    """The system in the shortest of the suggested coordinates; its Lagrangians in the given ones again."""
    for change, system in _shorter(material)[:_MOST_CHANGES]:
        yield Smaller(
            (system,), material.motion.with_time, partial(_carried_back, _table(change.new, system.coordinates))
        )


def _carried_back(table: dict[Expression, Expression], found: Sequence[Sequence[Expression]]) -> list[Expression]:
    return [merge_powers(substitute(tree, table)) for tree in found[0]]


def _shorter(material: Material) -> list[tuple[Change, SecondOrderSystem]]:
    """The changes that make f shorter, the best first, with the system in the new coordinates."""
    system = material.analysis.system
    settled = [_settled(f, system.coordinates) for f in system.accelerations]
    own = min(_size(system.accelerations), _size(settled))
    found = list(_transformed(material, own))
    return sorted(found, key=lambda pair: _size(pair[1].accelerations))


def _size(trees: Sequence[Expression]) -> int:
    return sum(1 for tree in trees for _ in walk(tree))


def _transformed(material: Material, size: int) -> Iterator[tuple[Change, SecondOrderSystem]]:
    """The changes that make f smaller than that."""
    for change in suggested(material):
        check()
        try:
            with within(_WORK_OF_A_CHANGE):
                other = transformed(material.analysis.system, change, size)
        except (ArithmeticError, ValueError, OutOfTime):
            continue
        if other is not None:
            yield change, other


def transformed(system: SecondOrderSystem, change: Change, size: float = math.inf) -> SecondOrderSystem | None:
    """The system in the new coordinates: Q'' = W_q f + (W_qq v) v with q = psi(Q); None where f gets that large."""
    names = system.coordinates
    forces = dict(zip(names, system.accelerations, strict=True))
    table: dict[Expression, Expression] = {**_table(change.old, names), **change.functions}
    accelerations = []
    for name in names:
        rate = _rate(change.new[name], names) if name in change.new else Velocity(name)
        along = [multiply(differentiate(rate, Velocity(other)), forces[other]) for other in names]
        whole = add(_rate(rate, names), *along)
        placed = substitute(to_kernels(whole) if change.functions else whole, table)
        accelerations.append(_settled(placed, names))
        if _size(accelerations) >= size:
            return None
    return replace(system, accelerations=tuple(accelerations))


def _rate(tree: Expression, names: Sequence[str]) -> Expression:
    """sum v dF/dq."""
    return add(ZERO, *(multiply(differentiate(tree, Symbol(name)), Velocity(name)) for name in names))


def _table(functions: Mapping[str, Expression], names: Sequence[str]) -> dict[Expression, Expression]:
    """Each coordinate that changes, and its velocity, as functions of the others."""
    table: dict[Expression, Expression] = {}
    for name, tree in functions.items():
        table[Symbol(name)] = tree
        table[Velocity(name)] = _rate(tree, names)
    return table


def _settled(tree: Expression, names: Sequence[str]) -> Expression:
    """The tree as factored quotients, arguments of functions and radicands first."""
    return _quotient(_inside(collect(tree), names), names)


def _inside(tree: Expression, names: Sequence[str]) -> Expression:
    tree = rebuild(tree, lambda part: _inside(part, names))
    if isinstance(tree, Apply):
        return Apply(tree.function, _quotient(tree.argument, names))
    if isinstance(tree, Power) and isinstance(tree.exponent, Number) and tree.exponent.value.denominator > 1:
        return Power(_quotient(tree.base, names), tree.exponent)
    return tree


def _quotient(tree: Expression, names: Sequence[str]) -> Expression:
    if isinstance(tree, Number | Symbol | Velocity):
        return tree
    symbols: list[Symbol | Velocity] = [TIME, *map(Symbol, names), *map(Velocity, names)]
    budget = Budget(_TERMS, end(), _WORK_TO_SIMPLIFY)
    try:
        ring = exact_ring([tree], symbols, 0, budget, slopes=False)
        return quotient_tree(ring, ring.value(tree))
    except (TooLarge, ZeroDivisionError):
        return tree
    finally:
        check(1 + budget.done)

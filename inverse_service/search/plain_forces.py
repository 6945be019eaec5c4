"""f as plain as the search can make it: roots denested, few atoms, few constants."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial

import mpmath

from inverse_service import bounds
from inverse_service.decision.deciding import Analysis, analyze
from inverse_service.errors import InputError, IrreducibleAtoms
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import (
    ONE,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    add,
    distinct_nodes,
    dot,
    node_count,
    number,
    rebuild,
    substitute,
    walk,
)
from inverse_service.field.real_point import varies
from inverse_service.field.tower import AngleRule, Tower, to_kernels
from inverse_service.search.tidy import collected_inside, without_arctangents


def plain(analysis: Analysis) -> Analysis:
    """The system with f as plain as it can be made.

    Lagrangians that hold for it are checked with f as it was given.
    """
    forces = with_few_constants(tuple(map(partial(_plainer, analysis.tower), analysis.system.accelerations)))
    if forces != analysis.system.accelerations:
        with suppress(IrreducibleAtoms):
            return analyze(replace(analysis.system, accelerations=forces))
    return analysis


def _plainer(tower: Tower, force: Expression) -> Expression:
    """Nested roots denested; atoms that follow from others, such as e^(log x), written by these if that is shorter."""
    force = denested(force)
    plain = to_kernels(without_arctangents(force))
    for rule in reversed(tower.rules):
        if not isinstance(rule, AngleRule) and not rule.free:
            plain = substitute(plain, {rule.atom: rule.tree})
    with suppress(InputError):
        plain = plain if plain == force else collected_inside(plain)
    return min(force, plain, key=node_count)


@lru_cache(maxsize=256)
def denested(tree: Expression) -> Expression:
    """The tree with each root of a constant sum of roots as a short sum of these, where it is one to 60 digits."""
    match tree:
        case Power(Sum() as base, Number(exponent)) if exponent.denominator > 1 and _is_constant(base):
            with suppress(NoRealValue):
                return _short_sum(tree, base) or tree
            return tree
        case _:
            return rebuild(tree, denested)


def _is_constant(tree: Expression) -> bool:
    return all(isinstance(node, Number | Power | Sum | Product) for node in walk(tree))


def _short_sum(tree: Expression, base: Expression) -> Expression | None:
    """Rationals times 1 and the roots in the base that add up to the tree."""
    basis: list[Expression] = [ONE]
    basis += dict.fromkeys(node for node in walk(base) if isinstance(node, Power))
    basis = basis[: 1 + bounds.FEW]
    with mpmath.workdps(bounds.DIGITS):
        values = [evaluate(part, {}) for part in (tree, *basis)]
        relation = mpmath.pslq(values, maxcoeff=bounds.RATIO, maxsteps=bounds.RATIO)
    if not relation or not relation[0]:
        return None
    weights = (number(Fraction(-c, relation[0])) for c in relation[1:])
    return dot(weights, basis)


def with_few_constants(forces: tuple[Expression, ...]) -> tuple[Expression, ...]:
    """The trees with cos(pi/5) and the like as short sums of the roots in them, where they are to 60 digits."""
    nodes = [node for node in distinct_nodes(forces) if not varies(node)]
    roots = dict.fromkeys(node for node in nodes if isinstance(node, Power) and _is_constant(node))
    table: dict[Expression, Expression] = {}
    for node in nodes if roots else ():
        if isinstance(node, Apply):
            with suppress(NoRealValue):
                found = _short_sum(node, add(*roots))
                table |= {} if found is None else {node: found}
    return tuple(substitute(force, table) for force in forces) if table else forces

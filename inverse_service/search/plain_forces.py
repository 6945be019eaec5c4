"""f as plain as the search can make it: roots denested, few atoms, few constants."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial

import mpmath

from inverse_service import bounds, errors
from inverse_service.decision import deciding
from inverse_service.expressions import evaluation
from inverse_service.expressions import tree as ex
from inverse_service.field import real_point
from inverse_service.field.tower import AngleRule, Tower, to_kernels
from inverse_service.search import tidy


def plain(analysis: deciding.Analysis) -> deciding.Analysis:
    """The system with f as plain as it can be made.

    Lagrangians that hold for it are checked with f as it was given.
    """
    forces = with_few_constants(tuple(map(partial(_plainer, analysis.tower), analysis.system.accelerations)))
    if forces != analysis.system.accelerations:
        with suppress(errors.IrreducibleAtoms):
            return deciding.analyze(replace(analysis.system, accelerations=forces))
    return analysis


def _plainer(tower: Tower, force: ex.Expression) -> ex.Expression:
    """Nested roots denested; atoms that follow from others, such as e^(log x), written by these if that is shorter."""
    force = denested(force)
    plain = to_kernels(tidy.without_arctangents(force))
    for rule in reversed(tower.rules):
        if not isinstance(rule, AngleRule) and not rule.free:
            plain = ex.substitute(plain, {rule.atom: rule.tree})
    with suppress(errors.InputError):
        plain = plain if plain == force else tidy.collected_inside(plain)
    return min(force, plain, key=ex.node_count)


@lru_cache(maxsize=256)
def denested(tree: ex.Expression) -> ex.Expression:
    """The tree with each root of a constant sum of roots as a short sum of these, where it is one to 60 digits."""
    match tree:
        case ex.Power(ex.Sum() as base, ex.Number(exponent)) if exponent.denominator > 1 and _is_constant(base):
            with suppress(evaluation.NoRealValue):
                return _short_sum(tree, base) or tree
            return tree
        case _:
            return ex.rebuild(tree, denested)


def _is_constant(tree: ex.Expression) -> bool:
    return all(isinstance(node, ex.Number | ex.Power | ex.Sum | ex.Product) for node in ex.walk(tree))


def _short_sum(tree: ex.Expression, base: ex.Expression) -> ex.Expression | None:
    """Rationals times 1 and the roots in the base that add up to the tree."""
    basis: list[ex.Expression] = [ex.ONE]
    basis += dict.fromkeys(node for node in ex.walk(base) if isinstance(node, ex.Power))
    basis = basis[: 1 + bounds.FEW]
    with mpmath.workdps(bounds.DIGITS):
        values = [evaluation.evaluate(part, {}) for part in (tree, *basis)]
        relation = mpmath.pslq(values, maxcoeff=bounds.RATIO, maxsteps=bounds.RATIO)
    if not relation or not relation[0]:
        return None
    weights = (ex.number(Fraction(-c, relation[0])) for c in relation[1:])
    return ex.dot(weights, basis)


def with_few_constants(forces: tuple[ex.Expression, ...]) -> tuple[ex.Expression, ...]:
    """The trees with cos(pi/5) and the like as short sums of the roots in them, where they are to 60 digits."""
    nodes = [node for node in ex.distinct_nodes(forces) if not real_point.varies(node)]
    roots = dict.fromkeys(node for node in nodes if isinstance(node, ex.Power) and _is_constant(node))
    table: dict[ex.Expression, ex.Expression] = {}
    for node in nodes if roots else ():
        if isinstance(node, ex.Apply):
            with suppress(evaluation.NoRealValue):
                found = _short_sum(node, ex.add(*roots))
                table |= {} if found is None else {node: found}
    return tuple(ex.substitute(force, table) for force in forces) if table else forces

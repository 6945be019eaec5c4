"""A Lagrangian with its multiplier and the set on which it lives."""

from __future__ import annotations

from collections.abc import Iterable

from inverse_service.algebra.rational_functions import TooLarge
from inverse_service.expressions.tree import Expression, Number, Power, Symbol, Velocity, negate, walk
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.decision.certify import domain_of
from inverse_service.inverse_problem.outcome import Lagrangian, Matrix
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of, tree_of
from inverse_service.mechanics.euler_lagrange import hessian


def describe(analysis: Analysis, lagrangian: Expression, family: str) -> Lagrangian:
    """g = d2L/dv dv, the functions that must not vanish, those that are positive on its connected domain."""
    names = analysis.system.coordinates
    multiplier = tuple(tuple(_compact(entry) for entry in row) for row in hessian(lagrangian, names))
    positive = domain_of(analysis, lagrangian).positive
    signed = {*positive, *map(negate, positive)}
    nonzero = _distinct(p for p in _denominators(lagrangian, multiplier) if p not in signed)
    return Lagrangian(lagrangian, multiplier, nonzero, family, positive)


def _compact(entry: Expression) -> Expression:
    try:
        return tree_of(terms_of(entry))
    except (TooManyTerms, TooLarge):
        return entry


def _varies(tree: Expression) -> bool:
    return any(isinstance(node, Symbol | Velocity) for node in walk(tree))


def _denominators(lagrangian: Expression, multiplier: Matrix) -> Iterable[Expression]:
    """Bases of negative powers in L and in g."""
    for tree in (lagrangian, *(entry for row in multiplier for entry in row)):
        for node in walk(tree):
            if isinstance(node, Power) and isinstance(node.exponent, Number) and node.exponent.value < 0:
                yield node.base


def _distinct(trees: Iterable[Expression]) -> tuple[Expression, ...]:
    return tuple(dict.fromkeys(tree for tree in trees if _varies(tree)))

"""Lagrangians for one coordinate from Jacobi's last multiplier (Jacobi 1844; Darboux 1894)."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.algebra.real_point import real_sign
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import NoRealValue
from inverse_service.expressions.tree import Expression, Sum, add, negate
from inverse_service.inverse_problem.search.choice import scaled
from inverse_service.inverse_problem.search.deadline import check
from inverse_service.inverse_problem.search.factors import find_factors
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.numerical_verification import holds_numerically
from inverse_service.inverse_problem.search.one_coordinate.algebra import negated, weight
from inverse_service.inverse_problem.search.one_coordinate.kinetic import NotElementary, Place, double_integral
from inverse_service.inverse_problem.search.one_coordinate.multiplier import LastMultiplier, last_multipliers
from inverse_service.inverse_problem.search.one_coordinate.potential import potential
from inverse_service.inverse_problem.search.terms import TooManyTerms, monomial_tree, terms_of, tree_of

_MOST = 3
_MOST_TERMS_OF_FORCE = 30
_MOST_TRIED = 16


def applies(material: Material) -> bool:
    """One coordinate, f of moderate size with a real point."""
    motion = material.motion
    moderate = motion.size == 1 and len(motion.forces[0]) <= _MOST_TERMS_OF_FORCE
    return moderate and material.analysis.real_point is not None


def propose(material: Material, seed: int) -> Sequence[Expression]:
    """Regular Lagrangians whose multiplier is a product of Darboux factors, the simplest first.

    Each obeys its equation at random real points at 40 digits; none where no such multiplier is found.
    """
    found: dict[Expression, None] = {}
    point = material.analysis.real_point
    for multiplier in last_multipliers(material, find_factors(material, seed), seed)[:_MOST_TRIED]:
        check()
        lagrangian = lagrangian_of(material, multiplier)
        if lagrangian is not None and point and holds_numerically(material.analysis.system, lagrangian, point, seed):
            found[lagrangian] = None
    return sorted(found, key=weight)[:_MOST]


def lagrangian_of(material: Material, multiplier: LastMultiplier) -> Expression | None:
    """L = K + U in closed form, with d2L/dv2 positive at the real point of f; None where there is none."""
    motion, point = material.motion, material.analysis.real_point
    force = material.analysis.system.accelerations[0]
    if point is None:
        return None
    place = Place(motion.coordinates[0], motion.velocities[0], point)
    try:
        bases = [(_oriented(base, place), e) for base, e in multiplier.moving]
        kinetic = double_integral(monomial_tree(multiplier.factor), bases, place)
        rest = potential(kinetic, force, place)
        return None if rest is None else _positive(add(kinetic, rest), place)
    except (NotElementary, NoRealValue, IrreducibleAtoms, TooManyTerms):
        return None


def _oriented(base: Expression, place: Place) -> Expression:
    """The base or its opposite, positive at the real point."""
    return base if real_sign(base, place.point) > 0 else negated(base)


def _positive(lagrangian: Expression, place: Place) -> Expression:
    """The shorter of the tree and its expansion with simple coefficients, with a positive Hessian at the point."""
    tree = min((tree_of(scaled(terms_of(lagrangian))), lagrangian), key=weight)
    hessian = differentiate(differentiate(tree, place.v), place.v)
    if real_sign(hessian, place.point) > 0:
        return tree
    return add(*map(negate, tree.terms)) if isinstance(tree, Sum) else negate(tree)

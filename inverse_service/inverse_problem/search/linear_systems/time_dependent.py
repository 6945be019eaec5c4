"""Lagrangians of linear systems q'' = -C q' - K q + b(t), quadratic with coefficients that may depend on t."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from inverse_service.algebra.rational_functions import TooLarge
from inverse_service.algebra.real_point import RealTable
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.search.linear_systems.choice import Choice, choose
from inverse_service.inverse_problem.search.linear_systems.lagrangian import lagrangian
from inverse_service.inverse_problem.search.linear_systems.modes import (
    Branch,
    Multipliers,
    all_branches,
    constant_branches,
    invariant_multipliers,
    uniform_branches,
)
from inverse_service.inverse_problem.search.linear_systems.reading import LinearSystem, linear_system, linear_terms
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.numerical_verification import holds_numerically

_MOST = 3
_MOST_TO_BE_DEFINITE = 3


def is_linear(material: Material) -> bool:
    """Whether f is linear in q and v, with constant coefficients of v."""
    return linear_terms(material.motion) is not None


def linear_lagrangians(material: Material, seed: int) -> Sequence[Expression]:
    """Regular Lagrangians whose multiplier depends on t at most, the simplest first.

    One function of time suffices where there is a regular multiplier e^(ct) G; else sums of branches
    of e^(tT) are taken. Each proposal is verified to 40 digits; none where V holds no regular matrix
    or the exponents are no square roots.
    """
    table = material.analysis.real_point
    try:
        system = linear_system(material) if table is not None else None
        if system is None or table is None:
            return ()
        found = _choices(system, material.motion.with_time, table)
        trees = dict.fromkeys(lagrangian(system, material.motion, choice.branch) for choice in found)
        return tuple(tree for tree in trees if holds_numerically(material.analysis.system, tree, table, seed))
    except (TooLarge, ZeroDivisionError, KeyError):
        return ()


def _choices(system: LinearSystem, with_time: bool, table: RealTable) -> list[Choice]:
    """Of the first stage with a definite multiplier; else of the first with a regular one.

    For many coordinates one function of time is preferred to a definite sum over several.
    """
    space = invariant_multipliers(system)
    regular: list[Choice] = []
    for branches in _stages(space, with_time, table) if space.basis else ():
        found = choose(system, branches, table)
        if any(choice.definite for choice in found):
            return [*(choice for choice in found if choice.definite), *regular][:_MOST]
        regular = regular or found
        if regular and system.size > _MOST_TO_BE_DEFINITE:
            break
    return regular


def _stages(space: Multipliers, with_time: bool, table: RealTable) -> Iterator[list[Branch]]:
    """Sets of branches to combine, the simplest first."""
    yield constant_branches(space)
    if with_time:
        yield uniform_branches(space)
        yield all_branches(space, table)

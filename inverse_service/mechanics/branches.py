"""A system on each of the open sets on which its roots of squares, |u| and sign(u) are single formulas."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import Variable
from inverse_service.algebra.real_point import are_positive, find_real_point
from inverse_service.algebra.sign_cases import Case, sign_cases
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, substitute
from inverse_service.mechanics.second_order_system import Branch, SecondOrderSystem

MOST_BRANCHES = 8
# Counted no further.
MOST_COUNTED = 64
_SEED = 1


def branches_of(system: SecondOrderSystem) -> tuple[SecondOrderSystem, ...]:
    """The system itself, where it has one formula everywhere, or one for each of the cases that have a real point.

    At most `MOST_COUNTED` are made.
    """
    if system.branch is not None:
        return (system,)
    found = tuple(islice(_branches(system), MOST_COUNTED))
    if not found or (len(found) > 1 and len({branch.accelerations for branch in found}) == 1):
        formulas = found[0].accelerations if found else system.accelerations  # |u|^2 is u^2 on both sides
        return (replace(system, accelerations=formulas, branch=Branch(system.accelerations)),)
    return _default_first(system, found) if len(found) > 1 else found


def _default_first(system: SecondOrderSystem, branches: tuple[SecondOrderSystem, ...]) -> tuple[SecondOrderSystem, ...]:
    """First comes the branch of a point with positive parameters, else of any, that one formula would be taken at."""
    kernels, parameters = tuple(map(to_kernels, system.accelerations)), [*map(Symbol, system.parameters)]
    points = (find_real_point(kernels, _variables(system), _SEED, positive) for positive in (parameters, ()))
    table = next((point for point in points if point is not None), None)
    return tuple(sorted(branches, key=lambda one: table is None or not are_positive(one.positive, table)))


def on_branch(tree: Expression, system: SecondOrderSystem) -> Expression:
    """The tree with the roots of the system as they are on its branch."""
    for root, value in () if system.branch is None else system.branch.roots:
        tree = substitute(tree, {root: value})
    return tree


def _branches(system: SecondOrderSystem) -> Iterator[SecondOrderSystem]:
    for case in sign_cases(system.accelerations):
        if not case.positive or _has_point(system, case):
            branch = Branch(system.accelerations, case.positive, case.roots)
            formulas = tuple(map(collect, case.formulas)) if case.roots else system.accelerations
            yield replace(system, accelerations=formulas, branch=branch)


def _has_point(system: SecondOrderSystem, case: Case) -> bool:
    kernels = tuple(map(to_kernels, case.formulas))
    return find_real_point(kernels, _variables(system), _SEED, case.positive) is not None


def _variables(system: SecondOrderSystem) -> list[Variable]:
    names = (*system.coordinates, *system.parameters)
    return [TIME, *map(Symbol, names), *map(Velocity, system.coordinates)]

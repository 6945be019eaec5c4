"""Verification of a Lagrangian by numbers alone, for formulas whose derivatives are long.

Central differences with step h = 10^-40 in 180 digits have an error of the size of h^2 = 10^-80.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence

import mpmath

from inverse_service.algebra.real_point import RealTable, find_real_point
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.inverse_problem.decision.analysis import Analysis, variables_of
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_DIGITS = 180
_STEP_DIGITS = 40
_TOLERANCE = mpmath.mpf(10) ** -40
_SMALLEST_DETERMINANT = mpmath.mpf(10) ** -25
_POINTS = 2

Direction = Mapping[Expression, mpmath.mpf]


def holds_numerically(analysis: Analysis, tree: Expression, seed: int) -> bool:
    """Whether the Euler-Lagrange equations hold to 40 digits and g is regular at points near a real one."""
    system = analysis.system
    for table in (analysis.real_point, find_real_point([*system.accelerations, tree], variables_of(system), seed)):
        generator = random.Random(seed)
        try:
            with mpmath.workdps(_DIGITS):
                points = [_perturbed(table, generator) for _ in range(_POINTS)] if table else []
                if points:
                    return all(_holds_at(system, tree, point) for point in points)
        except NoRealValue:
            continue
    return False


def _perturbed(table: RealTable, generator: random.Random) -> RealTable:
    """A point near the given one, so that it lies on the same branch of all roots."""
    return {name: value * (1 + mpmath.mpf(generator.randrange(1, 1000)) / 10**8) for name, value in table.items()}


def _holds_at(system: SecondOrderSystem, tree: Expression, point: RealTable) -> bool:
    names = system.coordinates
    motion: dict[Expression, mpmath.mpf] = {TIME: mpmath.mpf(1)}
    for name, f in zip(names, system.accelerations, strict=True):
        motion[Symbol(name)] = point[Velocity(name)]
        motion[Velocity(name)] = evaluate(f, point)
    one = mpmath.mpf(1)
    for name in names:
        along = _second(tree, point, {Velocity(name): one}, motion)
        if abs(along - _first(tree, point, {Symbol(name): one})) > _TOLERANCE * (1 + abs(along)):
            return False
    form = [[_second(tree, point, {Velocity(a): one}, {Velocity(b): one}) for a in names] for b in names]
    return _is_regular(form)


def _is_regular(form: Sequence[Sequence[mpmath.mpf]]) -> bool:
    matrix = mpmath.matrix(form)
    size = max(abs(entry) for entry in matrix)
    return bool(size and abs(mpmath.det(matrix / size)) > _SMALLEST_DETERMINANT)


def _first(tree: Expression, point: RealTable, direction: Direction) -> mpmath.mpf:
    """The derivative along a direction."""
    h = mpmath.mpf(10) ** -_STEP_DIGITS
    return (evaluate(tree, _at(point, direction, h)) - evaluate(tree, _at(point, direction, -h))) / (2 * h)


def _second(tree: Expression, point: RealTable, one: Direction, other: Direction) -> mpmath.mpf:
    """The derivative along both directions, the second one held constant."""
    h = mpmath.mpf(10) ** -_STEP_DIGITS
    return (_first(tree, _at(point, other, h), one) - _first(tree, _at(point, other, -h), one)) / (2 * h)


def _at(point: RealTable, direction: Direction, h: mpmath.mpf) -> RealTable:
    moved = dict(point)
    for name, part in direction.items():
        moved[name] = moved.get(name, mpmath.mpf(0)) + h * part
    return moved

"""Lagrangians besides the one that is shown: which are others, and which of those a reader wants to see."""

from __future__ import annotations

from collections.abc import Sequence

import mpmath

from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Symbol, Velocity, walk
from inverse_service.field.real_point import RealTable
from inverse_service.mechanics.euler_lagrange import hessian
from inverse_service.search.motion_terms import reading_class

_TINY, _STEP = mpmath.mpf(10) ** -20, mpmath.mpf(129) / 128


def is_multiple(first: Expression, second: Expression, names: Sequence[str], table: RealTable | None) -> bool:
    """Whether the Hessians are constant multiples of each other, seen at the real point and at one beside it."""
    if table is None:
        return first == second
    rows = zip(hessian(first, names), hessian(second, names), strict=True)
    entries = [pair for row in rows for pair in zip(*row, strict=True)]
    moving = {*map(Symbol, names), *map(Velocity, names)}
    try:
        with mpmath.workdps(30):
            beside = {leaf: value * _STEP if leaf in moving else value for leaf, value in table.items()}
            pairs = [(evaluate(x, point), evaluate(y, point)) for point in (table, beside) for x, y in entries]
            a, b = max(pairs, key=lambda pair: abs(pair[0]))
            return all(abs(x * b - y * a) < _TINY * (1 + abs(a * b)) for x, y in pairs)
    except NoRealValue:
        return False


def why_shown(shown: Expression, other: Expression, names: Sequence[str], table: RealTable | None) -> str:
    """What another Lagrangian has that the one that is shown has not; "" where that is nothing."""
    if len(to_text(other)) < len(to_text(shown)):
        return "shorter"
    if is_definite(other, names, table) and not is_definite(shown, names, table):
        return "positive definite"
    return "of another kind" if _kind(other, names) < _kind(shown, names) else ""


def is_definite(lagrangian: Expression, names: Sequence[str], table: RealTable | None) -> bool:
    """Whether the Hessian is positive definite at the real point."""
    if table is None:
        return False
    try:
        with mpmath.workdps(30):
            form = mpmath.matrix([[evaluate(entry, table) for entry in row] for row in hessian(lagrangian, names)])
            return all(mpmath.det(form[:k, :k]) > _TINY for k in range(1, len(names) + 1))
    except NoRealValue:
        return False


def _kind(lagrangian: Expression, names: Sequence[str]) -> tuple[int, bool]:
    """How it reads, and whether it is more than quadratic in the velocities."""
    moving = {*map(Velocity, names)}
    held = any(node in moving for row in hessian(lagrangian, names) for entry in row for node in walk(entry))
    return reading_class(lagrangian), held

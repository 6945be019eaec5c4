"""A system is answered cell by cell: where formulas with other relations hold, there is another answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.real_point import RealTable, are_positive, find_real_point
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.decision.analysis import variables_of
from inverse_service.mechanics.second_order_system import (
    MOST_BRANCHES,
    SecondOrderSystem,
    branches_of,
    on_side,
    unreached,
)

Answer = TypeVar("Answer")
_SEEDS = range(2, 10)  # of points all over, each of which has to be in a cell
NO_POINT = "no real point was found here"
TOO_MANY = f"more than {MOST_BRANCHES} cells"
BEYOND = "no cell that was answered holds the point"


@dataclass(frozen=True, slots=True)
class Left:
    """What was not answered: where the trees are positive, at the point if there is one."""

    positive: tuple[Expression, ...]
    near: RealTable | None
    reason: str


def answered(
    branches: Sequence[SecondOrderSystem],
    answer: Callable[[SecondOrderSystem, int], tuple[Answer, Sequence[Expression]]],
) -> tuple[list[Answer], list[Left]]:
    """The answers on all cells, and what is left.

    `answer` is asked about a system, and for how many it has to leave time; it gives the answer and the trees that are
    positive on its cell. What is beyond each of these, within the same branch, is a cell of its own.
    """
    waiting, found, left = [*branches], list[Answer](), list[Left]()
    while waiting:
        system = waiting.pop(0)
        if len(found) == MOST_BRANCHES:
            left.append(Left(tuple(map(collect, system.positive)), point_of(system), TOO_MANY))
            continue
        one, sides = answer(system, len(waiting) + 1)
        found.append(one)
        known = {collect(tree) for tree in system.positive}
        fresh = [side for side in sides if side not in known]
        for k, side in enumerate(fresh):
            other = on_side(system, [*fresh[:k], collect(-side)])
            if other is not None and point_of(other) is not None:
                waiting.append(other)
    return found, left


def beyond(system: SecondOrderSystem, cells: Sequence[Sequence[Expression]]) -> list[Left]:
    """Cases without a known point, and the first point of the system that lies in none of the cells."""
    found = [Left(tuple(map(collect, one.positive)), None, NO_POINT) for one in unreached(system)]
    for seed in _SEEDS:
        point = point_of(system, seed)
        if point is not None and not any(are_positive(cell, point) for cell in cells):
            return [*found, Left((), point, BEYOND)]
    return found


def point_of(system: SecondOrderSystem, seed: int = 1) -> RealTable | None:
    kernels = tuple(map(to_kernels, system.accelerations))
    return find_real_point(kernels, variables_of(system), seed, system.positive)


__all__ = ["Left", "answered", "beyond", "branches_of", "point_of"]

"""A system is answered cell by cell: where formulas with other relations hold, there is another answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice, product
from typing import TypeVar

from inverse_service import deadline
from inverse_service.decision import deciding
from inverse_service.expressions import collecting
from inverse_service.expressions.tree import Expression
from inverse_service.field import real_point, tower
from inverse_service.mechanics import second_order_system

Answer = TypeVar("Answer")
_MOST_OUTSIDE = 64  # choices of one side of each cell
NO_TIME = "the time was over"
NO_POINT = "no real point was found here"
TOO_MANY = f"more than {second_order_system.MOST_BRANCHES} cells"
BEYOND = "no cell that was answered holds the point"


@dataclass(frozen=True, slots=True)
class Left:
    """What was not answered: where the trees are positive, at the point if there is one."""

    positive: tuple[Expression, ...]
    near: real_point.RealTable | None
    reason: str


def answered(
    branches: Sequence[second_order_system.SecondOrderSystem],
    answer: Callable[
        [second_order_system.SecondOrderSystem, Sequence[second_order_system.SecondOrderSystem]],
        tuple[Answer, Sequence[Expression]],
    ],
    end: float = math.inf,
) -> tuple[list[Answer], list[Left]]:
    """The answers on all cells, and what is left.

    `answer` is asked about a system, beside those that wait; it gives the answer and the trees that are positive on
    its cell. What is beyond each of these, within the same branch, is a cell of its own. No further one is begun after
    the `end`.
    """
    waiting, found, left = [*branches], list[Answer](), list[Left]()
    while waiting:
        system = waiting.pop(0)
        if len(found) == second_order_system.MOST_BRANCHES or (system not in branches and deadline.now() > end):
            reason = TOO_MANY if len(found) == second_order_system.MOST_BRANCHES else NO_TIME
            left.append(Left(tuple(map(collecting.collect, system.positive)), point_of(system), reason))
            continue
        one, sides = answer(system, waiting)
        found.append(one)
        known = {collecting.collect(tree) for tree in system.positive}
        fresh = [side for side in sides if side not in known]
        for k, side in enumerate(fresh):
            other = second_order_system.on_side(system, [*fresh[:k], collecting.collect(-side)])
            if other is not None and point_of(other) is not None:
                waiting.append(other)
    return found, left


def beyond(system: second_order_system.SecondOrderSystem, cells: Sequence[Sequence[Expression]]) -> list[Left]:
    """Cases without a known point, and sets that lie in none of the cells, each with a point."""
    found = [
        Left(tuple(map(collecting.collect, one.positive)), None, NO_POINT)
        for one in second_order_system.unreached(system)
    ]
    for outside in islice(product(*cells), _MOST_OUTSIDE) if system.branch is None else ():
        other = second_order_system.on_side(system, [collecting.collect(-side) for side in outside])
        point = None if other is None else point_of(other)
        if other is not None and point is not None:
            return [*found, Left(other.positive, point, BEYOND)]
    return found


def point_of(system: second_order_system.SecondOrderSystem, seed: int = 1) -> real_point.RealTable | None:
    kernels = tuple(map(tower.to_kernels, system.accelerations))
    return real_point.find_real_point(kernels, deciding.variables_of(system), seed, system.positive)

"""A system is answered cell by cell: where formulas with other relations hold, there is another answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice, product
from typing import TypeVar

from inverse_service.deadline import now
from inverse_service.decision.deciding import variables_of
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import Expression
from inverse_service.field.real_point import RealTable, find_real_point
from inverse_service.field.tower import to_kernels
from inverse_service.mechanics.second_order_system import (
    MOST_BRANCHES,
    SecondOrderSystem,
    on_side,
    unreached,
)

Answer = TypeVar("Answer")
_MOST_OUTSIDE = 64  # choices of one side of each cell
NO_TIME = "the time was over"
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
    answer: Callable[[SecondOrderSystem, Sequence[SecondOrderSystem]], tuple[Answer, Sequence[Expression]]],
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
        if len(found) == MOST_BRANCHES or (system not in branches and now() > end):
            reason = TOO_MANY if len(found) == MOST_BRANCHES else NO_TIME
            left.append(Left(tuple(map(collect, system.positive)), point_of(system), reason))
            continue
        one, sides = answer(system, waiting)
        found.append(one)
        known = {collect(tree) for tree in system.positive}
        fresh = [side for side in sides if side not in known]
        for k, side in enumerate(fresh):
            other = on_side(system, [*fresh[:k], collect(-side)])
            if other is not None and point_of(other) is not None:
                waiting.append(other)
    return found, left


def beyond(system: SecondOrderSystem, cells: Sequence[Sequence[Expression]]) -> list[Left]:
    """Cases without a known point, and sets that lie in none of the cells, each with a point."""
    found = [Left(tuple(map(collect, one.positive)), None, NO_POINT) for one in unreached(system)]
    for outside in islice(product(*cells), _MOST_OUTSIDE) if system.branch is None else ():
        other = on_side(system, [collect(-side) for side in outside])
        point = None if other is None else point_of(other)
        if other is not None and point is not None:
            return [*found, Left(other.positive, point, BEYOND)]
    return found


def point_of(system: SecondOrderSystem, seed: int = 1) -> RealTable | None:
    kernels = tuple(map(to_kernels, system.accelerations))
    return find_real_point(kernels, variables_of(system), seed, system.positive)

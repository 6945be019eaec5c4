"""Answer a system cell by cell, because regions where other formulas are valid have separate answers."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from typing import Any, TypeVar

from inverse_service import deadline
from inverse_service.certificate import checker
from inverse_service.decision import certify, deciding
from inverse_service.expressions import collecting, tree as ex
from inverse_service.field import real_point, tower
from inverse_service.mechanics import second_order_system

Answer = TypeVar("Answer")
_MOST_OUTSIDE = 64  # combinations of one side of each cell
_OTHER_POINTS = range(2, 8)  # seeds of points on other parts of a cell
_FAR = 8
NO_TIME = "the time was over"
NO_POINT = "no real point was found in this set"
TOO_MANY = f"more than {second_order_system.MOST_BRANCHES} cells"
BEYOND = "no solved cell contains the point"


@dataclass(frozen=True, slots=True)
class Left:
    """A set without an answer: the region where the trees are positive, with a point of it if one is known."""

    positive: tuple[ex.Expression, ...]
    near: real_point.RealTable | None
    reason: str


def answered(
    system: second_order_system.SecondOrderSystem,
    answer: Callable[
        [second_order_system.SecondOrderSystem, Sequence[second_order_system.SecondOrderSystem]],
        tuple[Answer, Sequence[ex.Expression]],
    ],
    end: float = math.inf,
) -> tuple[list[Answer], list[Left]]:
    """The answers on all cells, and the sets without an answer.

    `answer` is called with the system on a cell and the systems still waiting; it returns the answer and the trees that
    are positive on its cell. The other side of each tree, within the same branch, is a separate cell. No new cell is
    begun after the time `end`. Branches without a known point, and points in no cell, have no answer either.
    """
    branches = second_order_system.branches_of(system)
    waiting, found, left, known_sides = [*branches], list[Answer](), list[Left](), list[Sequence[ex.Expression]]()
    while waiting:
        cell = waiting.pop(0)
        if len(found) == second_order_system.MOST_BRANCHES or (cell not in branches and deadline.now() > end):
            reason = TOO_MANY if len(found) == second_order_system.MOST_BRANCHES else NO_TIME
            left.append(Left(tuple(map(collecting.collect, cell.positive)), point_of(cell), reason))
            continue
        one, sides = answer(cell, waiting)
        found.append(one)
        known_sides.append(sides)
        known = {collecting.collect(tree) for tree in cell.positive}
        fresh = [side for side in sides if side not in known]
        for k, side in enumerate(fresh):
            other = second_order_system.on_side(cell, [*fresh[:k], collecting.collect(-side)])
            if other is not None and point_of(other) is not None:
                waiting.append(other)
    unreached = second_order_system.unreached(system)
    left += [Left(tuple(map(collecting.collect, one.positive)), None, NO_POINT) for one in unreached]
    return found, left + (_in_no_cell(system, known_sides) if system.branch is None else [])


def _in_no_cell(system: second_order_system.SecondOrderSystem, sides: Sequence[Sequence[ex.Expression]]) -> list[Left]:
    """The sets with a known point that no cell contains: of the trees positive on each cell, one is negative there."""
    found = list[Left]()
    for outside in islice(product(*sides), _MOST_OUTSIDE):
        beyond = second_order_system.on_side(system, [collecting.collect(-side) for side in outside])
        point = None if beyond is None else point_of(beyond)
        if beyond is None or point is None or any(real_point.are_positive(one.positive, point) for one in found):
            continue
        found.append(Left(beyond.positive, point, BEYOND))
    return found


def other_part(
    analysis: deciding.Analysis,
    certificate: Mapping[str, Any],
    sides: Sequence[ex.Expression],
    end: float,
    wanted: Sequence[str] = ("invalid", "incomplete"),
) -> tuple[real_point.RealTable, checker.CheckResult] | None:
    """Repeat the check of a claim at points on other connected parts of its cell, where all `sides` are > 0.

    The point with the wanted verdict and the checker's result; earlier entries of `wanted` take precedence. None if no
    tried point has such a verdict.
    """
    found = dict[str, tuple[real_point.RealTable, checker.CheckResult]]()
    for point in (one for seed in _OTHER_POINTS for one in _points(analysis.system, seed)):
        if wanted[0] not in found and real_point.are_positive(sides, point) and deadline.now() < end:
            moved = {**certificate, "near": certify.moved_to(certificate["near"], point)}
            proof = certify.proved(replace(analysis, real_point=point), moved, deadline.left(end, 1.0))[1]
            found.setdefault(proof.verdict, (point, proof))
    return next((found[verdict] for verdict in wanted if verdict in found), None)


def _points(system: second_order_system.SecondOrderSystem, seed: int) -> list[real_point.RealTable]:
    """A point where f is defined, and one farther in its direction, beyond other zeros of periodic functions."""
    near = point_of(system, seed)
    if near is None:
        return []
    far = near | {name: _FAR * near[name] for name in deciding.variables_of(system) if name in near}
    kernels = tuple(map(tower.to_kernels, system.accelerations))
    return [near, far] if real_point.is_defined(kernels, far) else [near]


def point_of(system: second_order_system.SecondOrderSystem, seed: int = 1) -> real_point.RealTable | None:
    """A real point at which f has a value and everything in `system.positive` is > 0."""
    kernels = tuple(map(tower.to_kernels, system.accelerations))
    return real_point.find_real_point(kernels, deciding.variables_of(system), seed, system.positive)

"""Impulses that the ends of a straight way do not show, however narrow the force: bounds over boxes, cut in two.

The impulse is int |F - line| dt, the line broken at a few places of the way and there equal to F.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.integrators.trajectory import Array
from inverse_service.simulation.array_values import Box, array_value, bounds, table_of
from inverse_service.simulation.scene_data import Stop

SHARE = 64  # a box that may hold less than this part of what is too much is not cut
_DEPTH, _MOST_BOXES, _AT_ONCE, _NOISE = 48, 2**17, 2**13, 1e-9


@dataclass(frozen=True, slots=True)
class Ways:
    """Straight ways: from `starts` by `moves` (m, n), in `step` s from `times` (m,); parameters, numbers or (m,)."""

    starts: Array
    moves: Array
    times: Array
    step: float
    values: Mapping[str, float | Array]

    def part(self, rows: NDArray[np.int64] | slice) -> Ways:
        values = {name: value[rows] if isinstance(value, np.ndarray) else value for name, value in self.values.items()}
        return Ways(self.starts[rows], self.moves[rows], self.times[rows], self.step, values)


@dataclass(frozen=True, slots=True)
class Hidden:
    """`impulses` (m,) of the ways, 0 where none is too much; a `part` (m, 2) of each way where it is; which ways are
    `open` (m,): their bounds decided nothing."""

    impulses: Array
    part: Array
    open: NDArray[np.bool_]


def hidden_impulses(
    coordinates: tuple[str, ...], trees: tuple[Expression, ...], ways: Ways, allowed: Array, pieces: int,
    stop: Stop | None = None,
) -> Hidden:  # fmt: skip
    """The impulses that the ends of the ways do not show, where they are above `allowed` (m,)."""
    count = len(allowed)
    found = Hidden(np.zeros(count), np.zeros((count, 2)), np.zeros(count, dtype=bool))
    for first in range(0, count, _AT_ONCE):
        if stop is not None and stop():
            found.open[first:] = True
            break
        rows = slice(first, first + _AT_ONCE)
        for tree in trees:
            _add_force(_Force(coordinates, tree, ways.part(rows)), allowed[rows], pieces, found, rows)
    found.open[found.impulses > 0] = False
    return found


@dataclass(frozen=True, slots=True)
class _Force:
    coordinates: tuple[str, ...]
    tree: Expression
    ways: Ways

    def at(self, rows: NDArray[np.int64], places: Array) -> Array:
        """F at a place from 0 to 1 of each way."""
        ways = self.ways.part(rows)
        positions, moments = ways.starts + places[:, None] * ways.moves, ways.times + places * ways.step
        table = table_of(self.coordinates, positions, ways.moves / ways.step, ways.values, moments)
        return array_value(self.tree, table)

    def impulses(self, rows: NDArray[np.int64], parts: tuple[Array, Array], line: tuple[Array, Array]) -> Box:
        """Bounds of int |F - line| dt over parts of the ways; `line` has its values at their ends."""
        ways = self.ways.part(rows)
        ends = [ways.starts + place[:, None] * ways.moves for place in parts]
        boxes: dict[Expression, Box] = {TIME: (ways.times + parts[0] * ways.step, ways.times + parts[1] * ways.step)}
        boxes |= {Symbol(name): (np.asarray(value), np.asarray(value)) for name, value in ways.values.items()}
        for k, name in enumerate(self.coordinates):
            boxes[Symbol(name)] = ends[0][:, k], ends[1][:, k]
            boxes[Velocity(name)] = (ways.moves[:, k] / ways.step,) * 2
        low, high = bounds(self.tree, boxes)
        least, greatest = _ordered(*line)
        noise = _NOISE * (np.abs(least) + np.abs(greatest))
        time = np.abs(ways.step) * (parts[1] - parts[0])
        near = time * np.maximum(np.maximum(low - greatest, least - high) - noise, 0.0)
        far = time * np.maximum(np.maximum(high - least, greatest - low) - noise, 0.0)
        return np.where(np.isfinite(near), near, 0.0), np.where(np.isfinite(far), far, np.inf)


def _add_force(force: _Force, allowed: Array, pieces: int, found: Hidden, where: slice) -> None:
    """Boxes are cut in two until their bounds decide. A way whose whole box shows nothing needs no more."""
    rows, zero, one = np.arange(len(allowed)), np.zeros(len(allowed)), np.ones(len(allowed))
    most = force.impulses(rows, (zero, one), (force.at(rows, zero), force.at(rows, one)))[1]
    rows = np.repeat(rows[~(most <= allowed)], pieces)
    before = np.tile(np.arange(pieces) / pieces, len(rows) // pieces)
    after = before + 1 / pieces
    line = force.at(rows, before), force.at(rows, after)
    sure, open_ = np.zeros(len(allowed)), found.open[where]
    for depth in range(_DEPTH):
        least, most = force.impulses(rows, (before, after), line)
        keep = most > allowed[rows] / SHARE
        reached = sure + np.bincount(rows[keep], least[keep], len(sure)) > allowed
        for k in np.flatnonzero(reached & (found.impulses[where] == 0)):
            mine = np.flatnonzero((rows == k) & keep & (least > 0))
            if len(mine):
                found.part[where][k] = before[mine].min(), after[mine].max()
        sure += np.bincount(rows, np.where(keep & ~reached[rows], 0.0, least), len(sure))
        keep &= ~reached[rows]
        if depth == _DEPTH - 1 or keep.sum() > _MOST_BOXES:
            open_[rows[keep]] = True
            break
        if not keep.any():
            break
        rows, before, after = np.tile(rows[keep], 2), np.tile(before[keep], 2), np.tile(after[keep], 2)
        first, last = (np.tile(column[keep], 2) for column in line)
        half = len(rows) // 2
        middle, bend = (before + after) / 2, (first + last) / 2
        before, after = np.append(before[:half], middle[half:]), np.append(middle[:half], after[half:])
        line = np.append(first[:half], bend[half:]), np.append(bend[:half], last[half:])
    found.impulses[where] = np.maximum(found.impulses[where], np.where(sure > allowed, sure, 0.0))


def _ordered(a: Array, b: Array) -> Box:
    return np.minimum(a, b), np.maximum(a, b)

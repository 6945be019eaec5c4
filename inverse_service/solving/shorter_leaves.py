"""Lists of leaves without those that say again what others say.

A member belongs to the last leaf of a list that holds it. A leaf repeats others if each of its
members has the same verdicts without it: then it is left out, with the cases that led to it. A leaf
with the verdicts of the first one is left out, too, if an inequation of those around it says the
same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from flint import fmpq_mpoly

from inverse_service import deadline, errors
from inverse_service.solving import leaves
from inverse_service.solving.leaves import Draw, Leaf, NotSplit

MOST_STEPS = 100  # by which the cases of one set are split
MOST_CASES, MOST_OF_LIST = 60, 2000  # of one set, and for one list
MOST_PARTING = 4  # terms of an inequation that stands for a leaf


@dataclass
class Allowance:
    """The cases that may still be looked at for one list, and the moment at which the time is over.

    Work is counted, so that a list is told alike however busy the machine is.
    """

    end: float
    cases: int = MOST_OF_LIST

    @property
    def is_over(self) -> bool:
        return self.cases <= 0 or deadline.now() > self.end


class Row(NamedTuple):
    """A leaf of a list, and its verdicts."""

    leaf: Leaf
    verdicts: tuple[Any, Any]


def shorter(
    rows: Sequence[Row], candidates: Sequence[int], draw: Draw, allowance: Allowance
) -> dict[int, Leaf]:
    """The leaves that stay, by their places: without inequations that part none from other
    verdicts, without those candidates that repeat others, the longest first, and without those for
    which inequations can stand.

    Each member keeps its verdicts; what is not shown within the allowance stays.
    """
    table = _Table(rows, {place: row.leaf for place, row in enumerate(rows)}, draw, allowance)
    for place in table.kept:
        for one in table.kept[place].nonzero:
            rest = tuple(other for other in table.kept[place].nonzero if other != one)
            wider = replace(table.kept[place], nonzero=rest)
            if table.asked(place).holds(wider, one):
                table.kept[place] = wider
    order = sorted(candidates, key=lambda k: (rows[k].leaf.size, k), reverse=True)
    table.leave_out(order)
    general = [k for k in table.kept if k and rows[k].verdicts == rows[0].verdicts]
    for place in general:
        table = _parted(table, place) or table
    table.leave_out(order)
    return table.kept


class _Table(NamedTuple):
    """The leaves of a list that are kept, by their places."""

    rows: Sequence[Row]
    kept: dict[int, Leaf]
    draw: Draw
    allowance: Allowance

    def asked(self, place: int) -> Asked:
        """What the other leaves say of the members of this one."""
        others = {k: leaf for k, leaf in self.kept.items() if k != place}
        # A later row has its members, whatever this one holds.
        is_right = [k > place or self.rows[k].verdicts == self.rows[place].verdicts for k in others]
        return Asked([*others.values()], is_right, self.draw, self.allowance)

    def leave_out(self, order: Sequence[int]) -> None:
        """Those that repeat others."""
        count = -1
        while count != len(self.kept):  # a row may repeat others only without one inside it
            count = len(self.kept)
            for place in order:
                if place in self.kept and self.asked(place).holds(self.kept[place]):
                    del self.kept[place]


def _parted(table: _Table, place: int) -> _Table | None:
    """The list without a leaf, and with one of its equations as an inequation of each leaf with
    other verdicts around it; None if this is not shown to say the same.
    """
    leaf = table.kept[place]
    try:
        points = list(leaves.points(leaf, table.draw, 7, 2))
    except (NotSplit, errors.IrreducibleAtoms, KeyError, ValueError):
        return None
    around = [
        k
        for k, other in table.kept.items()
        if k < place
        and table.rows[k].verdicts != table.rows[place].verdicts
        and leaves.contains(other, points)
    ]
    for one in sorted(leaf.equations, key=len):
        if around and len(one) <= MOST_PARTING:
            changed = table._replace(kept=dict(table.kept))
            for k in around:
                if not changed.asked(k).holds(changed.kept[k], one):
                    break
                nonzero = (*changed.kept[k].nonzero, one)
                changed.kept[k] = replace(changed.kept[k], nonzero=nonzero)
            else:
                if changed.asked(place).holds(leaf):
                    del changed.kept[place]
                    return changed
    return None


class Asked:
    """Whether all members of a set belong to leaves that are right for them."""

    def __init__(
        self, known: list[Leaf], is_right: list[bool], draw: Draw, allowance: Allowance
    ) -> None:
        self.known, self.is_right, self.draw, self.allowance = known, is_right, draw, allowance
        self.cases = 0

    def holds(self, whole: Leaf, vanishing: fmpq_mpoly | None = None) -> bool:
        """Whether this is shown for a set, or for its members where an element vanishes; False if
        it is not true, or if a limit is reached.
        """
        self.cases = 0
        if self.allowance.is_over:
            return False
        try:
            parts = [whole] if vanishing is None else self._split(whole, [vanishing])
            return all(map(self._holds, parts))
        except (NotSplit, errors.IrreducibleAtoms, KeyError, ValueError):
            return False

    def _holds(self, piece: Leaf) -> bool:
        self.cases += 1
        self.allowance.cases -= 1
        if self.cases > MOST_CASES or self.allowance.is_over:
            return False
        last = self._last_right(piece)
        return last is not None and all(
            self._holds(inner) for further in self._elsewhere(piece, last) for inner in further
        )

    def _last_right(self, piece: Leaf) -> int | None:
        """The last right leaf whose equations hold for all members of the piece; None if a random
        member belongs to a leaf that is not right.
        """
        points = list(leaves.points(piece, self.draw, 7, 2))
        for place in reversed(range(len(self.known))):
            leaf = self.known[place]
            if not self.is_right[place] and leaves.contains(leaf, points):
                return None
            if (
                self.is_right[place]
                and leaves.contains(leaf, points)
                and all(piece.reduced(one).is_zero() for one in leaf.equations)
            ):
                return place
        return None

    def _elsewhere(self, piece: Leaf, last: int) -> Iterator[list[Leaf]]:
        """The members of the piece that may be outside this leaf, or in one after it that is not
        right.
        """
        for vanishing in self.known[last].nonzero:
            if vanishing not in piece.nonzero:
                yield self._split(piece, [vanishing])
        for place in range(last + 1, len(self.known)):
            other = self.known[place]
            if not self.is_right[place]:
                more = [one for one in other.nonzero if one not in piece.nonzero]
                crossed = replace(piece, nonzero=(*piece.nonzero, *more))
                yield self._split(crossed, other.equations)

    def _split(self, piece: Leaf, equations: Sequence[fmpq_mpoly]) -> list[Leaf]:
        return leaves.split_leaf(piece, equations, self.allowance.end, self.draw, MOST_STEPS)

"""The sets on which statements and formulas hold."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from inverse_service.expressions import tree as ex

Trees = tuple[ex.Expression, ...]


@dataclass(frozen=True, slots=True)
class Domain:
    """The set on which all trees of `positive` are > 0 and none of `nonzero` is 0; () everywhere.

    The proof that something holds there depends on the signs of `sides`. If `connected`, it holds
    only on the connected component of the proof's point.
    """

    positive: Trees = ()
    nonzero: Trees = ()
    sides: Trees = ()
    connected: bool = False

    def changed(self, change: Callable[[ex.Expression], ex.Expression]) -> "Domain":
        """The set in other variables."""
        positive, nonzero, sides = (
            tuple(map(change, trees)) for trees in (self.positive, self.nonzero, self.sides)
        )
        return Domain(positive, nonzero, sides, self.connected)

    def within(self, other: "Domain") -> "Domain":
        """The part of the set in which the conditions of another one hold, too."""
        return replace(
            self,
            positive=tuple(dict.fromkeys((*other.positive, *self.positive))),
            nonzero=tuple(dict.fromkeys((*other.nonzero, *self.nonzero))),
        )

    @property
    def trees(self) -> Trees:
        """Those that vanish nowhere on it."""
        return (*self.nonzero, *self.positive)


EVERYWHERE = Domain()

"""What a search hands over, and the search as methods see it that ask for a smaller system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.decision.analysis import Analysis


@dataclass(frozen=True, slots=True)
class Found:
    """Regular Lagrangians of one family, the simplest first; `parts` are those that the first is a sum of."""

    lagrangians: tuple[Expression, ...]
    family: str
    parts: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """What was found, and the families tried with the number of their candidates."""

    found: Found | None
    tried: tuple[tuple[str, int], ...]


# (system, whether L may depend on t, seed, units of work) -> what a search of its own finds.
Ladder = Callable[[Analysis, bool, int, int], Found | None]

"""Claims about a motion on constraints, s' = w(t, q, u) with q = (r, s), r' = u, u' = F(t, q, u): see FORMAT.md."""

from __future__ import annotations

from typing import Any

from .checker import KindsOfRows, Question, Tools
from .numbers import Arithmetic, Number
from .series import Elimination, Expansion


class MotionExpansion(Expansion):
    """Power series in x = (t?, q, u), and the conditions on L = l + lambda_a mu^a, mu^a = s^a' - w^a.

    An unknown is a coefficient of L of mu-degree at most 1; its degree is one less than that of its monomial.
    """

    offset = 1

    def coefficients(self, degree: int) -> list[int]:
        transverse = (key + self.all_units[a] for a in self.mu for key in self.monomials(degree))
        return [*self.monomials(degree + 1), *transverse]

    def matrix(self, elimination: Elimination) -> list[list[Number]]:
        """Random combinations of the rows of [d2l/du du - lambda d2w/du du; dlambda/du] of a random solution."""
        rows = self.hessian(elimination.solution([key for degree in (0, 1) for key in self.unknowns(degree)]))
        return [[sum([x * row[b] for x, row in zip(weights, rows, strict=True)]) for b in range(len(self.v))]
                for weights in self.question.mixing]  # fmt: skip


class Motion(Question):
    """A motion on constraints, and the checks of certificates about its Lagrangians."""

    where = " on the constraints"

    def __init__(self, tools: Tools, document: Any, timed: bool = True, claim: Any = None) -> None:
        super().__init__(tools, document, timed, claim)
        self.mixing = [[self.generator.getrandbits(60) for _ in self.coordinates] for _ in self.free]

    def listed_rows(self) -> KindsOfRows:
        return {"free": (1, 2, [(i,) for i in range(len(self.free))]),
                "dependent": (1, 2, [(a,) for a in range(len(self.bound))])}  # fmt: skip

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return MotionExpansion(arithmetic, degree)

"""Claims about a motion on constraints, s' = w(t, q, u) with q = (r, s), r' = u, u' = F(t, q, u): see FORMAT.md."""

from __future__ import annotations

import math
from functools import cache
from itertools import product
from typing import Any

from .checker import KindsOfRows, Question, Tools
from .formulas import MAX_ORDER, check_shape
from .numbers import Arithmetic, Number, Series
from .series import Elimination, Expansion, Term

PACE = 4  # brackets with Gamma that count as one order


class MotionExpansion(Expansion):
    """Power series in x = (t?, q, u), and the conditions on L = l + lambda_a mu^a, mu^a = s^a' - w^a.

    An unknown is a coefficient of L of mu-degree at most 1; its degree is one less than that of its monomial.
    """

    offset = 1

    def __init__(self, arithmetic: Arithmetic, degree: int) -> None:
        super().__init__(arithmetic, degree)
        self.bracket = cache(self.bracketed)
        self.bends = {(a, v): self.derivative(rate, v) for a, rate in zip(self.mu, self.rates, strict=True)
                      for v in self.v}  # fmt: skip

    def bracketed(self, v: int, j: int) -> dict[int, Series]:
        """(ad Gamma)^j d_v: its components by q, v, and by mu those by ds - w_v dr; to a degree that is j less."""
        if not j:
            return {x: self.one if x == v else {} for x in (*self.q, *self.v, *self.mu)}
        before, own, degree = self.bracket(v, j - 1), (*self.q, *self.v), self.degree - j
        signs, found = [1] * len(self.field) + [-1] * len(own), dict[int, Series]()
        for x in own:
            pairs = [(rate, self.derivative(before[x], y)) for y, rate in enumerate(self.field)]
            pairs += [(before[y], self.derivative(self.field[x], y)) for y in own]
            found[x] = self.add([self.multiply(*pair, degree) for pair in pairs], signs)
        for a, s in zip(self.mu, self.q[len(self.v) :], strict=True):
            parts = [self.multiply(self.bends[a, v], found[r], degree) for r, v in zip(self.q, self.v, strict=False)]
            found[a] = self.add([found[s], *parts], [1] + [-1] * len(parts))
        return found

    def terms(self, kind: str, *place: int) -> list[Term]:
        """Of a row of a bivector: sum_i C(j, i) dtheta(V_i, V'_(j - i)), theta = L_v dr + L_mu (ds - w_v dr)."""
        if kind[0] != "B":
            return super().terms(kind, *place)
        j, first = map(int, kind[1:].split("_"))
        pairs = [(self.bracket(self.v[first], i), self.bracket(self.v[place[0]], j - i)) for i in range(j + 1)]
        terms, signs = list[Term](), [sign * math.comb(j, i) for i in range(j + 1) for sign in (1, -1)]
        by = dict(zip((*self.q[: len(self.v)], *self.mu), (*self.v, *self.mu), strict=True))
        for (y, of), x in product(by.items(), (*self.q, *self.v)):
            parts = [(one[x], other[y]) for pair in pairs for one, other in (pair, pair[::-1])]
            part = self.add([self.multiply(*both, self.degree - j) for both in parts], signs)
            terms.append((1, part, (of, x)))
            for a in self.mu if of in self.v else ():
                bend = self.derivative(self.bends[a, of], x)
                terms.append((-1, self.multiply(part, bend, self.degree - j), (a,)))
        return terms

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
        self.last = (claim or {}).get("bivectors") or 1  # the last j
        check_shape(self.last, range(1, MAX_ORDER * PACE), "certificate.bivectors")
        super().__init__(tools, document, timed, claim)
        self.mixing = [[self.generator.getrandbits(60) for _ in self.coordinates] for _ in self.free]

    def listed_rows(self) -> KindsOfRows:
        bivectors: KindsOfRows = {f"B{j}_{a}": (-(-j // PACE), max(2, j), [(b,) for b in range(a + 1, len(self.free))])
                     for j in range(self.last, 1, -1) for a in range(len(self.free) - 1)}  # fmt: skip
        return bivectors | {"free": (1, 2, [(i,) for i in range(len(self.free))]),
                "dependent": (1, 2, [(a,) for a in range(len(self.bound))])}  # fmt: skip

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return MotionExpansion(arithmetic, degree)

"""Claims about a motion on constraints: s' = w(t, q, u), q = (r, s), r' = u, u' = F(t, q, u).

See KINDS.md.
"""

import math
from fractions import Fraction
from functools import cache
from itertools import combinations, product
from typing import Any

from .formulas import MAX_ORDER, check_shape
from .numbers import Arithmetic, Number, Series
from .question import KindsOfRows, Question, RowKind, Tools
from .series import Elimination, Expansion, Row, Term

AT_ONCE = 5  # the order up to which a solution is found order by order
PACE = 4  # the number of brackets with Gamma that count as one order


class MotionExpansion(Expansion):
    """Power series in x = (t?, q, u), and the conditions on L = l + lambda_a mu^a.

    Here mu^a = s^a' - w^a. The unknowns are the coefficients of L of mu-degree at most 1; the
    degree of an unknown is one less than that of its monomial.
    """

    offset = 1

    def __init__(self, arithmetic: Arithmetic, degree: int) -> None:
        super().__init__(arithmetic, degree)
        self.bracket = cache(self.bracketed)
        self.rate_slope = cache(lambda x, y: self.derivative(self.field[x], y))
        self.bends = {
            (a, v): self.derivative(rate, v)
            for a, rate in zip(self.mu, self.rates, strict=True)
            for v in self.v
        }

    def bracketed(self, v: int, j: int) -> dict[int, Series]:
        """(ad Gamma)^j d_v: the components along q and v, and under mu those along ds - w_v dr.

        They are known to a degree lower by j.
        """
        if not j:
            return {x: self.one if x == v else {} for x in (*self.q, *self.v, *self.mu)}
        before, own, degree = self.bracket(v, j - 1), (*self.q, *self.v), self.degree - j
        signs, found = [1] * len(self.field) + [-1] * len(own), dict[int, Series]()
        for x in own:
            pairs = [(rate, self.derivative(before[x], y)) for y, rate in enumerate(self.field)]
            pairs += [(before[y], self.rate_slope(x, y)) for y in own]
            found[x] = self.dot(pairs, degree, signs)
        for a, s in zip(self.mu, self.q[len(self.v) :], strict=True):
            pairs = [(self.bends[a, v], found[r]) for r, v in zip(self.q, self.v, strict=False)]
            signs = [1] + [-1] * len(pairs)
            found[a] = self.dot([(self.one, found[s]), *pairs], degree, signs)
        return found

    def terms(self, kind: str, *place: int, degree: int = 0) -> list[Term]:
        """The terms of a bivector row: sum_i C(j, i) dtheta(V_i, V'_(j - i)).

        theta = L_v dr + L_mu (ds - w_v dr).
        """
        if kind[0] != "B":
            return super().terms(kind, *place, degree=degree)
        j, first = map(int, kind[1:].split("_"))
        pairs = [
            (self.bracket(self.v[first], i), self.bracket(self.v[place[0]], j - i))
            for i in range(j + 1)
        ]
        terms = list[Term]()
        signs = [sign * math.comb(j, i) for i in range(j + 1) for sign in (1, -1)]
        by = dict(zip((*self.q[: len(self.v)], *self.mu), (*self.v, *self.mu), strict=True))
        for (y, of), x in product(by.items(), (*self.q, *self.v)):
            parts = [(one[x], other[y]) for pair in pairs for one, other in (pair, pair[::-1])]
            part = self.dot(parts, degree, signs)
            terms.append(Term(1, part, (of, x)))
            for a in self.mu if of in self.v else ():
                bend = self.derivative(self.bends[a, of], x)
                terms.append(Term(-1, self.multiply(part, bend, degree), (a,)))
        return terms

    def coefficients(self, degree: int) -> list[int]:
        transverse = (key + self.all_units[a] for a in self.mu for key in self.monomials(degree))
        return [*self.monomials(degree + 1), *transverse]

    def matrix(self, elimination: Elimination) -> list[list[Number]]:
        """Random combinations of the rows of the matrix of a random solution.

        The matrix is [d2l/du du - lambda d2w/du du; dlambda/du].
        """
        columns = [*self.unknowns(0), *self.unknowns(1)]
        return self.mixed(self.hessian(elimination.solution(columns)))

    def mixed(self, rows: list[list[Number]]) -> list[list[Number]]:
        """Random combinations of the rows, as many as there are free velocities."""
        pairs = ([*zip(weights, rows, strict=True)] for weights in self.question.mixing)
        columns = range(len(self.v))
        return [[sum([x * row[b] for x, row in weighted]) for b in columns] for weighted in pairs]


class FlowExpansion(MotionExpansion):
    """Series in the time along the solution that starts at a point.

    They are of first order in displacements from the points of this solution.
    """

    clocks = 1

    def expand(self) -> None:
        last, self.clock = self.degree, (1 << self.shift - 8) | (1 << self.shift)
        if not last:  # read only
            super().expand()
            return
        start = {name: {0: self.arithmetic.values[name]} for name in self.question.variables}
        solution, number = dict[str, Series](start), self.arithmetic.number
        near = (last - 1) // 2 if last > AT_ONCE else last
        for degree in range(near):
            self.follow(degree, solution)
            for name, rate in zip(start, self.field, strict=True):
                grown = {
                    key + self.clock: part * number(Fraction(1, (key >> self.shift) + 1))
                    for key, part in rate.items()
                }
                solution[name] = self.settle(start[name] | grown)
        if near < last:
            self.continue_solution(solution, near, last)
        self.follow(last, self.moved(solution))
        self.vertical = self.pulled_back(last)

    def moved(self, solution: dict[str, Series]) -> dict[str, Series]:
        """The solution with a displacement of each variable."""
        one = self.arithmetic.number(Fraction(1))
        units = zip(self.question.variables, self.units, strict=True)
        return {name: solution[name] | {unit: one} for name, unit in units}

    def continue_solution(self, solution: dict[str, Series], near: int, last: int) -> None:
        """A solution x to t^near continued to t^last, last <= 2 near + 2, by one step of Newton's.

        The rest d = O(t^(near + 1)) satisfies d' = F(x) - x' + F'(x) d up to O(d^2), for which F'
        is needed to t^near.
        """
        self.follow(near + 1, self.moved(solution))
        slopes = self.slopes_in_time(near + 1)
        self.follow(last - 1, solution)
        own = {name: z for z, name in enumerate(self.question.variables) if z in slopes[0]}
        rates = {z: self.field[z] for z in own.values()}
        rest: list[dict[int, Number]] = [{}] * (near + 1)
        for k in range(near, last):
            share, found = self.arithmetic.number(Fraction(1, k + 1)), Series()
            for z, rate in rates.items():
                found[z] = rate.get(k * self.clock, 0)
                for before, slope in zip(reversed(rest), slopes, strict=False):
                    found[z] += sum([before[y] * part for y, part in slope[z] if y in before])
            rest.append({z: part * share for z, part in self.settle(found).items()})
        for name, z in own.items():
            more = {k * self.clock: one[z] for k, one in enumerate(rest) if z in one}
            solution[name] = self.settle(solution[name] | more)

    def follow(self, degree: int, solution: dict[str, Series]) -> None:
        """Read f to a degree along a solution, always with the same start values."""
        self.arithmetic, self.degree = self.arithmetic.again(), degree
        self.names = {name: {0: value} for name, value in self.arithmetic.values.items()} | solution
        self.read()

    def gather(self, total: Series, left: Series, right: Series, degree: int, weight: int) -> None:
        """To first order in the displacements."""
        displaced = (1 << 8 * len(self.units)) - 1
        moved = {key: part for key, part in left.items() if key & displaced}
        if not moved:
            super().gather(total, left, right, degree, weight)
            return
        still = {key: part for key, part in left.items() if not key & displaced}
        plain = {key: part for key, part in right.items() if not key & displaced}
        for one, other in ((still, right), (moved, plain)):
            if one and other:
                super().gather(total, one, other, degree, weight)

    def accumulate(self, total: Series, left: Series, right: Series) -> None:
        """To first order in the displacements."""
        displaced = (1 << 8 * len(self.units)) - 1
        plain = {key: part for key, part in right.items() if not key & displaced}
        for key, part in left.items():
            super().accumulate(total, {key: part}, plain if key & displaced else right)

    def slopes_in_time(self, count: int) -> list[dict[int, list[tuple[int, Number]]]]:
        """The first coefficients in time of dGamma/dx, as read with displacements: by component z,
        the pairs (y, coefficient).
        """
        own, found = (*self.q, *self.v), list[dict[int, list[tuple[int, Number]]]]()
        for k in range(count):
            keys = {y: self.units[y] + k * self.clock for y in own}
            found.append({z: [(y, self.field[z][key]) for y, key in keys.items()
                              if self.field[z].get(key)] for z in own})  # fmt: skip
        return found

    def pulled_back(self, last: int) -> dict[int, list[Series]]:
        """Phi(t)^-1 d_v to t^last, by components.

        Psi = Phi^-1 satisfies Psi' = -Psi dGamma/dx, Psi(0) = 1.
        """
        own, slopes = (*self.q, *self.v), self.slopes_in_time(last)
        psi: list[Series] = [{x << 8 | x: self.one[0] for x in own}]
        for k in range(last):
            total = Series()
            for before, slope in zip(psi, reversed(slopes[: k + 1]), strict=True):
                for place, part in before.items():
                    for y, rate in slope[place & 255]:
                        key = place & ~255 | y
                        total[key] = total.get(key, 0) - part * rate
            share = self.arithmetic.number(Fraction(1, k + 1))
            psi.append({key: part * share for key, part in self.settle(total).items()})
        return {
            v: [{x: part[x << 8 | v] for x in own if x << 8 | v in part} for part in psi]
            for v in self.v
        }

    def row(self, kind: str, place: tuple[int, ...], alpha: int) -> Series:
        """The coefficient of t^alpha of Omega(Phi^-1 d_v, Phi^-1 d_v').

        Omega has its components at the start.
        """
        left, right = (self.vertical[self.v[a]] for a in place)
        row = Series()
        for i in range(alpha + 1):
            for (x, a), (y, b) in product(left[i].items(), right[alpha - i].items()):
                if x != y:
                    key, part = self.pair(x, y), a * b if x < y else -a * b
                    row[key] = row.get(key, 0) + part
        return self.settle(row)

    def pair(self, x: int, y: int) -> int:
        return min(x, y) << 8 | max(x, y)

    def matrix(self, elimination: Elimination) -> list[list[Number]]:
        """Random combinations of the rows of [Omega(d_q, d_v)] of a random solution."""
        columns = [self.pair(x, y) for x, y in combinations((*self.q, *self.v), 2)]
        form = elimination.solution(columns)
        return self.mixed([[form.get(self.pair(q, v), 0) for v in self.v] for q in self.q])


class Motion(Question):
    """A motion on constraints, and the checks of certificates about its Lagrangians."""

    where = " on the constraints"

    def __init__(self, tools: Tools, document: Any, timed: bool, claim: Any) -> None:
        self.last = claim.get("bivectors") or 1  # the last j
        check_shape(self.last, range(1, MAX_ORDER * PACE), "certificate.bivectors")
        super().__init__(tools, document, timed, claim)
        self.mixing = [
            [self.generator.getrandbits(60) for _ in self.coordinates] for _ in self.free
        ]

    def listed_rows(self) -> KindsOfRows:
        found = KindsOfRows()
        for j in range(self.last, 1, -1):
            for a in range(len(self.free) - 1):
                later = [(b,) for b in range(a + 1, len(self.free))]
                found[f"B{j}_{a}"] = RowKind(-(-j // PACE), max(2, j), later)
        found["free"] = RowKind(1, 2, [(i,) for i in range(len(self.free))])
        found["dependent"] = RowKind(1, 2, [(a,) for a in range(len(self.bound))])
        return found

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return MotionExpansion(arithmetic, degree)


class Along(Motion):
    """The claim that brackets along one solution allow 2-forms of one type only.

    Those 2-forms have vertical vectors in their kernels.
    """

    def listed(self, document: dict[str, Any]) -> tuple[list[Row], int]:
        last, pairs = document["along"], [*combinations(range(len(self.free)), 2)]
        check_shape(last, range(1, MAX_ORDER * PACE), "certificate.along")
        return [Row("A", pair, j) for j in range(last + 1) for pair in pairs], last

    def expansion(self, arithmetic: Arithmetic, degree: int) -> Expansion:
        return FlowExpansion(arithmetic, degree)

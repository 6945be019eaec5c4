"""The conditions on a multiplier g as a linear differential system, completed on a part of a
family.

At one instant the unknowns g_ij(q, v) satisfy algebraic conditions, (H1) dg_ij/dv^k = dg_ik/dv^j,
and its derivative along solutions, H_k g_ij - g_jm N^m_ik symmetric in j and k; for L(q, q') also
Gamma(g) = g N + (g N)^T, which else gives g_t. The completion (Riquier, Janet) solves equations for
their highest derivatives, puts these into the others, and makes mixed derivatives agree, also those
with t. An equation holds for each member for which no factor that was divided out of it, or of
those it comes from, vanishes; the system is passive for each member for which no pivot does.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from .formulas import Incomplete
from .member_sets import MAX_TERMS, Part, Polynomial
from .quotients import Quotient

if TYPE_CHECKING:
    from .family import Conditions

MAX_EQUATIONS = 80
Orders = tuple[int, ...]
Place = tuple[int, Orders]  # the derivative of an unknown by q and v
Row = dict[Place, Polynomial]


class Equation(NamedTuple):
    """A row = 0, solved for its leader, with the numbers of the factors that were divided out."""

    row: Row
    leader: Place
    divided: frozenset[int]

    @property
    def pivot(self) -> Polynomial:
        return self.row[self.leader]


class Passive:
    """The completion for one question, from rows of algebraic conditions; `order` ranks the g_ij."""

    def __init__(
        self,
        conditions: Conditions,
        part: Part,
        algebraic: Sequence[Sequence[Polynomial]],
        order: Sequence[int],
        timed: bool,
    ) -> None:
        self.conditions, self.part, self.order, self.timed = conditions, part, order, timed
        self.ring = conditions.ring
        self.variables = [*conditions.q, *conditions.v]
        self.none = (0,) * len(self.variables)
        self.kept, self.pivots = list[Equation](), list[Polynomial]()
        self.divided = list[Polynomial]()
        first = [self.row_of(row) for row in algebraic]
        self.complete([*first, *map(self.whole, self.differential())])
        n, done = conditions.n, 0
        while not self.is_singular():
            phi = [conditions.row(("Phi", "0", str(i), str(j))) for i in range(n) for j in range(i + 1, n)]  # fmt: skip
            rows = [self.row_of(row) for row in phi]
            rows += [self.evolved(one.row) for one in self.kept] if timed else []
            left = [row for row in rows if self.reduced(row, frozenset()) is not None]
            done += 1
            if not left:
                break
            if done > MAX_EQUATIONS:
                raise Incomplete("The differential conditions are too many.")
            self.complete(left)

    def row_of(self, entries: Sequence[Polynomial]) -> Row:
        return {(k, self.none): one for k, one in enumerate(entries) if one}

    # The equations.

    def at(self, i: int, j: int, *by: int) -> Place:
        orders = tuple(by.count(variable) for variable in self.variables)
        return self.conditions.places.index((min(i, j), max(i, j))), orders

    def differential(self) -> Iterator[list[tuple[Place, Quotient]]]:
        c, ring, span = self.conditions, self.ring, self.conditions.span
        one = ring.constant(1)
        minus = ring.constant(-1)
        half = c.connection

        def horizontal(i: int, j: int, k: int) -> list[tuple[Place, Quotient]]:
            """H_k g_ij - g_jm N^m_ik."""
            found = [(self.at(i, j, c.q[k]), one)]
            for m in span:
                found.append((self.at(i, j, c.v[m]), ring.times(minus, half[m][k])))
                bent = ring.by(half[m][i], c.v[k])
                found.append((self.at(j, m), ring.times(minus, bent)))
            return found

        for i in span:
            for j, k in itertools.combinations(span, 2):
                yield [(self.at(i, j, c.v[k]), one), (self.at(i, k, c.v[j]), minus)]
                right = [(key, ring.times(minus, value)) for key, value in horizontal(i, k, j)]
                yield [*horizontal(i, j, k), *right]
        if not self.timed:
            for i, j in c.places:
                yield [(key, ring.times(minus, value)) for key, value in self.rate(i, j)]

    def rate(self, i: int, j: int) -> list[tuple[Place, Quotient]]:
        """dg_ij/dt = (g N + (g N)^T)_ij - v^k dg_ij/dq^k - f^k dg_ij/dv^k."""
        c, ring = self.conditions, self.ring
        found, minus = list[tuple[Place, Quotient]](), ring.constant(-1)
        for k in c.span:
            speed = Quotient(-ring.gens[c.v[k]], ring.one)
            found.append((self.at(i, j, c.q[k]), speed))
            found.append((self.at(i, j, c.v[k]), ring.times(minus, c.forces[k])))
            found.append((self.at(i, k), c.connection[k][j]))
            found.append((self.at(j, k), c.connection[k][i]))
        return found

    def evolved(self, row: Row) -> Row:
        """The derivative of an equation by t, without derivatives by t."""
        found = list[tuple[Place, Quotient]]()
        for (unknown, orders), value in row.items():
            found.append(((unknown, orders), Quotient(self.ring.slope(value, 0), self.ring.one)))
            rate = self.summed(self.rate(*self.conditions.places[unknown]))
            for variable, times in zip(self.variables, orders, strict=True):
                for _ in range(times):
                    rate = self.by(rate, variable)
            found += [
                (place, self.ring.times(Quotient(value, self.ring.one), one))
                for place, one in rate.items()
            ]
        return self.whole(found)

    def by(self, row: Mapping[Place, Quotient], variable: int) -> dict[Place, Quotient]:
        k = self.variables.index(variable)
        found = list[tuple[Place, Quotient]]()
        for (unknown, orders), value in row.items():
            found.append(((unknown, (*orders[:k], orders[k] + 1, *orders[k + 1 :])), value))
            found.append(((unknown, orders), self.ring.by(value, variable)))
        return self.summed(found)

    def summed(self, terms: Iterable[tuple[Place, Quotient]]) -> dict[Place, Quotient]:
        found = dict[Place, Quotient]()
        for place, value in terms:
            found[place] = self.ring.plus(found[place], value) if place in found else value
        return {place: value for place, value in found.items() if value.above}

    def whole(self, terms: Iterable[tuple[Place, Quotient]]) -> Row:
        """The equation times its denominators, which vanish for no member."""
        found = self.summed(terms)
        below = self.ring.one
        for value in found.values():
            below = below * (value.below / below.gcd(value.below))
        return {place: value.above * (below / value.below) for place, value in found.items()}

    # Their reduction.

    def rank(self, place: Place) -> tuple[object, ...]:
        unknown, orders = place
        return sum(orders), self.order.index(unknown), orders

    def on_part(self, row: Row) -> Row:
        """The coefficients on the part, all times the same elements that vanish for no member."""
        self.check(row)
        places = list(row)
        while (step := self.part.step([row[place] for place in places])) is not None:
            number, scale, rest = step
            row = {
                place: rest if k == number else row[place] * scale for k, place in enumerate(places)
            }
            self.check(row)
        return {place: value for place, value in row.items() if value}

    def check(self, row: Row) -> None:
        self.ring.check_time()
        if sum(map(len, row.values())) > 5 * MAX_TERMS:
            raise Incomplete("A differential condition is too large.")

    def combined(self, row: Row, other: Row, place: Place) -> Row:
        """The combination of two equations without this derivative."""
        common = row[place].gcd(other[place])
        left, right = other[place] / common, row[place] / common
        found = {key: value * left for key, value in row.items() if key != place}
        for key, value in other.items():
            if key != place:
                term = value * right
                found[key] = found[key] - term if key in found else -term
        return found

    def raised(self, one: Equation, place: Place) -> Row:
        row = one.row
        for variable, high, low in zip(self.variables, place[1], one.leader[1], strict=True):
            for _ in range(high - low):
                terms = {key: Quotient(value, self.ring.one) for key, value in row.items()}
                slopes = self.by(terms, variable)
                row = self.on_part({key: value.above for key, value in slopes.items()})
        return row

    def reduced(self, row: Row, divided: frozenset[int]) -> Equation | None:
        """The equation with the derivatives put in for which others are solved; None for 0 = 0."""
        row = self.on_part(row)
        while True:
            self.check(row)
            place, one = next(
                ((place, one) for place in sorted(row, key=self.rank, reverse=True)
                 for one in self.kept if is_above(place, one.leader)),
                (None, None),
            )  # fmt: skip
            if place is None or one is None:
                break
            divided |= one.divided
            row = self.on_part(self.combined(row, self.raised(one, place), place))
        if not row:
            return None
        leader = max(row, key=self.rank)
        row = self.with_simple_pivot(row, leader)
        common = self.ring.none
        for value in row.values():
            common = common.gcd(value) if common else value
        if not common.is_constant():
            row = {place: value / common for place, value in row.items()}
            if self.ring.unknowns(common):
                self.divided.append(common)
                divided |= {len(self.divided) - 1}
        return Equation(row, leader, divided)

    def with_simple_pivot(self, row: Row, place: Place) -> Row:
        """The equation times what frees its pivot of roots of the part's equations.

        Where what it is multiplied by vanishes, the new pivot does, too.
        """
        for _ in self.part.rules:
            by = self.part.cofactor(row[place])
            if by is None:
                break
            row = self.on_part({key: value * by for key, value in row.items()})
        return row

    def complete(self, rows: Sequence[Row]) -> None:
        waiting = [(row, frozenset[int]()) for row in rows if row]
        while waiting:
            waiting.sort(key=lambda item: _cost(item[0]))
            equation = self.reduced(*waiting.pop(0))
            if equation is None:
                continue
            self.pivots.append(equation.pivot)
            for one in list(self.kept):
                if any(is_above(place, equation.leader) for place in one.row):
                    self.kept.remove(one)
                    waiting.append((one.row, one.divided))
            for one in self.kept:
                if one.leader[0] == equation.leader[0]:
                    top = one.leader[0], tuple(map(max, one.leader[1], equation.leader[1]))
                    row = self.combined(self.raised(one, top), self.raised(equation, top), top)
                    waiting.append((row, one.divided | equation.divided))
            self.kept.append(equation)
            if len(self.kept) > MAX_EQUATIONS:
                raise Incomplete("The differential conditions are too many.")
            if self.is_singular():
                return

    # What is left.

    @property
    def algebraic(self) -> list[Equation]:
        return [one for one in self.kept if not any(one.leader[1])]

    def is_singular(self) -> bool:
        return not self.determinant()

    def determinant(self) -> list[Polynomial]:
        """det g in the free entries: its coefficients that do not vanish on the part."""
        ring, n, places = self.ring, self.conditions.n, self.conditions.places
        solved = {one.leader[0]: one for one in self.algebraic}
        entries = dict[tuple[int, int], dict[int, Polynomial]]()
        for k, pair in enumerate(places):
            others = [one.pivot for place, one in solved.items() if place != k]
            scale = ring.one
            for pivot in others:
                scale = scale * pivot
            if k in solved:
                row = solved[k].row
                entries[pair] = {m: -value * scale for (m, _), value in row.items() if m != k}
            else:
                entries[pair] = {k: scale}
        total = dict[tuple[int, ...], Polynomial]()
        for columns in itertools.permutations(range(n)):
            turned = sum(a > b for a, b in itertools.combinations(columns, 2))
            terms: dict[tuple[int, ...], Polynomial] = {(): ring.context.constant((-1) ** turned)}
            for i, j in enumerate(columns):
                found = dict[tuple[int, ...], Polynomial]()
                for key, value in terms.items():
                    for m, factor in entries[min(i, j), max(i, j)].items():
                        new = tuple(sorted((*key, m)))
                        found[new] = found.get(new, ring.none) + value * factor
                terms = found
            for key, value in terms.items():
                total[key] = total.get(key, ring.none) + value
        return [value for value in total.values() if not self.part.vanishes([value])]

    def missed(self, exists: bool) -> list[list[Polynomial]]:
        """Sets of polynomials: a member with another answer has one whose polynomials all
        vanish.
        """
        factors = list(self.pivots)
        if not exists:
            held = frozenset[int]().union(*(one.divided for one in self.algebraic))
            factors = [one.pivot for one in self.algebraic] + [self.divided[k] for k in held]
        parts = {str(one): one for whole in factors for one in self.ring.factors(whole)}
        found = [[one] for one in parts.values() if not self.part.is_unit(one)]
        return [*found, self.determinant()] if exists else found


def is_above(place: Place, leader: Place) -> bool:
    return place[0] == leader[0] and all(a >= b for a, b in zip(place[1], leader[1], strict=True))


def _cost(row: Row) -> tuple[int, int]:
    return max((sum(orders) for _, orders in row), default=0), sum(map(len, row.values()))

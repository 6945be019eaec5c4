"""The differential conditions on a multiplier g, completed on a leaf of a family.

At one instant the unknowns g_ij(q, v) of L(t, q, q') satisfy, besides the algebraic conditions,

    dg_ij/dv^k = dg_ik/dv^j
    H_k g_ij - g_jm N^m_ik = H_j g_ik - g_km N^m_ij,   H_k = d/dq^k - N^m_k d/dv^m,
                                                      N^m_k = -1/2 df^m/dv^k, N^m_ik = dN^m_i/dv^k

(Gamma(g) = g N + (g N)^T defines g_t, and the algebraic conditions are closed under it for n = 2).
For L(q, q'), and with t as a variable for n > 2, Gamma(g_ij) = g_im N^m_j + g_jm N^m_i is added.

These linear equations are completed as by Riquier and Janet: equations are solved for their highest
derivatives, derivatives of these are put into the others, and mixed derivatives have to agree. Then
g is free at a point up to the equations without derivatives. The elimination divides by *pivots*,
polynomials in the constants and jets of the family and in q and v. A member at which no pivot is
identically zero has the same equations, so the same answer as the general one; so has, if only
singular g are left, one at which no divided content and not all minors of the equations without
derivatives vanish.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from flint import fmpq_mpoly

from inverse_service import deadline
from inverse_service.explanation import hierarchy
from inverse_service.expressions import polynomials
from inverse_service.field import exact_field, matrices
from inverse_service.mechanics import conditions as cd
from inverse_service.solving.leaves import Leaf, NotSplit
from inverse_service.statements.questions import Question

Orders = tuple[int, ...]
Place = tuple[int, Orders]  # a derivative of an unknown g_ij, by number
Row = dict[Place, fmpq_mpoly]
MOST_TERMS = 100_000  # of one equation, before it is reduced
MOST_EQUATIONS = 60


@dataclass(frozen=True)
class Completed:
    """Whether a regular g is left, and systems of equations of which one holds at each member for
    which the answer may be another.
    """

    is_regular: bool
    special: tuple[tuple[fmpq_mpoly, ...], ...]
    order: tuple[int, ...]  # of the unknowns


@dataclass(frozen=True)
class _Equation:
    """A row = 0, its highest derivative, and the contents that were divided out of it and of those
    it comes from.
    """

    row: Row
    leader: Place
    contents: frozenset[int]

    @property
    def pivot(self) -> fmpq_mpoly:
        return self.row[self.leader]


@dataclass
class _Completion:
    leaf: Leaf
    exact: cd.MotionInRing
    variables: tuple[int, ...]  # of the ring, by number
    order: tuple[int, ...]  # of the unknowns: the highest last
    until: float
    contents: list[fmpq_mpoly] = field(default_factory=list)
    pivots: list[fmpq_mpoly] = field(default_factory=list)
    kept: list[_Equation] = field(default_factory=list)

    @property
    def ring(self) -> exact_field.ExactRing:
        return self.exact.ring

    def rank(self, place: Place) -> tuple[object, ...]:
        unknown, orders = place
        return sum(orders), self.order.index(unknown), orders

    def derivative(self, row: Row, variable: int) -> Row:
        """The derivative of the equation, times the denominators of its coefficients."""
        by = self.ring.partial(self.variables[variable])
        found = dict[Place, exact_field.Quotient]()
        zero = self.ring.constant(0)
        for (unknown, orders), value in row.items():
            up = (*orders[:variable], orders[variable] + 1, *orders[variable + 1 :])
            raised = exact_field.Quotient(self.ring.field, value, ())
            found[unknown, up] = found.get((unknown, up), zero) + raised
            slope = by.of_polynomial(self.ring.field, value)
            found[unknown, orders] = found.get((unknown, orders), zero) + slope
        return self.whole(found)

    def whole(self, row: Mapping[Place, exact_field.Quotient]) -> Row:
        parts = {place: value for place, value in row.items() if not value.is_zero}
        return dict(zip(parts, matrices.numerators(self.ring, parts.values()), strict=True))

    def on_leaf(self, row: Row) -> Row:
        """The coefficients on the leaf, all times the same elements that vanish nowhere on it."""
        while True:
            steps = ((place, *self.leaf.reduced_once(value)) for place, value in row.items())
            step = next((one for one in steps if one[1] is not None), None)
            if step is None:
                return {place: value for place, value in row.items() if not value.is_zero()}
            reduced, by, rest = step
            assert by is not None
            product = self.ring.field.product
            row = {
                place: rest if place == reduced else product(value, by)
                for place, value in row.items()
            }
            self.check(row)

    def check(self, row: Row) -> None:
        if deadline.now() > self.until:
            raise NotSplit("the time for the differential conditions was over")
        if sum(map(len, row.values())) > MOST_TERMS:
            raise NotSplit("a differential condition is too large")

    def reduced(self, row: Row, contents: frozenset[int]) -> _Equation | None:
        """The equation with the derivatives put in for which others are solved; None if it is
        0 = 0.
        """
        row = self.on_leaf(row)
        while True:
            self.check(row)
            target = next(
                ((place, one) for place in sorted(row, key=self.rank, reverse=True)
                 for one in self.kept if _is_above(place, one.leader)), None)  # fmt: skip
            if target is None:
                break
            place, one = target
            other = self.raised(one, place)
            contents |= one.contents
            row = self.on_leaf(self.combined(row, other, place))
        row = {place: value for place, value in row.items() if not value.is_zero()}
        if not row:
            return None
        leader = max(row, key=self.rank)
        row = self.with_simple_pivot(row, leader)
        common = exact_field.common_divisor(list(row.values()))
        if not common.is_constant():
            row = {place: value / common for place, value in row.items()}
            if self.leaf.unknowns.unknowns_in(common):
                self.contents.append(common)
                contents |= {len(self.contents) - 1}
        return _Equation(row, leader, contents)

    def with_simple_pivot(self, row: Row, place: Place) -> Row:
        """The equation times what frees its pivot of roots of the leaf's equations.

        Then a factor that all coefficients have in common on the leaf is common to the polynomials,
        too; else it stays hidden, and the equations grow. Where what is multiplied by vanishes, the
        pivot does.
        """
        for _ in self.leaf.rules:  # at most once each, where they are solved for each other
            pivot = row[place]
            found = next(
                (one for one in self.leaf.rules if one.degree > 1 and pivot.degrees()[one.leader]),
                None,
            )
            by = None if found is None else _cofactor(pivot, found.equation, found.leader)
            if by is None:
                break
            product = self.ring.field.product
            row = self.on_leaf({key: product(value, by) for key, value in row.items()})
        return row

    def raised(self, one: _Equation, place: Place) -> Row:
        row = one.row
        for variable, (high, low) in enumerate(zip(place[1], one.leader[1], strict=True)):
            for _ in range(high - low):
                row = self.on_leaf(self.derivative(row, variable))
                self.check(row)
        return row

    def combined(self, row: Row, other: Row, place: Place) -> Row:
        """The combination of two equations without this derivative."""
        product = self.ring.field.product
        common = exact_field.common_divisor([row[place], other[place]])
        left, right = other[place] / common, row[place] / common
        found = {key: product(value, left) for key, value in row.items() if key != place}
        for key, value in other.items():
            if key != place:
                term = product(value, right)
                found[key] = found[key] - term if key in found else -term
        return found

    def complete(self, rows: Sequence[Row]) -> None:
        waiting: list[tuple[Row, frozenset[int]]] = [(row, frozenset()) for row in rows]
        while waiting:
            waiting.sort(key=lambda item: _cost(item[0]))
            row, contents = waiting.pop(0)
            equation = self.reduced(row, contents)
            if equation is None:
                continue
            self.pivots.append(equation.pivot)
            for one in list(self.kept):
                if any(_is_above(place, equation.leader) for place in one.row):
                    self.kept.remove(one)
                    waiting.append((one.row, one.contents))
            for one in self.kept:
                if one.leader[0] == equation.leader[0]:
                    waiting.append(self.crossed(one, equation))
            self.kept.append(equation)
            if len(self.kept) > MOST_EQUATIONS:
                raise NotSplit("the differential conditions are too many")
            if self.is_singular():
                return

    def crossed(self, one: _Equation, other: _Equation) -> tuple[Row, frozenset[int]]:
        top = one.leader[0], tuple(map(max, one.leader[1], other.leader[1]))
        row = self.combined(self.raised(one, top), self.raised(other, top), top)
        return row, one.contents | other.contents

    @property
    def algebraic(self) -> list[_Equation]:
        return [one for one in self.kept if not any(one.leader[1])]

    def is_singular(self) -> bool:
        found = self.determinant()
        return not found

    def determinant(self) -> list[fmpq_mpoly]:
        """The coefficients of det g in the free entries, where g satisfies the equations without
        derivatives.
        """
        n = self.exact.motion.size
        pairs, owner = hierarchy.unknowns(n), self.ring.field
        none = (0,) * len(self.variables)
        solved = {one.leader[0]: one for one in self.algebraic}
        free = [k for k in range(len(pairs)) if k not in solved]
        product = owner.context.constant(1)
        for one in solved.values():
            product = owner.product(product, one.pivot)
        # Each entry times the product of pivots, a combination of free entries.
        entries = dict[tuple[int, int], dict[int, fmpq_mpoly]]()
        for k, pair in enumerate(pairs):
            if k in solved:
                one = solved[k]
                rest = owner.context.constant(1)
                for other in solved.values():
                    rest = rest if other is one else owner.product(rest, other.pivot)
                entries[pair] = {
                    m: owner.product(-value, rest)
                    for (m, orders), value in one.row.items()
                    if m != k and orders == none
                }
            else:
                entries[pair] = {k: product}
        zero = owner.context.constant(0)
        total = dict[tuple[int, ...], fmpq_mpoly]()
        for columns in itertools.permutations(range(n)):
            sign = _sign(columns)
            terms: dict[tuple[int, ...], fmpq_mpoly] = {(): owner.context.constant(sign)}
            for i, j in enumerate(columns):
                entry = entries[min(i, j), max(i, j)]
                terms = _added(
                    (tuple(sorted((*key, m))), owner.product(value, factor))
                    for key, value in terms.items()
                    for m, factor in entry.items()
                )
            for key, value in terms.items():
                total[key] = total.get(key, zero) + value
        assert set(itertools.chain(*total)) <= set(free)
        reduced = [self.leaf.reduced(owner.reduce(value)) for value in total.values()]
        return [one for one in reduced if not one.is_zero()]

    def special(self, is_regular: bool) -> Iterator[fmpq_mpoly]:
        """Elements of which one vanishes identically at each member with another answer."""
        if is_regular:
            yield from self.pivots
            yield from self.contents
        else:
            for one in self.algebraic:
                yield one.pivot
            for k in frozenset[int]().union(*(one.contents for one in self.algebraic)):
                yield self.contents[k]


def _cofactor(polynomial: fmpq_mpoly, by: fmpq_mpoly, leader: int) -> fmpq_mpoly | None:
    """s with s p = r + t q for the polynomial p and the irreducible q, r without the leader."""
    context = polynomial.context()
    high, low = (by, context.constant(0)), (polynomial, context.constant(1))
    while low[0].degrees()[leader] > 0:
        while not high[0].is_zero() and (
            (more := high[0].degrees()[leader] - low[0].degrees()[leader]) >= 0
        ):
            first, second = (
                exact_field.coefficient(one, leader, one.degrees()[leader])
                for one in (high[0], low[0])
            )
            common = exact_field.common_divisor([first, second])
            up, down = second / common, first / common * context.gen(leader) ** more
            high = high[0] * up - low[0] * down, high[1] * up - low[1] * down
        if high[0].is_zero():
            return None
        common = exact_field.common_divisor([*high])
        high, low = low, (high[0] / common, high[1] / common)
    return low[1]


def _added(
    terms: Iterator[tuple[tuple[int, ...], fmpq_mpoly]],
) -> dict[tuple[int, ...], fmpq_mpoly]:
    found = dict[tuple[int, ...], fmpq_mpoly]()
    for key, value in terms:
        found[key] = found[key] + value if key in found else value
    return found


def _sign(columns: Sequence[int]) -> int:
    turned = sum(a > b for a, b in itertools.combinations(columns, 2))
    return -1 if turned % 2 else 1


def _is_above(place: Place, leader: Place) -> bool:
    return place[0] == leader[0] and all(a >= b for a, b in zip(place[1], leader[1], strict=True))


def _cost(row: Row) -> tuple[int, int]:
    return max((sum(orders) for _, orders in row), default=0), sum(map(len, row.values()))


def complete(
    leaf: Leaf,
    exact: cd.MotionInRing,
    algebraic: Sequence[Sequence[fmpq_mpoly]],
    question: Question,
    until: float,
) -> Completed:
    """The completion for L(t, q, q') or L(q, q') on a leaf, from the rows of the algebraic
    conditions.

    Raises NotSplit where a limit is reached, TooLarge and ZeroDivisionError as the ring does.
    """
    n = exact.motion.size
    with_t = question.timed and n > 2
    variables = tuple(range(0 if with_t else 1, 2 * n + 1))
    rows = [_row(leaf, row, len(variables)) for row in algebraic]
    order = _order(leaf, rows, n)
    work = _Completion(leaf, exact, variables, order, until)
    started = _differential_rows(exact, variables, question.timed and not with_t)
    work.complete([*(row for row in rows if row), *map(work.whole, started)])
    is_regular = not work.is_singular()
    listed = dict[frozenset[str], tuple[fmpq_mpoly, ...]]()
    for element in work.special(is_regular):
        for parts in systems_of(leaf, element):
            listed.setdefault(frozenset(map(str, parts)), parts)
    if is_regular:
        # det g vanishes if all coefficients in the free entries do.
        parts = tuple(p for one in work.determinant() for p in leaf.unknowns.coefficients(one))
        if not any(_vanishes_nowhere(leaf, part) for part in parts):
            listed.setdefault(frozenset(map(str, parts)), parts)
    return Completed(is_regular, tuple(listed.values()), order)


def systems_of(leaf: Leaf, element: fmpq_mpoly) -> Iterator[tuple[fmpq_mpoly, ...]]:
    """Systems of equations of which one holds if the element is identically zero at a member."""
    unknowns = leaf.unknowns
    for factor, _ in polynomials.factor_polynomial(element)[1]:
        parts = tuple(unknowns.coefficients(factor))
        if not any(_vanishes_nowhere(leaf, part) for part in parts):
            yield parts


def _vanishes_nowhere(leaf: Leaf, part: fmpq_mpoly) -> bool:
    """Whether the element is known to vanish at no member of the leaf."""
    if not leaf.unknowns.unknowns_in(part):
        return True
    if len(part) > 40:
        return False
    factors = [
        factor / factor.leading_coefficient()
        for factor, _ in polynomials.factor_polynomial(part)[1]
        if leaf.unknowns.unknowns_in(factor)
    ]
    return all(factor in leaf.nonzero for factor in factors)


def _row(leaf: Leaf, entries: Sequence[fmpq_mpoly], size: int) -> Row:
    reduced = list(entries)
    return {(k, (0,) * size): one for k, one in enumerate(reduced) if not one.is_zero()}


def _order(leaf: Leaf, rows: Sequence[Row], n: int) -> tuple[int, ...]:
    """The unknowns, those last for which the algebraic conditions are solved most simply."""
    sizes = dict[int, tuple[int, int, int]]()
    for k in range(len(hierarchy.unknowns(n))):
        found = list[tuple[int, int, int]]()
        for row in rows:
            for (unknown, _), value in row.items():
                left = leaf.reduced(value) if unknown == k else value * 0
                if not left.is_zero():
                    hard = not any(
                        _vanishes_nowhere(leaf, part) for part in leaf.unknowns.coefficients(left)
                    )
                    found.append((int(hard), len(left), k))
        sizes[k] = min(found, default=(2, 0, -k))
    return tuple(sorted(sizes, key=lambda k: sizes[k], reverse=True))


def _differential_rows(
    exact: cd.MotionInRing, variables: tuple[int, ...], at_one_instant: bool
) -> Iterator[dict[Place, exact_field.Quotient]]:
    motion, ring, n = exact.motion, exact.ring, exact.motion.size
    place = {pair: k for k, pair in enumerate(hierarchy.unknowns(n))}
    one, zero = ring.constant(1), ring.constant(0)
    half = cd.connection(motion)
    bent = [[[motion.by_velocity[k](half[m][i]) for k in range(n)] for i in range(n)] for m in range(n)]  # fmt: skip

    def at(i: int, j: int, *by: int) -> Place:
        orders = tuple(by.count(variable) for variable in variables)
        return place[min(i, j), max(i, j)], orders

    def total(terms: Sequence[tuple[Place, exact_field.Quotient]]) -> dict[Place, exact_field.Quotient]:  # fmt: skip
        found = dict[Place, exact_field.Quotient]()
        for key, value in terms:
            found[key] = found.get(key, zero) + value
        return found

    def horizontal(i: int, j: int, k: int) -> list[tuple[Place, exact_field.Quotient]]:
        """H_k g_ij - g_jm N^m_ik."""
        return [
            (at(i, j, 1 + k), one),
            *((at(i, j, 1 + n + m), -half[m][k]) for m in range(n)),
            *((at(j, m), -bent[m][i][k]) for m in range(n)),
        ]

    for i in range(n):
        for j, k in itertools.combinations(range(n), 2):
            yield total([(at(i, j, 1 + n + k), one), (at(i, k, 1 + n + j), -one)])
            right = [(key, -value) for key, value in horizontal(i, k, j)]
            yield total([*horizontal(i, j, k), *right])
    if at_one_instant:
        return
    speeds = [ring.atoms[v] for v in ring.variables[1 + n :]]
    for i, j in hierarchy.unknowns(n):
        yield total(
            [
                *([(at(i, j, 0), one)] if 0 in variables else []),
                *((at(i, j, 1 + k), speeds[k]) for k in range(n)),
                *((at(i, j, 1 + n + k), motion.accelerations[k]) for k in range(n)),
                *((at(i, m), -half[m][j]) for m in range(n)),
                *((at(j, m), -half[m][i]) for m in range(n)),
            ]
        )

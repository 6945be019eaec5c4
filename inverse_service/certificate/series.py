"""Power series about a point, the Helmholtz conditions as series, and elimination."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from heapq import heapify, heappop, heappush
from itertools import accumulate, chain, combinations_with_replacement, pairwise, product, repeat
from typing import TYPE_CHECKING, Any, NamedTuple

from .formulas import (
    MAX_POWER,
    SPECIAL,
    Incomplete,
    Order,
    laws_of,
    read_formulas,
    require,
    shifted,
    slopes_of,
    value_of,
)
from .numbers import Arithmetic, Number, Root, Series, Unsettled

if TYPE_CHECKING:
    from .question import Question

MAX_MONOMIALS, MAX_DEGREE = 400_000, 1 << 20
# The table of a condition; see Expansion.condition.
Table = dict[int, list[tuple[Number, int, list[tuple[int, int]]]]]
Factors = list[tuple[int, Number]]  # numbers of rows, and what each is taken times


class Term(NamedTuple):
    """A term of a condition: weight times factor times the derivative of L by these variables."""

    weight: int
    factor: Series
    by: tuple[int, ...]


class Row(NamedTuple):
    """The name of a row: the coefficient `alpha` of the condition of a kind at a place."""

    kind: str
    place: tuple[int, ...]
    alpha: int


class Step(NamedTuple):
    """A step of an elimination: the name of a row, its pivot, and its columns."""

    row: Any
    pivot: int
    columns: frozenset[int]


class Symbol(NamedTuple):
    """The dimension of the symbol of a system, the dimension of its prolongation, and its
    characters.
    """

    dimension: int
    prolonged: int
    characters: tuple[int, ...]


class Count:
    """Read formulas to bound their degrees and bits.

    A value is (degree of numerator, of denominator, bits of the coefficients of both, the depth of
    the roots in it: see Root).
    """

    def __init__(self, question: Question) -> None:
        self.question = question
        self.entries = iter(question.plan.entries)
        self.weights, self.depths = dict[int, int](), dict[int, tuple[int, int]]()
        self.names = dict.fromkeys((*question.names, "pi"), (1, 0, 1, 0, 0))
        self.degree, self.ties = 0, list[Any]()
        self.forces = question.read_all(self)

    def bounded(self, *found: int) -> Any:
        self.question.check_time()
        plan = self.question.plan
        if max(found) * (1 if plan.wide else plan.split) > MAX_DEGREE:
            raise Incomplete(f"A degree, or the bits of a coefficient, may be above {MAX_DEGREE}.")
        return found

    def constant(self, value: Fraction) -> Any:
        return self.bounded(0, 0, value.numerator.bit_length(), value.denominator.bit_length(), 0)

    def add(self, terms: list[Any], weights: Iterable[int] = ()) -> Any:
        above, below, high, low, depth = terms[0] if terms else (0, 0, 0, 0, 0)
        for a, b, c, d, e in terms[1:]:
            high, low = max(high + d, low + c) + 1, low + d
            above, below, depth = max(above + b, below + a), below + b, max(depth, e)
        return self.bounded(above, below, high, low, depth)

    def multiply(self, left: Any, right: Any, degree: int = 0) -> Any:
        sizes = (a + b for a, b in zip(left[:-1], right[:-1], strict=True))
        return self.bounded(*sizes, max(left[-1], right[-1]))

    def power(self, u: Any, exponent: int) -> Any:
        *sizes, depth = u if exponent >= 0 else (u[1], u[0], u[3], u[2], u[4])
        times = min(abs(exponent), MAX_POWER + 1)
        return self.bounded(*(times * size for size in sizes), depth)

    def atom(self, u: Any, logarithm: bool) -> Any:
        """The degrees of all powers that occur in computations with Residues."""
        plan, entry, size, depth = self.question.plan, next(self.entries), max(*u[:-1], 1), u[-1]
        if entry.pair:
            self.weights[entry.pair] = size if logarithm else 1
            # The depths of l and r: a new logarithm and a new exponential are indeterminates.
            self.depths[entry.pair] = (0, depth) if logarithm else (depth, 0)
            if logarithm and (degree := plan.pairs[entry.pair].scale) > 1:
                plan.roots.append(Root(degree, depth + 1))
                self.depths[entry.pair] = 0, depth + 1
            depth = 0
        else:
            depths = [self.depths.get(j, (0, 0))[not logarithm] for j, _ in entry.parts]
            depth = max(depths, default=0)
        powers = ((math.ceil(abs(a) * plan.pairs[j].scale), j) for j, a in entry.parts)
        weight = sum(power * self.weights.get(j, 1) for power, j in powers)
        if logarithm:
            self.bounded(size * entry.times, weight * entry.times)
            return self.bounded(1, 0, entry.times, entry.times, depth)
        weight = weight or (plan.pairs[entry.pair].scale if entry.pair else 1)
        return self.bounded(weight, weight, 1, 1, depth)

    def elementary(self, name: str, u: Any) -> Any:
        if name == "atan" and self.question.halves:
            square = self.add([(0, 0, 1, 0, 0), self.multiply(u, u)])
            length = self.atom(self.atom(square, True), False)
            return self.atom(self.multiply(u, length), True)
        # The atom of w = (1 + iu)/(1 - iu), which has the degree of u.
        found = self.atom(u, name in ("log", "atan"))
        return self.multiply(found, found) if name in ("sin", "cos") else found

    def function(self, name: str, orders: tuple[int, ...], arguments: list[Any]) -> Any:
        return 1, 0, 1, 0, 0

    def special(self, name: str, arguments: list[Any], order: Order) -> Any:
        *orders, u = arguments
        free = (1, 0, 1, 0, 0)
        bound = {"u": u, "y": free, "z": free} | laws_of(self, name, u)
        bound |= dict(zip("n", orders, strict=False))
        found = self.add([free, *slopes_of(self, name, **bound)])
        shift = order.shift if name != "polygamma" else 0
        return shifted(self, (found, found), bound.get("n"), u, shift)

    def integral(self, name: str, orders: list[int], arguments: list[Any]) -> Any:
        known = self.question.integrals[name]
        bound = known.bound(name, orders, arguments)
        slopes = read_formulas(self, known.slopes.values(), **bound)
        return self.add([(1, 0, 1, 0, 0), *slopes, *arguments])


class Expansion:
    """Power series about a point, and conditions on L.

    The variables are the displacements of t (if any), q_1 … q_n, v_1 … v_k. If velocities are
    dependent, s' = w(t, q, v), L also has the variables mu = s' - w.
    """

    offset = 2  # the total degree of the coefficients of L that count as degree 0
    clocks = 0  # variables of the series in addition to those of the question

    def __init__(self, arithmetic: Arithmetic, degree: int) -> None:
        self.question, self.arithmetic, self.degree = arithmetic.question, arithmetic, degree
        self.settle: Callable[[Series], Series] = arithmetic.settle
        question, n = self.question, len(self.question.coordinates)
        m, free, transverse = len(question.variables), len(question.free), len(question.bound)
        self.shift = 8 * (m + transverse + self.clocks)
        self.one = self.settle({0: arithmetic.number(Fraction(1))})
        self.all_units = [(1 << 8 * a) | (1 << self.shift) for a in range(m + transverse)]
        self.units, self.mu = self.all_units[:m], range(m, m + transverse)
        self.q, self.v = range(m - free - n, m - free), range(m - free, m)
        self.phi = cache(self.curvature)
        self.table = cache(self.condition)
        self.share = cache(lambda k: arithmetic.number(Fraction(1, k)))
        self.unknowns = cache(self.coefficients)
        # The powers of arguments of functions, with the argument whose identity is the key.
        self.raised = dict[tuple[int, int], tuple[Series, list[Series]]]()
        self.expand()

    def expand(self) -> None:
        """Read f with displaced variables."""
        arithmetic, question, degree = self.arithmetic, self.question, self.degree
        if math.comb(len(self.units) + degree, degree) * (1 + len(self.mu)) > MAX_MONOMIALS:
            raise Incomplete(f"Series of more than {MAX_MONOMIALS} terms would be needed.")
        self.names = {name: {0: value} for name, value in arithmetic.values.items()}
        for name, unit in zip(question.variables, self.units, strict=True) if degree else ():
            self.names[name][unit] = arithmetic.number(Fraction(1))
        self.read()
        if degree and question.bound:
            moved = zip(question.bound, self.rates, self.mu, strict=True)
            self.names = self.names | {
                name + "'": self.add([rate, {self.all_units[a]: self.one[0]}])
                for name, rate, a in moved
            }
        self.slopes = [[self.derivative(force, v) for v in self.v] for force in self.forces]

    def read(self) -> None:
        """Read f and the components of Gamma."""
        self.ties, free = list[Series](), len(self.question.free)
        found = self.question.read_all(self)
        self.forces, self.rates = found[:free], found[free:]
        rates = [self.names[name + "'"] for name in self.question.coordinates]
        self.field = [self.one] * self.question.timed + rates + self.forces

    def constant(self, value: Fraction) -> Series:
        return self.settle({0: self.arithmetic.number(value)})

    def exponent(self, key: int, variable: int) -> int:
        return (key >> 8 * variable) & 255

    def monomials(self, degree: int) -> Iterator[int]:
        return map(sum, combinations_with_replacement(self.units, degree) if degree >= 0 else ())

    def add(self, terms: list[Series], weights: Iterable[int] = ()) -> Series:
        """The sum of the series, each times a small integer."""
        total: Series = {}
        for term, weight in zip(terms, weights or [1] * len(terms), strict=True):
            for key, value in term.items():
                own = value if weight == 1 else value * weight
                total[key] = total.get(key, 0) + own
        return self.settle(total)

    def multiply(self, left: Series, right: Series, degree: int) -> Series:
        """The product up to a total degree."""
        return self.dot([(left, right)], degree)

    def dot(
        self, pairs: Iterable[tuple[Series, Series]], degree: int, weights: Iterable[int] = ()
    ) -> Series:
        """The sum of products up to a total degree, each times a small integer."""
        total: Series = {}
        for (left, right), weight in zip(pairs, weights or repeat(1), strict=False):
            short, long = (left, right) if len(left) < len(right) else (right, left)
            if short:
                self.gather(total, short, long, degree, weight)
        return self.settle(total)

    def gather(self, total: Series, left: Series, right: Series, degree: int, weight: int) -> None:
        """Add a product up to a total degree; monomials are ordered by degree first."""
        if not degree:
            total[0] = total.get(0, 0) + left.get(0, 0) * right.get(0, 0) * weight
            return
        shift, most, work = self.shift, degree - (min(left) >> self.shift), 0
        blocks: list[list[tuple[int, Number]]] = [[] for _ in range(most + 1)]
        for key, value in right.items():
            if key >> shift <= most:
                blocks[key >> shift].append((key, value))
        terms, reach = [*chain(*blocks)], [*accumulate(map(len, blocks))]
        for place, (first, value) in enumerate(left.items()):
            if not place % 64:  # querying the time takes as long as about ten products
                self.question.check_time(10 + work)
                work = 0
            if first >> shift > degree:
                continue
            near, by = reach[degree - (first >> shift)], value if weight == 1 else value * weight
            work += near
            for second, coefficient in terms[:near]:
                key = first + second
                total[key] = total.get(key, 0) + by * coefficient
        self.question.work += work

    def derivative(self, series: Series, variable: int) -> Series:
        unit = self.units[variable]
        return {
            key - unit: part * power
            for key, part in series.items()
            if (power := self.exponent(key, variable))
        }

    def compose(
        self, arguments: list[Series], coefficient: Callable[..., Number], *beta: int
    ) -> Series:
        """sum over beta of coefficient(beta) (u - u_0)^beta.

        By Horner's rule, in the last argument by its powers. The arguments u have the values u_0.
        """
        result, u, degree = Series(), arguments[len(beta)], self.degree - sum(beta)
        if len(beta) == len(arguments) - 1:
            for k, part in enumerate(self.powers(u)[: degree + 1]):
                by = coefficient(*beta, k)
                self.question.work += len(part)
                for key, value in part.items():
                    if key >> self.shift <= degree:
                        result[key] = result.get(key, 0) + value * by
            return self.settle(result)
        step = {key: value for key, value in u.items() if key}
        for power in range(degree if step else 0, -1, -1):
            raised = self.multiply(result, step, degree - power)
            result = self.add([raised, self.compose(arguments, coefficient, *beta, power)])
        return result

    def powers(self, u: Series) -> list[Series]:
        """1, s, s^2, ... to the degree, for s = u - u_0; once for all functions of the same u."""
        known, found = self.raised.get((id(u), self.degree), (None, list[Series]()))
        if known is not u:
            step, found = {key: value for key, value in u.items() if key}, [self.one]
            while step and len(found) <= self.degree:
                found.append(self.multiply(found[-1], step, self.degree))
            self.raised[id(u), self.degree] = u, found
        return found

    def grown(
        self,
        u: Series,
        starts: Sequence[Number],
        weight: Callable[[int, int], int],
        shares: Sequence[Number],
    ) -> list[Series]:
        """The series y_1, ..., y_m with the values `starts`, from their parts of lower degree.

        k (y_i)_k = share_i sum_j weight(k, j) u_j (y_(m+1-i))_(k-j), for the parts of degree k: a
        differential equation along the Euler field, whose solution takes about one product.
        """
        parts = [Series() for _ in range(self.degree + 1)]
        for key, value in u.items():
            if key >> self.shift <= self.degree:
                parts[key >> self.shift][key] = value
        found = [[self.settle({0: start})] for start in starts]
        for k in range(1, self.degree + 1):
            self.question.check_time()
            known, new = [*reversed(found)], list[Series]()
            for share, other in zip(shares, known, strict=True):
                total, by = Series(), share * self.share(k)
                for j, part in enumerate(parts[1 : k + 1], 1):
                    if part and (times := weight(k, j)):
                        scaled = {key: value * times for key, value in part.items()}
                        self.question.work += len(scaled) * len(other[k - j])
                        self.accumulate(total, scaled, other[k - j])
                total = self.settle(total)
                new.append(self.settle({key: value * by for key, value in total.items()}))
            for series, part in zip(found, new, strict=True):
                series.append(part)
        return [{key: value for part in series for key, value in part.items()} for series in found]

    def accumulate(self, total: Series, left: Series, right: Series) -> None:
        """Add the product to the total."""
        for first, value in left.items():
            for second, coefficient in right.items():
                key = first + second
                total[key] = total.get(key, 0) + value * coefficient

    def power(self, u: Series, exponent: int) -> Series:
        start = u[0] if 0 in u else self.arithmetic.number(Fraction(0))
        if not self.degree:
            return self.settle({0: self.arithmetic.power(start, exponent)})
        if 0 <= exponent <= MAX_POWER:
            if exponent < 2:
                return u if exponent else self.one
            half = self.power(u, exponent // 2)
            square = self.multiply(half, half, self.degree)
            return self.multiply(square, u, self.degree) if exponent % 2 else square
        found = self.arithmetic.power(start, exponent)  # u E(y) = exponent y E(u)
        share = self.arithmetic.inverse(start)
        return self.grown(u, [found], lambda k, j: (exponent + 1) * j - k, [share])[0]

    def elementary(self, name: str, u: Series) -> Series:
        number = self.arithmetic.number
        start = u[0] if 0 in u else number(Fraction(0))
        # y satisfies E(y) = w E(u), where E multiplies by the degree and w is the derivative.
        if name in ("log", "atan"):
            value = self.arithmetic.log(start) if name == "log" else self.arithmetic.angle(start)
            if not self.degree:
                return self.settle({0: value})
            one = self.constant(Fraction(1))
            below = u if name == "log" else self.add([one, self.multiply(u, u, self.degree)])
            growth = {key: part * (key >> self.shift) for key, part in u.items() if key}
            growth = self.multiply(self.power(below, -1), growth, self.degree)
            parts = {
                key: part * number(Fraction(1, key >> self.shift)) for key, part in growth.items()
            }
            return self.settle({0: value} | parts)
        if not self.degree:
            values = (
                [self.arithmetic.exp(start)] if name == "exp" else self.arithmetic.circle(start)
            )
            return self.settle({0: values[name == "cos"]})
        if name == "exp":
            return self.grown(
                u, [self.arithmetic.exp(start)], lambda _, j: j, [number(Fraction(1))]
            )[0]
        signs = [number(Fraction(1)), number(Fraction(-1))]
        found = self.grown(u, self.arithmetic.circle(start), lambda _, j: j, signs)
        return found[name == "cos"]

    def function(self, name: str, orders: tuple[int, ...], arguments: list[Series]) -> Series:
        """A derivative of a declared function, with random Taylor coefficients.

        Equal arguments give the same coefficients.
        """
        field, zero = self.arithmetic, self.arithmetic.number(Fraction(0))
        place = field.class_of(name, [argument.get(0, zero) for argument in arguments])

        def coefficient(*beta: int) -> Number:
            value = field.jet(name, place, tuple(map(sum, zip(beta, orders, strict=True))))
            return value * field.number(Fraction(1, math.prod(map(math.factorial, beta))))

        return self.compose(arguments, coefficient)

    def special(self, name: str, arguments: list[Series], order: Order) -> Series:
        """A special function: its value at the point, and the rest from its derivatives, degree by
        degree.
        """
        field, (*orders, u) = self.arithmetic, arguments
        zero = field.number(Fraction(0))
        require(all(not any(one) for one in orders), f"The order of {name} has to be constant.")
        bound = {"u": u} | laws_of(self, name, u)
        start = u.get(0, zero)
        if name == "polygamma":
            place = field.class_of(name, [start])

            def slope(k: int) -> Number:
                value = field.special(name, place, order.shift + k, [start], order)
                return value * field.number(Fraction(1, math.factorial(k)))

            return self.compose([u], slope)
        if orders:
            less = self.constant(Fraction(order.shift))
            bound["n"] = self.add([orders[0], less], [1, -1])
        at = [bound[key].get(0, zero) for key in ("n", "u") if key in bound]
        place = field.class_of(name, at)
        count = len(SPECIAL[name].slopes)
        values = [field.special(name, place, k, at, order) for k in range(count)]
        growth = {key: part * (key >> self.shift) for key, part in u.items() if key}
        found = [self.settle({0: value}) for value in values]
        for _ in range(self.degree):
            moving = dict(zip("yz", found, strict=False))
            slopes = slopes_of(self, name, **bound, **moving)
            raised = [self.multiply(slope, growth, self.degree) for slope in slopes]
            found = [
                self.settle(
                    {0: value}
                    | {
                        key: part * field.number(Fraction(1, key >> self.shift))
                        for key, part in one.items()
                        if key
                    }
                )
                for value, one in zip(values, raised, strict=True)
            ]
        pair = found[0], found[-1]
        return shifted(self, pair, bound["n"], u, order.shift) if orders else found[0]

    def integral(self, name: str, orders: list[int], arguments: list[Series]) -> Series:
        """A function with given derivatives, random where none are given.

        Equal arguments give the same function.
        """
        known_integral = self.question.integrals[name]
        names, slopes, letter = known_integral
        if letter:
            return self.function_of_one(name, known_integral.bound(name, orders, arguments))
        written = len(arguments) == len(names) and not any(orders)
        written = written and all(a is self.names[b] for a, b in zip(arguments, names, strict=True))
        require(written, f"{name} must be written with its own arguments.")
        places = self.question.variables.index
        known = {places(by): slope for by, slope in slopes.items()}
        open_axes = {places(argument) for argument in names} - {*known}
        series = {
            key: self.arithmetic.jet(name, 0, (key,))
            for d in range(self.degree + 1)
            for key in self.monomials(d)
            if all(a in open_axes or not self.exponent(key, a) for a in range(len(self.units)))
        }
        done = list[int]()
        for axis, slope in known.items():
            for key, part in self.slope_of_integral(slope).items():
                if key >> self.shift < self.degree and not any(self.exponent(key, a) for a in done):
                    share = self.arithmetic.number(Fraction(1, self.exponent(key, axis) + 1))
                    series[key + self.units[axis]] = part * share
            done.append(axis)
        return self.settle(series)

    def function_of_one(self, name: str, bound: dict[str, Series]) -> Series:
        """G(u) with given G'(u): its value is random, its derivatives are G'(u) times those of u.

        Equal values of u give the same value.
        """
        field, ((letter, u),) = self.arithmetic, bound.items()
        slope = self.slope_of_integral(self.question.integrals[name].slopes[letter], **bound)
        place = field.class_of(name, [u.get(0, field.number(Fraction(0)))])
        found: Series = {0: field.jet(name, place, (0,))}
        done = list[int]()
        for axis, unit in enumerate(self.all_units):
            rate = {
                key - unit: part * power
                for key, part in u.items()
                if (power := self.exponent(key, axis))
            }
            if not rate or not slope:
                continue
            for key, part in self.multiply(slope, rate, self.degree - 1).items():
                if not any(self.exponent(key, a) for a in done):
                    share = field.number(Fraction(1, self.exponent(key, axis) + 1))
                    found[key + unit] = part * share
            done.append(axis)
        return self.settle(found)

    def slope_of_integral(self, slope: tuple[str, ...], **bound: Series) -> Series:
        found: Series = value_of(self, slope, **bound)
        return found

    def coefficients(self, degree: int) -> list[int]:
        """The unknowns of a degree: monomials of total degree two higher and v-degree at least
        two.
        """
        keys = self.monomials(degree + 2)
        return [key for key in keys if sum(self.exponent(key, v) for v in self.v) >= 2]

    def curvature(self, k: int, j: int, degree: int) -> Series:
        """2 Phi^k_j = 2 Gamma(df^k/dv^j) - 4 df^k/dq^j - sum_l df^k/dv^l df^l/dv^j to a degree."""
        pairs = [(rate, self.derivative(self.slopes[k][j], a)) for a, rate in enumerate(self.field)]
        pairs += [(self.slopes[k][m], self.slopes[m][j]) for m in range(len(self.v))]
        pairs.append((self.one, self.derivative(self.forces[k], self.q[j])))
        return self.dot(pairs, degree, [2] * len(self.field) + [-1] * len(self.v) + [-4])

    def terms(self, kind: str, *place: int, degree: int = 0) -> list[Term]:
        """A condition, an expression in L that must vanish, as a sum of terms.

        Their factors are correct up to the degree.
        """
        if kind in ("free", "dependent"):
            return self.euler_lagrange(kind, place[0], degree)
        (i, j), sign = ((self.v[a] for a in place), -1 if kind == "H3" else 1)
        along = enumerate(self.field) if kind == "H2" else ()
        terms = [Term(2, rate, (i, j, a)) for a, rate in along]
        for k, v in enumerate(self.v):
            left, right = (
                self.phi(k, c, degree) if kind == "H3" else self.slopes[k][c]
                for c in reversed(place)
            )
            terms += [Term(1, left, (i, v)), Term(sign, right, (j, v))]
        return terms

    def euler_lagrange(self, kind: str, i: int, degree: int) -> list[Term]:
        """Gamma(d_v L) - d_q L; for dependent velocities, in v and mu (see FORMAT.md)."""
        s = self.q[len(self.v) :]
        by, of = (self.v[i], self.q[i]) if kind == "free" else (self.mu[i], s[i])
        terms = [Term(1, rate, (by, a)) for a, rate in enumerate(self.field)]
        terms.append(Term(-1, self.one, (of,)))
        for rate, a, b in zip(self.rates, self.mu, s, strict=True):
            if kind == "free":  # (X(w^b) - Gamma(w^b_v)) d_mu L - w^b_v d_s L
                slope = self.derivative(rate, by)
                moved = {c: self.derivative(w, by) for w, c in zip(self.rates, s, strict=True)}
                across = [self.derivative(rate, of), self.along(moved, rate, degree)]
                curving = [*across, self.along(dict(enumerate(self.field)), slope, degree)]
                bend = self.add(curving, [1, 1, -1])
                terms += [Term(-1, slope, (b,)), Term(1, bend, (a,))]
            else:
                terms.append(Term(1, self.derivative(rate, of), (a,)))
        return terms

    def along(self, parts: dict[int, Series], series: Series, degree: int) -> Series:
        """The derivation with these components by variable, applied to the series, to a degree."""
        return self.dot(((part, self.derivative(series, a)) for a, part in parts.items()), degree)

    def condition(self, kind: str, *place: int) -> Table:
        """The terms value x^part d_a d_b … L of a condition, grouped by part; see row().

        Its factors contain derivatives of f, so that they are known to a lower degree than f, and
        are needed to the degree of the largest alpha only.
        """
        known = self.degree - self.question.kinds_of_rows[kind].depth
        table, degree = Table(), min(known, self.question.largest.get(kind, known))
        for weight, factor, by in self.terms(kind, *place, degree=degree):
            raised = sum(self.all_units[a] for a in by)
            falls = [(8 * a, by[:k].count(a)) for k, a in enumerate(by)]
            for part, value in factor.items():
                table.setdefault(part, []).append((value * weight, raised, falls))
        return table

    def row(self, kind: str, place: tuple[int, ...], alpha: int) -> Series:
        """The coefficient alpha of a condition, in the coefficients of L."""
        exponents = [self.exponent(alpha, a) for a in range(len(self.units))]
        table, row = self.table(kind, *place), Series()
        powers = [
            [unit * e for e in range(most + 1)]
            for unit, most in zip(self.units, exponents, strict=True)
            if most
        ]
        for rest in (alpha - sum(choice) for choice in product(*powers)):
            for value, raised, falls in table.get(alpha - rest, ()):
                key, times = rest + raised, 1
                for at, less in falls:
                    times *= (key >> at & 255) - less
                row[key] = row.get(key, 0) + value * times
        self.question.work += len(row)
        return self.settle(row)

    def value(self, terms: list[Term], series: Series) -> Series:
        """The value at the point of the terms of a condition applied to a series."""
        total = self.arithmetic.number(Fraction(0))
        for weight, factor, by in terms:
            times = weight * math.prod(by[:k].count(a) + 1 for k, a in enumerate(by))
            total += factor.get(0, 0) * series.get(sum(self.all_units[a] for a in by), 0) * times
        return {0: total}

    def rows(self, degree: int) -> Iterator[Row]:
        """All rows whose unknowns have this highest degree, in an order with little fill-in."""
        for kind, (order, _, places) in self.question.kinds_of_rows.items():
            for place in reversed(places):
                for alpha in reversed([*self.monomials(degree - order)]):
                    yield Row(kind, place, alpha)

    def extend(self, elimination: Elimination, degree: int, idle: set[Row]) -> None:
        """Insert all rows of a degree except those that vanish on a random solution of the others.

        A row independent of the others vanishes with probability 1/prime. `idle` collects the
        dependent rows; it only selects the rows to test: the same rows at another point, and their
        derivatives.
        """
        likely = list[Row]()
        for name in self.rows(degree):
            if not idle.isdisjoint(
                name._replace(alpha=name.alpha - unit) for unit in (0, *self.units)
            ):
                likely.append(name)
            elif not elimination.insert(self.row(*name), name):
                idle.add(name)
        columns = [key for k in range(degree + 1) for key in self.unknowns(k)]
        solution = elimination.solution(columns)
        for name in likely:
            self.question.check_time()
            if self.solved(row := self.row(*name), solution) or not elimination.insert(row, name):
                idle.add(name)

    def solved(self, row: Series, values: Series) -> bool:
        """Whether the row vanishes on the values."""
        return not self.settle({0: sum([value * values.get(key, 0) for key, value in row.items()])})

    def matrix(self, elimination: Elimination) -> list[list[Number]]:
        """The matrix of a random solution that must be regular, g(p)."""
        return self.hessian(elimination.solution(self.unknowns(0)))

    def hessian(self, series: Series) -> list[list[Number]]:
        """d2L/dvdv at the point.

        With dependent velocities, in the basis (d_v + (dw/dv) d_s', d_s').
        """

        def second(of: Series, a: int, b: int) -> Number:
            return of.get(self.all_units[a] + self.all_units[b], 0) * (1 + (a == b))

        bends = [
            (series.get(self.all_units[a], 0), rate)
            for a, rate in zip(self.mu, self.rates, strict=True)
        ]
        along = (*self.v, *self.mu)
        return [
            [second(series, a, b) - sum([x * second(w, a, b) for x, w in bends]) for b in along]
            for a in along
        ]


class Elimination:
    """Rows in echelon form, degree by degree.

    Of each row, `rows` has the part of the degree of its pivot, without the pivot, which is 1.
    Below that degree a row is `scales` times (`lower` minus the `factors` times earlier rows of its
    degree): few rows lose all of their highest degree, and a solution needs no more. `order`
    numbers the rows by their pivots (monomials).
    """

    def __init__(self, arithmetic: Arithmetic, shift: int) -> None:
        self.arithmetic, self.shift, self.names = arithmetic, shift, list[Any]()
        self.settle: Callable[[Series], Series] = arithmetic.settle
        self.rows, self.pivots, self.order = list[Series](), list[int](), dict[int, int]()
        self.lower, self.scales, self.factors = list[Series](), list[Number](), list[Factors]()

    def insert(self, row: Series, name: Any = None) -> bool:
        """Reduce a row degree by degree, and keep it once its part of highest degree is new.

        Returns whether it was kept.
        """
        field = self.arithmetic
        field.question.check_time()
        while row:
            high, low = self._divided(row, max(row) >> self.shift)
            high, factors = self._reduced(high)
            if high:
                self.keep(field.pivot(high), high, low, factors, name)
                return True
            row = self.below(low, factors)
        return False

    def _divided(self, row: Series, degree: int) -> tuple[Series, Series]:
        """The parts of at least the degree, and of lower ones."""
        first, low = degree << self.shift, dict(row)
        return {key: low.pop(key) for key in row if key >= first}, low

    def keep(self, pivot: int, high: Series, low: Series, factors: Factors, name: Any) -> None:
        scale, self.order[pivot] = self.arithmetic.inverse(high[pivot]), len(self.rows)
        self.pivots.append(pivot)
        self.names.append(name)
        kept = {key: value * scale for key, value in high.items() if key != pivot}
        self.rows.append(self.settle(kept))
        self.lower.append(low)
        self.scales.append(scale)
        self.factors.append(factors)

    def _reduced(self, high: Series) -> tuple[Series, Factors]:
        """A part of one degree, reduced by the pivots, and the factors of the rows subtracted.

        A kept row contains no earlier pivot of its degree.
        """
        field, order, raw, factors = self.arithmetic, self.order, dict(high), Factors()
        queue = sorted([order[key] for key in high if key in order])  # a heap
        while queue:
            number = heappop(queue)
            factor = self.settle({0: raw.pop(self.pivots[number])}).get(0)
            if factor is not None:
                factors.append((number, factor))
                field.question.check_time(10 + len(self.rows[number]))
                less = -factor
                for key, value in self.rows[number].items():
                    if key in raw:
                        raw[key] += less * value
                        continue
                    raw[key] = less * value
                    if key in order:
                        heappush(queue, order[key])
        return self.settle(raw) if factors else raw, factors

    def below(self, low: Series, factors: Factors) -> Series:
        """What is left below a degree at which nothing is: `low` without the factors times the
        rows.
        """
        raw, left = dict(low), {number: -factor for number, factor in factors}
        queue = [-number for number in left]
        heapify(queue)
        while queue:
            number = -heappop(queue)
            factor = self.settle({0: left.pop(number) * self.scales[number]}).get(0)
            if factor is None:
                continue
            for key, value in self.lower[number].items():
                raw[key] = raw.get(key, 0) + factor * value
            for other, value in self.factors[number]:
                if other not in left:
                    left[other] = 0
                    heappush(queue, -other)
                left[other] -= factor * value
        return self.settle(raw)

    def follow(self, row: Series, step: Step) -> None:
        """Repeat a step of another elimination in balls, without the entries found to be zero
        there.
        """
        degree = step.pivot >> self.shift
        while row and max(row) >> self.shift > degree:
            high, low = self._divided(row, max(row) >> self.shift)
            row = self.below(low, self._reduced(high)[1])
        high, low = self._divided(row, degree)
        high, factors = self._reduced(high)
        if step.pivot not in high:
            raise Unsettled
        high, low = (
            {key: value for key, value in part.items() if key in step.columns or key == step.pivot}
            for part in (high, low)
        )
        self.keep(step.pivot, high, low, factors, step.row)

    def script(self) -> list[Step]:
        columns = (
            frozenset({**row, **low}) for row, low in zip(self.rows, self.lower, strict=True)
        )
        return [Step(*parts) for parts in zip(self.names, self.pivots, columns, strict=True)]

    def solution(self, columns: list[int]) -> Series:
        """A random solution in the columns, which must be all columns up to some degree."""
        field, values = self.arithmetic, {column: self.arithmetic.draw() for column in columns}
        zero = field.number(Fraction(0))
        degrees = dict[int, list[int]]()
        for number, pivot in enumerate(self.pivots):
            if pivot in values:
                degrees.setdefault(pivot >> self.shift, []).append(number)
        for _, numbers in sorted(degrees.items()):
            right = dict[int, Number]()
            for number in numbers:
                total = sum(
                    [value * values[key] for key, value in self.lower[number].items()], zero
                )
                total += sum([value * right[k] for k, value in self.factors[number]], zero)
                right[number] = self.settle({0: -total * self.scales[number]}).get(0, zero)
            for number in reversed(numbers):
                total = right[number] - sum(
                    [value * values[key] for key, value in self.rows[number].items()], zero
                )
                values[self.pivots[number]] = self.settle({0: total}).get(0, zero)
        return self.settle(values)


def followed(ring: Expansion, steps: list[Step]) -> Elimination:
    """The elimination of rows in balls with the pivots of another elimination."""
    echelon = Elimination(ring.arithmetic, ring.shift)
    for step in steps:
        ring.question.check_time()
        echelon.follow(ring.row(*step.row), step)
    return echelon


def symbol_rows(
    system: Elimination, ring: Expansion, degree: int, directions: list[list[int]]
) -> Iterator[tuple[Any, Series]]:
    """(pivot, row) for the equations of the symbol.

    Then those that derivatives along the directions vanish.
    """
    one, top = ring.arithmetic.number(Fraction(1)), degree + ring.offset
    for pivot, row in zip(system.pivots, system.rows, strict=True):
        if pivot >> ring.shift == top:
            yield pivot, {pivot: one} | row
    for number, direction in enumerate(directions):
        for key in ring.unknowns(degree - 1):
            killed = {}
            for a, (unit, part) in enumerate(zip(ring.units, direction, strict=True)):
                killed[key + unit] = one * (part * (ring.exponent(key, a) + 1))
            yield (number, key), killed


def symbol_of(
    system: Elimination, ring: Expansion, degree: int, directions: list[list[int]]
) -> tuple[Symbol, Elimination]:
    """The symbol, and the elimination of all `symbol_rows`.

    It is involutive if the dimension of its prolongation is sum_k k a_k with the characters a_k.
    """
    field, unknown = system.arithmetic, len(ring.unknowns(degree))
    killed = Elimination(field, ring.shift)
    above = Elimination(field, ring.shift)
    left = list[int]()
    for name, row in symbol_rows(system, ring, degree, directions):
        number = name[0] + 1 if isinstance(name, tuple) else 0
        left += [unknown - len(killed.rows)] * (number - len(left))
        killed.insert(field.settle(row), name)
        for a, unit in enumerate(ring.units) if not number else ():
            raised = {key + unit: row[key] * (ring.exponent(key, a) + 1) for key in row}
            above.insert(field.settle(raised))
    left += [unknown - len(killed.rows)] * (len(directions) + 1 - len(left))
    prolonged = len(ring.unknowns(degree + 1)) - len(above.rows)
    return Symbol(left[0], prolonged, tuple(a - b for a, b in pairwise(left))), killed

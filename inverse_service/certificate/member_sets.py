"""Sets of members of a family: equations between constants and derivatives of unknown functions.

All is exact, over the rational numbers. A polynomial holds the time, coordinates, velocities,
constants, and derivatives of the functions, as independent generators. It vanishes *for a member*
if it is zero with the member's constants and functions put in, for all values of the others: these
functions of the arguments of the unknown functions are analytic, so a product vanishes only if a
factor does, and derivatives of what vanishes vanish.

`split_part` parts a set by cases p = 0 and p != 0. Each case either ends in a contradiction or is a
`Part`: equations, solved for a leader each, whose initials and separants do not vanish, so that
pseudo-division proves that other polynomials vanish on it. Nothing is claimed but these steps, so a
strategy that is not complete cannot prove anything false.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

from flint import Ordering, fmpq, fmpq_mpoly_ctx, fmpz_mpoly_ctx, fmpz_mpoly_vec

from .formulas import TEXT, Incomplete, Nodes, Order, check_shape, read_tokens, require, value_of
from .quotients import Quotient, added, multiplied, reduced

MAX_TERMS, MAX_STEPS, FEW_STEPS = 20_000, 3_000, 80
FACTORED = 6  # equations at a time
MOST_OF_BASIS, MOST_ROUNDS = (60, 300, 2000), 3  # equations, terms of one, bits of a coefficient
SHORT = 60  # terms of what does not vanish, for its own sake
Polynomial = Any  # fmpq_mpoly
Orders = tuple[int, ...]


class TooHigh(Incomplete):
    """A derivative of a function has no generator."""


class Ring:
    """Rational functions of the generators, and the derivations by time, coordinates, and
    velocities.

    Of each function, the derivatives to `order` are generators. `free` are the constants and the
    derivatives of free functions; `inner` the other constants and functions, which are general, and
    the variables on which a function depends; `outer` all other variables. A polynomial in inner
    generators alone vanishes nowhere.
    """

    degree = 0

    def __init__(
        self,
        coordinates: Sequence[str],
        letters: Sequence[str],
        fixed: Sequence[str],
        functions: dict[str, list[str]],
        order: int,
        deadline: float,
        with_atoms: bool = False,
        general: Sequence[str] = (),
    ) -> None:
        self.variables = ["t", *coordinates, *(name + "'" for name in coordinates)]
        self.functions, self.deadline, self.integrals = functions, deadline, dict[str, Any]()
        self.general = [*fixed, *(f"{one}({', '.join(functions[one])})" for one in general)]
        self.size, self.nodes, self.question = len(coordinates), Nodes(), self
        plain = [*self.variables, *letters, *fixed]
        self.jets = dict[int, tuple[str, Orders]]()
        for name, of in functions.items():
            for total in range(order + 1):
                for orders in orders_of(len(of), total):
                    self.jets[len(plain) + len(self.jets)] = name, orders
        self.places = {jet: k for k, jet in self.jets.items()}
        count = len(plain) + len(self.jets)
        # tan(x/2) and exp(x/12) of each variable x, independent of each other and of x.
        held = range(len(self.variables)) if with_atoms else range(0)
        self.tangents = {k: count + 2 * k for k in held}
        self.exponentials = {k: count + 2 * k + 1 for k in held}
        count += 2 * len(held)
        self.context = fmpq_mpoly_ctx.get([f"g{k}" for k in range(count)], Ordering.lex)
        self.gens = self.context.gens()
        self.one, self.none = self.context.constant(1), self.context.constant(0)
        moving = {name for of in functions.values() for name in of}
        self.letters = {plain.index(name): name for name in letters}
        self.moving = [k for k, name in enumerate(self.variables) if name in moving]
        still = [k for k, name in enumerate(self.variables) if name not in moving]
        not_free = [k for k, (name, _) in self.jets.items() if name in general]
        self.outer = self.with_atoms(still)
        self.inner = [*self.with_atoms(self.moving), *not_free]
        self.free = frozenset((*self.letters, *self.jets)) - {*not_free}
        self.names = {name: Quotient(self.gens[k], self.one) for k, name in enumerate(plain)}
        self.of_functions = {name: sorted(functions).index(name) for name in functions}
        self.slopes = dict[tuple[int, int], Polynomial]()
        self.prefers_bases = False  # they split what cases alone did not

    def with_atoms(self, variables: list[int]) -> list[int]:
        atoms = (self.tangents, self.exponentials)
        return [*variables, *(table[k] for table in atoms for k in variables if k in table)]

    # Formulas.

    def read(self, text: str) -> Quotient:
        """A formula, or `A = B` for A - B."""
        check_shape(text, TEXT, "a formula")
        sides = text.split("=")
        require(len(sides) <= 2, "An equation has one equals sign.")
        values = [value_of(self, read_tokens(side, "a formula")) for side in sides]
        return values[0] if len(values) == 1 else self.minus(*values)

    def check_time(self) -> None:
        if time.thread_time() > self.deadline:
            raise Incomplete("The time limit ended the check of the family.")

    def constant(self, value: Fraction | int) -> Quotient:
        number = Fraction(value)
        return Quotient(self.context.constant(fmpq(number.numerator, number.denominator)), self.one)

    def add(self, terms: Sequence[Quotient], weights: Iterable[int] = ()) -> Quotient:
        total = self.constant(0)
        for term, weight in itertools.zip_longest(terms, weights, fillvalue=1):
            total = self.plus(total, Quotient(term.above * weight, term.below))  # type: ignore[union-attr]
        return total

    def multiply(self, left: Quotient, right: Quotient, degree: int = 0) -> Quotient:
        return self.times(left, right)

    def power(self, value: Quotient, exponent: int) -> Quotient:
        if exponent < 0:
            require(value.above, "A divisor is zero.")
            value = self.quotient(value.below, value.above)
        if abs(exponent) > 64:
            raise Incomplete("A power in a family is too high.")
        return Quotient(value.above ** abs(exponent), value.below ** abs(exponent))

    def elementary(self, name: str, value: Quotient) -> Quotient:
        """sin, cos and exp of sums of multiples of variables, rational in tan(x/2), exp(x/12)."""
        parts = self.multiples(value, 12 if name == "exp" else 1)
        if name not in ("sin", "cos", "exp") or not parts:
            raise Incomplete("Families are proven for rational functions of q, q', sin, cos, exp.")
        if name == "exp":
            found = self.constant(1)
            for k, times in parts.items():
                power = Quotient(self.gens[self.exponentials[k]], self.one)
                found = self.times(found, self.power(power, times))
            return found
        real, imaginary, below = self.one, self.none, self.one
        for k, times in parts.items():
            half = self.gens[self.tangents[k]]
            cosine, sine = 1 - half * half, 2 * half * (1 if times > 0 else -1)
            for _ in range(abs(times)):
                real, imaginary = real * cosine - imaginary * sine, real * sine + imaginary * cosine
            below = below * (1 + half * half) ** abs(times)
        return self.quotient(real if name == "cos" else imaginary, below)

    def multiples(self, value: Quotient, scale: int) -> dict[int, int]:
        """{variable: number}, if the value times the scale is the sum of such small multiples."""
        found, below = dict[int, int](), value.below
        if not below.is_constant():
            return {}
        for exponents, number in value.above.terms():
            held = [k for k, degree in enumerate(exponents) if degree]
            ratio = number / below.leading_coefficient() * scale
            plain = len(held) == 1 and exponents[held[0]] == 1 and held[0] in self.tangents
            if not plain or ratio.q != 1 or abs(ratio.p) > 48:
                return {}
            found[held[0]] = int(ratio.p)
        return found

    def special(self, name: str, arguments: list[Quotient], order: Order) -> Quotient:
        raise Incomplete("Families are proven for rational functions of q, q', sin, cos, exp.")

    def function(self, name: str, orders: Orders, arguments: list[Quotient]) -> Quotient:
        plain = [self.names[one] for one in self.functions[name]]
        if arguments != plain:
            raise Incomplete(f"{name} has other arguments than those it is declared with.")
        return Quotient(self.gens[self.jet(name, orders)], self.one)

    def integral(self, name: str, orders: list[int], arguments: list[Quotient]) -> Quotient:
        raise Incomplete("Families are proven without integrals.")

    def jet(self, name: str, orders: Orders) -> int:
        if (name, orders) not in self.places:
            raise TooHigh("A family needs derivatives of too high an order.")
        return self.places[name, orders]

    # Arithmetic.

    def quotient(self, above: Polynomial, below: Polynomial) -> Quotient:
        return reduced(*self.bounded(Quotient(above, below)))

    def bounded(self, value: Quotient) -> Quotient:
        self.check_time()
        if max(map(len, value)) > MAX_TERMS:
            raise Incomplete(f"A formula of the family has more than {MAX_TERMS} terms.")
        return value

    def plus(self, left: Quotient, right: Quotient) -> Quotient:
        return self.quotient(*added(left, right))

    def minus(self, left: Quotient, right: Quotient) -> Quotient:
        return self.plus(left, Quotient(-right.above, right.below))

    def times(self, left: Quotient, right: Quotient) -> Quotient:
        return self.bounded(multiplied(left, right))

    def total(self, values: Iterable[Quotient]) -> Quotient:
        found = self.constant(0)
        for value in values:
            found = self.plus(found, value)
        return found

    def slope(self, polynomial: Polynomial, variable: int) -> Polynomial:
        """The derivative of a polynomial by a variable, of which functions may depend."""
        found, name = polynomial.derivative(variable), self.variables[variable]
        if variable in self.tangents:
            half, power = self.tangents[variable], self.exponentials[variable]
            found += polynomial.derivative(half) * (1 + self.gens[half] ** 2) / 2
            found += polynomial.derivative(power) * self.gens[power] / 12
        if variable in self.moving:
            for k, degree in enumerate(polynomial.degrees()):
                if degree > 0 and k in self.jets:
                    function, orders = self.jets[k]
                    of = self.functions[function]
                    if name in of:
                        higher = tuple(one + (of[i] == name) for i, one in enumerate(orders))
                        found += polynomial.derivative(k) * self.gens[self.jet(function, higher)]
        return found

    def by(self, value: Quotient, variable: int) -> Quotient:
        above, below = self.slope(value.above, variable), self.slope(value.below, variable)
        if not below:
            return self.quotient(above, value.below)
        return self.quotient(above * value.below - value.above * below, value.below**2)

    # Unknowns.

    def unknowns(self, polynomial: Polynomial) -> list[int]:
        """The free constants and derivatives in it, the highest first."""
        found = [
            k for k, degree in enumerate(polynomial.degrees()) if degree > 0 and k in self.free
        ]
        return sorted(found, key=self.rank, reverse=True)

    def rank(self, k: int) -> tuple[Any, ...]:
        """Constants below derivatives, these by their order (an orderly ranking)."""
        if k in self.letters:
            return (0, -k)
        name, orders = self.jets[k]
        return (1, sum(orders), self.of_functions[name], orders)

    def coefficients(self, polynomial: Polynomial) -> list[Polynomial]:
        """What vanishes for the members for which the polynomial vanishes, and the other way
        round.
        """
        found = self.collected(polynomial, self.outer)
        return [part for one in found for part in self.constants(one)]

    def constants(self, polynomial: Polynomial) -> list[Polynomial]:
        """The same for a polynomial without outer variables: one of constants alone is free of
        variables.
        """
        holds_functions = any(k in self.jets for k in self.unknowns(polynomial))
        return (
            [polynomial]
            if holds_functions or not self.unknowns(polynomial)
            else self.collected(polynomial, self.inner)
        )

    def collected(self, polynomial: Polynomial, over: Sequence[int]) -> list[Polynomial]:
        """The coefficients of a polynomial in these generators."""
        if not any(polynomial.degrees()[k] > 0 for k in over):
            return [polynomial] if polynomial else []
        table = dict[tuple[int, ...], dict[tuple[int, ...], Any]]()
        for exponents, value in polynomial.terms():
            key = tuple(int(exponents[k]) for k in over)
            rest = list(exponents)
            for k in over:
                rest[k] = 0
            table.setdefault(key, {})[tuple(rest)] = value
        return [self.context.from_dict(terms) for terms in table.values()]

    def factors(self, polynomial: Polynomial) -> list[Polynomial]:
        """The distinct irreducible factors with unknowns in them; none if it vanishes for no
        member.
        """
        self.check_time()
        if len(polynomial) > MAX_TERMS:
            raise Incomplete(f"An equation of the family has more than {MAX_TERMS} terms.")
        return [
            one / one.leading_coefficient()
            for one, _ in polynomial.factor()[1]
            if self.unknowns(one)
        ]

    def initial(self, polynomial: Polynomial, k: int, degree: int) -> Polynomial:
        """The coefficient of the highest power of a generator."""
        for times in range(degree):
            polynomial = polynomial.derivative(k) / (times + 1)
        return polynomial

    def powers(self, polynomial: Polynomial, k: int) -> list[Polynomial]:
        """The coefficients of a polynomial in a generator, the constant one first."""
        degree = max(0, int(polynomial.degrees()[k]))
        found = [self.none] * (degree + 1)
        while degree:
            found[degree] = high = self.initial(polynomial, k, degree)
            polynomial = polynomial - high * self.gens[k] ** degree
            degree = int(polynomial.degrees()[k]) if polynomial else 0
        found[0] = polynomial
        return found


def orders_of(count: int, total: int) -> Iterator[Orders]:
    """The orders of all derivatives of this total order by as many arguments."""
    if count == 1:
        yield (total,)
        return
    for first in range(total, -1, -1):
        for rest in orders_of(count - 1, total - first):
            yield (first, *rest)


class Rule(NamedTuple):
    """An equation, and the constant or derivative it is solved for."""

    equation: Polynomial
    leader: int


@dataclass(frozen=True)
class Part:
    """Members for which the rules vanish and no `nonzero` element does.

    The initials and separants of the rules vanish for none of them.
    """

    ring: Ring
    rules: tuple[Rule, ...] = ()
    nonzero: tuple[Polynomial, ...] = ()

    def divisor(self, k: int) -> Polynomial | None:
        """The rule with this leader, or the derivative of one."""
        ring = self.ring
        for rule in self.rules:
            if rule.leader == k:
                return rule.equation
        if k in ring.letters:
            return None
        name, orders = ring.jets[k]
        for rule in self.rules:
            own, below = ring.jets.get(rule.leader, ("", ()))
            if own == name and all(a >= b for a, b in zip(orders, below, strict=True)):
                return derived(ring, rule, orders)
        return None

    def reduced(self, polynomial: Polynomial) -> Polynomial:
        """A polynomial that vanishes for the same members of the part."""
        ring, changed = self.ring, True
        while changed and polynomial:
            changed = False
            for k in ring.unknowns(polynomial):
                divisor = self.divisor(k)
                if divisor is None or polynomial.degrees()[k] < divisor.degrees()[k]:
                    continue
                polynomial, changed = remainder(ring, polynomial, divisor, k), True
                if polynomial:
                    polynomial = polynomial / polynomial.leading_coefficient()
                break
        return polynomial

    def scaled(self, values: Sequence[Polynomial]) -> list[Polynomial]:
        """The values on the part, all times or divided by elements that vanish for no member."""
        ring, found = self.ring, list(values)
        while (step := self.step(found)) is not None:
            place, scale, rest = step
            found = [rest if k == place else one * scale for k, one in enumerate(found)]
        unit = ring.one
        for factor, times in _common(ring, found).factor()[1]:
            if self.is_unit(factor):
                unit = unit * factor**times
        return [one / unit for one in found]

    def proportional(self, values: Sequence[Polynomial]) -> list[Polynomial]:
        """The values on the part, all times or divided by the same, with no common divisor."""
        found = self.scaled(values)
        common = _common(self.ring, found)
        return [one / common for one in found]

    def step(self, values: Sequence[Polynomial]) -> tuple[int, Polynomial, Polynomial] | None:
        """(k, s, r): s, which vanishes for no member, times the value at k is r, of lower degree."""
        for place, value in enumerate(values):
            for k in self.ring.unknowns(value):
                divisor = self.divisor(k)
                if divisor is not None and value.degrees()[k] >= divisor.degrees()[k]:
                    return place, *scaled_remainder(self.ring, value, divisor, k)
        return None

    def cofactor(self, polynomial: Polynomial) -> Polynomial | None:
        """s, so that s times the polynomial is free of the first leader that it holds, on the part;
        None if it holds none.
        """
        ring = self.ring
        rule = next(
            (one for one in self.rules if polynomial.degrees()[one.leader] > 0),
            None,
        )
        if rule is None or len(ring.powers(rule.equation, rule.leader)) <= 2:
            return None
        k = rule.leader
        # (a, s): s times the polynomial is a, plus a multiple of the rule.
        high, low = (rule.equation, ring.none), (polynomial, ring.one)
        while (degree := int(low[0].degrees()[k])) > 0:
            first = ring.initial(low[0], k, degree)
            while high[0] and (more := int(high[0].degrees()[k]) - degree) >= 0:
                ring.check_time()
                top = ring.initial(high[0], k, degree + more)
                common = first.gcd(top)
                down = top / common * ring.gens[k] ** more
                high = tuple(
                    a * (first / common) - b * down for a, b in zip(high, low, strict=True)
                )
                if len(high[0]) + len(high[1]) > MAX_TERMS:
                    raise Incomplete(f"An equation of the family has more than {MAX_TERMS} terms.")
            if not high[0]:
                return None
            common = high[0].gcd(high[1])
            high, low = low, (high[0] / common, high[1] / common)
        return low[1]

    def common(self, rule: Rule, polynomial: Polynomial) -> Polynomial | None:
        """What a rule for a constant has in common with a polynomial on the part, by remainders;
        None if nothing is found, or the rule is irreducible as its leader is linear in it.
        """
        ring, k = self.ring, rule.leader
        if k not in ring.letters or rule.equation.degrees()[k] < 2 or not polynomial.degrees()[k]:
            return None
        high, low = rule.equation, self.reduced(polynomial)
        while low and low.degrees()[k] > 0:
            low = low / _common(ring, ring.powers(low, k))
            rest = self.reduced(remainder(ring, high, low, k))
            if not rest:
                return low if low.degrees()[k] < rule.equation.degrees()[k] else None
            if rest.degrees()[k] >= low.degrees()[k]:  # other rules hold this leader
                return None
            high, low = low, rest
        return None

    def vanishes(self, polynomials: Iterable[Polynomial]) -> bool:
        """Whether these vanish for all members of the part."""
        return not any(
            self.reduced(part) for one in polynomials for part in self.ring.coefficients(one)
        )

    def is_unit(self, polynomial: Polynomial) -> bool:
        """Whether this vanishes for no member of the part: a product of what does not vanish."""
        left = self.reduced(polynomial)
        return bool(left) and all(one in self.nonzero for one in self.ring.factors(left))

    def is_invertible(self, polynomial: Polynomial) -> bool:
        """The same, also where a multiple of it without leaders does not vanish: c + 1 for c^2 = 2."""
        left = self.reduced(polynomial)
        for _ in self.rules:
            if not left or self.is_unit(left):
                break
            factor = self.cofactor(left)
            if factor is None:
                return False
            left = self.reduced(left * factor)
        return bool(left) and self.is_unit(left)


def _common(ring: Ring, values: Sequence[Polynomial]) -> Polynomial:
    found = ring.none
    for one in values:
        found = found.gcd(one) if found else one
    return found or ring.one


def derived(ring: Ring, rule: Rule, orders: Orders) -> Polynomial:
    """The derivative of a rule whose leader is the derivative of these orders."""
    name, below = ring.jets[rule.leader]
    equation = rule.equation
    for argument, a, b in zip(ring.functions[name], orders, below, strict=True):
        for _ in range(a - b):
            equation = ring.slope(equation, ring.variables.index(argument))
    return equation


def remainder(ring: Ring, polynomial: Polynomial, divisor: Polynomial, k: int) -> Polynomial:
    return scaled_remainder(ring, polynomial, divisor, k)[1]


def scaled_remainder(
    ring: Ring, polynomial: Polynomial, divisor: Polynomial, k: int
) -> tuple[Polynomial, Polynomial]:
    """(s, r): s times the polynomial, minus a multiple of the divisor, is r, of lower degree; s
    divides a power of the initial.
    """
    degree, scale = int(divisor.degrees()[k]), ring.one
    initial = ring.initial(divisor, k, degree)
    while polynomial and (high := int(polynomial.degrees()[k])) >= degree:
        ring.check_time()
        first = ring.initial(polynomial, k, high)
        common = ring.one if initial.is_constant() else initial.gcd(first)
        by = initial / common
        polynomial = polynomial * by - first / common * ring.gens[k] ** (high - degree) * divisor
        scale = scale * by
        if len(polynomial) > MAX_TERMS:
            raise Incomplete(f"An equation of the family has more than {MAX_TERMS} terms.")
    return scale, polynomial


class Waiting(NamedTuple):
    """Equations that are still to be solved in a part. With `has_bases`, those of the lowest order
    between functions are replaced by a basis; `low` is this order where it is done.
    """

    equations: tuple[Polynomial, ...]
    part: Part
    has_bases: bool = False
    low: int | None = None


def split_part(part: Part, equations: Iterable[Polynomial]) -> list[Part]:
    """Parts that together hold all members of the part for which the equations vanish."""
    ring = part.ring
    whole = tuple(coefficient for one in equations for coefficient in ring.coefficients(one))
    degrees = [one.degrees() for one in (*whole, *(rule.equation for rule in part.rules))]
    # Constants in which these are of a low degree first.
    order = sorted(ring.letters, key=lambda k: (max((d[k] for d in degrees), default=0), k))
    if not ring.jets:
        return _split(Waiting(whole, part), order, MAX_STEPS)
    # Bases are longer where they do not help.
    ways = [(FEW_STEPS, False), (MAX_STEPS, True)]
    for steps, has_bases in reversed(ways) if ring.prefers_bases else ways:
        try:
            found = _split(Waiting(whole, part, has_bases), order, steps)
        except TooHigh:
            raise
        except Incomplete:
            ring.check_time()
        else:
            ring.prefers_bases = has_bases
            return found
    return _split(Waiting(whole, part), order, MAX_STEPS)


def _split(start: Waiting, order: Sequence[int], steps: int) -> list[Part]:
    waiting, found = [start], list[Part]()
    for _ in range(steps):
        if not waiting:
            return found
        start.part.ring.check_time()
        found += _step(waiting.pop(), waiting, order)
    raise Incomplete("The equations of the family have too many cases.")


def _step(item: Waiting, waiting: list[Waiting], order: Sequence[int]) -> list[Part]:
    part, ring = item.part, item.part.ring
    if any(not part.reduced(one) for one in part.nonzero):
        return []
    reduced = map(part.reduced, item.equations)
    left = [one for whole in reduced if whole for one in ring.constants(whole)]
    left.sort(key=lambda one: (_order(ring, one), len(one)))
    simpler = _with_basis(item, left) if item.has_bases else None
    if simpler is not None:
        waiting.append(simpler)
        return []
    table, late = dict[frozenset[str], list[Polynomial]](), left[FACTORED:]
    for one in left[:FACTORED]:  # long ones are shorter later
        factors = [factor for factor in ring.factors(one) if factor not in part.nonzero]
        if not factors:
            return []  # what vanishes for no member would vanish
        table[frozenset(map(str, factors))] = factors
    if not table:
        further = _compatibility(part) or _quotients(part)
        if not further:
            return [part]
        waiting.append(Waiting(tuple(further), part, item.has_bases))
        return []
    least = [factors for key, factors in table.items() if not any(other < key for other in table)]
    first, *others = sorted(least, key=lambda one: _cost(ring, one))
    rest = (*map(_product, others), *late)
    if len(first) > 1:
        for factor in sorted(first, key=len):
            waiting.append(Waiting((factor, *rest), part, item.has_bases))
            part = replace(part, nonzero=(*part.nonzero, factor))
        return []
    _solve(first[0], rest, item, waiting, order)
    return []


def _with_basis(item: Waiting, left: Sequence[Polynomial]) -> Waiting | None:
    """The item with a Groebner basis in place of its equations of the lowest order, if they hold
    functions and are several; these are sorted by their order. None if nothing is simpler.

    Constants, variables, and derivatives are independent generators there: what is in the ideal of
    equations that vanish vanishes.
    """
    part, ring = item.part, item.part.ring
    if not left or not any(k in ring.jets for k in ring.unknowns(left[0])):
        return None
    low = _order(ring, left[0])
    if item.low is not None and low >= item.low:
        return None
    lows = [one for one in left[: MOST_OF_BASIS[0] + 1] if _order(ring, one) == low]
    solved = [rule for rule in part.rules if _order(ring, rule.equation) <= low]
    basis = [*(rule.equation for rule in solved), *lows]
    if len(basis) < 2 or len(lows) > MOST_OF_BASIS[0] or max(map(len, basis)) > MOST_OF_BASIS[1]:
        return None
    for _ in range(MOST_ROUNDS):
        found = _groebner(ring, basis)
        if found is None:
            return None
        basis = [
            _product([f for f in ring.factors(one) if f not in part.nonzero] or [ring.one])
            for one in found
        ]
        if {*map(str, basis)} == {*map(str, found)}:
            break
    kept = tuple(rule for rule in part.rules if rule not in solved)
    return Waiting((*basis, *left[len(lows) :]), replace(part, rules=kept), True, low)


def _groebner(ring: Ring, equations: Sequence[Polynomial]) -> list[Polynomial] | None:
    """A Groebner basis; None if it is large."""
    ring.check_time()
    held = [k for k in range(len(ring.gens)) if any(one.degrees()[k] > 0 for one in equations)]
    unknown = sorted((k for k in held if k in ring.free), key=ring.rank, reverse=True)
    used = [*unknown, *(k for k in held if k not in ring.free)]
    small = fmpz_mpoly_ctx.get(tuple(f"c{k}" for k in used), Ordering.degrevlex)
    whole = list[Any]()
    for one in equations:
        scale = math.lcm(*(int(value.q) for _, value in one.terms()))
        table = {tuple(int(e[k]) for k in used): int((value * scale).p) for e, value in one.terms()}
        whole.append(small.from_dict(table))
    found, is_complete = fmpz_mpoly_vec(whole, small).buchberger_naive(limits=MOST_OF_BASIS)
    if not is_complete:
        return None
    result = list[Polynomial]()
    for one in found.autoreduction():  # type: ignore[attr-defined]
        terms = dict[tuple[int, ...], Any]()
        for exponents, value in one.terms():
            key = [0] * len(ring.gens)
            for k, exponent in zip(used, exponents, strict=True):
                key[k] = int(exponent)
            terms[tuple(key)] = fmpq(int(value))
        whole_one = ring.context.from_dict(terms)
        result.append(whole_one / whole_one.leading_coefficient())
    return result


def _order(ring: Ring, polynomial: Polynomial) -> int:
    """The order of its highest derivative."""
    return max((ring.rank(k)[1] for k in ring.unknowns(polynomial) if k in ring.jets), default=0)


def _product(factors: Sequence[Polynomial]) -> Polynomial:
    found = factors[0]
    for one in factors[1:]:
        found = found * one
    return found


def _cost(ring: Ring, factors: Sequence[Polynomial]) -> tuple[Any, ...]:
    """Short equations of low order first, those with a constant that has a number before it above
    all.
    """
    first = factors[0]
    easy = len(factors) == 1 and any(
        first.degrees()[k] == 1 and not ring.unknowns(ring.powers(first, k)[1])
        for k in ring.letters
    )
    top = max(ring.rank(k)[:2] for one in factors for k in ring.unknowns(one)[:1])
    return (not easy, len(factors), top, sum(map(len, factors)))


def _solve(
    equation: Polynomial,
    rest: Sequence[Polynomial],
    item: Waiting,
    waiting: list[Waiting],
    order: Sequence[int],
) -> None:
    """Solve an irreducible equation for its leader; where that fails is another case."""
    part, ring = item.part, item.part.ring
    leader = _leader(part, equation, order)
    squares = _squares(ring, equation)
    if squares is not None:  # constants are real
        if squares:
            waiting.append(Waiting((*squares, *rest), part, item.has_bases))
        return
    parts = ring.powers(equation, leader)
    guards = ring.factors(parts[-1]) if ring.unknowns(parts[-1]) else []
    guards += ring.factors(equation.derivative(leader)) if len(parts) > 2 else []
    for one in guards:
        if one not in part.nonzero:
            waiting.append(Waiting((one, equation, *rest), part, item.has_bases))
            part = replace(part, nonzero=(*part.nonzero, one))
    kept, again = list[Rule](), list[Polynomial]()
    for rule in part.rules:
        if any(_is_above(ring, k, leader) for k in ring.unknowns(rule.equation)):
            again.append(rule.equation)
        else:
            kept.append(rule)
    solved = replace(part, rules=(*kept, Rule(equation, leader)))
    if not again:
        solved = replace(solved, nonzero=(*part.nonzero, *_reduced_units(solved, leader)))
    waiting.append(Waiting((*again, *rest), solved, item.has_bases, item.low))


def _reduced_units(part: Part, leader: int) -> list[Polynomial]:
    """What the elements with a new leader are on the part, which do not vanish there either: these
    are met again where other polynomials are reduced.
    """
    ring, found = part.ring, dict[str, Polynomial]()
    for one in part.nonzero:
        if len(one) <= SHORT and any(_is_above(ring, k, leader) for k in ring.unknowns(one)):
            left = part.reduced(one)
            if len(left) <= SHORT:
                found |= {str(factor): factor for factor in ring.factors(left)}
    known = {*map(str, part.nonzero)}
    return [one for key, one in found.items() if key not in known]


def _is_above(ring: Ring, k: int, leader: int) -> bool:
    """Whether this is the leader, or a derivative of it."""
    if k == leader or k not in ring.jets or leader not in ring.jets:
        return k == leader
    (own, below), (name, orders) = ring.jets[k], ring.jets[leader]
    return own == name and all(a >= b for a, b in zip(below, orders, strict=True))


def _leader(part: Part, equation: Polynomial, order: Sequence[int]) -> int:
    """The highest derivative; of constants the one that is simplest to solve for.

    If all are of a higher degree, it is the first in the order, so that splitting ends.
    """
    ring = part.ring
    found = ring.unknowns(equation)
    if found[0] in ring.jets:
        return found[0]
    taken = {rule.leader for rule in part.rules}

    def cost(k: int) -> tuple[Any, ...]:
        if equation.degrees()[k] > 1:
            return True, equation.degrees()[k], order.index(k)
        first = ring.powers(equation, k)[-1]
        return False, k in taken, len(first) if ring.unknowns(first) else 0, k

    return min(found, key=cost)


def _squares(ring: Ring, equation: Polynomial) -> list[Polynomial] | None:
    """What vanishes where a sum of squares does; None if the equation is no such sum.

    So is A a^2 + B a + C, times 4 A, if 4 A C - B^2 is one: then it is zero, and 2 A a + B, or A
    and B and C. All generators are real, for each member at each point.
    """
    for form in (equation, -equation):
        if _is_sum_of_squares(form):
            return _terms(ring, form)
    for k in ring.unknowns(equation):
        if equation.degrees()[k] == 2:
            low, middle, high = ring.powers(equation, k)
            form = low * high * 4 - middle * middle
            if form and _is_sum_of_squares(form):
                terms = _terms(ring, form)
                slope = high * ring.gens[k] * 2 + middle
                return [*terms, slope, middle * ring.gens[k] + low * 2] if terms else []
    return None


def _terms(ring: Ring, form: Polynomial) -> list[Polynomial]:
    """The monomials of a sum of squares; none if one has no unknowns, so that it never vanishes."""
    found = [ring.context.from_dict({exponents: 1}) for exponents, _ in form.terms()]
    return [] if any(not ring.unknowns(one) for one in found) else found


def _is_sum_of_squares(form: Polynomial) -> bool:
    return all(
        value > 0 and not any(int(exponent) % 2 for exponent in exponents)
        for exponents, value in form.terms()
    )


def _compatibility(part: Part) -> list[Polynomial]:
    """Differences of equal derivatives of two rules, and derivatives of rules by variables that
    their function does not have: all these vanish.
    """
    ring, found = part.ring, list[Polynomial]()
    rules = [rule for rule in part.rules if rule.leader in ring.jets]
    for rule in rules:
        name, _ = ring.jets[rule.leader]
        for variable in ring.moving:
            if ring.variables[variable] not in ring.functions[name]:
                found.append(ring.slope(rule.equation, variable))
    for one, other in itertools.combinations(rules, 2):
        (name, orders), (own, below) = ring.jets[one.leader], ring.jets[other.leader]
        if name == own:
            top = tuple(map(max, orders, below))
            k = ring.jet(name, top)
            left, right = derived(ring, one, top), derived(ring, other, top)
            if left.degrees()[k] > 1 or right.degrees()[k] > 1:
                low, high = sorted((left, right), key=lambda p, k=k: p.degrees()[k])  # type: ignore[misc]
                found.append(remainder(ring, high, low, k))
            else:
                found.append(ring.powers(right, k)[1] * left - ring.powers(left, k)[1] * right)
    reduced = [part.reduced(one) for one in found if one]
    return [one for one in reduced if one]


def _quotients(part: Part) -> list[Polynomial]:
    """What vanishes, too, as a rule for a constant is a product on the part, and a factor of it one
    of an element that does not vanish: b + c for b^2 - a = 0 where a = c^2 and b - c is not zero.
    """
    for one in part.nonzero:
        for rule in part.rules if len(one) <= SHORT else ():
            with suppress(Incomplete):  # too long; it is not needed
                quotient = _quotient(part, rule, one)
                if quotient is not None:
                    return [quotient]
    return []


def _quotient(part: Part, rule: Rule, one: Polynomial) -> Polynomial | None:
    """A rule without what it has in common with an element that does not vanish."""
    ring, k, common = part.ring, rule.leader, part.common(rule, one)
    if common is None or not part.is_invertible(ring.powers(common, k)[-1]):
        return None
    rest = _divided(ring, one, common, k)[1]
    quotient, other = _divided(ring, rule.equation, common, k)
    return quotient if part.vanishes([rest, other]) and not part.vanishes([quotient]) else None


def _divided(
    ring: Ring, polynomial: Polynomial, divisor: Polynomial, k: int
) -> tuple[Polynomial, Polynomial]:
    """(q, r): the polynomial times a power of the divisor's initial is q times the divisor plus r."""
    low, quotient = int(divisor.degrees()[k]), ring.none
    initial = ring.initial(divisor, k, low)
    while polynomial and (high := int(polynomial.degrees()[k])) >= low:
        ring.check_time()
        term = ring.initial(polynomial, k, high) * ring.gens[k] ** (high - low)
        quotient = quotient * initial + term
        polynomial = polynomial * initial - term * divisor
    return quotient, polynomial


def determinant(ring: Ring, matrix: Sequence[Sequence[Polynomial]]) -> Polynomial:
    """By expansion along the rows, each minor of the last rows once."""
    known, size = dict[tuple[int, ...], Polynomial](), len(matrix)

    def minor(columns: tuple[int, ...]) -> Polynomial:
        if not columns:
            return ring.one
        if columns not in known:
            ring.check_time()
            row, total = matrix[size - len(columns)], ring.none
            for k, column in enumerate(columns):
                if row[column]:
                    term = row[column] * minor((*columns[:k], *columns[k + 1 :]))
                    total = total + term if k % 2 == 0 else total - term
            known[columns] = total
        return known[columns]

    return minor(tuple(range(size)))

"""Sets of members of a family, given by equations for its constants and unknown functions, and
points on them.

A *leaf* is a chain of equations between constants a, b, ... and derivatives ("jets") of functions
F(x, y), ..., each with a leader: the highest constant or derivative in it. Its members satisfy all
equations of the chain and none of its `nonzero` ones. `split_leaf` turns equations into leaves
whose union has the same members (Rosenfeld and Groebner's algorithm as in Boulier et al. 1995, with
factors split first): an equation that is linear in a constant is solved for it, an equation I u^d +
... for its leader u where I and dp/du are not zero, and I = 0, dp/du = 0 are separate cases;
derivatives of leaders are reduced, and cross derivatives have to agree. Constants are real, so a
sum of squares is zero only if each is.

`PointOnLeaf` is a random point modulo a prime whose constants and jets satisfy the chain:
parametric ones are random, the others are computed. So it is the generic member of the leaf, and
every question about a system can be asked there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

from flint import Ordering, fmpq_mpoly, fmpz_mpoly_ctx, fmpz_mpoly_vec, nmod_poly

from inverse_service import bounds, deadline, errors
from inverse_service.expressions import calculus, polynomials, tree as ex
from inverse_service.field import exact_field, modular, tower

Orders = tuple[int, ...]
Jet = tuple[str, Orders]  # a derivative of an unknown function
Draw = Callable[[int], modular.Point]  # a random point, by a seed
MOST_TERMS = 400  # of an equation that is split
LONGEST_PRODUCT = 100 * MOST_TERMS  # terms, before like ones are collected
MOST_STEPS = 2000
FEW_STEPS, SHARE_WITHOUT_BASES = 150, 0.25  # where there are functions, before bases are tried
MOST_LISTED = 2000  # polynomials whose terms are kept
MOST_FACTORED = 6  # equations at a time, the shortest of the lowest order
MOST_OF_BASIS = 60, 300, 2000  # equations, terms of one, bits of a coefficient
MOST_ROUNDS = 3  # of a basis that loses factors
MOST_ROOTS_TRIED = 24  # points modulo primes, until one has all roots


class NotSplit(Exception):
    """Equations that were not split within the limits; the text says why."""


class _TooManyCases(NotSplit):
    """Not split in this number of steps, or the time."""


# Why the conditions of a family cannot be computed, or not within the limits.
NOT_COMPUTED = (NotSplit, exact_field.TooLarge, errors.IrreducibleAtoms, ZeroDivisionError)


class Term(NamedTuple):
    """A coefficient, and generators with their exponents."""

    coefficient: Fraction
    powers: list[tuple[int, int]]


@dataclass(frozen=True)
class Unknowns:
    """The constants and functions of a family as generators of an exact ring.

    `letters` maps generators to names of constants, `jets` to derivatives. `inner` are the
    generators with coordinates on which an unknown function depends, `outer` all others: an element
    vanishes for all values of these exactly if its coefficients in them do. `places` are the ring's
    variables on which functions depend.
    """

    ring: exact_field.ExactRing
    letters: Mapping[int, str]
    jets: Mapping[int, Jet]
    arguments: Mapping[str, tuple[ex.Symbol | ex.Velocity, ...]]
    inner: frozenset[int]
    outer: tuple[int, ...]
    moving: tuple[int, ...] = ()  # the inner ones that are no constants
    derivatives: dict[tuple[str, int], fmpq_mpoly] = field(
        default_factory=dict, compare=False, repr=False
    )
    listed: dict[int, tuple[fmpq_mpoly, list[Term]]] = field(
        default_factory=dict, compare=False, repr=False
    )

    @classmethod
    def of(
        cls,
        ring: exact_field.ExactRing,
        letters: Sequence[str],
        functions: Mapping[str, Sequence[str]],
    ) -> Unknowns:
        """Those of these names; NotSplit if a function has composed or different arguments."""
        constants, jets, arguments = (
            dict[int, str](),
            dict[int, Jet](),
            dict[str, tuple[Any, ...]](),
        )
        for index, tree in ring.trees.items():
            if isinstance(tree, ex.Symbol) and tree.name in letters:
                constants[index] = tree.name
            if isinstance(tree, ex.Arbitrary) and tree.name in functions:
                plain = all(
                    isinstance(one, ex.Symbol | ex.Velocity) and one in ring.variables
                    for one in tree.arguments
                )
                if not plain or arguments.setdefault(tree.name, tree.arguments) != tree.arguments:
                    raise NotSplit(f"{tree.name} has other arguments than coordinates")
                jets[index] = (tree.name, tree.orders)
        moving = {one for of in arguments.values() for one in of}
        fixed = {
            index
            for index, tree in ring.trees.items()
            if isinstance(tree, ex.Symbol)
            and tree not in ring.variables
            and tree != ex.PI
            and index not in constants
        }
        inner = fixed | {
            index
            for index, tree in ring.trees.items()
            if index not in jets and not moving.isdisjoint(ex.walk(tree))
        }
        outer = [
            index
            for index in ring.trees
            if index not in constants and index not in jets and index not in inner
        ]
        moved = tuple(sorted(inner - fixed))
        return cls(ring, constants, jets, arguments, frozenset(inner), tuple(outer), moved)

    @property
    def context(self) -> Any:
        return self.ring.field.context

    @cached_property
    def variables(self) -> dict[int, ex.Symbol | ex.Velocity]:
        """The ring's variables on which functions depend, by number."""
        moving = {one for of in self.arguments.values() for one in of}
        return {k: one for k, one in enumerate(self.ring.variables) if one in moving}  # type: ignore[misc]

    @cached_property
    def generators(self) -> dict[Jet, int]:
        return {jet: index for index, jet in self.jets.items()}

    @cached_property
    def descending(self) -> tuple[int, ...]:
        """The constants and jets, the highest first."""
        return tuple(sorted((*self.letters, *self.jets), key=self.rank, reverse=True))

    def rank(self, index: int) -> tuple[Any, ...]:
        """Constants first, then derivatives by their order (an orderly ranking)."""
        if index in self.letters:
            return (0, -index)
        name, orders = self.jets[index]
        return (1, sum(orders), sorted(self.arguments).index(name), orders)

    def unknowns_in(self, polynomial: fmpq_mpoly) -> list[int]:
        """The constants and jets in it, the highest first."""
        degrees = polynomial.degrees()
        return [k for k in self.descending if degrees[k]]

    def order(self, polynomial: fmpq_mpoly) -> int:
        """The order of its highest derivative, 0 without functions."""
        degrees = polynomial.degrees()
        return max((sum(orders) for k, (_, orders) in self.jets.items() if degrees[k]), default=0)

    def coefficients(self, polynomial: fmpq_mpoly) -> list[fmpq_mpoly]:
        """What has to vanish for it to vanish at all values of the outer generators."""
        found = exact_field.coefficients_of(polynomial, self.outer).values()
        return [part for one in found for part in self.constants(one)]

    def constants(self, polynomial: fmpq_mpoly) -> list[fmpq_mpoly]:
        """What has to vanish for an element without outer generators to vanish: if it holds no
        function, its coefficients in the variables.
        """
        degrees = polynomial.degrees()
        if any(degrees[k] for k in self.jets) or not any(degrees[k] for k in self.moving):
            return [polynomial]
        return list(exact_field.coefficients_of(polynomial, self.moving).values())

    def factors(self, polynomial: fmpq_mpoly) -> list[fmpq_mpoly]:
        """The distinct irreducible factors that hold unknowns; [] if it vanishes nowhere."""
        if len(polynomial) > MOST_TERMS:
            raise NotSplit(f"an equation has {len(polynomial)} terms")
        found = [
            factor
            for factor, _ in polynomials.factor_polynomial(polynomial)[1]
            if all(map(self.unknowns_in, self.constants(factor)))
        ]
        return [factor / factor.leading_coefficient() for factor in found]

    def derivative(self, polynomial: fmpq_mpoly, variable: int) -> fmpq_mpoly:
        """The numerator of its derivative by a variable of the ring."""
        key = (str(polynomial), variable)
        if key not in self.derivatives:
            try:
                found = self.ring.partial(variable).of_polynomial(self.ring.field, polynomial)
            except exact_field.TooLarge as problem:
                raise NotSplit("an equation needs derivatives of too high an order") from problem
            self.derivatives[key] = found.numerator
        return self.derivatives[key]

    def terms(self, polynomial: fmpq_mpoly) -> list[Term]:
        """Its terms; they are kept, as a polynomial is met at many points."""
        known = self.listed.get(id(polynomial))
        if known is None:
            found = [
                Term(
                    polynomials.as_fraction(value),
                    [(k, int(power)) for k, power in enumerate(exponents) if power],
                )
                for exponents, value in polynomial.terms()
            ]
            if len(self.listed) > MOST_LISTED:
                self.listed.clear()
            self.listed[id(polynomial)] = known = polynomial, found  # it stays, and so does its id
        return known[1]

    def tree(self, polynomial: fmpq_mpoly) -> ex.Expression:
        return exact_field.polynomial_tree(self.ring, polynomial)


@dataclass(frozen=True)
class Rule:
    """An irreducible equation p = 0 and the generator that is its leader."""

    equation: fmpq_mpoly
    leader: int

    @property
    def degree(self) -> int:
        return int(self.equation.degrees()[self.leader])

    @property
    def initial(self) -> fmpq_mpoly:
        return exact_field.coefficient(self.equation, self.leader, self.degree)


@dataclass(frozen=True)
class Leaf:
    """The members that satisfy the rules, and for which no `nonzero` element vanishes.

    Where `whole` is given, these equations define the set, and the rules its general member alone.
    """

    unknowns: Unknowns
    rules: tuple[Rule, ...] = ()
    nonzero: tuple[fmpq_mpoly, ...] = ()
    whole: tuple[fmpq_mpoly, ...] = ()
    divisors: dict[int, fmpq_mpoly | None] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    @property
    def equations(self) -> list[fmpq_mpoly]:
        return [*self.whole] or [rule.equation for rule in self.rules]

    @property
    def shown(self) -> list[Rule]:
        """The equations that define the set, each for the unknown of the lowest degree in it."""

        def leader(equation: fmpq_mpoly) -> int:
            degrees = equation.degrees()
            return min(self.unknowns.unknowns_in(equation), key=lambda k: (degrees[k], k))

        return [Rule(one, leader(one)) for one in self.whole] or [*self.rules]

    @property
    def size(self) -> tuple[int, int]:
        """(number of rules, their terms): larger sets come first in this order."""
        return len(self.rules), sum(len(rule.equation) for rule in self.rules)

    def reduced(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        """The polynomial on the leaf, times elements that vanish nowhere on it."""
        scale: fmpq_mpoly | None = polynomial
        while scale is not None and not polynomial.is_zero():
            scale, polynomial = self.reduced_once(polynomial)
            if len(polynomial) > 10 * MOST_TERMS:
                raise NotSplit(f"an equation has {len(polynomial)} terms")
        return polynomial

    def reduced_once(self, polynomial: fmpq_mpoly) -> tuple[fmpq_mpoly | None, fmpq_mpoly]:
        """(scale, rest): scale times the polynomial is the rest on the leaf; the scale is None if
        no rule applies. NotSplit if a product would be too long, or the time is over.
        """
        degrees = polynomial.degrees()
        for index in self.unknowns.unknowns_in(polynomial) if self.rules else ():
            divisor = self.divisor(index)
            if divisor is None or degrees[index] < divisor.degrees()[index]:
                continue
            budget = exact_field.Budget(LONGEST_PRODUCT, deadline.end())
            try:
                scale, _, rest = exact_field.pseudo_division(polynomial, divisor, index, budget)
            except exact_field.TooLarge:
                raise NotSplit("an equation is too long on its set") from None
            return scale, self.unknowns.ring.field.reduce(rest)
        return None, polynomial

    def divisor(self, index: int) -> fmpq_mpoly | None:
        """The rule for a constant or jet, or the derivative of one with that leader."""
        if index not in self.divisors:
            self.divisors[index] = self._divisor(index)
        return self.divisors[index]

    def _divisor(self, index: int) -> fmpq_mpoly | None:
        for rule in self.rules:
            if rule.leader == index:
                return rule.equation
        if index in self.unknowns.letters:
            return None
        name, orders = self.unknowns.jets[index]
        for rule in self.rules:
            own = self.unknowns.jets.get(rule.leader)
            if (
                own is not None
                and own[0] == name
                and all(a >= b for a, b in zip(orders, own[1], strict=True))
            ):
                equation = rule.equation
                for variable, times in self.steps(name, orders, own[1]):
                    for _ in range(times):
                        equation = self.unknowns.derivative(equation, variable)
                return equation
        return None

    def steps(self, name: str, orders: Orders, below: Orders) -> list[tuple[int, int]]:
        """(variable, how often) from one derivative of a function to a higher one."""
        places = {one: k for k, one in self.unknowns.variables.items()}
        arguments = self.unknowns.arguments[name]
        return [
            (places[one], a - b)
            for one, a, b in zip(arguments, orders, below, strict=True)
            if a > b
        ]


# Splitting.


@dataclass(frozen=True)
class _Open:
    """Equations that are still to be solved on a leaf; `is_basis` if they are a Groebner basis.

    With `has_bases`, those of the lowest order between functions are replaced by one; `low` is this
    order where it is done.
    """

    todo: tuple[fmpq_mpoly, ...]
    leaf: Leaf
    is_basis: bool = False
    has_bases: bool = False
    low: int | None = None


def split_leaf(
    leaf: Leaf,
    equations: Iterable[fmpq_mpoly],
    end: float,
    draw: Draw | None = None,
    steps: int = MOST_STEPS,
) -> list[Leaf]:
    """Leaves with the members of the leaf that satisfy the equations; NotSplit if a limit is
    reached, of so many steps or another.

    With `draw`, mixed derivatives that agree at random points are taken to agree; else they are
    reduced, which may take long. The checker does not rely on either.
    """
    start = _Open(tuple(equations), leaf)
    if not leaf.unknowns.jets:
        return _split(start, end, draw, steps)
    try:
        until = deadline.now() + SHARE_WITHOUT_BASES * (end - deadline.now())
        return _split(start, until, draw, min(steps, FEW_STEPS))
    except NotSplit as problem:  # bases are longer where they do not help
        with suppress(NotSplit):
            return _split(replace(start, has_bases=True), end, draw, steps)
        if isinstance(problem, _TooManyCases):
            return _split(start, end, draw, steps)
        raise


def _split(start: _Open, end: float, draw: Draw | None, steps: int) -> list[Leaf]:
    waiting, found = [start], list[Leaf]()
    for _ in range(steps):
        if not waiting:
            return found
        if deadline.now() > end:
            raise _TooManyCases("the time for splitting was over")
        try:
            with deadline.until(end):  # a single equation may take longer
                found += _step(waiting.pop(), waiting, draw)
        except exact_field.TooLarge as problem:
            raise NotSplit(str(problem)) from problem
    raise _TooManyCases("the equations have too many cases")


def _step(item: _Open, waiting: list[_Open], draw: Draw | None) -> list[Leaf]:
    """Solve one equation, or split it; a leaf that is done is returned."""
    leaf, unknowns = item.leaf, item.leaf.unknowns
    table, late, left = (
        dict[frozenset[str], list[fmpq_mpoly]](),
        list[fmpq_mpoly](),
        list[fmpq_mpoly](),
    )
    for equation in item.todo:
        try:
            one = leaf.reduced(equation)
        except NotSplit:
            late.append(equation)
            continue
        if len(one) > MOST_TERMS:  # shorter ones first may reduce it
            late.append(one)
        elif not one.is_zero():
            left += unknowns.constants(one)
    left.sort(key=lambda one: (unknowns.order(one), len(one)))
    simpler = _with_basis(item, left, late) if item.has_bases else None
    if simpler is not None:
        waiting.append(simpler)
        return []
    most = MOST_FACTORED if any(map(unknowns.order, left)) else len(left)
    late += left[most:]
    for one in left[:most]:
        parts = [part for part in unknowns.factors(one) if part not in leaf.nonzero]
        if not parts:
            return []
        table[frozenset(map(str, parts))] = parts
    least = [parts for key, parts in table.items() if not any(other < key for other in table)]
    if any(leaf.reduced(one).is_zero() for one in leaf.nonzero):
        return []
    if not least:
        further = _cross_derivatives(leaf, draw)
        if not further and not late:
            return [leaf]
        met = {*map(str, item.todo)}  # what was too long to be reduced
        if all(len(one) > MOST_TERMS or str(one) in met for one in further):
            sizes = [len(one) for one in (*further, *late) if len(one) > MOST_TERMS]
            grown = f"an equation has {min(sizes)} terms" if sizes else "equations grew too long"
            raise NotSplit(grown)
        waiting.append(replace(item, todo=(*further, *late), low=None))
        return []
    if not item.is_basis and not late and len(least) + len(leaf.rules) > 2:
        whole = [math.prod(parts[1:], start=parts[0]) for parts in least]
        basis = _basis(unknowns, [*leaf.equations, *whole])
        if basis is not None:
            bare = Leaf(unknowns, (), leaf.nonzero)
            waiting.append(replace(item, todo=tuple(basis), leaf=bare, is_basis=True))
            return []
    least.sort(key=lambda parts: _cost(unknowns, parts))
    parts, *others = least
    rest = [*(math.prod(more[1:], start=more[0]) for more in others), *late]
    if len(parts) > 1:
        known = list(leaf.nonzero)
        for part in sorted(parts, key=len):
            around = replace(leaf, nonzero=tuple(known))
            waiting.append(_Open((part, *rest), around, has_bases=item.has_bases))
            known.append(part)
        return []
    _solve(parts[0], rest, item, waiting)
    return []


def _with_basis(
    item: _Open, left: Sequence[fmpq_mpoly], late: Sequence[fmpq_mpoly]
) -> _Open | None:
    """The item with a basis in place of its equations and rules of the lowest order; None if they
    are one, or it is large. `left` are sorted by their order, `late` are too long.
    """
    leaf, unknowns = item.leaf, item.leaf.unknowns
    lows = _lowest(unknowns, left)
    if not lows:
        return None
    order = unknowns.order(lows[0])
    if item.low is not None and order >= item.low:
        return None
    solved = [rule for rule in leaf.rules if unknowns.order(rule.equation) <= order]
    equations = [*(rule.equation for rule in solved), *lows]
    basis = _low_basis(leaf, equations) if len(equations) > 1 else None
    if basis is None:
        return None
    kept = tuple(rule for rule in leaf.rules if rule not in solved)
    todo = (*basis, *left[len(lows) :], *late)
    return replace(item, todo=todo, leaf=replace(leaf, rules=kept), low=order)


def _lowest(unknowns: Unknowns, equations: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly]:
    """Those of the lowest order, of equations that are sorted by it and hold functions."""
    orders = [unknowns.order(one) for one in equations[: MOST_OF_BASIS[0] + 1]]
    if not orders or not any(k in unknowns.jets for k in unknowns.unknowns_in(equations[0])):
        return []
    found = [one for one, order in zip(equations, orders, strict=False) if order == orders[0]]
    fits = len(found) <= MOST_OF_BASIS[0] and all(len(one) <= MOST_OF_BASIS[1] for one in found)
    return found if fits else []


def _low_basis(leaf: Leaf, equations: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly] | None:
    """A Groebner basis of equations of one order between constants and jets as independent
    unknowns, without factors that do not vanish on the leaf; None if it is large.
    """
    unknowns, found = leaf.unknowns, list(equations)
    for _ in range(MOST_ROUNDS):
        basis = _groebner(unknowns, found, Ordering.degrevlex)
        if basis is None:
            return None
        found = list[fmpq_mpoly]()
        for one in basis:
            parts = [part for part in unknowns.factors(one) if part not in leaf.nonzero]
            found.append(math.prod(parts, start=one * 0 + 1))
        if {*map(str, found)} == {*map(str, basis)}:
            break
    return found


def _basis(unknowns: Unknowns, equations: Sequence[fmpq_mpoly]) -> list[fmpq_mpoly] | None:
    """A Groebner basis of equations between constants alone; None if they hold others, or it is
    large.
    """
    if not all(
        k in unknowns.letters
        for one in equations
        for k, degree in enumerate(one.degrees())
        if degree
    ):
        return None
    return _groebner(unknowns, equations, Ordering.lex)


def _groebner(
    unknowns: Unknowns, equations: Sequence[fmpq_mpoly], order: Ordering
) -> list[fmpq_mpoly] | None:
    """A Groebner basis, the generators being independent; None if it is large."""
    held = {k for one in equations for k, degree in enumerate(one.degrees()) if degree}
    used = sorted(held)
    if order != Ordering.lex:
        high = [k for k in unknowns.descending if k in held]
        used = [*high, *(k for k in used if k not in high)]
    small = fmpz_mpoly_ctx.get(tuple(f"c{k}" for k in used), order)
    whole = list[Any]()
    for one in equations:
        scale = math.lcm(*(polynomials.as_fraction(value).denominator for _, value in one.terms()))
        table = {tuple(int(e[k]) for k in used): int((value * scale).p) for e, value in one.terms()}
        whole.append(small.from_dict(table))
    found, is_complete = fmpz_mpoly_vec(whole, small).buchberger_naive(limits=MOST_OF_BASIS)
    if not is_complete:
        return None
    result, size = list[fmpq_mpoly](), len(unknowns.context.gens())
    for one in found.autoreduction():  # type: ignore[attr-defined]
        terms = dict[tuple[int, ...], Any]()
        for exponents, value in one.terms():
            key = [0] * size
            for k, exponent in zip(used, exponents, strict=True):
                key[k] = int(exponent)
            terms[tuple(key)] = int(value)
        result.append(unknowns.context.from_dict(terms))
    return [one / one.leading_coefficient() for one in result]


def _cost(unknowns: Unknowns, parts: Sequence[fmpq_mpoly]) -> tuple[Any, ...]:
    """Single equations that are solved without a case first, then short ones of low order."""
    (first, *more) = parts
    easy = not more and _letter_of(unknowns, first, 0) is not None
    high = max(
        (unknowns.rank(k)[:2] for part in parts for k in unknowns.unknowns_in(part)[:1]),
        default=(0,),
    )
    mixed = any(_is_mixed(unknowns, part) for part in parts)
    return (not easy, mixed, len(more), high, sum(map(len, parts)))


def _is_mixed(unknowns: Unknowns, equation: fmpq_mpoly) -> bool:
    """Whether it holds functions of different variables."""
    names = {unknowns.jets[k][0] for k in unknowns.unknowns_in(equation) if k in unknowns.jets}
    return len({frozenset(unknowns.arguments[name]) for name in names}) > 1


def _letter_of(unknowns: Unknowns, equation: fmpq_mpoly, most: float) -> int | None:
    """A constant in which the equation is linear, the coefficient having the fewest terms, at most
    this many.
    """
    if any(k in unknowns.jets for k in unknowns.unknowns_in(equation)):
        return None
    degrees, found = equation.degrees(), list[tuple[int, int, int]]()
    for index in unknowns.letters:
        if degrees[index] == 1:
            high = exact_field.coefficient(equation, index, 1)
            weight = len(high) if unknowns.unknowns_in(high) else 0
            found.append((weight, len(equation), index))
    best = min(found, default=None)
    return best[2] if best is not None and best[0] <= most else None


def _solve(
    equation: fmpq_mpoly,
    rest: Sequence[fmpq_mpoly],
    item: _Open,
    waiting: list[_Open],
) -> None:
    """Add the rule of an irreducible equation, and the cases where it has another leader."""
    leaf, unknowns = item.leaf, item.leaf.unknowns
    letter = _letter_of(unknowns, equation, math.inf)
    leader = letter if letter is not None else _leader(leaf, equation)
    squares = _real_zeros(unknowns, equation, leader)
    if squares is not None:
        if squares:
            waiting.append(_Open((*squares, *rest), leaf, has_bases=item.has_bases))
        return
    rule = Rule(equation, leader)
    initial, degree = rule.initial, rule.degree
    separant = equation.derivative(leader)
    nonzero = [*leaf.nonzero]
    cases = list[_Open]()

    def case(part: fmpq_mpoly) -> _Open:
        around = replace(leaf, nonzero=tuple(nonzero))
        return _Open((part, equation, *rest), around, has_bases=item.has_bases)

    for part in unknowns.factors(initial) if unknowns.unknowns_in(initial) else ():
        if part not in nonzero:
            cases.append(case(part))
            nonzero.append(part)
    if degree > 1:
        for part in unknowns.factors(separant):
            if part not in nonzero:
                cases.append(case(part))
                nonzero.append(part)
    kept, again = list[Rule](), list[fmpq_mpoly]()
    for old in leaf.rules:
        touched = any(
            k == leader or _is_above(unknowns, k, leader)
            for k in unknowns.unknowns_in(old.equation)
        )
        (again if touched else kept).append(old.equation if touched else old)  # type: ignore[arg-type]
    waiting.extend(cases)
    solved = Leaf(unknowns, (*kept, rule), tuple(nonzero))
    waiting.append(replace(item, todo=(*again, *rest), leaf=solved))


def _leader(leaf: Leaf, equation: fmpq_mpoly) -> int:
    """The highest jet; of constants one that no rule has as its leader, of the lowest degree."""
    unknowns, taken = leaf.unknowns, {rule.leader for rule in leaf.rules}
    found = unknowns.unknowns_in(equation)
    if found[0] in unknowns.jets:
        return found[0]
    degrees = equation.degrees()
    return min(
        found,
        key=lambda k: (
            k in taken,
            degrees[k],
            len(exact_field.coefficient(equation, k, degrees[k])),
        ),
    )


def _is_above(unknowns: Unknowns, index: int, leader: int) -> bool:
    """Whether a constant or jet is a derivative of a leader, or the same jet."""
    if index not in unknowns.jets or leader not in unknowns.jets:
        return False
    (name, orders), (own, below) = unknowns.jets[index], unknowns.jets[leader]
    return name == own and all(a >= b for a, b in zip(orders, below, strict=True))


def _real_zeros(unknowns: Unknowns, equation: fmpq_mpoly, leader: int) -> list[fmpq_mpoly] | None:
    """What is 0 where a definite form is; None if the equation may have other real zeros.

    [] if there are none. A form is definite if all its terms are even and of one sign; so is A a^2
    + B a + C with a discriminant that is minus such a form.
    """
    form = equation
    if equation.degrees()[leader] == 2:
        low, middle, high = (exact_field.coefficient(equation, leader, k) for k in range(3))
        discriminant = middle * middle - high * low * 4
        roots = _roots_of_squares(-discriminant)
        if roots is not None:
            if any(not unknowns.unknowns_in(root) for root in roots):
                return []
            # 2 p = a (2 A a + B) + (B a + 2 C), where A may be 0, too.
            gen = equation.context().gen(leader)
            return [*roots, high * gen * 2 + middle, middle * gen + low * 2]
    if _is_definite(form) or _is_definite(-form):
        monomials = [form.context().from_dict({e: 1}) for e, _ in form.terms()]
        return [] if any(not unknowns.unknowns_in(one) for one in monomials) else monomials
    return None


def _roots_of_squares(form: fmpq_mpoly) -> list[fmpq_mpoly] | None:
    """What vanishes where a form does that is not negative: its monomials, if all terms are even
    and positive, or the product of its factors, if it is a square; None if it is neither.
    """
    if form.is_zero():
        return None
    if _is_definite(form):
        return [form.context().from_dict({e: 1}) for e, _ in form.terms()]
    if len(form) > MOST_TERMS:
        return None
    constant, factors = polynomials.factor_polynomial(form)
    if constant > 0 and all(power % 2 == 0 for _, power in factors):
        return [math.prod((factor for factor, _ in factors), start=form * 0 + 1)]
    return None


def _is_definite(polynomial: fmpq_mpoly) -> bool:
    return all(
        value > 0 and not any(int(e) % 2 for e in exponents)
        for exponents, value in polynomial.terms()
    )


def _cross_derivatives(leaf: Leaf, draw: Draw | None) -> list[fmpq_mpoly]:
    """What must vanish, too: differences of equal derivatives of leaders, and derivatives of rules
    without leaders.
    """
    unknowns, found = leaf.unknowns, list[fmpq_mpoly]()
    of_functions = [rule for rule in leaf.rules if rule.leader in unknowns.jets]
    for rule in of_functions:
        name, _ = unknowns.jets[rule.leader]
        for variable, argument in unknowns.variables.items():
            if argument not in unknowns.arguments[name]:
                found.append(unknowns.derivative(rule.equation, variable))
    for one, other in itertools.combinations(of_functions, 2):
        (name, orders), (own, below) = unknowns.jets[one.leader], unknowns.jets[other.leader]
        if name != own:
            continue
        top = tuple(map(max, orders, below))
        if draw is not None and _agree_at_points(leaf, one, other, top, draw):
            continue
        if (name, top) not in unknowns.generators:
            raise NotSplit("an equation needs derivatives of too high an order")
        index, pair = unknowns.generators[name, top], list[fmpq_mpoly]()
        for rule, start in ((one, orders), (other, below)):
            equation = rule.equation
            for variable, times in leaf.steps(name, top, start):
                for _ in range(times):
                    equation = unknowns.derivative(equation, variable)
            pair.append(equation)
        if any(equation.degrees()[index] > 1 for equation in pair):
            high, low = sorted(pair, key=lambda p, index=index: -p.degrees()[index])  # type: ignore[misc]
            found.append(exact_field.pseudo_division(high, low, index)[2])
            continue
        slopes = [exact_field.coefficient(equation, index, 1) for equation in pair]
        found.append(slopes[1] * pair[0] - slopes[0] * pair[1])
    reduced = list[fmpq_mpoly]()
    for each in found:
        whole = unknowns.ring.field.reduce(each)
        with suppress(NotSplit):  # too long; others may be shorter, and reduce it
            whole = leaf.reduced(whole)
        reduced.append(whole)
    return [one for one in reduced if not one.is_zero()]


def _agree_at_points(leaf: Leaf, one: Rule, other: Rule, top: Orders, draw: Draw) -> bool:
    """Whether two rules for derivatives of a function give the same derivative at random points."""
    jets = leaf.unknowns.jets
    try:
        for point in points(leaf, draw, 11, 2):
            values = {
                point.by_rule(
                    rule, tuple(a - b for a, b in zip(top, jets[rule.leader][1], strict=True))
                )
                for rule in (one, other)
            }
            if len(values) > 1:
                return False
    except (NotSplit, modular.SingularPoint, errors.IrreducibleAtoms, KeyError):
        return False
    return True


# Points.


@dataclass(slots=True)
class PointOnLeaf(modular.Point):
    """A point modulo a prime at which the constants and jets satisfy the rules of a leaf."""

    leaf: Leaf | None = None
    solving: set[Any] = field(default_factory=set)
    known: dict[Any, Any] = field(default_factory=dict)

    def variable(self, name: modular.Variable) -> int:
        leaf = self.leaf
        if isinstance(name, ex.Symbol) and name not in self.variables and leaf is not None:
            rule = next(
                (one for one in leaf.rules if leaf.unknowns.letters.get(one.leader) == name.name),
                None,
            )
            if rule is not None:
                self.variables[name] = self.root(rule.equation, rule.leader)
        return modular.Point.variable(self, name)

    def jet(self, name: str, arguments: tuple[int, ...], orders: Orders) -> int:
        leaf = self.leaf
        if leaf is None or name not in leaf.unknowns.arguments:
            return modular.Point.jet(self, name, arguments, orders)
        key = (name, orders)
        if key not in self.known:
            self.known[key] = self.solved(name, orders)
            if self.known[key] is None:
                self.known[key] = modular.Point.jet(self, name, arguments, orders)
        return int(self.known[key])

    def solved(self, name: str, orders: Orders) -> int | None:
        """The derivative by the rule that determines it; None for a parametric one."""
        leaf = self.leaf
        assert leaf is not None
        jets, best = leaf.unknowns.jets, None
        for rule in leaf.rules:
            own, below = jets.get(rule.leader, ("", ()))
            if own == name and all(a >= b for a, b in zip(orders, below, strict=True)):
                extra = tuple(a - b for a, b in zip(orders, below, strict=True))
                if best is None or sum(extra) < sum(best[1]):
                    best = rule, extra
        if best is None:
            return None
        return self.by_rule(*best)

    def by_rule(self, rule: Rule, extra: Orders) -> int:
        """The derivative of these orders of a rule's leader."""
        leaf = self.leaf
        assert leaf is not None
        if not any(extra):
            return self.root(rule.equation, rule.leader)
        name, below = leaf.unknowns.jets[rule.leader]
        orders = tuple(a + b for a, b in zip(below, extra, strict=True))
        # D^extra p = S u_(leader + extra) + terms of lower rank; the unknown derivative counts as 0
        # first.
        arguments = leaf.unknowns.arguments[name]
        known = self.known.get((name, orders))
        self.known[name, orders] = 0
        rest = self.coefficient(rule.equation, extra, arguments)
        if known is None:
            del self.known[name, orders]
        else:
            self.known[name, orders] = known
        slope = self.value(rule.equation.derivative(rule.leader))
        if not slope:
            raise modular.SingularPoint("a separant vanishes")
        return (
            -rest * math.prod(map(math.factorial, extra)) * pow(slope, -1, self.prime) % self.prime
        )

    def value(self, polynomial: fmpq_mpoly) -> int:
        """The polynomial at the point."""
        assert self.leaf is not None
        unknowns, total = self.leaf.unknowns, 0
        values = dict[int, int]()
        for coefficient, powers in unknowns.terms(polynomial):
            term = modular.number_value(coefficient, self.prime)
            for index, exponent in powers:
                if index not in values:
                    values[index] = self.generator(unknowns.ring.trees[index])
                term = term * pow(values[index], exponent, self.prime) % self.prime
            total += term
        return total % self.prime

    def generator(self, tree: ex.Expression) -> int:
        if isinstance(tree, ex.Symbol | ex.Velocity):
            return self.variable(tree)
        if isinstance(tree, ex.Arbitrary):
            return modular.evaluate(tree, self)
        if tree not in self.known:
            self.known[tree] = modular.evaluate(tower.to_kernels(tree), self)
        return int(self.known[tree])

    def root(self, equation: fmpq_mpoly, leader: int) -> int:
        """A root of the equation in its leader; SingularPoint if there is none modulo the prime."""
        degree = int(equation.degrees()[leader])
        values = [
            self.value(exact_field.coefficient(equation, leader, k)) for k in range(degree + 1)
        ]
        if not values[-1]:
            raise modular.SingularPoint("an initial vanishes")
        if degree == 1:
            return -values[0] * pow(values[1], -1, self.prime) % self.prime
        roots = [-int(part[0]) * pow(int(part[1]), -1, self.prime) % self.prime
                 for part, _ in nmod_poly(values, self.prime).factor()[1] if part.degree() == 1]  # fmt: skip
        if not roots:
            raise modular.SingularPoint("an equation of the leaf has no root modulo the prime")
        return sorted(roots)[self.seed % len(roots)]

    def coefficient(
        self, polynomial: fmpq_mpoly, order: Orders, arguments: Sequence[ex.Expression]
    ) -> int:
        """The Taylor coefficient of the polynomial at the multi-index, in displacements of these
        arguments.
        """
        assert self.leaf is not None
        below = list(itertools.product(*(range(k + 1) for k in order)))
        unknowns, total, zero = self.leaf.unknowns, 0, (0,) * len(order)
        known = dict[int, dict[Orders, int]]()
        for coefficient, powers in unknowns.terms(polynomial):
            product: dict[Orders, int] = {zero: modular.number_value(coefficient, self.prime)}
            for index, exponent in powers:
                if index not in known:
                    known[index] = self.series(unknowns.ring.trees[index], below, arguments)
                other = known[index]
                for _ in range(exponent):
                    sums = dict[Orders, int]()
                    for a, left in product.items():
                        for b, right in other.items():
                            c = tuple(x + y for x, y in zip(a, b, strict=True))
                            if all(x <= y for x, y in zip(c, order, strict=True)):
                                sums[c] = (sums.get(c, 0) + left * right) % self.prime
                    product = sums
            total += product.get(order, 0)
        return total % self.prime

    def series(
        self, tree: ex.Expression, below: Sequence[Orders], arguments: Sequence[ex.Expression]
    ) -> dict[Orders, int]:
        """The Taylor coefficients of a generator at these multi-indices."""
        zero, prime = below[0], self.prime
        if isinstance(tree, ex.Symbol | ex.Velocity):
            found = {zero: self.variable(tree)}
            if tree in arguments:
                found[tuple(int(one == tree) for one in arguments)] = 1
            return found
        result = dict[Orders, int]()
        for order in below:
            if isinstance(tree, ex.Arbitrary):
                steps = dict(zip(arguments, order, strict=True))
                if any(k and one not in tree.arguments for one, k in steps.items()):
                    continue
                orders = tuple(
                    a + steps.get(one, 0)
                    for one, a in zip(tree.arguments, tree.orders, strict=True)
                )
                value = modular.evaluate(ex.Arbitrary(tree.name, tree.arguments, orders), self)
            else:
                key = (tree, order, tuple(arguments))
                if key not in self.known:
                    slope: ex.Expression = tree
                    for one, k in zip(arguments, order, strict=True):
                        for _ in range(k):
                            slope = calculus.differentiate(slope, one)
                    self.known[key] = modular.evaluate(tower.to_kernels(slope), self)
                value = int(self.known[key])
            if value:
                result[order] = (
                    value * pow(math.prod(map(math.factorial, order)), -1, prime) % prime
                )
        return result


def on_leaf(leaf: Leaf, draw: Draw, seed: int) -> PointOnLeaf:
    """A random point of the leaf; SingularPoint if its equations have no root at this seed."""
    base = draw(seed)
    # The sign of a constant matters where it stands in an atom; elsewhere it may hide all roots.
    free = {ex.Symbol(name) for name in leaf.unknowns.letters.values()} if not base.atoms else ()
    return PointOnLeaf(
        base.prime,
        base.seed,
        {name: sign for name, sign in base.signs.items() if name not in free},
        base.salts,
        base.flipped,
        atoms=dict(base.atoms),
        leaf=leaf,
    )


def points(leaf: Leaf, draw: Draw, seed: int, count: int) -> Iterator[PointOnLeaf]:
    """Points of the leaf at which all rules hold and no nonzero element vanishes; NotSplit if none
    is found.
    """
    found = 0
    for attempt in range(MOST_ROOTS_TRIED * count):
        point = on_leaf(leaf, draw, seed * bounds.ATTEMPTS + attempt)
        try:
            good = not any(point.value(rule.equation) for rule in leaf.rules)
            if not (good and all(map(point.value, leaf.nonzero))):
                continue
        except (modular.SingularPoint, ValueError):
            continue
        yield point
        found += 1
        if found == count:
            return
    raise NotSplit("no point of the set was found modulo primes")


def holds(large: Leaf, small: Leaf, draw: Draw) -> bool:
    """Whether the equations of the large leaf hold at random points of the small one."""
    return not large.rules or all(
        not any(map(one.value, large.equations)) for one in points(small, draw, 7, 2)
    )


def contains(large: Leaf, places: Sequence[PointOnLeaf]) -> bool:
    """Whether these points of another leaf belong to this one."""
    if not large.rules and not large.nonzero:
        return True
    equations = large.equations
    try:
        return bool(places) and all(
            not any(map(one.value, equations)) and all(map(one.value, large.nonzero))
            for one in places
        )
    except modular.SingularPoint:  # it has no value for a derivative in the equations
        return False

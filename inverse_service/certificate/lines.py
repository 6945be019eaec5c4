"""Numbers modulo a prime at given values of the parameters, and at several places of a line in
their space, with the divisors of a computation.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import combinations
from operator import add, mul, sub
from typing import TYPE_CHECKING, Any

from .formulas import MAX_POWER
from .numbers import Residues, Undefined, drawn_for

if TYPE_CHECKING:
    from .question import Question

MAX_DENOMINATORS = 4  # of the formulas, in a divisor


class Special(Residues):
    """Numbers at given values of the parameters.

    `divisors` are the divisors of the computation, `None` before it begins; `denominators` are
    those of the formulas that depend on the parameters. For the parameters in `rooted`, the values
    are their roots, so that sqrt(a), sqrt(a*b) and sqrt(a/b) are products of values. `moved` has
    free values of some pairs by their place (`OnAtoms`).
    """

    divisors: list[Any] | None = None
    denominators: list[Any]
    salt = 0  # which values the functions in `salted` have
    salted: frozenset[str] = frozenset()

    def __init__(
        self,
        question: Question,
        prime: int,
        seed: int,
        values: dict[str, Any],
        rooted: frozenset[str] = frozenset(),
        last: bool = False,
        moved: Mapping[int, Any] | None = None,
    ) -> None:
        self.denominators, self.moved = list[Any](), moved or {}
        super().__init__(question, prime, seed, question.plan.choices[0])
        self.given, self.last, self.pivot = values, last, max if last else min
        self.rooted = rooted
        self.values |= values | {name: values[name] * values[name] % prime for name in rooted}
        self.known_roots = [(root * root % prime, root) for root in self.products()]
        self.drawn = random.Random(seed)

    def again(self) -> Special:
        found = self.drawn_again()
        found.salt, found.salted = self.salt, self.salted
        found.denominators = self.denominators
        return found

    def drawn_again(self) -> Special:
        return type(self)(
            self.question, self.prime, self.seed, self.given, self.rooted, self.last, self.moved
        )

    def products(self) -> Iterator[Any]:
        """The roots of parameters, and the products and quotients of two of them."""
        roots = [self.given[name] for name in sorted(self.rooted)]
        yield from roots
        for one, other in combinations(roots, 2):
            yield one * other % self.prime
            for above, below in ((one, other), (other, one)):
                with suppress(Undefined):
                    yield above * self.inverse_of(below) % self.prime

    def inverse_of(self, value: Any) -> Any:
        return super().inverse(value)

    def root(self, value: Any, degree: int) -> Any:
        if degree == 2:
            for square, root in self.known_roots:
                if value == square:
                    return root
        return self.root_of(value, degree)

    def root_of(self, value: Any, degree: int) -> Any:
        return super().root(value, degree)

    def draw(self) -> int:
        return self.drawn.randrange(self.prime)

    def jet(self, name: str, number: int, orders: tuple[int, ...]) -> int:
        if self.salt and name in self.salted:
            return drawn_for(f"{self.salt} {(name, number, orders)}", self.prime)
        return super().jet(name, number, orders)

    def inverse(self, value: Any) -> Any:
        self.note(value)
        return super().inverse(value)

    def regular(self, matrix: list[list[Any]]) -> bool:
        determinant = self.determinant(matrix)
        if determinant:
            self.note(determinant)
        return bool(determinant)

    def note(self, value: Any) -> None:
        """Record a divisor, which must be a number modulo the prime."""
        if self.divisors is not None:
            value = self.reduced(value)
            if not isinstance(value, int):
                raise Undefined
            self.divisors.append(value)


class Several:
    """Numbers at several places of a line, which are added and multiplied place by place."""

    __slots__ = ("at",)

    def __init__(self, at: list[Any]) -> None:
        self.at = at

    def __add__(self, other: Any) -> Several:
        if isinstance(other, Several):
            return Several(list(map(add, self.at, other.at)))
        return Several([a + other for a in self.at]) if other else self

    def __mul__(self, other: Any) -> Several:
        if isinstance(other, Several):
            return Several(list(map(mul, self.at, other.at)))
        return Several([a * other for a in self.at])

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Several:
        return Several([-a for a in self.at])

    def __sub__(self, other: Any) -> Several:
        if isinstance(other, Several):
            return Several(list(map(sub, self.at, other.at)))
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Several:
        return self.__neg__().__add__(other)

    def __mod__(self, prime: int) -> Several:
        return Several([a % prime for a in self.at])

    def __bool__(self) -> bool:
        return any(self.at)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Several) and self.at == other.at

    def __hash__(self) -> int:
        return hash(tuple(self.at))


class OnLine(Special):
    """Numbers at several places of a line in the space of the parameters, in one computation."""

    def reduced(self, value: Any) -> Any:
        return self.each(super().reduced, value) if self.field else value % self.prime

    def inverse(self, value: Any) -> Any:
        self.note(value)
        return self.inverse_of(value)

    def moderate_power(self, value: Any, exponent: int) -> Any:
        if isinstance(value, Several) and exponent < 0:  # one divisor, not one at each place
            value, exponent = self.inverse(value), -exponent
        moderate_power = super().moderate_power
        return self.each(lambda one: moderate_power(one, exponent), value)

    def power(self, value: Any, exponent: int) -> Any:
        if isinstance(value, Several) and abs(exponent) > MAX_POWER:
            raise Undefined
        return super().power(value, exponent)

    def inverse_of(self, value: Any) -> Any:
        if self.field or not isinstance(value, Several):
            return self.each(super().inverse_of, value)
        # The inverse of the product of all, times the product of all others: one costs as much as
        # some fifty products.
        prime, before = self.prime, [1]
        for one in value.at:
            before.append(before[-1] * one % prime)
        after, found = super().inverse_of(before.pop()), list[Any]()
        for one in reversed(value.at):
            found.append(before.pop() * after % prime)
            after = after * one % prime
        return Several(found[::-1])

    def root_of(self, value: Any, degree: int) -> Any:
        root = super().root_of
        return self.each(lambda one: root(one, degree), value)

    def determinant(self, matrix: list[list[Any]]) -> Any:
        entries, determinant = [entry for row in matrix for entry in row], super().determinant
        count = max((len(one.at) for one in entries if isinstance(one, Several)), default=0)
        if not count:
            return determinant(matrix)
        held, self.divisors = self.divisors, None  # pivots at one place are none of all places
        found = [
            determinant([[x.at[k] if isinstance(x, Several) else x for x in row] for row in matrix])
            for k in range(count)
        ]
        self.divisors = held
        if any(found) and not all(found):
            raise Undefined
        return Several(found)

    def note(self, value: Any) -> None:
        if self.divisors is None and len(self.denominators) == MAX_DENOMINATORS:
            return
        if isinstance(value := self.reduced(value), Several):
            if not all(isinstance(one, int) for one in value.at):
                raise Undefined
            if self.divisors is not None:
                self.divisors.append(value)
            elif value not in self.denominators:
                self.denominators.append(value)
        elif self.divisors is not None:
            super().note(value)

    def each(self, work: Callable[[Any], Any], value: Any) -> Any:
        return Several([*map(work, value.at)]) if isinstance(value, Several) else work(value)


class OnAtoms(OnLine):
    """Numbers where the free values of some pairs (l, e) are other ones: l of a logarithm, else e.

    See `numbers.Pair`; `moved` has them by the place of the pair, at one or at several places.
    """

    def draw_pairs(self) -> None:
        super().draw_pairs()
        for place, value in self.moved.items():
            exponent, power = self.pairs[place]
            given = self.plan.pairs[place].logarithm
            self.pairs[place] = (value, power) if given else (exponent, value)

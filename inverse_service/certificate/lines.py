"""Numbers modulo a prime at given values of the parameters, and along a line in their space, with
the divisors of a computation.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import combinations
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


class Displaced:
    """A number that changes along a line: a power series in the place s, up to s^(size - 1).

    A rational function of s is found from its series as it is from its values, and a product of
    series takes a fraction of the time of products at as many places.
    """

    __slots__ = ("part", "size")

    def __init__(self, part: Any, size: int) -> None:
        self.part, self.size = part, size

    def __add__(self, other: Any) -> Displaced:
        return Displaced(self.part + (other.part if type(other) is Displaced else other), self.size)

    def __mul__(self, other: Any) -> Displaced:
        if type(other) is Displaced:
            return Displaced(self.part.mul_low(other.part, self.size), self.size)
        return Displaced(self.part * other, self.size)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Displaced:
        return Displaced(-self.part, self.size)

    def __sub__(self, other: Any) -> Displaced:
        return Displaced(self.part - (other.part if type(other) is Displaced else other), self.size)

    def __rsub__(self, other: Any) -> Displaced:
        return Displaced(other - self.part, self.size)

    def __mod__(self, prime: int) -> Displaced:
        """Itself, as the coefficients are numbers modulo this prime."""
        return self

    def __bool__(self) -> bool:
        return bool(self.part)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Displaced) and bool(self.part == other.part)

    def __hash__(self) -> int:
        return hash(tuple(map(int, self.part.coeffs())))


class OnLine(Special):
    """Numbers along a line in the space of the parameters, or of atoms, in one computation."""

    def reduced(self, value: Any) -> Any:
        return value % self.prime

    def inverse(self, value: Any) -> Any:
        self.note(value)
        return self.inverse_of(value)

    def inverse_of(self, value: Any) -> Any:
        if not isinstance(value, Displaced):
            return super().inverse_of(value)
        if not int(value.part[0]):  # it has no series, at one of 2^60 starts of a line
            raise Undefined
        return Displaced(value.part.inverse_series_trunc(value.size), value.size)

    def moderate_power(self, value: Any, exponent: int) -> Any:
        if not isinstance(value, Displaced):
            return super().moderate_power(value, exponent)
        value = value if exponent >= 0 else self.inverse(value)
        return Displaced(value.part.pow_trunc(abs(exponent), value.size), value.size)

    def power(self, value: Any, exponent: int) -> Any:
        if isinstance(value, Displaced) and abs(exponent) > MAX_POWER:
            raise Undefined
        return super().power(value, exponent)

    def root_of(self, value: Any, degree: int) -> Any:
        if isinstance(value, Displaced):
            if value.part.degree() > 0 and degree > 1:  # no rational function of the place
                raise Undefined
            return value if degree == 1 else super().root_of(int(value.part[0]), degree)
        return super().root_of(value, degree)

    def determinant(self, matrix: list[list[Any]]) -> Any:
        """By elimination of the rows, whose pivots are not noted as divisors."""
        rows = [[self.reduced(entry) for entry in row] for row in matrix]
        if not any(isinstance(entry, Displaced) for row in rows for entry in row):
            return super().determinant(matrix)
        found: Any = 1
        while rows:
            pivot = next((row for row in rows if row[0]), None)
            if pivot is None:
                return 0
            found = found * pivot[0] * (-1) ** rows.index(pivot)
            rows.remove(pivot)
            scale = self.inverse_of(pivot[0])
            for k, row in enumerate(rows):
                factor = row[0] * scale
                pairs = zip(row[1:], pivot[1:], strict=True)
                rows[k] = [self.reduced(a - factor * b) for a, b in pairs]
        return self.reduced(found)

    def note(self, value: Any) -> None:
        if self.divisors is None and len(self.denominators) == MAX_DENOMINATORS:
            return
        value = self.reduced(value)
        if not isinstance(value, Displaced):
            if self.divisors is not None:
                super().note(value)
        elif self.divisors is not None:
            self.divisors.append(value)
        elif value not in self.denominators:
            self.denominators.append(value)


class OnAtoms(OnLine):
    """Numbers where the free values of some pairs (l, e) are other ones: l of a logarithm, else e.

    See `numbers.Pair`; `moved` has them by the place of the pair, at one place or along a line.
    """

    def draw_pairs(self) -> None:
        super().draw_pairs()
        for place, value in self.moved.items():
            exponent, power = self.pairs[place]
            given = self.plan.pairs[place].logarithm
            self.pairs[place] = (value, power) if given else (exponent, value)

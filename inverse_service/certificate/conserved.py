"""Claims that a system has no first integrals polynomial in the velocities but combinations of
given products.

F = sum c_a(t, q) v^a, |a| <= k, is conserved if the coefficients of all v^b in Gamma F vanish:
equations of first order for the functions c_a whose symbols are those of Killing tensors,
symmetrized gradients. They determine all derivatives of order k + 1, so that the Taylor
coefficients of the c_a up to an order N >= k at one point determine F. These solve the Taylor
coefficients up to order N - 1 of the equations. So the dimension of all F is at most the number of
unknowns minus the rank of these at any one point, and the rank at the generic point is at least
that. See FORMAT.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from functools import reduce
from itertools import combinations_with_replacement
from operator import add
from typing import Any

from flint import arb, nmod_mat

from . import formulas as fm
from .formulas import TEXT, Incomplete, check_shape, read_tokens, require
from .numbers import Arithmetic, Number, Residues, Series, Undefined
from .question import Claims, Question, Tools, Zero
from .series import Expansion

FORMAT = "inverse-service/integrals/1"
MAX_DEGREE, MAX_ORDER = 4, 12
# Unknowns, for residues and for balls.
MAX_UNKNOWNS, MAX_IN_BALLS = 4_000, 400
DOCUMENT = {
    "format": FORMAT,
    "system": {},
    "question": "autonomous|time_dependent",
    "near?": {},
    "conditions?": [TEXT, fm.MAX_LISTED],
    "degree": range(1, MAX_DEGREE + 1),
    "order": range(1, MAX_ORDER + 1),
    "number": range(1, MAX_UNKNOWNS),
    "integrals": [TEXT, fm.MAX_LISTED],
    "products": [[range(fm.MAX_LISTED), MAX_DEGREE], 500],
}
Exponents = tuple[int, ...]
Rows = dict[tuple[Exponents, Exponents], dict[int, Number]]


class Degrees:
    """Read formulas for an upper bound of their degree as polynomials in the velocities; Incomplete
    for others.
    """

    degree = 0

    def __init__(self, question: Question) -> None:
        self.question, self.ties = question, list[Any]()
        self.names = dict.fromkeys((*question.names, "pi"), 0) | {
            name + "'": 1 for name in question.free
        }

    def constant(self, value: Fraction) -> int:
        return 0

    def add(self, terms: list[int], weights: Iterable[int] = ()) -> int:
        return max(terms, default=0)

    def multiply(self, left: int, right: int, degree: int = 0) -> int:
        return left + right

    def power(self, u: int, exponent: int) -> int:
        return u * exponent if exponent > 0 else self.at_rest(u)

    def elementary(self, name: str, u: int) -> int:
        return self.at_rest(u)

    def function(self, name: str, orders: tuple[int, ...], arguments: list[int]) -> int:
        return self.at_rest(max(arguments))

    def at_rest(self, u: int) -> int:
        if u:
            raise Incomplete("A formula is not a polynomial in the velocities as it is written.")
        return 0


class Slice(Expansion):
    """f as a polynomial in the velocities, with series in t and q up to an order as
    coefficients.
    """

    def __init__(self, arithmetic: Arithmetic, order: int, highest: int) -> None:
        self.order, self.highest = order, highest
        super().__init__(arithmetic, order + highest)

    def expand(self) -> None:
        self.names = {name: {0: value} for name, value in self.arithmetic.values.items()}
        for name, unit in zip(self.question.variables, self.units, strict=True):
            start = {} if name.endswith("'") else self.names[name]
            self.names[name] = start | {unit: self.one[0]}
        self.ties = list[Series]()
        self.forces = self.question.read_all(self)

    def parts(self, key: int) -> tuple[Exponents, Exponents]:
        """The exponents of the velocities, and of t and q."""
        still = len(self.units) - len(self.v)
        return (
            tuple(self.exponent(key, a) for a in self.v),
            tuple(self.exponent(key, a) for a in range(still)),
        )

    def product(self, left: Series, right: Series) -> Series:
        return self.multiply(left, right, self.degree)

    def multiply(self, left: Series, right: Series, degree: int) -> Series:
        found = super().multiply(left, right, degree)
        kept = {key: self.parts(key) for key in found}
        fits = (
            key for key, (v, q) in kept.items() if sum(v) <= self.highest and sum(q) <= self.order
        )
        return {key: found[key] for key in fits}


class Conserved(Question):
    """A system, and the check of claims about all its first integrals of a degree in the
    velocities.
    """

    def __init__(self, tools: Tools, document: dict[str, Any]) -> None:
        super().__init__(
            tools, document["system"], document["question"] == "time_dependent", document
        )
        require(
            not self.bound and not self.unsolved,
            "The system has to be solved for q'', without constraints.",
        )
        moving = {name + "'" for name in self.coordinates}
        still = moving.isdisjoint(
            token for sides in self.conditions for side in sides for token in side
        )
        require(
            still, "The conditions have to be free of velocities: f is expanded where they are 0."
        )
        if self.functions:
            raise Incomplete("The system contains arbitrary functions.")

    def complete(self, document: dict[str, Any]) -> str:
        """Check that the products of the given integrals are independent and that there are no
        other integrals.

        On return, each given function is conserved in the ring, the Taylor coefficients of the
        products have full rank, and the rank of the prolonged equations leaves no room for more: at
        a point modulo a prime if everything is rational, else in balls at the real point.
        """
        degree, order, number = document["degree"], document["order"], document["number"]
        integrals = [read_tokens(text, "integrals") for text in document["integrals"]]
        for tokens in integrals:
            self.check_names("An integral", tokens)
        ring = Degrees(self)
        highest = max([1, *fm.read_formulas(ring, self.force_texts)])
        degrees = fm.read_formulas(ring, integrals)
        products = [tuple(one) for one in document["products"]]
        good = (
            all(place < len(integrals) for one in products for place in one)
            and len(set(products)) == number
        )
        require(
            good and len(products) == number,
            "Name each product of integrals once, as many as `number`.",
        )
        fitting = all(sum(degrees[place] for place in one) <= degree for one in products)
        require(fitting, "A product has a higher degree in the velocities than the claim.")
        require(order >= degree, "The order has to be at least the degree.")
        self.prepare(lambda ring: fm.read_formulas(ring, integrals), integrals)
        self.settle(1, lambda ring: self.rates(ring, integrals), 3 if self.rational else 2)
        self.independent_products(integrals, products, order, max(highest, degree))
        self.no_others(degree, order, highest, number)
        return (
            f"First integrals that are polynomials of degree at most {degree} in the velocities are combinations of "
            f"{number} products of those listed, with any analytic coefficients."
        )

    def rates(self, ring: Expansion, integrals: list[tuple[str, ...]]) -> Claims:
        """Gamma F of each integral."""
        zeros = []
        for place, one in enumerate(fm.read_formulas(ring, integrals), 1):
            slopes = (ring.derivative(one, a) for a in range(len(ring.units)))
            terms = [
                ring.multiply(rate, slope, 0)
                for rate, slope in zip(ring.field, slopes, strict=True)
            ]
            zeros.append(
                Zero({0: ring.add(terms).get(0, 0)}, f"Integral {place} is not conserved.")
            )
        return Claims(zeros, [])

    def independent_products(
        self,
        integrals: list[tuple[str, ...]],
        products: list[tuple[int, ...]],
        order: int,
        highest: int,
    ) -> None:
        """By their Taylor coefficients at one point, modulo a prime or in balls."""

        def coefficients(ring: Slice) -> list[Series]:
            values = fm.read_formulas(ring, integrals)
            return [reduce(ring.product, (values[k] for k in one), ring.one) for one in products]

        def real(ring: Expansion) -> None:
            rows = coefficients(Slice(ring.arithmetic.again(), order, highest))
            zero = arb(0)
            pairs = [
                [(row.get(key, zero), other.get(key, zero)) for key in row]
                for row in rows
                for other in rows
            ]
            gram = [sum((x * y for x, y in pair), start=zero) for pair in pairs]
            size = len(rows)
            ring.arithmetic.regular([gram[size * k : size * (k + 1)] for k in range(size)])

        if not self.rational:
            self.proven_in_balls(
                0, real, "Balls do not show that the products of integrals are independent."
            )
            return
        rows, prime = self.at_a_point(coefficients, order, highest)
        keys = [*dict.fromkeys(key for row in rows for key in row)]
        table = [[row.get(key, 0) for key in keys] for row in rows]
        require(nmod_mat(table, prime).rank() == len(rows), "The products are not independent.")

    def at_a_point(self, work: Callable[[Slice], Any], order: int, highest: int) -> tuple[Any, int]:
        """The result at a random point modulo a prime, and the prime."""
        prime = self.prime()
        for _ in range(200):
            with suppress(Undefined):
                field = Residues(self, prime, self.generator.getrandbits(64), self.plan.choices[0])
                return work(Slice(field, order, highest)), prime
            self.check_time()
        raise Incomplete("No point was found at which every formula is defined.")

    def no_others(self, degree: int, order: int, highest: int, number: int) -> None:
        """The rank of the prolonged equations is the number of unknowns minus the claimed
        number.
        """
        still = len(self.variables) - len(self.free)
        velocities = [a for d in range(degree + 1) for a in exponents(len(self.free), d)]
        powers = [a for d in range(order, -1, -1) for a in exponents(still, d)]
        size = len(velocities) * len(powers)
        if size > (MAX_UNKNOWNS if self.rational else MAX_IN_BALLS):
            raise Incomplete(f"There are {size} unknowns, which are too many.")
        rows, prime = self.at_a_point(
            lambda ring: self.equations(ring, velocities, powers), order, highest
        )
        names = [*rows]
        table = [[rows[name].get(k, 0) % prime for k in range(size)] for name in names]
        columns = pivots_of(nmod_mat(table, prime))
        if size - len(columns) > number:
            raise Incomplete(f"Up to this order, {size - len(columns)} integrals are possible.")
        require(size - len(columns) == number, "There are fewer integrals than claimed.")
        if self.rational:
            return
        lines = pivots_of(nmod_mat([[line[k] for line in table] for k in columns], prime))
        chosen = [names[k] for k in lines]

        def real(ring: Expansion) -> None:
            rows = self.equations(
                Slice(ring.arithmetic.again(), order, highest), velocities, powers
            )
            matrix = [[rows.get(name, {}).get(k, 0) for k in columns] for name in chosen]
            ring.arithmetic.regular(matrix)

        self.proven_in_balls(
            0, real, "Balls at the real point do not show that there are no other integrals."
        )

    def equations(self, ring: Slice, velocities: list[Exponents], powers: list[Exponents]) -> Rows:
        """The coefficients of v^b q^c in Gamma F, by the places of the unknown coefficients of v^a
        q^m in F.
        """
        order, timed, n = ring.order, self.timed, len(self.free)
        place = {name: k for k, name in enumerate((a, m) for m in powers for a in velocities)}
        forces = [
            [(*ring.parts(key), value) for key, value in force.items()] for force in ring.forces
        ]
        units = [tuple(int(i == j) for j in range(n)) for i in range(n)]
        rows: Rows = {}

        def put(b: Exponents, c: Exponents, column: int, value: Number) -> None:
            row = rows.setdefault((b, c), {})
            row[column] = row[column] + value if column in row else value

        for (a, m), column in place.items():
            self.check_time()
            for i, power in enumerate(m):
                if power:
                    lower = (*m[:i], power - 1, *m[i + 1 :])
                    by = a if timed and i == 0 else tuple(map(add, a, units[i - timed]))
                    put(by, lower, column, ring.arithmetic.number(Fraction(power)))
            for i, power in enumerate(a):
                if power:
                    for v, q, value in forces[i]:
                        c = tuple(map(add, m, q))
                        if sum(c) < order:
                            b = tuple(x + y - z for x, y, z in zip(a, v, units[i], strict=True))
                            put(b, c, column, value * power)
        return {name: row for name, row in rows.items() if sum(name[1]) < order}


def exponents(count: int, degree: int) -> Iterator[Exponents]:
    """The exponents of all monomials of a degree."""
    for chosen in combinations_with_replacement(range(count), degree):
        yield tuple(chosen.count(k) for k in range(count))


def pivots_of(matrix: nmod_mat) -> list[int]:
    reduced, rank = matrix.rref()
    found, column = list[int](), 0
    for row in range(rank):
        while not int(reduced[row, column]):
            column += 1
        found.append(column)
        column += 1
    return found


def complete_integrals(document: Any, tools: Tools) -> str:
    """The statement that a document proves, or Ended."""
    check_shape(document, DOCUMENT, "certificate")
    return Conserved(tools, document).complete(document)

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

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import cache, reduce
from itertools import chain, combinations_with_replacement
from typing import Any, NamedTuple

from flint import arb, nmod_mat, nmod_poly

from . import formulas as fm
from .formulas import TEXT, Incomplete, check_shape, read_tokens, require
from .numbers import ONE, TURN, Arithmetic, Number, Residues, Series, Undefined
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
# Functions that are rational in exponentials of real (False) or imaginary (True) arguments.
EXPONENTIALS = dict.fromkeys(("exp", "sinh", "cosh", "tanh", "coth", "sech", "csch"), False)
EXPONENTIALS |= dict.fromkeys(("sin", "cos", "tan", "cot", "sec", "csc"), True)
Exponents = tuple[int, ...]
Rows = dict[int, dict[int, Number]]
Block = tuple[list[int], list[int]]  # names of rows, and columns


class Prolonged(NamedTuple):
    """The equations at a point modulo a prime, and the numbers of integrals that they leave
    possible, one for each choice of the roots there.
    """

    possible: list[int]
    equations: list[Rows]
    prime: int


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

    def special(self, name: str, arguments: list[int], order: fm.Order) -> int:
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
        self.highest: int | None = None  # degree of f in the velocities; None before `possible`

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
        self.no_others(degree, order, highest, number)
        self.settle(1, lambda ring: self.rates(ring, integrals), 3 if self.rational else 2)
        self.independent_products(integrals, products, order, max(highest, degree))
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

        if not self.exact(*integrals):
            self.proven_in_balls(
                0, real, "Balls do not show that the products of integrals are independent."
            )
            return
        found, prime = self.at_a_point(coefficients, order, highest)
        for rows in found:
            keys = [*dict.fromkeys(key for row in rows for key in row)]
            table = [[row.get(key, 0) for key in keys] for row in rows]
            require(nmod_mat(table, prime).rank() == len(rows), "The products are not independent.")

    def at_a_point(
        self, work: Callable[[Slice], Any], order: int, highest: int
    ) -> tuple[list[Any], int]:
        """The results at a random point modulo a prime, one for each choice of the roots there,
        and the prime.
        """
        prime = self.prime()
        for _ in range(200 * self.plan.draws):
            seed = self.generator.getrandbits(64)

            def ring(choice: dict[int, int], *sizes: int, seed: int = seed) -> Slice:
                return Slice(Residues(self, prime, seed, choice), *sizes)

            with suppress(Undefined):
                if self.plan.draws > 1:  # whether the roots exist, which is known at once
                    ring(self.plan.choices[0], 0, 0)
                return [work(ring(choice, order, highest)) for choice in self.plan.choices], prime
            self.check_time()
        raise Incomplete("No point was found at which every formula is defined.")

    def exact(self, *more: tuple[str, ...]) -> bool:
        """Whether nothing made of f and more formulas is zero as a function but 0 in the ring: see
        FORMAT.md.

        That is so for algebraic functions and exponentials, sines and cosines of rational functions
        of which no sum with whole factors is constant.
        """
        if self.rational:
            return True
        rational, inside = set[int](), {True: set[int](), False: set[int]()}
        read = [self.nodes.order(text) for text in (*self.texts(), *more)]
        for number in sorted({number for one in read for number in one}):
            kind, *parts = self.nodes.listed[number]
            below = self.nodes.parts(number)
            if kind in ("number", "name", "+", "*", "/", "power"):
                if rational.issuperset(below):
                    rational.add(number)
            elif kind in EXPONENTIALS and rational.issuperset(below):
                inside[EXPONENTIALS[kind]].add(below[0])
            elif not (kind == "sqrt" or (kind == "^" and self.is_constant(parts[1]))):
                return False
        # Of e and pi, or e^i, it is not known that they are algebraically independent.
        powers = (part for entry in self.plan.entries for part, _ in entry.parts)
        if self.plan.wide or not {ONE, TURN}.isdisjoint(powers):
            return False
        return all(
            self.are_independent(rational, nodes, imaginary) for imaginary, nodes in inside.items()
        )

    def is_constant(self, number: int) -> bool:
        """Whether a formula consists of numbers alone."""
        kind, *_ = self.nodes.listed[number]
        parts = self.nodes.parts(number)
        return kind == "number" or (
            kind in ("+", "*", "/", "power") and all(map(self.is_constant, parts))
        )

    def are_independent(self, rational: set[int], nodes: set[int], imaginary: bool) -> bool:
        """Whether these functions span as many dimensions, modulo constants, as there are
        exponentials.
        """
        wanted = sum(
            pair.imaginary == imaginary and not pair.logarithm and not pair.number
            for pair in self.plan.pairs
        )

        def series(ring: Slice) -> list[Series]:
            known: dict[int, Series] = {}
            for number in sorted(rational):
                node = self.nodes.listed[number]
                known[number] = fm.computed(ring, self.nodes, node, ring.names, known)
            return [known[number] for number in sorted(nodes)]

        if not nodes:
            return not wanted
        (rows, *_), prime = self.at_a_point(series, 2, 2)
        keys = [*dict.fromkeys(key for row in rows for key in row if key)] or [1]
        table = [[int(row.get(key, 0)) for key in keys] for row in rows]
        return all(map(any, table)) and bool(nmod_mat(table, prime).rank() == wanted)

    def no_others(self, degree: int, order: int, highest: int, number: int) -> None:
        """The rank of the prolonged equations is the number of unknowns minus the claimed
        number.
        """
        velocities, powers = self.unknown(degree, order)
        size = len(velocities) * len(powers)
        possible, found, prime = self.prolonged(degree, order, highest)
        for each in possible:
            if each > number:
                raise Incomplete(f"Up to this order, {each} integrals are possible.")
            require(each == number, "There are fewer integrals than claimed.")
        if self.exact():
            return
        if size > MAX_IN_BALLS:
            raise Incomplete(f"There are {size} unknowns, which are too many for balls.")
        blocks = [self.regular_part(found[-1], *block, prime) for block in blocks_of(found[-1])]

        def real(ring: Expansion) -> None:
            rows = self.equations(
                Slice(ring.arithmetic.again(), order, highest), velocities, powers
            )
            for names, columns in blocks:
                matrix = [[rows.get(name, {}).get(k, 0) for k in columns] for name in names]
                ring.arithmetic.regular(matrix)

        self.proven_in_balls(
            0, real, "Balls at the real point do not show that there are no other integrals."
        )

    def prolonged(self, degree: int, order: int, highest: int) -> Prolonged:
        """The equations at a random point for each choice of the roots there, and how many
        integrals these leave possible.
        """
        velocities, powers = self.unknown(degree, order)
        if (size := len(velocities) * len(powers)) > MAX_UNKNOWNS:
            raise Incomplete(f"There are {size} unknowns, which are too many.")
        found, prime = self.at_a_point(
            lambda ring: self.equations(ring, velocities, powers), order, highest
        )
        self.check_time()
        return Prolonged([size - rank_modulo(rows, prime) for rows in found], found, prime)

    def possible(self, degree: int, order: int) -> int:
        """How many integrals the equations of an order leave possible, whichever are known."""
        if self.highest is None:
            self.prepare(lambda ring: ())
            self.highest = max([1, *fm.read_formulas(Degrees(self), self.force_texts)])
        return max(self.prolonged(degree, order, self.highest).possible)

    def unknown(self, degree: int, order: int) -> tuple[list[Exponents], list[Exponents]]:
        """The exponents of the velocities, and of t and q, whose coefficients in F are unknown."""
        still = len(self.variables) - len(self.free)
        velocities = [a for d in range(degree + 1) for a in exponents(len(self.free), d)]
        return velocities, [a for d in range(order, -1, -1) for a in exponents(still, d)]

    def block(self, rows: Rows, names: list[Any], columns: list[int], prime: int) -> nmod_mat:
        """These rows and columns of the equations modulo a prime."""
        self.check_time()
        places = {column: k for k, column in enumerate(columns)}
        found = nmod_mat(len(names), len(columns), prime)
        for i, name in enumerate(names):
            for column, value in rows[name].items():
                if column in places:
                    found[i, places[column]] = value % prime
        return found

    def regular_part(
        self, rows: Rows, names: list[Any], columns: list[int], prime: int
    ) -> tuple[list[Any], list[int]]:
        """The names of rows and the columns of a largest regular part of a block."""
        places = [columns[k] for k in pivots_of(self.block(rows, names, columns, prime))]
        lines = pivots_of(self.block(rows, names, places, prime).transpose())
        return [names[k] for k in lines], places

    def equations(self, ring: Slice, velocities: list[Exponents], powers: list[Exponents]) -> Rows:
        """The coefficients of v^b q^c in Gamma F, by the places of the unknown coefficients of v^a
        q^m in F. A row is named by the key of v^b q^c without its degree.
        """
        order, timed, count = ring.order, self.timed, len(ring.units)
        whole = (1 << ring.shift) - 1
        units = [unit & whole for unit in ring.units]
        at_rest, moving = units[: count - len(self.free)], units[count - len(self.free) :]
        number = [ring.arithmetic.number(Fraction(k)) for k in range(order + 1)]
        forces = [
            [(key & whole, sum(ring.parts(key)[1]), value) for key, value in force.items()]
            for force in ring.forces
        ]

        @cache
        def terms(i: int, power: int, reach: int) -> list[tuple[int, Number]]:
            """The terms of f_i d/dv_i on a power of v_i, below a degree in t and q."""
            return [
                (key - moving[i], value * power) for key, size, value in forces[i] if size < reach
            ]

        keys = [_packed(a, moving) for a in velocities]
        rows: Rows = {}
        for place, m in enumerate(powers):
            self.check_time(len(velocities))
            start, reach = _packed(m, at_rest), order - sum(m)
            lower = [
                ((moving[i - timed] if i >= timed else 0) - at_rest[i], power)
                for i, power in enumerate(m)
                if power
            ]
            for column, (a, key) in enumerate(
                zip(velocities, keys, strict=True), place * len(velocities)
            ):
                found = [(step, number[power]) for step, power in lower]
                for i, power in enumerate(a):
                    if power:
                        found += terms(i, power, reach)
                for step, value in found:
                    row = rows.setdefault(start + key + step, {})
                    row[column] = row[column] + value if column in row else value
        return rows


def _packed(exponents: Exponents, units: Sequence[int]) -> int:
    return sum(power * unit for power, unit in zip(exponents, units, strict=True))


def rank_modulo(rows: Rows, prime: int) -> int:
    """The rank of the equations modulo a prime.

    An equation with one unknown left determines it; where there is none, the last unknown, which is
    one of lowest degree in t and q, is free. So few are free, as v dF/dq determines most of the
    higher ones. What is known is a linear form in the free ones, held as the coefficients of a
    polynomial: the rank is the number of those determined plus that of the equations left over.
    """
    lines = [[(at, int(one)) for at, one in row.items() if one % prime] for row in rows.values()]
    lines_with = dict[int, list[int]]()
    for place, line in enumerate(lines):
        for at, _ in line:
            lines_with.setdefault(at, []).append(place)
    left = [len(line) for line in lines]  # unknowns of each that are not known
    ready = [place for place, count in enumerate(left) if count == 1]
    forms, over = dict[int, nmod_poly](), list[nmod_poly]()
    zero, one, step = (nmod_poly(parts, prime) for parts in ([0], [1], [0, 1]))
    free = 0
    for unknown in sorted(lines_with, reverse=True):
        if unknown in forms:
            continue
        forms[unknown], one, free, found = one, one * step, free + 1, [unknown]
        while found:
            for place in chain.from_iterable(map(lines_with.__getitem__, found)):
                left[place] -= 1
                if left[place] < 2:
                    ready.append(place)
            found = []
            for place in ready:
                line, lines[place] = lines[place], []
                form, last = zero, None
                for at, value in line:
                    if at in forms:
                        form = form + forms[at] * value
                    else:
                        last, by = at, value
                if last is not None:
                    forms[last] = form * pow(-by, -1, prime)
                    found.append(last)
                elif form:
                    over.append(form)
            ready = []
    table = [form.coeffs() + [0] * (free - len(form.coeffs())) for form in over]
    return len(forms) - free + (int(nmod_mat(table, prime).rank()) if table else 0)


def blocks_of(rows: Rows) -> list[Block]:
    """The rows and columns of a matrix by connected blocks: even and odd ones, if f is even in v.

    A column without an entry belongs to no block.
    """
    home = dict[int, tuple[list[int], set[int]]]()  # of a column
    for name, row in rows.items():
        met = {id(block): block for column in row if (block := home.get(column)) is not None}
        whole, *others = sorted(met.values(), key=lambda one: -len(one[1])) or [([], set())]
        names, columns = whole
        for more, touched in others:
            names += more
            columns |= touched
            home.update(dict.fromkeys(touched, whole))
        names.append(name)
        columns.update(row)
        home.update(dict.fromkeys(row, whole))
    distinct = {id(block): block for block in home.values()}.values()
    return [(names, sorted(columns)) for names, columns in distinct]


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

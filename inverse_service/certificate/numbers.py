"""Two kinds of numbers: residues prove that a value is zero, balls that it is not.

A plan expresses the atoms (powers, logarithms, angles) by independent ones. It is guessed from
decimals and proven in the residues.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from hashlib import blake2b
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import flint
from flint import arb, fmpq, fmpz

from .formulas import MAX_POWER, ORDERED, SPECIAL, Incomplete, Order, is_real_everywhere

if TYPE_CHECKING:
    from .question import Question

MAX_SPLIT = 1024  # points drawn to find one at which all roots exist
MAX_WIDE = 1 << 64
MAX_CHOICES = 64
MAX_SCALE = 4096
MAX_TURNS = 720
MAX_RELATED = 24
MAX_SEARCHES = 12
MAX_SIZE = arb(2) ** 20_000  # of numbers that are written as fractions
SPARE = 4  # points more than there are independent atoms
# Pairs (l, e): (1, e), (i, e^i), (pi i, -1), (log 2, 2), (log 3, 3); see Pair.
CONSTANTS = (
    (False, False, 1), (True, False, 1), (True, False, -1, 12), (False, True, 2, 2),
    (False, True, 3, 2),
)  # fmt: skip
ONE, TURN, PI, TWO, THREE = range(5)  # places in CONSTANTS

Number = Any  # a residue or a ball
# Coefficients of monomials: eight bits for each exponent, the total degree on top of them.
Series = dict[int, Number]
Arithmetic = Any  # Residues or Balls


class Undefined(Exception):
    """A formula is not defined at the current point."""


class Unsettled(Exception):
    """A ball does not decide the question, but more digits may."""


class Met(Exception):
    """Everything requested has been read."""


class Atom(NamedTuple):
    """l of exp(l) = e as encountered, from a logarithm or an angle (e is given) or not.

    If imaginary, exp(i l) = e.
    """

    logarithm: bool
    imaginary: bool
    value: arb


@dataclass(slots=True)
class Pair:
    """(l, e) with e = exp(l), where l is real or imaginary.

    It comes from a logarithm (e is given) or not; `number` is 1 or a prime.
    """

    imaginary: bool
    logarithm: bool
    number: int = 0
    scale: int = 1  # N: the generator is r with r^N = e


@dataclass(frozen=True, slots=True)
class Entry:
    """An atom: a new pair or a combination sum a_j l_j.

    The test of log w is w^times = prod e_j^(times a_j).
    """

    pair: int = 0
    parts: tuple[tuple[int, Fraction], ...] = ()
    times: int = 1


class Root(NamedTuple):
    """For r^N = w: N, and the nesting depth of roots of functions, including this one."""

    degree: int
    depth: int


def exactly(value: arb) -> Fraction:
    """The midpoint.

    0 if it is too large or too small for a fraction; such a value is not used in guesses.
    """
    middle = value.mid()
    if not MAX_SIZE**-1 < abs(middle) < MAX_SIZE:
        return Fraction(0)
    exact = middle.fmpq()
    return Fraction(int(exact.p), int(exact.q))


def are_alike(one: list[Atom], other: list[Atom]) -> bool:
    """Whether the atoms at a point are met in the same order in both, as far as balls tell."""
    return len(one) == len(other) and all(
        a[:2] == b[:2] and a.value.overlaps(b.value) for a, b in zip(one, other, strict=True)
    )


def count_distinct(trace: list[Atom]) -> int:
    """The number of atoms that are not k/24 times another one, as 3/2 log w is a multiple of log
    w.
    """
    kept: list[tuple[bool, float]] = []
    for atom in trace:
        value = float(atom.value.mid())
        ratios = [24 * value / other for kind, other in kept if kind == atom.imaginary]
        if value and all(
            abs(ratio - round(ratio)) > 1e-9 for ratio in ratios if 0.5 < abs(ratio) < 9999
        ):
            kept.append((atom.imaginary, value))
    return len(kept)


class Plan:
    """The expressions of the atoms, in the order of reading, by independent ones.

    They are guessed from decimals and proven elsewhere. `traces` are the atoms at points near the
    place, first at the place itself, with `bits` of precision.
    """

    def __init__(
        self, traces: list[list[Atom]], bits: int, check_time: Callable[[], None] = lambda: None
    ) -> None:
        self.bits = bits
        self.split = 1  # the product of the N of functions
        self.roots = list[Root]()  # roots of functions, in the order of reading
        self.entries = list[Entry]()
        self.turns = 1  # a multiple of the N of functions
        self.choices = [dict[int, int]()]  # see every_choice
        # Of the arguments of arbitrary functions, in the order of reading.
        self.classes: list[int] | None = None
        self.searches = 0
        self.halved = False  # whether half an arctangent's argument is an angle: see Residues.angle
        self.pairs = [Pair(*row) for row in CONSTANTS if traces and traces[0]]
        self.count = len(traces)
        constants = (arb(1), arb(1), arb.pi(), arb(2).log(), arb(3).log())
        self.values = [[value] * self.count for value in constants]
        ones = [arb(1)] * self.count
        self.basis: dict[bool, list[tuple[list[arb], int, dict[int, arb]]]] = {
            False: [(ones, 0, {ONE: arb(1)})], True: [(ones, 0, {TURN: arb(1)})]}  # fmt: skip
        for number, atom in enumerate(traces[0] if traces else ()):
            check_time()
            exact = [trace[number].value for trace in traces]
            self.entries.append(self.entry(atom.logarithm, atom.imaginary, exact))

    def entry(self, logarithm: bool, imaginary: bool, exact: list[arb]) -> Entry:
        values = [value.mid() for value in exact]
        if all(value.contains(0) for value in exact):
            values = [arb(0)] * self.count
        parts = None if imaginary else self.multiple(values)
        if parts and (self.moderate(parts) if logarithm else self.refined(parts)):
            return self.combination(parts, logarithm, imaginary, exact[0])
        rest, found = self.reduced(values, imaginary)
        largest = max(map(abs, values))
        small = all(abs(value) <= self.small() * largest for value in rest)
        for attempt in (self.rational, self.related) if small else ():
            parts = attempt(values, found, imaginary)
            if parts is not None and (self.moderate(parts) if logarithm else self.refined(parts)):
                return self.combination(parts, logarithm, imaginary, exact[0])
        self.pairs.append(Pair(imaginary, logarithm))
        self.values.append(exact)
        if not small and len(self.basis[imaginary]) < self.count - SPARE:
            place = max(range(self.count), key=lambda k: float(abs(rest[k]) / largest))
            new = {len(self.pairs) - 1: arb(1)} | {j: -a for j, a in found.items()}
            self.basis[imaginary].append((rest, place, new))
        return Entry(len(self.pairs) - 1)

    def small(self) -> arb:
        return arb(2) ** (-self.bits // 3)

    def multiple(self, values: list[arb]) -> dict[int, Fraction] | None:
        """{j: k/24} if the values are k/24 times those of a previous real function, else None."""
        least = self.small() * max(map(abs, values))
        for j, (pair, others) in enumerate(zip(self.pairs, self.values, strict=True)):
            if pair.imaginary or pair.number or not (other := float(others[0])):
                continue
            times = fmpq(round(24 * float(values[0]) / other), 24)
            pairs = zip(values, others, strict=True)
            if times != 0 and all(abs(a - times * b) <= least for a, b in pairs):
                return {j: Fraction(int(times.p), int(times.q))}
        return None

    def reduced(self, values: list[arb], imaginary: bool) -> tuple[list[arb], dict[int, arb]]:
        """The values reduced by the earlier pairs, and the subtracted combination of these."""
        rest, found = values, dict[int, arb]()
        for vector, place, combination in self.basis[imaginary]:
            factor = (rest[place] / vector[place]).mid()
            rest = [(a - factor * b).mid() for a, b in zip(rest, vector, strict=True)]
            for j, a in combination.items():
                found[j] = (found.get(j, 0) + factor * a).mid()
        return rest, found

    def fraction(self, value: arb) -> Fraction | None:
        """The simple fraction that agrees with the value to all digits, or None."""
        if abs(value) < self.small():
            return Fraction(0)
        simple = exactly(value).limit_denominator(1 << 40)
        rest = abs(value - fmpq(simple.numerator, simple.denominator))
        return simple if rest < self.small() else None

    def rational(
        self, values: list[arb], found: dict[int, arb], imaginary: bool
    ) -> dict[int, Fraction] | None:
        """The combination with rational coefficients.

        Its constant is a multiple of pi, of 1, or of a logarithm.
        """
        unit = TURN if imaginary else ONE
        parts = {j: self.fraction(a) for j, a in found.items() if j != unit}
        known = {j: a for j, a in parts.items() if a}
        if None in parts.values():
            return None
        constant = found[unit]
        if abs(constant) <= self.small() * max([abs(value) for value in values]):
            return known
        if (
            imaginary
            and (turns := self.fraction(constant / arb.pi())) is not None
            and turns.denominator <= 1 << 12
        ):
            return known | {PI: turns}
        if (simple := self.fraction(constant)) is not None:
            return known | {unit: simple}
        for times in () if imaginary or abs(constant) > 50 else (1, 2, 3, 4, 6):
            primes = self.factored((constant * times).exp())
            if primes is not None:
                return known | {j: a / times + known.get(j, 0) for j, a in primes.items()}
        return None

    def factored(self, value: arb) -> dict[int, Fraction] | None:
        """{pair of a prime number: exponent} for a rational number."""
        simple = exactly(value).limit_denominator(1 << self.bits // 8)
        above, below = simple.numerator, simple.denominator
        if (
            max(above, below).bit_length() > 100
            or abs(value - fmpq(above, below)) > self.small() * value
        ):
            return None
        factors = [(int(q), k) for q, k in fmpz(above).factor()]
        factors += [(int(q), -k) for q, k in fmpz(below).factor()]
        for prime, _ in factors:
            if prime not in [pair.number for pair in self.pairs]:
                self.pairs.append(Pair(False, True, prime))
                self.values.append([arb(prime).log()] * self.count)
        numbers = [pair.number for pair in self.pairs]
        return {numbers.index(prime, 2): Fraction(exponent) for prime, exponent in factors}

    def related(
        self, values: list[arb], found: dict[int, arb], imaginary: bool
    ) -> dict[int, Fraction] | None:
        """The shortest linear relation with integer coefficients among the values and those of all
        pairs (LLL).
        """
        self.searches += 1
        if self.searches > MAX_SEARCHES:
            return None
        near = [j for j, pair in enumerate(self.pairs) if pair.imaginary == imaginary][:MAX_RELATED]
        columns, taken = [values, *(self.values[j] for j in near)], range(min(self.count, 6))
        scale = max(abs(value) for value in values)
        rows = [[int(a == b) for b in range(len(columns))] for a in range(len(columns))]
        for line, column in zip(rows, columns, strict=True):
            line += [self.fixed(column[k] / scale) for k in taken]
        for row in flint.fmpz_mat(rows).lll().tolist():
            head = [int(a) for a in row[: len(columns)]]
            tail = [int(a) for a in row[len(columns) :]]
            if head[0] and max(map(abs, head)) < 1 << 16 and max(map(abs, tail)) < 1 << 30:
                return {j: Fraction(-a, head[0]) for j, a in zip(near, head[1:], strict=True) if a}
        return None

    def fixed(self, value: arb) -> int:
        return math.floor(exactly(value * arb(2) ** (self.bits // 4)))

    def refined(self, parts: dict[int, Fraction]) -> bool:
        """Refine the generators for these exponents; False if too many would be needed."""
        scales = {j: math.lcm(self.pairs[j].scale, a.denominator) for j, a in parts.items()}
        roots = [j for j, pair in enumerate(self.pairs) if pair.logarithm and not pair.number]
        split = math.prod([scales.get(j, self.pairs[j].scale) for j in roots])
        bounds = (
            (MAX_TURNS if j == PI else 24 if self.pairs[j].number > 1 else MAX_SCALE)
            for j in scales
        )
        good = split <= MAX_WIDE and all(
            scale <= most for scale, most in zip(scales.values(), bounds, strict=True)
        )
        if good and all(abs(a) * scales[j] <= MAX_POWER for j, a in parts.items()):
            self.split = split
            self.turns = math.lcm(self.turns, *[scales[j] for j in roots if j in scales])
            for j, scale in scales.items():
                self.halved |= (
                    self.pairs[j].imaginary and self.pairs[j].logarithm and scale % 2 == 0
                )
                self.pairs[j].scale = scale
            return True
        return False

    @property
    def wide(self) -> bool:
        """Whether the numbers are in GF(p^2), where every number modulo p is a square."""
        return self.split > MAX_SPLIT

    @property
    def draws(self) -> int:
        """The mean number of points drawn per point at which all roots exist."""
        free = Root(2, 1) if self.wide else None
        return math.prod([root.degree for root in self.roots if root != free])

    def every_choice(self) -> list[dict[int, int]]:
        """Each choice k of the roots r_j z_j^k_j of functions, where z_j is a root of unity."""
        if self.split > MAX_CHOICES:
            raise Incomplete(
                f"Roots that depend on each other have more than {MAX_CHOICES} choices."
            )
        scales = {
            j: pair.scale for j, pair in enumerate(self.pairs) if pair.logarithm and not pair.number
        }
        choices = product(*map(range, scales.values()))
        return [dict(zip(scales, choice, strict=True)) for choice in choices]

    def moderate(self, parts: dict[int, Fraction]) -> bool:
        times = math.lcm(*[a.denominator for j, a in parts.items() if j != PI])
        return times <= 48 and all(
            abs(a) * times * self.pairs[j].scale <= MAX_POWER for j, a in parts.items()
        )

    def combination(
        self, parts: dict[int, Fraction], logarithm: bool, imaginary: bool, exact: arb
    ) -> Entry:
        """The entry of a combination; for an imaginary logarithm, a ball at the place determines
        the multiple of pi.
        """
        times = math.lcm(*[a.denominator for j, a in parts.items() if j != PI])
        if logarithm and imaginary:
            part = math.lcm(12, parts.pop(PI, Fraction(1)).denominator) * times
            known = {j: fmpq(a.numerator, a.denominator) for j, a in parts.items()}
            rest = exact - sum([self.values[j][0] * a for j, a in known.items()])
            whole = (rest / arb.pi() * part).unique_fmpz()
            if whole is None:
                raise Incomplete("The branch of an arctangent could not be determined.")
            parts, times = parts | {PI: Fraction(int(whole), part)}, 2 * part
        return Entry(0, tuple((j, a) for j, a in parts.items() if a), times)


@lru_cache(maxsize=1 << 14)  # each reading of the formulas at a point asks for them again
def drawn_for(text: str, prime: int) -> int:
    """A random number modulo the prime, the same for the same text, which holds a random seed."""
    return int.from_bytes(blake2b(text.encode(), digest_size=40).digest(), "big") % prime


@lru_cache(maxsize=16)  # many points have one prime
def field_of_squares(prime: int) -> Any:
    """GF(p^2); finding a polynomial for it takes as long as reading all formulas."""
    return flint.fq_default_ctx(prime, 2)


class Residues:
    """Numbers modulo a prime: random values of all generators, one for all choices of roots.

    They are integers and, if the plan is wide, also other elements of GF(p^2), so that the square
    roots of integers exist at every point.
    """

    pivot: Any = staticmethod(min)  # among the places where a row is not 0

    def __init__(self, question: Question, prime: int, seed: int, choice: dict[int, int]) -> None:
        self.question = question
        self.prime = prime
        self.seed = seed
        self.plan = question.plan
        self.field = field_of_squares(prime) if self.plan.wide else None
        self.choice = choice
        self.generator, self.entries = random.Random(seed), iter(self.plan.entries)
        self.powers, self.classes, self.large = dict[int, tuple[int, int]](), list[int](), 0
        self.known = dict[tuple[str, tuple[int, ...]], int]()
        self.values = {
            name: self.generator.randrange(1, prime) for name in ("pi", *sorted(question.names))
        }
        # For each pair (l, e), the values of l and of r with r^N = e.
        self.pairs = list[tuple[int, int]]()
        if self.plan.pairs:
            self.draw_pairs()

    def draw_pairs(self) -> None:
        prime, plan, draw = self.prime, self.plan, self.generator.randrange
        self.i = self.number_roots(-1, 2)[0]
        self.turn = self.root_of_order(1, plan.turns, plan.turns)
        for pair in plan.pairs:
            logarithm, root = draw(1, prime), draw(1, prime)
            if pair.number > 1:
                root = self.number_roots(pair.number, pair.scale)[0]
            self.pairs.append((1 if pair.number in (1, -1) else logarithm, root))
        two, three = (pow(self.pairs[k][1], plan.pairs[k].scale // 2, prime) for k in (TWO, THREE))
        # e^(pi i/12)
        zeta = (two * three + two + self.i * (two * three - two)) * self.inverse(4)
        parts = plan.pairs[PI].scale
        fine = self.root_of_order(zeta % prime, parts // 12, 2 * parts)
        self.pairs[PI] = self.values["pi"], fine
        # sqrt q, or i sqrt q, is a sum of powers of e^(2 pi i/q) (Gauss)
        for k, pair in enumerate(plan.pairs):
            if pair.number > 3 and pair.scale % 2 == 0 and parts % (q := pair.number) == 0:
                step = pow(fine, 2 * parts // q, prime)
                gauss = sum(pow(step, a, prime) * fmpz(a).jacobi(q) for a in range(1, q))
                square = gauss * (1 if q % 4 == 1 else self.inverse(self.i)) % prime
                roots = self.number_roots(q, pair.scale)
                root = next(r for r in roots if pow(r, pair.scale // 2, prime) == square)
                self.pairs[k] = self.pairs[k][0], root

    def number_roots(self, value: Number, degree: int) -> list[Number]:
        """The roots of a number, the same at all points modulo the prime."""
        key, known = (self.prime, self.field is None, value, degree), self.question.number_roots
        if key not in known:
            known[key] = self.roots(value, degree)
        found: list[Number] = known[key]
        return found

    def root_of_order(self, value: int, degree: int, order: int) -> Number:
        return next(z for z in self.number_roots(value, degree) if self.has_order(z, order))

    def has_order(self, value: int, order: int) -> bool:
        return all(pow(value, order // int(q), self.prime) != 1 for q, _ in fmpz(order).factor())

    def again(self) -> Residues:
        """A copy in the state before any formula was read."""
        return Residues(self.question, self.prime, self.seed, self.choice)

    def draw(self) -> int:
        return self.question.generator.randrange(self.prime)

    def settle(self, raw: Series) -> Series:
        """The series without zero coefficients."""
        if self.field:
            return {key: rest for key, value in raw.items() if (rest := self.reduced(value))}
        prime = self.prime
        return {key: rest for key, value in raw.items() if (rest := value % prime)}

    def reduced(self, value: Number) -> Number:
        """The unique representation of the number: an integer if it is a number modulo p."""
        if not isinstance(value, int):
            whole, *rest = (int(part) for part in value.to_list())
            if any(rest):
                return value
            value = whole
        return value % self.prime

    def number(self, value: Fraction) -> Number:
        return value.numerator * self.inverse(value.denominator) % self.prime

    def inverse(self, value: Number) -> Number:
        value = self.reduced(value)
        if not value:
            raise Undefined
        return pow(value, -1, self.prime) if isinstance(value, int) else 1 / value

    def moderate_power(self, value: Number, exponent: int) -> Number:
        value = value if exponent >= 0 else self.inverse(value)
        if isinstance(value, int):
            return pow(value, abs(exponent), self.prime)
        return self.reduced(value ** abs(exponent))

    def power(self, value: Number, exponent: int) -> Number:
        """value^exponent; beyond MAX_POWER, a separate generator times a moderate power.

        The base must not be zero.
        """
        if abs(exponent) <= MAX_POWER:
            return self.moderate_power(value, exponent)
        self.inverse(value)
        self.large += 1
        start, free = self.powers.get(value, (0, 0))
        if abs(exponent - start) > MAX_POWER:
            start, free = self.powers[value] = exponent, self.jet("^", self.large, ())
        return self.reduced(free * self.moderate_power(value, exponent - start))

    def roots(self, value: Number, degree: int) -> list[Number]:
        """All solutions of r^degree = value, of which there must be `degree`."""
        if degree == 1:
            return [value]
        polynomial: Any = [self.reduced(-value), *[0] * (degree - 1), 1]
        if not polynomial[0]:
            raise Undefined
        if self.field:
            solved = flint.fq_default_poly_ctx(self.field)(polynomial).roots()
            found = sorted([self.reduced(root) for root, _ in solved], key=str)
        else:
            found = sorted(int(root) for root, _ in flint.nmod_poly(polynomial, self.prime).roots())
        if len(found) < degree:
            raise Undefined
        return found

    def root(self, value: Number, degree: int) -> Number:
        return self.roots(value, degree)[0]

    def product(self, entry: Entry, times: int = 1) -> Number:
        """The product of the e_j^(times a_j) of a combination, from their roots."""
        value: Number = 1
        for j, a in entry.parts:
            exponent = int(a * self.plan.pairs[j].scale * times)
            value = self.reduced(value * self.moderate_power(self.pairs[j][1], exponent))
        return value

    def total(self, entry: Entry) -> Number:
        return self.reduced(sum([self.pairs[j][0] * self.number(a) for j, a in entry.parts]))

    def same(self, left: Number, right: Number) -> None:
        if self.reduced(left - right):
            raise Incomplete(
                "A relation between functions was guessed that does not hold for all roots."
            )

    def exp(self, value: Number) -> Number:
        """e^l for an l with this value; e^(i l) if it is imaginary."""
        entry = next(self.entries)
        if entry.pair:
            self.pairs[entry.pair] = value, self.pairs[entry.pair][1]
            return self.moderate_power(self.pairs[entry.pair][1], self.plan.pairs[entry.pair].scale)
        self.same(value, self.total(entry))
        return self.product(entry)

    def log(self, value: Number) -> Number:
        """l with e^l equal to this value; l/i if it is imaginary."""
        entry = next(self.entries)
        self.inverse(value)
        if entry.pair:
            degree = self.plan.pairs[entry.pair].scale
            steps = self.plan.turns // degree * self.choice.get(entry.pair, 0)
            turn = pow(self.turn, steps, self.prime)
            root = self.reduced(self.root(value, degree) * turn)
            self.pairs[entry.pair] = self.pairs[entry.pair][0], root
            return self.pairs[entry.pair][0]
        self.same(self.moderate_power(value, entry.times), self.product(entry, entry.times))
        return self.total(entry)

    def circle(self, value: Number) -> tuple[Number, Number]:
        """(sin, cos) = ((E - 1/E)/2i, (E + 1/E)/2)."""
        there = self.exp(value)
        back, half = self.inverse(there), self.inverse(2)
        sine = (there - back) * half * self.inverse(self.i)
        return self.reduced(sine), self.reduced((there + back) * half)

    def angle(self, value: Number) -> Number:
        """atan u = log((1 + iu)/(1 - iu))/2i.

        If halves of it are angles, it is log((1 + iu)/sqrt(1 + u^2))/i.
        """
        turn, half = value * self.i, self.inverse(2)
        if self.question.halves:
            length = self.exp(self.reduced(self.log(self.reduced(value * value + 1)) * half))
            return self.log(self.reduced((turn + 1) * self.inverse(length)))
        whole = self.log(self.reduced((turn + 1) * self.inverse(1 - turn)))
        return self.reduced(whole * half)

    def class_of(self, name: str, values: list[Number]) -> int:
        """The class of the arguments; arguments that are equal in the ring share a class."""
        key = name, tuple(map(self.reduced, values))
        self.classes.append(self.known.setdefault(key, len(self.known)))
        return self.classes[-1]

    def jet(self, name: str, number: int, orders: tuple[int, ...]) -> int:
        """A derivative of a function: a random number, the same for the same class."""
        return drawn_for(f"{self.seed} {(name, number, orders)}", self.prime)

    def special(
        self, name: str, number: int, derivative: int, at: list[Number], order: Order
    ) -> int:
        """An independent derivative of a special function, or the function of the next order: a
        random number.
        """
        return self.jet(name, number, (derivative,))

    def determinant(self, matrix: list[list[Number]]) -> Number:
        rows, found = [[self.reduced(entry) for entry in row] for row in matrix], 1
        if not self.field:
            return int(flint.nmod_mat(rows, self.prime).det())
        while rows:
            pivot = next((row for row in rows if row[0]), None)
            if pivot is None:
                return 0
            found = self.reduced(found * pivot[0] * (-1) ** rows.index(pivot))
            rows.remove(pivot)
            scale = self.inverse(pivot[0])
            for k, row in enumerate(rows):
                factor = self.reduced(row[0] * scale)
                rows[k] = [
                    self.reduced(a - factor * b) for a, b in zip(row[1:], pivot[1:], strict=True)
                ]
        return found

    def regular(self, matrix: list[list[Number]]) -> bool:
        """Whether the determinant is not zero."""
        return bool(self.determinant(matrix))


class Witnesses(Residues):
    """Collect the radicands w of the roots r^N = w of one depth.

    Roots of this or greater depth are random numbers, so that reading can continue.
    """

    def __init__(self, question: Question, prime: int, seed: int, depth: int) -> None:
        super().__init__(question, prime, seed, {})
        self.depth, self.roots_met, self.found = depth, 0, list[tuple[int, int]]()
        self.last = max(k for k, root in enumerate(self.plan.roots, 1) if root.depth == depth)

    def root(self, value: int, degree: int) -> Number:
        if degree == 1:
            return value
        depth, self.roots_met = self.plan.roots[self.roots_met].depth, self.roots_met + 1
        if depth < self.depth:
            root = self.roots(value, degree)[0]
            if not isinstance(root, int):  # it exists in GF(p^2) only
                raise Undefined
            return root
        if depth == self.depth:
            self.found.append((value, degree))
        if self.roots_met == self.last:
            raise Met
        return self.generator.randrange(1, self.prime)

    def same(self, left: int, right: int) -> None:
        """Skip the test, because relations between roots are false for random numbers."""

    def logarithms(self, q: int) -> list[int]:
        """The logarithms modulo q, to any base, of the radicands of roots with q | N."""
        order = (self.prime - 1) // q
        powers = [pow(value, order, self.prime) for value, degree in self.found if not degree % q]
        base = next((power for power in powers if power != 1), 1)
        table = {pow(base, e, self.prime): e for e in reversed(range(q))}  # 0 for the value 1
        return [table[power] for power in powers]


@dataclass(slots=True)
class Place:
    """An exact real point, and the derivatives of the arbitrary functions there.

    It is within 2^-(5 + closer) of its parent, relative to the size of each number.
    """

    generator: random.Random
    values: dict[str, Fraction]
    parent: Place | None = None
    closer: int = 0
    jets: dict[tuple[str, int, tuple[int, ...]], Fraction] = field(default_factory=dict)

    def near(self, value: Fraction) -> Fraction:
        """A random number near `value`, relative to its size."""
        step = Fraction(self.generator.randrange(-(1 << 30), 1 << 30), 1 << 35 + self.closer)
        return value + step * (abs(value) or 1)

    def jet(self, key: tuple[str, int, tuple[int, ...]]) -> Fraction:
        if key not in self.jets:
            fresh = Fraction(self.generator.randrange(-(1 << 30), 1 << 30), 1 << 30)
            self.jets[key] = self.near(self.parent.jet(key)) if self.parent else fresh
        return self.jets[key]

    def neighbor(self, closer: int = 0) -> Place:
        found = Place(self.generator, {}, self, closer=closer)
        found.values |= {name: found.near(value) for name, value in self.values.items()}
        return found


class Balls:
    """Real numbers at a place, as balls of the working precision (arb).

    `trace` collects l of each atom encountered.
    """

    prime = 0

    def __init__(self, question: Question, place: Place, classes: list[int] | None) -> None:
        self.question = question
        self.place = place
        self.given = classes
        self.classes = iter(classes or [])
        self.guessing, self.trace = classes is None, list[Atom]()
        self.known, self.met = dict[int, tuple[str, list[arb]]](), list[int]()
        self.values = {name: self.number(value) for name, value in place.values.items()}
        self.values["pi"] = arb.pi()

    def again(self) -> Balls:
        """A copy in the state before any formula was read."""
        return Balls(self.question, self.place, self.given)

    def draw(self) -> arb:
        return arb(self.question.generator.randrange(-9999, 10_000)) / 1000

    def settle(self, raw: Series) -> Series:
        found = {
            key: value for key, value in raw.items() if not (type(value) is int or value.is_zero())
        }
        if not all(value.is_finite() for value in found.values()):
            raise Unsettled
        return found

    def number(self, value: Fraction) -> arb:
        return arb(fmpq(value.numerator, value.denominator))

    def inverse(self, value: arb) -> arb:
        return 1 / self.nonzero(value)

    def nonzero(self, value: arb) -> arb:
        """The number if it is not zero, else Unsettled.

        A formula may have no value at single points.
        """
        if not value.is_finite() or value.contains(0):
            raise Unsettled
        return value

    def power(self, value: arb, exponent: int) -> arb:
        # arb's power of a ball that contains zero is NaN.
        if 0 <= exponent <= MAX_POWER:
            half = self.power(value, exponent // 2) if exponent > 1 else arb(1)
            return half * half * value if exponent % 2 else half * half
        return self.nonzero(value) ** fmpz(exponent)

    def note(self, atom: Atom) -> arb:
        """Its value, which is kept in the trace."""
        if not atom.value.is_finite():
            raise Unsettled
        self.trace.append(atom)
        return atom.value

    def exp(self, value: arb) -> arb:
        return self.note(Atom(logarithm=False, imaginary=False, value=value)).exp()

    def log(self, value: arb) -> arb:
        if value < 0:
            raise Undefined
        if not value > 0:
            raise Unsettled
        return self.note(Atom(logarithm=True, imaginary=False, value=value.log()))

    def circle(self, value: arb) -> tuple[arb, arb]:
        return self.note(Atom(logarithm=False, imaginary=True, value=value)).sin_cos()

    def angle(self, value: arb) -> arb:
        if self.question.halves:
            self.exp(self.log(1 + value * value) / 2)
            return self.note(Atom(logarithm=True, imaginary=True, value=value.atan()))
        return self.note(Atom(logarithm=True, imaginary=True, value=2 * value.atan())) / 2

    def class_of(self, name: str, values: list[arb]) -> int:
        """The class that the ring found for this call.

        Its arguments must be disjoint from those of all other classes.
        """
        near = [number for number, (other, met) in self.known.items() if other == name
                and all(a.overlaps(b) for a, b in zip(values, met, strict=True))]  # fmt: skip
        number = (near[0] if near else len(self.known)) if self.guessing else next(self.classes)
        if any(one != number for one in near):
            raise Unsettled
        self.known.setdefault(number, (name, values))
        self.met.append(number)
        return number

    def jet(self, name: str, number: int, orders: tuple[int, ...]) -> arb:
        return self.number(self.place.jet((name, number, orders)))

    def special(
        self, name: str, number: int, derivative: int, at: list[Number], order: Order
    ) -> arb:
        """The value of a special function, of a derivative of digamma, or of the next order."""
        (*orders, u), law = at, SPECIAL[name]
        if law.least is not None and not is_real_everywhere(name, order):
            least = law.least()
            if u < least:
                raise Undefined
            if not u > least:
                raise Unsettled
        value = law.value(u, *([sum(orders) + derivative] if name in ORDERED else []))
        if not value.is_finite():
            raise Unsettled
        return value

    def regular(self, matrix: list[list[Number]]) -> bool:
        """True if the balls show that the determinant is not zero, else Unsettled."""
        determinant = flint.arb_mat([[arb(entry) for entry in row] for row in matrix]).det()
        if not determinant.is_finite() or determinant.contains(0):
            raise Unsettled
        return True

"""The two kinds of numbers: residues, which decide what is zero, and balls, which decide what is not."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from flint import arb, arb_mat, fmpq, fmpz, nmod_mat, nmod_poly

from .formulas import MAX_POWER, Ended
from .plan import PI, THREE, TWO, Entry

if TYPE_CHECKING:
    from .checker import Question

Number = Any  # a residue or a ball
Series = dict[int, Number]  # coefficients of monomials: eight bits for each exponent, the total degree on top of them


class Undefined(Exception):
    """A formula is not defined at the point in hand."""


class Unsettled(Exception):
    """A ball does not say what is asked of it: more digits may."""


class Residues:
    """Numbers modulo a prime: random values of all generators, the same for each choice of the roots."""

    pivot: Any = staticmethod(min)  # of the places where a row is not 0

    def __init__(self, question: Question, prime: int, seed: int, choice: dict[int, int]) -> None:
        self.question, self.prime, self.seed, self.plan, self.choice = question, prime, seed, question.plan, choice
        self.generator, self.entries = random.Random(seed), iter(self.plan.entries)
        self.powers, self.classes, self.large = dict[int, tuple[int, int]](), list[int](), 0
        self.known = dict[tuple[str, tuple[int, ...]], int]()
        self.values = {name: self.generator.randrange(1, prime) for name in ("pi", *sorted(question.names))}
        self.pairs = list[tuple[int, int]]()  # of a pair (l, e) the values of l and of r, where r^N = e
        if self.plan.pairs:
            self.i, turns = self.roots(-1, 2)[0], self.plan.turns
            self.turn = next(z for z in self.roots(1, turns) if self.has_order(z, turns))
            for pair in self.plan.pairs:
                free = self.generator.randrange(1, prime), self.generator.randrange(1, prime)
                number = (free[0], self.roots(pair.number, pair.scale)[0]) if pair.number > 1 else (1, free[1])
                self.pairs.append(number if pair.number else free)
            two, three = (pow(self.pairs[k][1], self.plan.pairs[k].scale // 2, prime) for k in (TWO, THREE))
            zeta = (two * three + two + self.i * (two * three - two)) * self.inverse(4)  # e^(pi i/12)
            parts = self.plan.pairs[PI].scale
            fine = next(z for z in self.roots(zeta % prime, parts // 12) if self.has_order(z, 2 * parts))
            self.pairs[PI] = self.values["pi"], fine
            # sqrt q, or i sqrt q, is a sum of powers of e^(2 pi i/q) (Gauss)
            for k, pair in enumerate(self.plan.pairs):
                if pair.number > 3 and pair.scale % 2 == 0 and parts % (q := pair.number) == 0:
                    gauss = sum([pow(fine, 2 * parts // q * a, prime) * fmpz(a).jacobi(q) for a in range(1, q)])
                    square = gauss * (1 if q % 4 == 1 else self.inverse(self.i)) % prime
                    found = [r for r in self.roots(q, pair.scale) if pow(r, pair.scale // 2, prime) == square]
                    self.pairs[k] = self.pairs[k][0], found[0]

    def has_order(self, value: int, order: int) -> bool:
        return all(pow(value, order // int(q), self.prime) != 1 for q, _ in fmpz(order).factor())

    def again(self) -> Residues:
        """The same, before any formula was read."""
        return Residues(self.question, self.prime, self.seed, self.choice)

    def draw(self) -> int:
        return self.question.generator.randrange(self.prime)

    def settle(self, raw: Series) -> Series:
        """The numbers without zeros."""
        prime = self.prime
        return {key: rest for key, value in raw.items() if (rest := value % prime)}

    def number(self, value: Fraction) -> int:
        return value.numerator * self.inverse(value.denominator) % self.prime

    def inverse(self, value: int) -> int:
        if value % self.prime == 0:
            raise Undefined
        return pow(value, -1, self.prime)

    def moderate_power(self, value: int, exponent: int) -> int:
        return pow(value if exponent >= 0 else self.inverse(value), abs(exponent), self.prime)

    def power(self, value: int, exponent: int) -> int:
        """Beyond MAX_POWER a generator of its own, times a moderate power; it needs a base that is not zero."""
        if abs(exponent) <= MAX_POWER:
            return self.moderate_power(value, exponent)
        self.inverse(value)
        self.large += 1
        start, free = self.powers.get(value, (0, 0))
        if abs(exponent - start) > MAX_POWER:
            start, free = self.powers[value] = exponent, self.jet("^", self.large, ())
        return free * self.moderate_power(value, exponent - start) % self.prime

    def roots(self, value: int, degree: int) -> list[int]:
        """All solutions of r^degree = value, of which there have to be so many."""
        if degree == 1:
            return [value]
        found = nmod_poly([-value % self.prime, *[0] * (degree - 1), 1], self.prime).roots()
        if value % self.prime == 0 or len(found) < degree:
            raise Undefined
        return sorted(int(root) for root, _ in found)

    def root(self, value: int, degree: int) -> int:
        return self.roots(value, degree)[0]

    def product(self, entry: Entry, times: int = 1) -> int:
        """The product of the e_j^(times a_j) of a combination, from their roots."""
        value = 1
        for j, a in entry.parts:
            value = value * self.moderate_power(self.pairs[j][1], int(a * self.plan.pairs[j].scale * times))
        return value % self.prime

    def total(self, entry: Entry) -> int:
        return sum([self.pairs[j][0] * self.number(a) for j, a in entry.parts]) % self.prime

    def same(self, left: int, right: int) -> None:
        if (left - right) % self.prime:
            raise Ended("incomplete", "A relation between functions was guessed that does not hold for all roots.")

    def exp(self, value: int) -> int:
        """e^l for an l with this value; for an imaginary one i l."""
        entry = next(self.entries)
        if entry.pair:
            self.pairs[entry.pair] = value, self.pairs[entry.pair][1]
            return pow(self.pairs[entry.pair][1], self.plan.pairs[entry.pair].scale, self.prime)
        self.same(value, self.total(entry))
        return self.product(entry)

    def log(self, value: int) -> int:
        """l with e^l of this value; for an imaginary one l/i."""
        entry = next(self.entries)
        self.inverse(value)
        if entry.pair:
            degree = self.plan.pairs[entry.pair].scale
            turn = pow(self.turn, self.plan.turns // degree * self.choice.get(entry.pair, 0), self.prime)
            self.pairs[entry.pair] = self.pairs[entry.pair][0], self.root(value, degree) * turn % self.prime
            return self.pairs[entry.pair][0]
        self.same(pow(value, entry.times, self.prime), self.product(entry, entry.times))
        return self.total(entry)

    def circle(self, value: int) -> tuple[int, int]:
        """(sin, cos) = ((E - 1/E)/2i, (E + 1/E)/2)."""
        there = self.exp(value)
        back, half = self.inverse(there), self.inverse(2)
        return (there - back) * half * self.inverse(self.i) % self.prime, (there + back) * half % self.prime

    def angle(self, value: int) -> int:
        """atan u = log((1 + iu)/(1 - iu))/2i, or where halves of it are angles, log((1 + iu)/sqrt(1 + u^2))/i."""
        turn, half = value * self.i, self.inverse(2)
        if self.question.halves:
            length = self.exp(self.log((value * value + 1) % self.prime) * half % self.prime)
            return self.log((turn + 1) * self.inverse(length) % self.prime)
        return self.log((turn + 1) * self.inverse(1 - turn) % self.prime) * half % self.prime

    def class_of(self, name: str, values: list[int]) -> int:
        """Arguments that are equal in the ring are in one class."""
        key = name, tuple(value % self.prime for value in values)
        self.classes.append(self.known.setdefault(key, len(self.known)))
        return self.classes[-1]

    def jet(self, name: str, number: int, orders: tuple[int, ...]) -> int:
        """A derivative of a function: random, the same for the same class."""
        return random.Random(f"{self.seed} {(name, number, orders)}").randrange(self.prime)

    def regular(self, matrix: list[list[Number]]) -> bool:
        """Whether the determinant is not zero."""
        return int(nmod_mat([[int(entry % self.prime) for entry in row] for row in matrix], self.prime).det()) != 0


class Witnesses(Residues):
    """Counts the roots r^N = w that were passed; of the first that is not there, the primes q with w no q-th power."""

    passed, found = 0, frozenset[int]()

    def root(self, value: int, degree: int) -> int:
        if degree > 1 and value % self.prime:
            factors = (int(q) for q, _ in fmpz(degree).factor())
            self.found = frozenset(q for q in factors if pow(value, (self.prime - 1) // q, self.prime) != 1)
        root = super().root(value, degree)
        self.passed += degree > 1
        return root


@dataclass(slots=True)
class Place:
    """A real point, exactly, and at it derivatives of the arbitrary functions."""

    generator: random.Random
    values: dict[str, Fraction]
    parent: Place | None = None
    jets: dict[tuple[str, int, tuple[int, ...]], Fraction] = field(default_factory=dict)

    def near(self, value: Fraction) -> Fraction:
        """A number near another, beside its size."""
        step = Fraction(self.generator.randrange(-(1 << 30), 1 << 30), 1 << 35)
        return value + step * (abs(value) or 1)

    def jet(self, key: tuple[str, int, tuple[int, ...]]) -> Fraction:
        if key not in self.jets:
            fresh = Fraction(self.generator.randrange(-(1 << 30), 1 << 30), 1 << 30)
            self.jets[key] = self.near(self.parent.jet(key)) if self.parent else fresh
        return self.jets[key]

    def neighbor(self) -> Place:
        return Place(self.generator, {name: self.near(value) for name, value in self.values.items()}, self)


class Balls:
    """Real numbers at a place as balls of the working precision (arb); `trace` keeps l of each atom that was met."""

    prime = 0

    def __init__(self, question: Question, place: Place, classes: list[int] | None) -> None:
        self.question, self.place, self.given, self.classes = question, place, classes, iter(classes or [])
        self.guessing, self.trace = classes is None, list[tuple[bool, bool, arb]]()
        self.known, self.met = dict[int, tuple[str, list[arb]]](), list[int]()
        self.values = {name: self.number(value) for name, value in place.values.items()} | {"pi": arb.pi()}

    def again(self) -> Balls:
        """The same, before any formula was read."""
        return Balls(self.question, self.place, self.given)

    def draw(self) -> arb:
        return arb(self.question.generator.randrange(-9999, 10_000)) / 1000

    def settle(self, raw: Series) -> Series:
        found = {key: value for key, value in raw.items() if not (type(value) is int or value.is_zero())}
        if not all(value.is_finite() for value in found.values()):
            raise Unsettled
        return found

    def number(self, value: Fraction) -> arb:
        return arb(fmpq(value.numerator, value.denominator))

    def inverse(self, value: arb) -> arb:
        return 1 / self.nonzero(value)

    def nonzero(self, value: arb) -> arb:
        """The number, which is not zero, or nobody knows: a formula may have no value at single points."""
        if not value.is_finite() or value.contains(0):
            raise Unsettled
        return value

    def power(self, value: arb, exponent: int) -> arb:
        if 0 <= exponent <= MAX_POWER:  # arb's own power of a ball that contains zero is not a number
            half = self.power(value, exponent // 2) if exponent > 1 else arb(1)
            return half * half * value if exponent % 2 else half * half
        return self.nonzero(value) ** fmpz(exponent)

    def note(self, source: bool, imaginary: bool, value: arb) -> arb:
        if not value.is_finite():
            raise Unsettled
        self.trace.append((source, imaginary, value))
        return value

    def exp(self, value: arb) -> arb:
        return self.note(False, False, value).exp()

    def log(self, value: arb) -> arb:
        if value < 0:
            raise Undefined
        if not value > 0:
            raise Unsettled
        return self.note(True, False, value.log())

    def circle(self, value: arb) -> tuple[arb, arb]:
        return self.note(False, True, value).sin_cos()

    def angle(self, value: arb) -> arb:
        if self.question.halves:
            self.exp(self.log(1 + value * value) / 2)
            return self.note(True, True, value.atan())
        return self.note(True, True, 2 * value.atan()) / 2

    def class_of(self, name: str, values: list[arb]) -> int:
        """The class that the ring found for this call; its arguments have to lie apart from those of all others."""
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

    def regular(self, matrix: list[list[Number]]) -> bool:
        """The determinant is not zero, or nobody knows."""
        determinant = arb_mat([[arb(entry) for entry in row] for row in matrix]).det()
        if not determinant.is_finite() or determinant.contains(0):
            raise Unsettled
        return True


Arithmetic = Any  # Residues or Balls

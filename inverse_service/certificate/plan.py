"""How the atoms of a document come from independent ones: guessed here from decimals, proven in the rings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from flint import arb, fmpq, fmpz, fmpz_mat

from .formulas import MAX_POWER, Ended

MAX_SPLIT, MAX_CHOICES, MAX_SCALE, MAX_TURNS, MAX_RELATED, MAX_SEARCHES = 1024, 64, 4096, 720, 24, 12
MAX_SIZE = arb(2) ** 20_000  # of numbers that are written as fractions
SPARE = 4  # points more than there are independent atoms
ONE, TURN, PI, TWO, THREE = 0, 1, 2, 3, 4  # the pairs (1, e), (i, e^i), (pi i, -1), (log 2, 2), (log 3, 3)


@dataclass(slots=True)
class Pair:
    """(l, e) with e = exp(l): l real or imaginary; of a logarithm (e is given) or not; of a number, 1 or a prime."""

    imaginary: bool
    logarithm: bool
    number: int = 0
    scale: int = 1  # N: the generator is r with r^N = e


@dataclass(frozen=True, slots=True)
class Entry:
    """An atom is a new pair or a combination sum a_j l_j; of log w the test is w^times = prod e_j^(times a_j)."""

    pair: int = 0
    parts: tuple[tuple[int, Fraction], ...] = ()
    times: int = 1


def exactly(value: arb) -> Fraction:
    """The midpoint; 0 for one that is too large or too small for a fraction: it takes part in no guess."""
    middle = value.mid()
    if not MAX_SIZE**-1 < abs(middle) < MAX_SIZE:
        return Fraction(0)
    exact = middle.fmpq()
    return Fraction(int(exact.p), int(exact.q))


class Plan:
    """How the atoms, in the order of reading, come from independent ones: guessed from decimals, proven elsewhere.

    `traces` are the atoms at points near the place, the first one at the place itself, with `bits` of precision.
    """

    def __init__(
        self, traces: list[list[tuple[bool, bool, arb]]], bits: int, check_time: Callable[[], None] = lambda: None
    ) -> None:
        self.bits, self.split, self.entries = bits, 1, list[Entry]()  # the product of the N of functions
        self.turns, self.choices = 1, [dict[int, int]()]  # a multiple of the N of functions; see every_choice
        self.classes: list[int] | None = None  # of the arguments of arbitrary functions, in the order of reading
        self.searches = 0
        self.halved = False  # whether half an arctangent's argument is an angle: see Residues.angle
        self.pairs = [Pair(False, False, 1), Pair(True, False, 1), Pair(True, False, -1, 12),
                      Pair(False, True, 2, 2), Pair(False, True, 3, 2)] if traces and traces[0] else []  # fmt: skip
        self.count = len(traces)
        constants = (arb(1), arb(1), arb.pi(), arb(2).log(), arb(3).log())
        self.values = [[value] * self.count for value in constants]
        ones = [arb(1)] * self.count
        self.basis: dict[bool, list[tuple[list[arb], int, dict[int, arb]]]] = {
            False: [(ones, 0, {ONE: arb(1)})], True: [(ones, 0, {TURN: arb(1)})]}  # fmt: skip
        for number, (logarithm, imaginary, _) in enumerate(traces[0] if traces else ()):
            check_time()
            self.entries.append(self.entry(logarithm, imaginary, [trace[number][2] for trace in traces]))

    def entry(self, logarithm: bool, imaginary: bool, exact: list[arb]) -> Entry:
        values = [value.mid() for value in exact]
        if all(value.contains(0) for value in exact):
            values = [arb(0)] * self.count
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

    def reduced(self, values: list[arb], imaginary: bool) -> tuple[list[arb], dict[int, arb]]:
        """What the pairs before leave of the values, and the combination of them that was subtracted."""
        rest, found = values, dict[int, arb]()
        for vector, place, combination in self.basis[imaginary]:
            factor = (rest[place] / vector[place]).mid()
            rest = [(a - factor * b).mid() for a, b in zip(rest, vector, strict=True)]
            for j, a in combination.items():
                found[j] = (found.get(j, 0) + factor * a).mid()
        return rest, found

    def fraction(self, value: arb) -> Fraction | None:
        """The simple fraction that this is to all digits, if any."""
        simple = exactly(value).limit_denominator(1 << 40)
        return simple if abs(value - fmpq(simple.numerator, simple.denominator)) < self.small() else None

    def rational(self, values: list[arb], found: dict[int, arb], imaginary: bool) -> dict[int, Fraction] | None:
        """The combination with rational coefficients, the constant in it a multiple of pi, of 1 or a logarithm."""
        unit = TURN if imaginary else ONE
        parts = {j: self.fraction(a) for j, a in found.items() if j != unit}
        known = {j: a for j, a in parts.items() if a}
        if None in parts.values():
            return None
        constant = found[unit]
        if abs(constant) <= self.small() * max([abs(value) for value in values]):
            return known
        if imaginary and (turns := self.fraction(constant / arb.pi())) is not None and turns.denominator <= 1 << 12:
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
        if max(above, below).bit_length() > 100 or abs(value - fmpq(above, below)) > self.small() * value:
            return None
        factors = [(int(q), k) for q, k in fmpz(above).factor()] + [(int(q), -k) for q, k in fmpz(below).factor()]
        for prime, _ in factors:
            if prime not in [pair.number for pair in self.pairs]:
                self.pairs.append(Pair(False, True, prime))
                self.values.append([arb(prime).log()] * self.count)
        numbers = [pair.number for pair in self.pairs]
        return {numbers.index(prime, 2): Fraction(exponent) for prime, exponent in factors}

    def related(self, values: list[arb], found: dict[int, arb], imaginary: bool) -> dict[int, Fraction] | None:
        """The shortest linear relation over the integers among the values and those of all pairs (LLL)."""
        self.searches += 1
        if self.searches > MAX_SEARCHES:
            return None
        near = [j for j, pair in enumerate(self.pairs) if pair.imaginary == imaginary][:MAX_RELATED]
        columns, taken = [values, *(self.values[j] for j in near)], range(min(self.count, 6))
        scale = max(abs(value) for value in values)
        rows = [[int(a == b) for b in range(len(columns))] + [self.fixed(column[k] / scale) for k in taken]
                for a, column in enumerate(columns)]  # fmt: skip
        for row in fmpz_mat(rows).lll().tolist():
            head, tail = [int(a) for a in row[: len(columns)]], [int(a) for a in row[len(columns) :]]
            if head[0] and max(map(abs, head)) < 1 << 16 and max(map(abs, tail)) < 1 << 30:
                return {j: Fraction(-a, head[0]) for j, a in zip(near, head[1:], strict=True) if a}
        return None

    def fixed(self, value: arb) -> int:
        return math.floor(exactly(value * arb(2) ** (self.bits // 4)))

    def refined(self, parts: dict[int, Fraction]) -> bool:
        """Make the generators fine enough for these exponents, unless they would become too many or too fine."""
        scales = {j: math.lcm(self.pairs[j].scale, a.denominator) for j, a in parts.items()}
        roots = [j for j, pair in enumerate(self.pairs) if pair.logarithm and not pair.number]
        split = math.prod([scales.get(j, self.pairs[j].scale) for j in roots])
        bounds = ((MAX_TURNS if j == PI else 24 if self.pairs[j].number > 1 else MAX_SCALE) for j in scales)
        good = split <= MAX_SPLIT and all(scale <= most for scale, most in zip(scales.values(), bounds, strict=True))
        if good and all(abs(a) * scales[j] <= MAX_POWER for j, a in parts.items()):
            self.split, self.turns = split, math.lcm(self.turns, *[scales[j] for j in roots if j in scales])
            for j, scale in scales.items():
                self.halved |= self.pairs[j].imaginary and self.pairs[j].logarithm and scale % 2 == 0
                self.pairs[j].scale = scale
            return True
        return False

    def every_choice(self) -> list[dict[int, int]]:
        """Each choice k of the roots r_j z_j^k_j of functions, z_j a root of unity."""
        if self.split > MAX_CHOICES:
            raise Ended("incomplete", f"Roots that depend on each other have more than {MAX_CHOICES} choices.")
        scales = {j: pair.scale for j, pair in enumerate(self.pairs) if pair.logarithm and not pair.number}
        return [dict(zip(scales, choice, strict=True)) for choice in product(*map(range, scales.values()))]

    def moderate(self, parts: dict[int, Fraction]) -> bool:
        times = math.lcm(*[a.denominator for j, a in parts.items() if j != PI])
        return times <= 48 and all(abs(a) * times * self.pairs[j].scale <= MAX_POWER for j, a in parts.items())

    def combination(self, parts: dict[int, Fraction], logarithm: bool, imaginary: bool, exact: arb) -> Entry:
        """Of a logarithm that is imaginary, the multiple of pi is the only one in a ball at the place."""
        times = math.lcm(*[a.denominator for j, a in parts.items() if j != PI])
        if logarithm and imaginary:
            part = math.lcm(12, parts.pop(PI, Fraction(1)).denominator) * times
            rest = exact - sum([self.values[j][0] * fmpq(a.numerator, a.denominator) for j, a in parts.items()])
            whole = (rest / arb.pi() * part).unique_fmpz()
            if whole is None:
                raise Ended("incomplete", "The branch of an arctangent could not be told.")
            parts, times = parts | {PI: Fraction(int(whole), part)}, 2 * part
        return Entry(0, tuple((j, a) for j, a in parts.items() if a), times)

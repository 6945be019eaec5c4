"""Random points at which the checker's own reader gives the right sides of a certificate's system.

For a second program that compares these with something else, such as the equations that a user gave. Where all
formulas are rational in everything the numbers are residues modulo random primes, else reals of 144 and more digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
from mpmath import mp

from inverse_service.certificate.checker import (
    PRECISIONS,
    Arithmetic,
    CheckResult,
    Elimination,
    Ended,
    Expansion,
    Question,
    Reader,
    Tools,
    Undefined,
    judged,
    read_tokens,
)

POINTS = 2
_FEWEST_BITS = 60  # what is compared is never measured against less than 2^-60, so that rounding is no difference
# Further points in (-4, 4): so many, if that many of those tried are in the domain.
_FAR, _FAR_ATTEMPTS = 4, 12

Value = Any  # an mpf (mpmath has no types) or a Residue


@dataclass(frozen=True, slots=True)
class Residue:
    """A number modulo a prime, for formulas that know + * and integral powers."""

    value: int
    prime: int

    def __add__(self, other: Residue) -> Residue:
        return Residue((self.value + other.value) % self.prime, self.prime)

    def __sub__(self, other: Residue) -> Residue:
        return Residue((self.value - other.value) % self.prime, self.prime)

    def __mul__(self, other: Residue) -> Residue:
        return Residue(self.value * other.value % self.prime, self.prime)

    def __truediv__(self, other: Residue) -> Residue:
        return self * other**-1

    def __pow__(self, exponent: int) -> Residue:
        if exponent < 0 and not self.value:
            raise Undefined
        return Residue(pow(self.value, exponent, self.prime), self.prime)

    def __abs__(self) -> int:
        """1 for what is not zero: no residue is larger than another."""
        return int(bool(self.value))


@dataclass(frozen=True, slots=True)
class Place:
    """One point: a value for t, each coordinate, velocity (`x'`) and parameter, and a jet for each function."""

    ring: Expansion

    @property
    def exact(self) -> bool:
        """Whether the numbers are residues."""
        return self.ring.arithmetic.prime > 0

    def number(self, value: Fraction) -> Value:
        return self._number(self.ring.arithmetic.number(value))

    @property
    def values(self) -> dict[str, Value]:
        return {name: self._number(series.get(0, 0)) for name, series in self.ring.names.items()}

    def accelerations(self, velocities: Mapping[str, Value]) -> tuple[Value, ...]:
        """f, in the order of the coordinates; `velocities` ("x'") replace those of the point."""
        bound = {name: {0: self._raw(value)} for name, value in velocities.items()}
        found = (Reader(self.ring, force, **bound).value for force in self.ring.question.forces)
        return tuple(self._number(series.get(0, 0)) for series in found)

    def read(self, text: str, given: Mapping[str, Value]) -> Value | None:
        """What the checker's reader makes of a formula, with further names ("x''"); None where it refuses it.

        None too where the formula has no value at the point by the checker's rules, such as (-1)^(4/2).
        """
        bound = {name: {0: self._raw(value)} for name, value in given.items()}
        try:
            return self._number(Reader(self.ring, read_tokens(text, "formula"), **bound).value.get(0, 0))
        except Undefined:
            return None
        except Ended as end:
            if end.args[0] == "incomplete":
                raise
            return None

    def function(self, name: str, orders: tuple[int, ...], arguments: Iterable[Value]) -> Value:
        """A derivative of a declared function: random, but the same wherever the arguments are."""
        series = self.ring.function(name, orders, [{0: self._raw(value)} for value in arguments])
        return self._number(series.get(0, 0))

    def vanishes(self, value: Value, size: Value) -> bool:
        """Whether it is zero beside numbers of this size; raises Ended("incomplete") where that is not clear."""
        arithmetic = self.ring.arithmetic
        return arithmetic.vanishes(self._raw(value), max(arithmetic.one >> _FEWEST_BITS, self._raw(size)))

    def rank(self, rows: Sequence[Sequence[Value]], sizes: Sequence[Value]) -> int:
        """The rank of a matrix, each row measured against its size."""
        arithmetic = self.ring.arithmetic
        elimination = Elimination(arithmetic, 64)
        for row, size in zip(rows, sizes, strict=True):
            least = max(arithmetic.one >> _FEWEST_BITS, self._raw(size))
            entries = {column: self._raw(value) for column, value in enumerate(row)}
            elimination.insert([arithmetic.row(entries, scale=least)])
        return len(elimination.rows)

    def _number(self, value: int) -> Value:
        arithmetic = self.ring.arithmetic
        return Residue(value, arithmetic.prime) if self.exact else mp.ldexp(mp.mpf(value), -arithmetic.bits)

    def _raw(self, value: Value) -> int:
        if isinstance(value, Residue | int):
            return value if isinstance(value, int) else value.value
        return int(mp.ldexp(value, self.ring.arithmetic.bits))


Trial = Callable[[Place], str]


@dataclass(frozen=True, slots=True)
class Kind:
    """What is known of the formulas of a trial: rational ones want residues, roots bind to one domain."""

    rational: bool
    roots: bool


def tried(
    system: object, near: object, trial: Trial, kind: Kind, time_limit: float = 60.0, seed: int | None = None
) -> CheckResult:
    """`trial` at random points; never raises.

    Residues where all formulas are rational. Else reals near the point named, with more digits where the trial does
    not come to an end, and, where there are no roots with their branches, in the rest of the domain too.
    `trial` gives the sentence that says what was found, and raises `Ended` with what it found wrong, or
    `Undefined` where something has no value at the point: then another is drawn.
    """

    def work(tools: Tools) -> list[str]:
        question, found = Question(tools, system, True, near), list[str]()

        def note(ring: Expansion) -> None:
            found.append(trial(Place(ring)))

        if kind.rational and question.rational:
            for _ in range(POINTS):
                question.at_point(Arithmetic(question, _prime(question)), 0, note)
            return found[-1:]
        rooted = kind.roots or any({"^", "sqrt"} & {*force} for force in question.forces)
        for precision in PRECISIONS:
            try:
                with mp.workprec(precision[0] + 64):
                    _at_real_points(Arithmetic(question, 0, *precision), note, 0 if rooted else _FAR)
                return found[-1:]
            except Ended as end:
                if end.args[0] == "invalid" or precision == PRECISIONS[-1]:
                    raise
        return found

    return judged(work, time_limit, seed)


def _prime(question: Question) -> int:
    while not mpmath.libmp.isprime(prime := question.generator.randrange(1 << 60, 1 << 61)):
        pass
    return prime


def _at_real_points(arithmetic: Arithmetic, note: Callable[[Expansion], None], far: int) -> None:
    """Near the point named, then elsewhere; what one point leaves open another may refute."""
    doubts: list[Ended] = []

    def noted(ring: Expansion) -> None:
        try:
            note(ring)
        except Ended as end:
            if end.args[0] == "invalid":
                raise
            doubts.append(end)

    for _ in range(POINTS):
        arithmetic.question.at_point(arithmetic, 0, noted)
    _at_far_points(arithmetic, noted, far)
    if doubts:
        raise doubts[0]


def _at_far_points(arithmetic: Arithmetic, note: Callable[[Expansion], None], wanted: int) -> None:
    """In turn with all numbers beyond 1, where x^999 is large (near 1/2 it is as good as zero), and anywhere."""
    question = arithmetic.question
    for attempt in range(_FAR_ATTEMPTS if wanted else 0):
        question.check_time()
        values = {name: _far_number(arithmetic, attempt % 2 == 0) for name in sorted(question.names)}
        try:
            note(Expansion(arithmetic, values | {"pi": arithmetic.real("pi")}, 0))
        except Undefined:
            continue
        wanted -= 1
        if not wanted:
            return


def _far_number(arithmetic: Arithmetic, beyond_one: bool) -> int:
    """A number of (-4, 4), or of it without [-1, 1]."""
    value = arithmetic.draw()
    return 4 * value if not beyond_one else 3 * value + (arithmetic.one if value >= 0 else -arithmetic.one)

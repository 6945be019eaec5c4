"""Random real points at which the checker's own reader gives the right sides of a certificate's system.

For a second program that compares these with something else, such as the equations that a user gave.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

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

Real = Any  # mpmath has no types


@dataclass(frozen=True, slots=True)
class Place:
    """One point: a value for t, each coordinate, velocity (`x'`) and parameter, and a jet for each function."""

    ring: Expansion

    @property
    def values(self) -> dict[str, Real]:
        return {name: self._real(series.get(0, 0)) for name, series in self.ring.names.items()}

    def accelerations(self, velocities: Mapping[str, Real]) -> tuple[Real, ...]:
        """f, in the order of the coordinates; `velocities` ("x'") replace those of the point."""
        bound = {name: {0: self._fixed(value)} for name, value in velocities.items()}
        found = (Reader(self.ring, force, **bound).value for force in self.ring.question.forces)
        return tuple(self._real(series.get(0, 0)) for series in found)

    def read(self, text: str, given: Mapping[str, Real]) -> Real | None:
        """What the checker's reader makes of a formula, with further names ("x''"); None where it refuses it.

        None too where the formula has no value at the point by the checker's rules, such as (-1)^(4/2).
        """
        bound = {name: {0: self._fixed(value)} for name, value in given.items()}
        try:
            return self._real(Reader(self.ring, read_tokens(text, "formula"), **bound).value.get(0, 0))
        except Undefined:
            return None
        except Ended as end:
            if end.args[0] == "incomplete":
                raise
            return None

    def function(self, name: str, orders: tuple[int, ...], arguments: Iterable[Real]) -> Real:
        """A derivative of a declared function: random, but the same wherever the arguments are."""
        series = self.ring.function(name, orders, [{0: self._fixed(value)} for value in arguments])
        return self._real(series.get(0, 0))

    def vanishes(self, value: Real, size: Real) -> bool:
        """Whether it is zero beside numbers of this size; raises Ended("incomplete") where that is not clear."""
        arithmetic = self.ring.arithmetic
        return arithmetic.vanishes(self._fixed(value), max(arithmetic.one >> _FEWEST_BITS, self._fixed(size)))

    def rank(self, rows: Sequence[Sequence[Real]], sizes: Sequence[Real]) -> int:
        """The rank of a matrix, each row measured against its size."""
        arithmetic = self.ring.arithmetic
        elimination = Elimination(arithmetic, 64)
        for row, size in zip(rows, sizes, strict=True):
            least = max(arithmetic.one >> _FEWEST_BITS, self._fixed(size))
            entries = {column: self._fixed(value) for column, value in enumerate(row)}
            elimination.insert([arithmetic.row(entries, scale=least)])
        return len(elimination.rows)

    def _real(self, value: int) -> Real:
        return mp.ldexp(mp.mpf(value), -self.ring.arithmetic.bits)

    def _fixed(self, value: Real) -> int:
        return int(mp.ldexp(value, self.ring.arithmetic.bits))


def tried(
    system: object, near: object, trial: Callable[[Place], str], time_limit: float = 60.0, seed: int | None = None
) -> CheckResult:
    """`trial` at random points near those named, with more digits where it does not come to an end; never raises.

    `trial` gives the sentence that says what was found, and raises `Ended` with what it found wrong, or
    `Undefined` where something has no value at the point: then another is drawn.
    """

    def work(tools: Tools) -> list[str]:
        question, found = Question(tools, system, True, near), list[str]()
        for bits, cut, gap in PRECISIONS:
            arithmetic = Arithmetic(question, 0, bits, cut, gap)
            try:
                with mp.workprec(bits + 64):
                    for _ in range(POINTS):
                        question.at_point(arithmetic, 0, lambda ring: found.append(trial(Place(ring))))
                return found[-1:]
            except Ended as end:
                if end.args[0] == "invalid" or bits == PRECISIONS[-1][0]:
                    raise
        return found

    return judged(work, time_limit, seed)

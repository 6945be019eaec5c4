"""A power series of a regular Lagrangian with rational coefficients, for people to read.

Coefficients are found modulo several primes at a point with small whole numbers, joined by the Chinese
remainder theorem and reconstructed as fractions (Wang 1981); a further prime confirms them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import isqrt
from typing import TypeVar

from inverse_service.algebra.point import Point
from inverse_service.algebra.primes import reconstruct, safe_prime
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import draw_point
from inverse_service.expressions.tree import (
    PI,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    number,
    power,
    subtract,
)
from inverse_service.inverse_problem.decision.analysis import Analysis, variables_of
from inverse_service.inverse_problem.decision.power_series import is_rational, prolonged, regular_at, symbols_of

_MOST_PRIMES = 12
_POINTS = 4

Index = tuple[int, ...]
Key = TypeVar("Key")


@dataclass(frozen=True, slots=True)
class RationalSeries:
    """Coefficients of (x - x_0)^alpha, x = (t?, q, v), v-degree >= 2, of one regular L; the others are free.

    `point` gives the values of t, q, v and the parameters, `variables` are those of x.
    """

    order: int
    variables: tuple[Symbol | Velocity, ...]
    point: Mapping[Symbol | Velocity, int]
    coefficients: Mapping[Index, Fraction]


def rational_series(analysis: Analysis, with_time: bool, order: int, spare: int = 0) -> RationalSeries | None:
    """One regular solution to the order, prolonged by `spare` and projected; None where none is met.

    The squares of the velocities get the coefficient 1/2, all other free coefficients are zero.
    """
    symbols = symbols_of(analysis)
    if PI in symbols or not is_rational(analysis):
        return None
    variables = variables_of(analysis.system)[not with_time : 1 + 2 * len(analysis.system.coordinates)]
    generic = _dimension(analysis, draw_point(analysis.tower, 1), with_time, (order, spare))
    for first in range(1, 1 + _POINTS):
        point = {symbol: first + k for k, symbol in enumerate(symbols)}
        try:
            if _dimension(analysis, _at(point, 0), with_time, (order, spare)) != generic:
                continue
            found = _reconstructed(analysis, point, with_time, (order, spare))
        except SingularPoint:
            continue
        if found is not None:
            return RationalSeries(order, variables, point, {index: a for index, a in found.items() if a})
    return None


def _at(values: Mapping[Symbol | Velocity, int], seed: int) -> Point:
    return Point(safe_prime(seed), seed, variables=dict(values))


def _dimension(analysis: Analysis, point: Point, with_time: bool, orders: tuple[int, int]) -> int:
    """How many coefficients are free: more than at a random point means that this one is singular."""
    return prolonged(analysis, point, with_time, sum(orders)).dimension(orders[0])


def _reconstructed(
    analysis: Analysis, values: Mapping[Symbol | Velocity, int], with_time: bool, orders: tuple[int, int]
) -> dict[Index, Fraction] | None:
    """The coefficients as fractions, once those from some primes agree with one prime more."""

    def residues(k: int) -> tuple[int, dict[Index, int] | None]:
        here = _at(values, k)
        return here.prime, regular_at(analysis, here, with_time, orders, _squares)

    return reconstructed(residues)


def reconstructed(residues_of: Callable[[int], tuple[int, Mapping[Key, int] | None]]) -> dict[Key, Fraction] | None:
    """Fractions from (prime, residues) for k = 0, 1, …, once those agree with one prime more."""
    modulus, residues = 1, dict[Key, int]()
    fractions: dict[Key, Fraction] | None = None
    for k in range(_MOST_PRIMES):
        prime, fresh = residues_of(k)
        if fresh is None:
            return None
        if fractions is not None and all(_agrees(a, fresh.get(key, 0), prime) for key, a in fractions.items()):
            return fractions
        residues = {key: _joined(residues.get(key, 0), modulus, value, prime) for key, value in fresh.items()}
        modulus *= prime
        fractions = _fractions(residues, modulus)
    return None


def _squares(index: Index, prime: int) -> int:
    """1/2 for the square of a velocity, zero for all else."""
    return pow(2, -1, prime) if sum(index) == 2 and 2 in index else 0


def _joined(residue: int, modulus: int, other: int, prime: int) -> int:
    """The number modulo modulus * prime with these residues."""
    return residue + modulus * ((other - residue) * pow(modulus, -1, prime) % prime)


def _fractions(residues: Mapping[Key, int], modulus: int) -> dict[Key, Fraction] | None:
    bound = isqrt(modulus // 2)
    found: dict[Key, Fraction] = {}
    for index, residue in residues.items():
        value = reconstruct(residue, modulus, bound)
        if value is None:
            return None
        found[index] = value
    return found


def _agrees(value: Fraction, residue: int, prime: int) -> bool:
    return (value.numerator - residue * value.denominator) % prime == 0


def as_tree(series: RationalSeries) -> Expression:
    """The polynomial in the displacements, low degrees first."""
    steps = [subtract(x, number(series.point[x])) for x in series.variables]
    ordered = sorted(series.coefficients.items(), key=lambda item: (sum(item[0]), item[0]))
    return add(
        *(multiply(number(a), *(power(d, e) for d, e in zip(steps, index, strict=True) if e)) for index, a in ordered)
    )

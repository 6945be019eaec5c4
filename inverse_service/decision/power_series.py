"""The Taylor coefficients of one regular Lagrangian at a point: existence made concrete.

The prolonged Helmholtz conditions are linear in the Taylor coefficients of L of v-degree >= 2. In their
echelon form the pivot of each row is its last column, columns in ascending degree, so the coefficients
follow one after another: those without a pivot are chosen, the others are determined by earlier ones.
Prolonged so far that the projection to the wanted order holds no further conditions (Cartan, Kuranishi),
the polynomial is the beginning of the series of an actual solution.

A power series of a regular Lagrangian with rational coefficients, for people to read.

Coefficients are found modulo several primes at a point with small integers, joined by the Chinese
remainder theorem and reconstructed as fractions (Wang 1981); a further prime confirms them.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import comb, isqrt
from typing import Any, TypeVar

from inverse_service import bounds
from inverse_service.decision.analysis import Analysis, is_irrational, moving_variables, variables_of
from inverse_service.decision.kinds.helmholtz import matrix_of
from inverse_service.decision.local_system import equations, local_system
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import PI, Expression, Symbol, Velocity, add, multiply, number, walk
from inverse_service.field.echelon import Echelon
from inverse_service.field.modular import reconstruct, safe_prime
from inverse_service.field.point import Point
from inverse_service.field.tower import draw_point
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.linear_pde.emission import Prolongation, advance, start
from inverse_service.linear_pde.involution import matrix_at
from inverse_service.linear_pde.unknowns import unknown_names

Coefficients = dict[int, int]  # by column
# The value of a free coefficient, from its multi-index and the prime.
Choice = Callable[[tuple[int, ...], int], int]


def is_rational(analysis: Analysis) -> bool:
    """Whether f is a rational function of t, q, v, the parameters and pi."""
    return not any(is_irrational(node) for f in analysis.accelerations for node in walk(f))


def count(n: int, with_time: bool, order: int) -> int:
    """The number of unknowns: monomials of v-degree >= 2 and total degree <= order + 2."""
    rest, degree = n + with_time, order + 2
    return comb(rest + n + degree, degree) - comb(rest + degree, degree) - n * comb(rest + degree - 1, degree - 1)


def regular_series(analysis: Analysis, with_time: bool, order: int, seed: int, spare: int = 0) -> dict[str, Any]:
    """One regular solution of the Helmholtz conditions to order `order` at a random point modulo a prime.

    The `series` of an existence certificate: {"order", "point", "prime", "terms"}, the terms being
    [multi-index, value] for v-degree >= 2 and total degree <= order + 2. The system is prolonged to
    `order + spare` and projected. ValueError where f is not rational, or no regular solution was met.
    """
    if not is_rational(analysis):
        raise ValueError("a series modulo a prime needs a rational f")
    for attempt in range(bounds.ATTEMPTS):
        point = draw_point(analysis.tower, seed + attempt)
        try:
            found = regular_at(analysis, point, with_time, (order, spare), _at_random(f"series {seed} {attempt}"))
        except SingularPoint:
            continue
        if found is not None:
            return {
                "order": order,
                "point": {to_text(s): str(point.variable(s)) for s in symbols_of(analysis)},
                "prime": point.prime,
                "terms": [[list(index), str(value)] for index, value in found.items() if value],
            }
    raise ValueError("no regular solution was met at any point tried")


def _at_random(seed: str) -> Choice:
    generator = random.Random(seed)
    return lambda index, prime: generator.randrange(prime)


def regular_at(
    analysis: Analysis, point: Point, with_time: bool, orders: tuple[int, int], choose: Choice
) -> dict[tuple[int, ...], int] | None:
    """{multi-index: coefficient} of a solution at the point to the first order, prolonged by the second.

    `choose(multi-index, prime)` gives the free coefficients. None where the solution is singular.
    """
    order, spare = orders
    prolongation = prolonged(analysis, point, with_time, order + spare)
    indices = [index for degree in range(order + 1) for _, index in unknown_names(prolongation.unknowns, degree)]
    prime = point.prime
    found = solution(prolongation.echelon, len(indices), lambda column: choose(indices[column], prime))
    if not is_regular(prolongation, len(analysis.system.coordinates), found):
        return None
    return {index: found[column] for column, index in enumerate(indices)}


def prolonged(analysis: Analysis, point: Point, with_time: bool, order: int) -> Prolongation:
    """All rows up to the order at the point; raises SingularPoint where f has no value there."""
    local = local_system(*analysis.series(point, with_time, order + 2))
    prolongation = start(equations(local))
    for _ in range(order + 1):
        advance(prolongation)
    return prolongation


def solution(echelon: Echelon, width: int, choose: Callable[[int], int]) -> Coefficients:
    """A solution on the first `width` columns: columns without pivot are chosen, pivots follow in order."""
    rows = {max(row): row for row in echelon.rows_within(0, width).values()}
    found: Coefficients = {}
    for column in range(width):
        if column not in rows:
            found[column] = choose(column) % echelon.prime
            continue
        # The entry of the pivot is 1.
        total = sum(value * found[k] for k, value in rows[column].items() if k != column)
        found[column] = -total % echelon.prime
    return found


def is_regular(prolongation: Prolongation, n: int, found: Mapping[int, int]) -> bool:
    """Whether g(p) is a regular matrix."""
    matrix = matrix_of(n, prolongation.size)
    return bool(matrix_at(prolongation.unknowns, matrix, found, prolongation.local.prime).rank() == n)


def symbols_of(analysis: Analysis) -> list[Symbol | Velocity]:
    """t, q, v, the parameters, and pi where f contains it."""
    has_pi = any(node == PI for f in analysis.accelerations for node in walk(f))
    return [*variables_of(analysis.system), *([PI] if has_pi else [])]


_MOST_PRIMES = 12

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
    variables = moving_variables(analysis.system, with_time)
    generic = _dimension(analysis, draw_point(analysis.tower, 1), with_time, (order, spare))
    for first in range(1, 1 + bounds.ATTEMPTS):
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
    steps = [x - series.point[x] for x in series.variables]
    ordered = sorted(series.coefficients.items(), key=lambda item: (sum(item[0]), item[0]))
    return add(*(multiply(number(a), *(d**e for d, e in zip(steps, index, strict=True) if e)) for index, a in ordered))

"""Random points over one prime, drawn one after another, and the letters with their logarithmic derivatives there.

The ansätze of a ladder ask for the same letters at the same points, each for some more of them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from inverse_service.algebra import truncated_series as ps
from inverse_service.algebra.point import Expansion, Point, Variable, evaluate, variables_in
from inverse_service.algebra.real_point import RealTable
from inverse_service.algebra.tower import Tower, draw_point, moved_point
from inverse_service.algebra.truncated_series import SingularPoint
from inverse_service.deadline import check
from inverse_service.expressions.tree import Expression, Symbol, Velocity, walk


class LetterValues(NamedTuple):
    """p, Gamma(log p), d log p/dv_i, Gamma'(d log p/dv_i), d log p/dq_i, d2 log p/dv_i dv_j, Gamma'(that)."""

    value: int
    along: int
    by_velocity: list[int]
    mixed: list[int]
    by_position: list[int]
    hessian: list[list[int]]
    third: list[list[int]]


def letter_values(
    expansion: Expansion, places: Sequence[int], kernel: Expression, drift: Sequence[int]
) -> LetterValues:
    """The entries for one letter, at the point of an expansion.

    `places` are those of the displaced variables among (t, q, v), `drift` is (1, v, f).
    """
    n, prime = len(drift) // 2, expansion.ring.prime
    value, gradient, second, third = _logarithmic(expansion, places, kernel, drift, n)
    return LetterValues(
        value,
        sum(a * b for a, b in zip(drift, gradient, strict=True)) % prime,
        gradient[1 + n :],
        [sum(a * b for a, b in zip(drift, second[1 + n + i], strict=True)) % prime for i in range(n)],
        gradient[1 : 1 + n],
        [row[1 + n :] for row in second[1 + n :]],
        third,
    )


def _logarithmic(
    expansion: Expansion, names: Sequence[int], kernel: Expression, drift: Sequence[int], n: int
) -> tuple[int, list[int], list[list[int]], list[list[int]]]:
    """(p, d_a log p, d_a d_b log p, sum_c drift_c d_c d_i d_j log p for velocities i, j) at the point.

    With u_a = p_a/p, w_ab = p_ab/p the second derivatives are w_ab - u_a u_b, the third p_abc/p - w_ab u_c
    - w_ac u_b - w_bc u_a + 2 u_a u_b u_c. `names` are the places among (t, q, v) of the variables that are displaced.
    """
    if isinstance(kernel, Symbol | Velocity):
        return _of_variable(expansion, kernel, names, drift, n)
    prime, size, span = expansion.ring.prime, 2 * n + 1, range(len(names))
    series = expansion.expand(kernel)
    value, coefficients = ps.value_at_point(series), ps.terms(series)
    unit = expansion.ring.invert_number(value)

    def slope(*places: int) -> int:
        """A derivative of p, over p: the Taylor coefficient times the factorials of its exponents."""
        exponents = tuple(places.count(k) for k in span)
        return coefficients.get(exponents, 0) * math.prod(map(math.factorial, exponents)) * unit % prime

    gradient, second, third = [0] * size, [[0] * size for _ in range(size)], [[0] * n for _ in range(n)]
    u = [slope(a) for a in span]
    w = [[slope(a, b) for b in span] for a in span]
    for a in span:
        gradient[names[a]] = u[a]
        for b in span:
            second[names[a]][names[b]] = (w[a][b] - u[a] * u[b]) % prime
    moving = [a for a in span if names[a] > n] if expansion.order > 2 else []
    for a, b in itertools.product(moving, repeat=2):
        third[names[a] - 1 - n][names[b] - 1 - n] = sum(
            drift[names[c]]
            * (slope(a, b, c) - w[a][b] * u[c] - w[a][c] * u[b] - w[b][c] * u[a] + 2 * u[a] * u[b] * u[c])
            for c in span
        ) % prime  # fmt: skip
    return value, gradient, second, third


def _of_variable(
    expansion: Expansion, variable: Symbol | Velocity, names: Sequence[int], drift: Sequence[int], n: int
) -> tuple[int, list[int], list[list[int]], list[list[int]]]:
    """The same for a letter that is t, q, v or a parameter: 1/x, -1/x^2, and 2/x^3 times the drift."""
    value, prime = expansion.point.variable(variable), expansion.ring.prime
    if value == 0:
        raise SingularPoint("a letter vanishes at the point")
    size = 2 * n + 1
    gradient, second, third = [0] * size, [[0] * size for _ in range(size)], [[0] * n for _ in range(n)]
    slope = pow(value, -1, prime)
    for place in names:
        gradient[place], second[place][place] = slope, -slope * slope % prime
        if place > n and expansion.order > 2:
            third[place - 1 - n][place - 1 - n] = 2 * slope * slope * slope * drift[place] % prime
    return value, gradient, second, third


# In units of the search (see `deadline`).
_WORK_OF_A_POINT, _WORK_OF_A_LETTER = 60, 10
Matrix = list[list[int]]


@dataclass(slots=True)
class _AtPoint:
    """What is known at one point; `drift` is (1, v, f), empty where f has no value."""

    point: Point
    drift: list[int]
    expansions: dict[tuple[tuple[int, ...], int], Expansion] = field(default_factory=dict)
    letters: dict[tuple[Expression, int], LetterValues | None] = field(default_factory=dict)
    tensors: tuple[Matrix, Matrix] | None = None


@dataclass(slots=True)
class SamplePoints:
    """The points of a tower that follow from a seed, on the constraints if any; `variables` are t, q, v.

    With `base` only what is `moving` differs from there.
    """

    forces: Sequence[Expression]
    variables: Sequence[Symbol | Velocity]
    tower: Tower
    seed: int
    prime: int
    constrained: Mapping[Velocity, Expression] = field(default_factory=dict)
    base: Point | None = None
    moving: Sequence[Symbol | Velocity] = ()
    places: list[_AtPoint] = field(default_factory=list)

    def point(self, k: int) -> Point:
        return self.place(k).point

    def place(self, k: int) -> _AtPoint:
        while len(self.places) <= k:
            check(_WORK_OF_A_POINT)
            point = self._drawn(len(self.places))
            self.places.append(_AtPoint(point, self._drift(point)))
        return self.places[k]

    def _drawn(self, k: int) -> Point:
        if self.base is None:
            return draw_point(self.tower, self.seed + 1 + k, self.prime)
        return moved_point(self.tower, self.base, self.moving, k)

    def _drift(self, point: Point) -> list[int]:
        known: dict[Expression, int] = {}
        try:
            point.variables.update((v, evaluate(w, point, known)) for v, w in self.constrained.items())
            f = [evaluate(force, point, known) for force in self.forces]
        except (SingularPoint, ValueError):
            return []
        return [1, *(point.variable(v) for v in self.variables[1 + len(f) :]), *f]

    def letters(self, k: int, kernels: Sequence[Expression], order: int) -> list[LetterValues] | None:
        """The values of all letters at a point; None where one has none."""
        place = self.place(k)
        row = []
        for kernel in kernels if place.drift else ():
            key = kernel, 3 if (kernel, 3) in place.letters else order
            if key not in place.letters:
                check(_WORK_OF_A_LETTER + sum(1 for _ in walk(kernel)))
                place.letters[key] = self._letter(place, kernel, order)
            found = place.letters[key]
            if found is None:
                return None
            row.append(found)
        return row if place.drift else None

    def values(self, k: int, kernels: Sequence[Expression]) -> list[int] | None:
        """The values of all letters at a point, without derivatives; None where one has none or vanishes."""
        place, known = self.place(k), dict[Expression, int]()
        check(1 + len(kernels))
        try:
            found = [evaluate(kernel, place.point, known) for kernel in kernels]
        except (SingularPoint, ValueError):
            return None
        return found if place.drift and all(found) else None

    def _letter(self, place: _AtPoint, kernel: Expression, order: int) -> LetterValues | None:
        # Only the variables of the letter are displaced: most letters have one.
        names: set[Variable] = set(variables_in(kernel))
        chosen = tuple(k for k, variable in enumerate(self.variables) if variable in names)
        key = chosen, order
        try:
            if key not in place.expansions:
                place.expansions[key] = Expansion(place.point, [self.variables[k] for k in chosen], order)
            return letter_values(place.expansions[key], chosen, kernel, place.drift)
        except (SingularPoint, ValueError):
            return None


# A seed, and the variables that move where the others stay as they are at one point.
Drawn = tuple[int, tuple[Symbol | Velocity, ...]]


@dataclass(frozen=True, slots=True)
class KnownTower:
    """A tower of the atoms of f and of an ansatz, on the branch of a real point, with the points that were drawn."""

    atoms: frozenset[Expression]
    real_point: RealTable
    tower: Tower
    points: dict[Drawn, SamplePoints] = field(default_factory=dict)

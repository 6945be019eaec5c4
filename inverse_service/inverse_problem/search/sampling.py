"""Values of letters and their logarithmic derivatives at random points of one prime field."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from inverse_service.algebra import montgomery
from inverse_service.algebra import series as ps
from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.montgomery import compiled, multiply
from inverse_service.algebra.point import Expansion, Point, variables_in
from inverse_service.algebra.primes import positive_power
from inverse_service.algebra.real_point import RealTable, find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import Tower, draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, power, walk
from inverse_service.inverse_problem.analysis import Analysis, variables_of
from inverse_service.inverse_problem.search.deadline import check
from inverse_service.inverse_problem.search.terms import Monomial

Words = npt.NDArray[np.uint64]
_ATTEMPTS = 8
# In units of the search (see `deadline`).
_WORK_OF_A_POINT, _WORK_OF_A_LETTER = 60, 10


@dataclass(slots=True)
class _Rows:
    """Points over one prime at which all letters have a value, with their entries of a table."""

    prime: int
    tried: int = 0
    kept: list[tuple[Point, tuple[list[Any], ...]]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Sampler:
    """A tower for f together with the letters of an ansatz, and a real point of both."""

    analysis: Analysis
    tower: Tower
    real_point: RealTable | None
    known: dict[tuple[tuple[Expression, ...], int, int], _Rows] = field(default_factory=dict, compare=False)

    @property
    def variables(self) -> list[Symbol | Velocity]:
        names = self.analysis.system.coordinates
        return [TIME, *(Symbol(name) for name in names), *(Velocity(name) for name in names)]

    def prime(self, seed: int) -> int:
        """The prime of the points that follow from a seed."""
        return draw_point(self.tower, seed).prime


def make_sampler(analysis: Analysis, letters: Iterable[tuple[Expression, Fraction]]) -> Sampler:
    """Raises IrreducibleAtoms where letters and f have no common real point or cannot be reduced."""
    extra = [to_kernels(tree) for letter, e in letters for tree in (letter, power(letter, Fraction(1, e.denominator)))]
    wanted = [*analysis.accelerations, *dict.fromkeys(extra)]
    variables = variables_of(analysis.system)
    table = find_real_point(wanted, variables, seed=2)
    if table is None:
        raise IrreducibleAtoms("the ansatz has no real point in common with f")
    tower = reduce_atoms(wanted, variables, table)
    return Sampler(analysis, tower, table)


@dataclass(frozen=True, slots=True)
class LetterTable:
    """Per sample and letter: Gamma(log p), d log p/dv_i, Gamma'(d log p/dv_i) and d log p/dq_i.

    Arrays of residues, (samples, letters) and (samples, letters, n); Gamma' acts on the derivative
    only, so that EL_i(m)/m = V_i G + H_i - Q_i with sums over the letters of m. `hessian` is
    d2 log p/dv_i dv_j, `third` Gamma of it (zero unless asked for), (samples, letters, n, n).
    """

    prime: int
    points: tuple[Point, ...]
    values: list[list[int]]
    along: Words
    by_velocity: Words
    mixed: Words
    by_position: Words
    hessian: Words
    third: Words


def sample_points(sampler: Sampler, count: int, seed: int) -> list[Point]:
    """Points over one prime."""
    prime = draw_point(sampler.tower, seed).prime
    points = []
    for k in range(count):
        check(_WORK_OF_A_POINT)
        points.append(draw_point(sampler.tower, seed + 1 + k, prime))
    return points


def letter_table(
    sampler: Sampler, letters: Sequence[Expression], count: int, seed: int, with_third: bool = False
) -> LetterTable:
    """The table at `count` random points; points at which a letter vanishes are left out.

    The points follow from the seed one by one, and what is known of them is kept with the sampler.
    """
    kernels = tuple(to_kernels(letter) for letter in letters)
    order = 3 if with_third else 2
    rows = sampler.known.setdefault((kernels, seed, order), _Rows(sampler.prime(seed)))
    work = _WORK_OF_A_POINT + sum(_WORK_OF_A_LETTER + sum(1 for _ in walk(kernel)) for kernel in kernels)
    while len(rows.kept) < count:
        check(work)
        if rows.tried >= _ATTEMPTS * count:
            raise IrreducibleAtoms("the letters of the ansatz vanish at too many points")
        rows.tried += 1
        point = draw_point(sampler.tower, seed + rows.tried, rows.prime)
        try:
            rows.kept.append((point, _letter_rows(sampler, point, kernels, order)))
        except (SingularPoint, ValueError):
            continue
    points, found = zip(*rows.kept[:count], strict=True)
    arrays = [np.array([row[k] for row in found], np.uint64) for k in range(1, 7)]
    return LetterTable(rows.prime, points, [row[0] for row in found], *arrays)


def samples_from(table: LetterTable, first: int) -> LetterTable:
    """The table without its samples before `first`."""
    return LetterTable(
        table.prime,
        table.points[first:],
        table.values[first:],
        table.along[first:],
        table.by_velocity[first:],
        table.mixed[first:],
        table.by_position[first:],
        table.hessian[first:],
        table.third[first:],
    )


def _letter_rows(sampler: Sampler, point: Point, kernels: Sequence[Expression], order: int) -> tuple[list[Any], ...]:
    """The entries of the table for one point."""
    forces = sampler.analysis.accelerations
    still = Expansion(point, (), 0)
    n, prime, variables = len(forces), point.prime, sampler.variables
    f = [ps.value_at_point(still.expand(force)) for force in forces]
    drift = [1, *(point.variable(v) for v in variables[1 + n :]), *f]
    expansions: dict[tuple[int, ...], Expansion] = {}
    table: tuple[list[Any], ...] = ([], [], [], [], [], [], [])
    for kernel in kernels:
        # Only the variables of the letter are displaced: most letters have one.
        names = set(variables_in(kernel))
        places = tuple(k for k, variable in enumerate(variables) if variable in names)
        if places not in expansions:
            expansions[places] = Expansion(point, [variables[k] for k in places], order)
        value, gradient, second, third = _logarithmic(expansions[places], places, kernel, drift, n)
        entries = (
            value,
            sum(a * b for a, b in zip(drift, gradient, strict=True)) % prime,
            gradient[1 + n :],
            [sum(a * b for a, b in zip(drift, second[1 + n + i], strict=True)) % prime for i in range(n)],
            gradient[1 : 1 + n],
            [row[1 + n :] for row in second[1 + n :]],
            third,
        )
        for column, entry in zip(table, entries, strict=True):
            column.append(entry)
    return table


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


def monomial_values(table: LetterTable, letters: Sequence[Expression], candidates: Sequence[Monomial]) -> Words:
    """The value of each candidate at each sample, (samples, candidates), in Montgomery form."""
    index = {letter: k for k, letter in enumerate(letters)}
    pairs: dict[tuple[Expression, Fraction], int] = {}
    starts, places = [0], []
    for candidate in candidates:
        places += [pairs.setdefault(item, len(pairs)) for item in candidate]
        starts.append(len(places))
    prime, radix = table.prime, (1 << 64) % table.prime
    powers = [
        [positive_power(sample[index[letter]], e, prime) * radix % prime for letter, e in pairs]
        for sample in table.values
    ]
    modulus, negative_inverse, one, _ = montgomery.constants(prime)
    result = np.full((len(powers), len(candidates)), one, np.uint64)
    _products(
        np.array(powers, np.uint64).reshape(len(powers), -1), np.array(starts, np.int64),
        np.array(places, np.int64), result, modulus, negative_inverse,
    )  # fmt: skip
    return result


@compiled
def _products(powers: Any, starts: Any, places: Any, result: Any, prime: Any, negative_inverse: Any) -> None:
    for s in range(result.shape[0]):
        for c in range(result.shape[1]):
            for k in range(starts[c], starts[c + 1]):
                result[s, c] = multiply(result[s, c], powers[s, places[k]], prime, negative_inverse)

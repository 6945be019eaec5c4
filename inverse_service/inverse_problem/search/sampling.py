"""Values of letters and their logarithmic derivatives at random points of one prime field."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from inverse_service.algebra import montgomery
from inverse_service.algebra import series as ps
from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.montgomery import compiled, multiply
from inverse_service.algebra.point import Expansion, Point
from inverse_service.algebra.primes import positive_power
from inverse_service.algebra.real_point import RealTable, find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import Tower, draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, power
from inverse_service.inverse_problem.analysis import Analysis, variables_of
from inverse_service.inverse_problem.search.terms import Monomial

Words = npt.NDArray[np.uint64]
_ATTEMPTS = 8


@dataclass(frozen=True, slots=True)
class Sampler:
    """A tower for f together with the letters of an ansatz, and a real point of both."""

    analysis: Analysis
    tower: Tower
    real_point: RealTable | None

    @property
    def variables(self) -> list[Symbol | Velocity]:
        names = self.analysis.system.coordinates
        return [TIME, *(Symbol(name) for name in names), *(Velocity(name) for name in names)]


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
    d2 log p/dv_i dv_j, (samples, letters, n, n).
    """

    prime: int
    points: tuple[Point, ...]
    values: list[list[int]]
    along: Words
    by_velocity: Words
    mixed: Words
    by_position: Words
    hessian: Words


def sample_points(sampler: Sampler, count: int, seed: int) -> list[Point]:
    """Points over one prime."""
    prime = draw_point(sampler.tower, seed).prime
    return [draw_point(sampler.tower, seed + 1 + k, prime) for k in range(count)]


def letter_table(sampler: Sampler, letters: Sequence[Expression], count: int, seed: int) -> LetterTable:
    """The table at `count` random points; points at which a letter vanishes are replaced."""
    kernels = [to_kernels(letter) for letter in letters]
    forces = sampler.analysis.accelerations
    kept: list[Point] = []
    rows = []
    for block in range(_ATTEMPTS):
        for point in sample_points(sampler, count, seed + block * 100_003) if len(kept) < count else []:
            if kept and point.prime != kept[0].prime:
                continue
            try:
                rows.append(_letter_rows(sampler, point, kernels, forces))
                kept.append(point)
            except (SingularPoint, ValueError):
                continue
    if len(kept) < count:
        raise IrreducibleAtoms("the letters of the ansatz vanish at too many points")
    arrays = [np.array([row[k] for row in rows[:count]], np.uint64) for k in range(1, 6)]
    return LetterTable(kept[0].prime, tuple(kept[:count]), [row[0] for row in rows[:count]], *arrays)


def _letter_rows(
    sampler: Sampler, point: Point, kernels: Sequence[Expression], forces: Sequence[Expression]
) -> tuple[list[int], list[int], list[list[int]], list[list[int]], list[list[int]], list[list[list[int]]]]:
    expansion = Expansion(point, sampler.variables, 2)
    values, along, by_velocity, mixed, by_position, hessian = [], [], [], [], [], []
    n, prime = len(forces), point.prime
    still = Expansion(point, (), 0)
    f = [ps.value_at_point(still.expand(force)) for force in forces]
    drift = [1, *(point.variable(v) for v in sampler.variables[1 + n :]), *f]
    for kernel in kernels:
        value, gradient, second = _logarithmic(expansion, kernel, 2 * n + 1)
        values.append(value)
        along.append(sum(a * b for a, b in zip(drift, gradient, strict=True)) % prime)
        by_velocity.append(gradient[1 + n :])
        by_position.append(gradient[1 : 1 + n])
        mixed.append([sum(a * b for a, b in zip(drift, second[1 + n + i], strict=True)) % prime for i in range(n)])
        hessian.append([row[1 + n :] for row in second[1 + n :]])
    return values, along, by_velocity, mixed, by_position, hessian


def _logarithmic(expansion: Expansion, kernel: Expression, size: int) -> tuple[int, list[int], list[list[int]]]:
    """(p, d_a log p, d_a d_b log p) at the point."""
    ring = expansion.ring
    series = expansion.expand(kernel)
    value = ps.value_at_point(series)
    logarithm = ps.logarithm(ring, series, 0)
    gradient, second = [0] * size, [[0] * size for _ in range(size)]
    for exponents, coefficient in ps.terms(logarithm).items():
        places = [k for k, e in enumerate(exponents) for _ in range(e)]
        if len(places) == 1:
            gradient[places[0]] = coefficient
        elif len(places) == 2:
            a, b = places
            second[a][b] = second[b][a] = coefficient * (2 if a == b else 1) % ring.prime
    return value, gradient, second


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

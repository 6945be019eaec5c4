"""Nonexistence of a Lagrangian from the differentiated Helmholtz conditions, in floating point.

L is a Taylor polynomial about a random point, its coefficients of v-degree 2 and more are the
unknowns; (H2) and (H3) are expanded about the same point. The null space of all equations,
restricted to g at the point, is tested for nonsingular members. If all are singular, no multiplier
exists.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import mpmath
import numpy as np
import sympy

from tests.systems.reading import TIME, Formulas, point

Exponents = tuple[int, ...]
Polynomial = dict[Exponents, float]
Term = tuple[float, Polynomial]
_TINY = 1e-9


def product(left: Polynomial, right: Polynomial, degree: int) -> Polynomial:
    result: Polynomial = {}
    for a, x in left.items():
        room = degree - sum(a)
        for b, y in right.items():
            if sum(b) <= room:
                key = tuple(i + j for i, j in zip(a, b, strict=True))
                result[key] = result.get(key, 0.0) + x * y
    return result


def total(*parts: Term) -> Polynomial:
    result: Polynomial = {}
    for factor, part in parts:
        for key, value in part.items():
            result[key] = result.get(key, 0.0) + factor * value
    return result


def slope(given: Polynomial, k: int) -> Polynomial:
    return {(*a[:k], a[k] - 1, *a[k + 1 :]): a[k] * value for a, value in given.items() if a[k]}


class Expansions:
    """Taylor polynomials of formulas about one point."""

    def __init__(self, given: Formulas, degree: int, with_time: bool, seed: int) -> None:
        self.variables = (*[TIME] * with_time, *given.coordinates, *given.velocities)
        self.place, self.degree = point(given, seed), degree
        self.zero: Exponents = (0,) * len(self.variables)

    def of(self, e: sympy.Expr) -> Polynomial:
        if e in self.variables:
            unit = tuple(int(v == e) for v in self.variables)
            return {self.zero: float(self.place[e]), unit: 1.0}
        if e.is_Symbol:
            return {self.zero: float(self.place[e])}
        if e.is_number:
            return {self.zero: float(e)}
        if e.is_Add:
            return total(*((1.0, self.of(part)) for part in e.args))
        if e.is_Mul:
            result = self.of(e.args[0])
            for part in e.args[1:]:
                result = product(result, self.of(part), self.degree)
            return result
        inner, function = self._function(e)
        return self._composed(
            inner, mpmath.taylor(function, inner.get(self.zero, 0.0), self.degree)
        )

    def _function(self, e: sympy.Expr) -> tuple[Polynomial, Callable[[float], float]]:
        if e.is_Pow and e.exp.is_number:
            exponent = mpmath.mpf(e.exp.p) / e.exp.q
            return self.of(e.base), lambda x: mpmath.power(x, exponent)
        return self.of(e.args[0]), getattr(mpmath, e.func.__name__)

    def _composed(self, inner: Polynomial, coefficients: list[float]) -> Polynomial:
        shift = {key: value for key, value in inner.items() if any(key)}
        power: Polynomial = {self.zero: 1.0}
        parts = []
        for c in coefficients:
            parts.append((float(c), power))
            power = product(power, shift, self.degree)
        return total(*parts)


def is_excluded(given: Formulas, order: int, with_time: bool = False, seed: int = 7) -> bool:
    """Whether the conditions up to this order leave singular g only, for L(q, v) or L(t, q, v)."""
    n, offset = len(given.coordinates), int(with_time)
    space = Expansions(given, order + 2, with_time, seed)
    f = [space.of(e) for e in given.accelerations]
    v = [space.of(symbol) for symbol in given.velocities]
    endomorphism = _endomorphism(f, v, offset, order)
    unknowns = list(_monomials(offset + 2 * n, offset + n, order + 2))
    columns = [dict(_equations(_hessian(m, n), f, v, endomorphism, order)) for m in unknowns]
    keys = {
        key: r for r, key in enumerate(dict.fromkeys(key for column in columns for key in column))
    }
    matrix = np.zeros((len(keys), len(unknowns)))
    for c, column in enumerate(columns):
        for key, value in column.items():
            matrix[keys[key], c] = value
    return _all_singular(matrix, unknowns, n)


def _monomials(variables: int, first_velocity: int, degree: int) -> Iterator[Exponents]:
    for size in range(2, degree + 1):
        for chosen in itertools.combinations_with_replacement(range(variables), size):
            exponents = tuple(chosen.count(k) for k in range(variables))
            if sum(exponents[first_velocity:]) >= 2:
                yield exponents


def _hessian(m: Exponents, n: int) -> list[list[Polynomial]]:
    one = {m: 1.0 / math.prod(map(math.factorial, m))}
    first = len(m) - n
    return [[slope(slope(one, first + i), first + j) for j in range(n)] for i in range(n)]


def _equations(
    g: list[list[Polynomial]],
    f: list[Polynomial],
    v: list[Polynomial],
    endomorphism: list[list[Polynomial]],
    order: int,
) -> Iterator[tuple[tuple[str, int, int, Exponents], float]]:
    n = len(f)
    offset = len(next(iter(v[0]))) - 2 * n
    connection = [[total((-0.5, slope(f[i], offset + n + j))) for j in range(n)] for i in range(n)]
    for i, j in itertools.combinations_with_replacement(range(n), 2):
        moved = _along(g[i][j], f, v, offset, order - 1)
        for a, b in ((i, j), (j, i)):
            moved += [(-1.0, product(g[a][k], connection[k][b], order - 1)) for k in range(n)]
        for key, value in total(*moved).items():
            if sum(key) < order:
                yield ("H2", i, j, key), value
        if i != j:
            pairs = [(1.0, product(g[i][k], endomorphism[k][j], order)) for k in range(n)]
            pairs += [(-1.0, product(g[j][k], endomorphism[k][i], order)) for k in range(n)]
            for key, value in total(*pairs).items():
                yield ("H3", i, j, key), value


def _along(
    p: Polynomial, f: list[Polynomial], v: list[Polynomial], offset: int, degree: int
) -> list[Term]:
    """The terms of Gamma(p); with an offset the first variable is t."""
    n = len(f)
    terms = [(1.0, product(v[k], slope(p, offset + k), degree)) for k in range(n)]
    terms += [(1.0, product(f[k], slope(p, offset + n + k), degree)) for k in range(n)]
    return terms + [(1.0, slope(p, 0))] * offset


def _endomorphism(
    f: list[Polynomial], v: list[Polynomial], offset: int, order: int
) -> list[list[Polynomial]]:
    span = range(len(f))
    rates = [[slope(f[i], offset + len(f) + j) for j in span] for i in span]

    def entry(i: int, j: int) -> Polynomial:
        squares = [(-0.5, product(rates[i][k], rates[k][j], order)) for k in span]
        return total(
            *_along(rates[i][j], f, v, offset, order), (-2.0, slope(f[i], offset + j)), *squares
        )

    return [[entry(i, j) for j in span] for i in span]


def _all_singular(matrix: np.ndarray, unknowns: list[Exponents], n: int) -> bool:
    scales = np.abs(matrix).max(axis=1)
    matrix = matrix[scales > 1e-14] / scales[scales > 1e-14, None]
    _, values, vectors = np.linalg.svd(matrix, full_matrices=True)
    rank = int((values > _TINY * values[0]).sum())
    lowest = [k for k, m in enumerate(unknowns) if sum(m) == 2]
    null = vectors[rank:, lowest]
    _, sizes, basis = np.linalg.svd(null, full_matrices=False)
    basis = basis[sizes > 1e-7]
    generator = np.random.default_rng(1)
    for _ in range(2 * len(basis)):
        weights = generator.normal(size=len(basis)) @ basis
        g = np.zeros((n, n))
        for k, value in zip(lowest, weights, strict=True):
            i, j = (index for index, e in enumerate(unknowns[k][-n:]) for _ in range(e))
            g[i, j] = g[j, i] = value
        if abs(np.linalg.det(g / np.abs(g).max())) > 1e-6:
            return False
    return True

"""The matrix G(t, q) of least degree in the atoms, where the conditions leave more than one up to a factor.

Carts with pendulums have a family of multipliers g, as M_t g + p p^T for a conserved momentum p; the one of a book is
of lowest degree. With the constants fixed, (H2) and (H3) themselves are linear equations for the coefficients of

    g_ij = sum of c_ijm m(t, q),  m a product of at most `degree` letters: cos, sin of angles, coordinates,

at random points modulo a prime. At the least degree with a solution, if it is the only one, its support is kept, and
its coefficients are interpolated as one vector in the constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, product

import numpy as np

from inverse_service.deadline import check
from inverse_service.expressions import tree as ex
from inverse_service.search.flow_points import PRIME, Flow, Generator, Numbers, Points
from inverse_service.search.one_matrix import OneMatrix
from inverse_service.search.projective import Given, Interpolation, NoFit, kernel_of, letters_of
from inverse_service.search.terms import (
    EMPTY,
    Monomial,
    Terms,
    add_terms,
    monomial_tree,
    multiply_terms,
    times,
)

# The highest degree, and unknown coefficients.
_DEGREE, _UNKNOWNS = 2, 700
# A coefficient: the entry of the matrix and the product of letters.
Column = tuple[int, Monomial]


def lowest_matrix(search: OneMatrix) -> list[Terms]:
    """The entries of the matrix; NoFit where no degree has exactly one regular solution."""
    variables = search.variables()
    own = [v for v in variables if _is_moving(v, search)]
    constants = [v for v in variables if v not in own]
    anchor = search.points({}, 1)
    fixed = {constant: int(anchor.value(constant)[0]) for constant in constants}
    for degree in range(_DEGREE + 1):
        monomials = list(_monomials(own, search, degree))
        columns = [(entry, key) for entry in range(len(search.pairs)) for key in monomials]
        if len(columns) > _UNKNOWNS:
            break
        solver = _Solver(search, columns)
        found = solver.kernels(fixed, 1)
        if found and len(found[0]) == 1:
            (vector,) = found[0]
            support = [column for column, value in zip(columns, vector, strict=True) if value]
            return _interpolated(search, support, constants)
        if found and found[0]:
            break
    raise NoFit("no least degree has one matrix")


def _is_moving(variable: Generator, search: OneMatrix) -> bool:
    names = {ex.TIME, *map(ex.Symbol, search.system.coordinates)}
    what = variable[1]
    trees: list[ex.Expression] = [p for p, _ in what] if isinstance(what, frozenset) else [what]  # type: ignore[list-item]
    return any(ex.holds(tree, *names) for tree in trees)


def _monomials(own: Sequence[Generator], search: OneMatrix, degree: int) -> list[Monomial]:
    """Products of letters of `degree` different variables at most; a coordinate only where it is no angle."""
    angles = {what for kind, what in own if kind == "angle"}
    used = [v for v in own if not (v[0] == "variable" and frozenset([(v[1], 1)]) in angles)]
    found: dict[Monomial, None] = {EMPTY: None}
    for size in range(1, degree + 1):
        for chosen in combinations(used, size):
            letters = [[letter for letter in letters_of(v, search.units) if letter] for v in chosen]
            for some in product(*letters):
                key = EMPTY
                for letter in some:
                    key = times(key, letter)
                found[key] = None
    return list(found)


def _interpolated(search: OneMatrix, support: Sequence[Column], constants: Sequence[Generator]) -> list[Terms]:
    solver = _Solver(search, support)

    def values(given: Given, count: int) -> tuple[Numbers, Points]:
        points = search.points(given, count)
        own = {constant: points.value(constant) for constant in constants}
        vectors = solver.kernels(own, count)
        good = [k for k, kernel in enumerate(vectors) if len(kernel) == 1]
        points.good = np.isin(np.arange(count), good)
        return np.array([vectors[k][0] for k in good], np.int64).reshape(len(good), len(support)).T, points

    coefficients = Interpolation(values, constants, search.units).terms()
    matrix: list[Terms] = [{} for _ in search.pairs]
    for (entry, key), terms in zip(support, coefficients, strict=True):
        matrix[entry] = add_terms(matrix[entry], multiply_terms(terms, {key: Fraction(1)}))
    return matrix


@dataclass(slots=True)
class _Solver:
    """(H2) and (H3) for sums of these columns."""

    search: OneMatrix
    columns: Sequence[Column]

    def kernels(self, given: Given, count: int) -> list[list[list[int]]]:
        """The coefficients that solve them, for each of `count` values of the given generators."""
        search, n = self.search, len(self.search.forces)
        each = len(search.pairs) + n * (n - 1) // 2
        places = -(-len(self.columns) // each) + 3
        wide = {key: np.repeat(np.broadcast_to(np.asarray(v, np.int64), count), 2 * places) for key, v in given.items()}
        points = search.points(wide, 2 * places * count)
        flow = Flow(points, search.forces, 2)
        connection, (tensor,) = flow.tensors(1)
        series = {key: flow.tree(monomial_tree(key)).data[0] for key in {key for _, key in self.columns}}
        check(len(self.columns) * points.count)
        rows = np.zeros((points.count, each, len(self.columns)), np.int64)
        number = {pair: k for k, pair in enumerate(search.pairs)}
        skew = list(combinations(range(n), 2))
        for c, (entry, key) in enumerate(self.columns):
            a, b = search.pairs[entry]
            value, rate = series[key][0], series[key][1]
            rows[:, entry, c] += rate
            for j in range(n):
                for i, m in {(a, b), (b, a)}:  # row i of g has this column at place m
                    # (g N)_ij + (g N)_ji
                    place = number[min(i, j), max(i, j)]
                    rows[:, place, c] -= value * connection[:, m, j] % PRIME * (2 if i == j else 1) % PRIME
            for row, (i, j) in enumerate(skew, len(search.pairs)):
                for p, m in {(a, b), (b, a)}:
                    if p == i:
                        rows[:, row, c] += value * tensor[:, m, j] % PRIME
                    if p == j:
                        rows[:, row, c] -= value * tensor[:, m, i] % PRIME
        rows %= PRIME
        found = []
        for k in range(count):
            block = slice(2 * places * k, 2 * places * (k + 1))
            good = np.flatnonzero(points.good[block])[:places] + 2 * places * k
            whole = rows[good].reshape(-1, len(self.columns))
            found.append(kernel_of(whole) if len(good) >= places else [])
        return found

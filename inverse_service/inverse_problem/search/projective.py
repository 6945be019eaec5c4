"""A vector of polynomials that is known up to a factor at points modulo a prime (Zippel 1979, projectively).

The vector (v_1 : ... : v_m) is one common polynomial vector (P_1, ..., P_m): with a reference entry r the unknown
coefficients solve v_e P_r(x) - v_r P_e(x) = 0, and no denominator is asked for. For each variable alone the least degree
for which there is a fit is found, the others fixed; then the variables are added one at a time, the support so far times
powers of the new one, and what comes out as 0 is dropped. The least degrees make the vector primitive.

The basis in an angle is c^a s^b with b <= 1, in any other variable its powers. Coefficients are divided by one of them and
reconstructed as rational numbers; that the result is right is for the caller to check.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from flint import nmod_mat

from inverse_service.algebra.modular import reconstruct
from inverse_service.deadline import check
from inverse_service.expressions import tree as ex
from inverse_service.inverse_problem.search.flow_points import PRIME, Generator, Numbers, Points, Units, generator_tree
from inverse_service.inverse_problem.search.terms import Monomial, Terms, add_terms, terms_of, times

# Degrees in one variable, unknown coefficients, and draws for one batch of points.
_DEGREE, _UNKNOWNS, _DRAWS = 8, 1_200, 24
# Numerators and denominators that one prime of 31 bits can tell apart.
_LARGEST = 32_767
Power = tuple[int, int]
# The vector at points with these generators fixed, (entries, points), and the good points themselves.
Values = Callable[[dict[Generator, int], int], tuple[Numbers, Points]]


class NoFit(ArithmeticError):
    """No polynomial vector of moderate degree was found."""


@dataclass(slots=True)
class Interpolation:
    """The vector as polynomials in the variables; `polynomials[e]` maps exponents of all variables to coefficients."""

    values: Values
    variables: Sequence[Generator]
    units: Units

    def terms(self) -> list[Terms]:
        """The entries as sums of products of letters, with integer coefficients without a common factor."""
        anchor_values, anchor = self.drawn({}, 1)
        fixed = {variable: int(anchor.value(variable)[0]) for variable in self.variables}
        entries = [e for e in range(anchor_values.shape[0]) if anchor_values[e, 0]]
        entries = sorted({*entries, *self._met(anchor_values.shape[0])})
        support: list[list[tuple[Power, ...]]] = [[()] for _ in entries]
        done: list[Generator] = []
        vector: list[int] = [1] * len(entries)
        if len(entries) > 1:
            degrees = {variable: self._degree(variable, entries, fixed) for variable in self.variables}
            for variable in self.variables:
                if degrees[variable] == 0:
                    continue
                done.append(variable)
                added = _basis(variable, degrees[variable])
                candidates = [[(*old, power) for power in added for old in olds] for olds in support]
                support, vector = self._fitted(candidates, entries, done, fixed)
            if not done:
                support, vector = self._fitted(support, entries, done, fixed)
        found = self._trees(support, vector, done)
        whole: list[Terms] = [{} for _ in range(anchor_values.shape[0])]
        for e, terms in zip(entries, found, strict=True):
            whole[e] = terms
        return whole

    def drawn(self, fixed: dict[Generator, int], count: int) -> tuple[Numbers, Points]:
        """At least so many points, all good."""
        for k in range(_DRAWS):
            check(count)
            values, points = self.values(fixed, (count + 8) << min(k, 3))
            if values.shape[1] >= count:
                return values, points
        raise NoFit("too few points")

    def _met(self, size: int) -> set[int]:
        values, _ = self.drawn({}, 3)
        return {e for e in range(size) if values[e].any()}

    def _degree(self, variable: Generator, entries: Sequence[int], fixed: dict[Generator, int]) -> int:
        """The least degree in one variable, the others fixed."""
        others = {key: value for key, value in fixed.items() if key != variable}
        for degree in range(_DEGREE + 1):
            basis = [[(power,) for power in _basis(variable, degree)] for _ in entries]
            if self._kernel(basis, entries, [variable], others):
                return degree
        raise NoFit("the degree in one variable is high")

    def _fitted(
        self,
        candidates: list[list[tuple[Power, ...]]],
        entries: Sequence[int],
        done: Sequence[Generator],
        fixed: dict[Generator, int],
    ) -> tuple[list[list[tuple[Power, ...]]], list[int]]:
        """The support and the coefficients of the only vector in the span of the candidates."""
        others = {key: value for key, value in fixed.items() if key not in done}
        kernel = self._kernel(candidates, entries, done, others)
        if len(kernel) != 1:
            raise NoFit("the vector is not the only one in its support")
        (vector,), place = kernel, 0
        kept, coefficients = list[list[tuple[Power, ...]]](), list[int]()
        for olds in candidates:
            values = vector[place : place + len(olds)]
            place += len(olds)
            kept.append([old for old, value in zip(olds, values, strict=True) if value])
            coefficients += [value for value in values if value]
        return kept, coefficients

    def _kernel(
        self,
        candidates: Sequence[Sequence[tuple[Power, ...]]],
        entries: Sequence[int],
        done: Sequence[Generator],
        others: dict[Generator, int],
    ) -> list[list[int]]:
        """A basis of the coefficients of all fits."""
        unknowns = sum(map(len, candidates))
        if unknowns > _UNKNOWNS:
            raise NoFit("too many unknown coefficients")
        count = -(-unknowns // max(1, len(entries) - 1)) + 4
        values, points = self.drawn(others, count)
        values = values[:, :count]
        powers = {
            old: self._value(old, done, points)[:count] for olds in candidates for old in dict.fromkeys(olds)
        }
        reference = min(range(len(entries)), key=lambda k: (len(candidates[k]), k))
        starts = np.cumsum([0, *map(len, candidates)])
        blocks = []
        for k, e in enumerate(entries):
            if k == reference:
                continue
            block = np.zeros((count, unknowns), np.int64)
            for j, old in enumerate(candidates[reference]):
                block[:, starts[reference] + j] = values[e] * powers[old] % PRIME
            for j, old in enumerate(candidates[k]):
                block[:, starts[k] + j] = (PRIME - values[entries[reference]]) * powers[old] % PRIME
            blocks.append(block)
        rows = np.concatenate(blocks)
        return kernel_of(rows)

    def _value(self, powers: tuple[Power, ...], done: Sequence[Generator], points: Points) -> Numbers:
        result = np.ones(points.count, np.int64)[points.good]
        for power, variable in zip(powers, done, strict=True):
            for base, e in zip(letters_at(variable, points), power, strict=True):
                for _ in range(e):
                    result = result * base[points.good] % PRIME
        return result

    def _trees(
        self, support: Sequence[Sequence[tuple[Power, ...]]], vector: Sequence[int], done: Sequence[Generator]
    ) -> list[Terms]:
        unit = pow(vector[0], -1, PRIME)
        numbers = [reconstruct(value * unit % PRIME, PRIME, _LARGEST) for value in vector]
        if any(number is None for number in numbers):
            raise NoFit("the coefficients are no small rational numbers")
        found, place = list[Terms](), 0
        letters = [letters_of(variable, self.units) for variable in done]
        for olds in support:
            total: Terms = {}
            for old in olds:
                key: Monomial = frozenset()
                for power, pair in zip(old, letters, strict=True):
                    for letter, e in zip(pair, power, strict=True):
                        key = times(key, letter, e) if e else key
                number = numbers[place]
                assert number is not None
                total = add_terms(total, {key: number})
                place += 1
            found.append(total)
        return found


def kernel_of(rows: Numbers) -> list[list[int]]:
    """A basis of the vectors that a matrix modulo the prime takes to 0."""
    height, width = rows.shape
    matrix = nmod_mat(height, width, rows.ravel().tolist(), PRIME)
    echelon, rank = matrix.rref()
    if rank == width:
        return []
    table = [[int(echelon[i, j]) for j in range(width)] for i in range(rank)]
    pivots = [next(j for j, value in enumerate(row) if value) for row in table]
    found = []
    for free in (j for j in range(width) if j not in set(pivots)):
        vector = [0] * width
        vector[free] = 1
        for pivot, row in zip(pivots, table, strict=True):
            vector[pivot] = -row[free] % PRIME
        found.append(vector)
    return found


def _basis(variable: Generator, degree: int) -> list[Power]:
    """Exponents of (cos, sin) of an angle, of (x, nothing) for other variables."""
    if variable[0] == "angle":
        return [(total - b, b) for total in range(degree + 1) for b in (0, 1) if b <= total]
    return [(k, 0) for k in range(degree + 1)]


def letters_at(variable: Generator, points: Points) -> tuple[Numbers, Numbers]:
    """The values of the two letters of a variable, the second one of an angle alone."""
    if variable[0] == "angle":
        sine, cosine = points.circle(variable[1])  # type: ignore[arg-type]
        return cosine, sine
    return points.value(variable), np.ones(points.count, np.int64)


def letters_of(variable: Generator, units: Units) -> tuple[Monomial, Monomial]:
    """The two letters of a variable as monomials."""
    tree = generator_tree(variable, units)
    second = ex.Apply("sin", tree.argument) if variable[0] == "angle" and isinstance(tree, ex.Apply) else ex.ONE
    return _monomial(tree), _monomial(second)


def _monomial(tree: ex.Expression) -> Monomial:
    terms = terms_of(tree)
    ((key, value),) = terms.items()
    if value != 1:
        raise NoFit("a letter has a factor")
    return key


def whole_numbers(vector: Sequence[Terms]) -> list[Terms]:
    """The vector times the number that makes its coefficients integers without a common factor."""
    from math import gcd, lcm

    numbers = [value for terms in vector for value in terms.values()]
    if not numbers:
        return list(vector)
    factor = Fraction(lcm(*(n.denominator for n in numbers)), gcd(*(n.numerator for n in numbers)))
    return [{key: value * factor for key, value in terms.items()} for terms in vector]

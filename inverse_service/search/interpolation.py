"""Interpolate a vector of polynomials known up to a factor at points modulo a prime (Zippel 1979,
projectively).

The vector (v_1 : ... : v_m) is proportional to one polynomial vector (P_1, ..., P_m): with a
reference entry r, the unknown coefficients solve v_e P_r(x) - v_r P_e(x) = 0, and no denominator is
needed. First, the least degree with a fit is found for each variable, with the others fixed. Then
the variables are added one at a time: the current support is multiplied by powers of the new
variable, and zero coefficients are dropped. The least degrees make the vector primitive.

The basis for an angle is c^a s^b with b <= 1, and for any other variable its powers. Coefficients
are divided by one of them and reconstructed as rational numbers. The caller must verify the result.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm
from typing import NamedTuple

import numpy as np

from inverse_service import deadline
from inverse_service.expressions import tree as ex
from inverse_service.expressions.terms import (
    Monomial,
    Terms,
    add_terms,
    monomial_tree,
    terms_of,
    times,
)
from inverse_service.field import flow, matrices, modular
from inverse_service.field.flow import PRIME, Generator, Numbers, Points, Units, generator_tree

# Limits on the degree in one variable, the unknown coefficients, and the draws for one batch of
# points.
_DEGREE, _UNKNOWNS, _DRAWS = 12, 1_200, 9
# Points for the degree in one variable.
_BLOCK = 24
# The largest numerator and denominator that one prime of 31 bits determines.
_LARGEST = 32_767
Power = tuple[int, int]
# The vector at points with these generators fixed, (entries, points), and the good points
# themselves.
Given = Mapping[Generator, int | Numbers]


class Drawn(NamedTuple):
    """A vector of entries at the good ones of some points, (entries, good points)."""

    values: Numbers
    points: Points


Values = Callable[[Given, int], Drawn]


class NoFit(ArithmeticError):
    """No polynomial vector of moderate degree was found."""


@dataclass(slots=True)
class Interpolation:
    """The vector as polynomials; `polynomials[e]` maps exponents of all variables to
    coefficients.
    """

    values: Values
    variables: Sequence[Generator]
    units: Units

    def terms(self) -> list[Terms]:
        """The entries as sums of products of generators, with integer coefficients without a common
        factor.

        `support` holds, for each entry, the products of powers of the variables that are `done`.
        """
        values, anchor = self.drawn({}, 3)
        first = int(np.flatnonzero(anchor.good)[0])
        fixed = {variable: int(anchor.value(variable)[first]) for variable in self.variables}
        entries = [e for e in range(len(values)) if values[e].any()]
        support: list[list[tuple[Power, ...]]] = [[()] for _ in entries]
        done: list[Generator] = []
        vector: list[int] = [1] * len(entries)
        if len(entries) > 1:
            degrees = self._degrees(entries, fixed)
            for variable in self.variables:
                if degrees[variable] == 0:
                    continue
                done.append(variable)
                # A root is no factor twice, and where one is a factor already, the degree may be
                # less.
                root = _radicand(variable, self.units)
                shared = [
                    k
                    for k, one in enumerate(done[:-1])
                    if root and _radicand(one, self.units) == root
                ]
                for degree in range(0 if shared else degrees[variable], degrees[variable] + 1):
                    candidates = [
                        [(*one, power) for power in _basis(variable, degree, self.units) for one in products
                         if not (power[1] and any(one[k][1] for k in shared))]
                        for products in support
                    ]  # fmt: skip
                    kernel = self._kernel(candidates, entries, done, _without(fixed, done))
                    if kernel:
                        break
                support, vector = _split(candidates, kernel)
            if not done:
                support, vector = _split(support, self._kernel(support, entries, done, fixed))
        found = self._entries(support, vector, done)
        known = dict(zip(entries, found, strict=True))
        return _whole_numbers([known.get(e, {}) for e in range(len(values))])

    def drawn(self, fixed: Given, count: int) -> Drawn:
        """The vector at `count` or more good points, and these points."""
        for k in range(_DRAWS):
            deadline.check(count)
            drawn = self.values(fixed, (count + 8) << min(k, 5))
            if drawn.values.shape[1] >= count:
                return drawn
        raise NoFit("too few points")

    def _degrees(
        self, entries: Sequence[int], fixed: Mapping[Generator, int]
    ) -> dict[Generator, int]:
        """The least degree in each variable with the others fixed, all from one batch of points."""
        block, generator = _BLOCK, np.random.default_rng(sum(fixed.values()) % PRIME)
        total = block * len(self.variables)
        given: dict[Generator, int | Numbers] = {}
        for place, variable in enumerate(self.variables):
            values = np.full(total, fixed[variable], np.int64)
            values[place * block : (place + 1) * block] = generator.integers(2, PRIME - 2, block)
            given[variable] = values
        values, points = self.values(given, total)
        own = np.arange(total)[points.good] // block
        found = {}
        for place, variable in enumerate(self.variables):
            mine = np.flatnonzero(own == place)
            for degree in range(_DEGREE + 1):
                basis = [
                    [(power,) for power in _basis(variable, degree, self.units)] for _ in entries
                ]
                if _needed(basis) <= len(mine):
                    fits = _fits(
                        basis, entries, values, _product_values(basis, [variable], points), mine
                    )
                else:
                    fits = self._kernel(basis, entries, [variable], _without(fixed, [variable]))
                if fits:
                    found[variable] = degree
                    break
            else:
                raise NoFit("the degree in one variable is high")
        return found

    def _kernel(
        self,
        candidates: Sequence[Sequence[tuple[Power, ...]]],
        entries: Sequence[int],
        done: Sequence[Generator],
        others: Given,
    ) -> list[list[int]]:
        """A basis of the coefficients of all fits."""
        unknowns = sum(map(len, candidates))
        if unknowns > _UNKNOWNS:
            raise NoFit("too many unknown coefficients")
        count = _needed(candidates)
        values, points = self.drawn(others, count)
        return _fits(
            candidates, entries, values, _product_values(candidates, done, points), np.arange(count)
        )

    def _entries(
        self,
        support: Sequence[Sequence[tuple[Power, ...]]],
        vector: Sequence[int],
        done: Sequence[Generator],
    ) -> list[Terms]:
        """The entries with these products of powers and coefficients, scaled so that the first
        coefficient is 1.
        """
        unit = pow(vector[0], -1, PRIME)
        numbers = [modular.reconstruct(value * unit % PRIME, PRIME, _LARGEST) for value in vector]
        if None in numbers:
            raise NoFit("the coefficients are not small rational numbers")
        found, known = list[Terms](), filter(None, numbers)
        letters = [basis_monomials(variable, self.units) for variable in done]
        for products in support:
            total: Terms = {}
            for one in products:
                key: Monomial = frozenset()
                for power, pair in zip(one, letters, strict=True):
                    for letter, e in zip(pair, power, strict=True):
                        key = times(key, letter, e) if e else key
                total = add_terms(total, {key: next(known)})
            found.append(total)
        return found


def _split(
    candidates: Sequence[list[tuple[Power, ...]]], kernel: Sequence[Sequence[int]]
) -> tuple[list[list[tuple[Power, ...]]], list[int]]:
    """The support and coefficients of the unique vector in the span of the candidates."""
    if len(kernel) != 1:
        raise NoFit("the vector is not the only one in its support")
    values = iter(kernel[0])
    return [[one for one in products if next(values)] for products in candidates], list(
        filter(None, kernel[0])
    )


def _without(fixed: Mapping[Generator, int], done: Sequence[Generator]) -> dict[Generator, int]:
    return {key: value for key, value in fixed.items() if key not in done}


def _needed(candidates: Sequence[Sequence[tuple[Power, ...]]]) -> int:
    """The number of points that determines all coefficients: each point gives one equation per
    entry.
    """
    least = min(map(len, candidates))
    together = -(-sum(map(len, candidates)) // max(1, len(candidates) - 1))
    return max(together, least + max(map(len, candidates))) + 4


def _product_values(
    candidates: Sequence[Sequence[tuple[Power, ...]]], done: Sequence[Generator], points: Points
) -> dict[tuple[Power, ...], Numbers]:
    """The value of each product of powers at the good points."""
    letters = [basis_monomials(variable, points.units) for variable in done]
    bases = [[flow.values_of(monomial_tree(key), points) for key in pair] for pair in letters]
    found = {}
    for one in dict.fromkeys(one for products in candidates for one in products):
        result = np.ones(int(points.good.sum()), np.int64)
        for power, pair in zip(one, bases, strict=True):
            for base, e in zip(pair, power, strict=True):
                result = result * flow.powers(base[points.good], e) % PRIME
        found[one] = result
    return found


def _fits(
    candidates: Sequence[Sequence[tuple[Power, ...]]],
    entries: Sequence[int],
    values: Numbers,
    powers: Mapping[tuple[Power, ...], Numbers],
    chosen: Numbers,
) -> list[list[int]]:
    """A basis of the coefficients with v_e P_r = v_r P_e at the chosen points."""
    reference = min(range(len(entries)), key=lambda k: (len(candidates[k]), k))
    starts = np.cumsum([0, *map(len, candidates)])
    blocks = []
    for k, e in enumerate(entries):
        if k == reference:
            continue
        block = np.zeros((len(chosen), int(starts[-1])), np.int64)
        for j, one in enumerate(candidates[reference]):
            block[:, starts[reference] + j] = values[e][chosen] * powers[one][chosen] % PRIME
        for j, one in enumerate(candidates[k]):
            block[:, starts[k] + j] = (
                (PRIME - values[entries[reference]][chosen]) * powers[one][chosen] % PRIME
            )
        blocks.append(block)
    return null_basis(np.concatenate(blocks))


def null_basis(rows: Numbers) -> list[list[int]]:
    """A basis of the kernel of a matrix modulo the prime."""
    return matrices.null_rows(rows.tolist(), rows.shape[1], PRIME)


def _basis(variable: Generator, degree: int, units: Units) -> list[Power]:
    """Exponents of (cos, sin) for an angle, of (x, sqrt(P(x)) if it occurs) for other variables."""
    if variable[0] == "angle" or _radicand(variable, units):
        return [(total - b, b) for total in range(degree + 1) for b in (0, 1) if b <= total]
    return [(k, 0) for k in range(degree + 1)]


def basis_monomials(variable: Generator, units: Units) -> tuple[Monomial, Monomial]:
    """The two generators of a variable as monomials."""
    tree, second = (
        generator_tree(variable, units),
        ex.power(_radicand(variable, units) or ex.ONE, ex.HALF),
    )
    if variable[0] == "angle" and isinstance(tree, ex.Apply):
        second = ex.Apply("sin", tree.argument)
    return _monomial(tree), _monomial(second)


def _radicand(variable: Generator, units: Units) -> ex.Expression | None:
    return units.radicands.get(variable[1]) if variable[0] == "variable" else None


def _monomial(tree: ex.Expression) -> Monomial:
    ((key, value),) = terms_of(tree).items()
    if value != 1:
        raise NoFit("a generator has a numeric factor")
    return key


def _whole_numbers(vector: Sequence[Terms]) -> list[Terms]:
    """The multiple of the vector whose coefficients are integers without a common factor."""
    numbers = [value for terms in vector for value in terms.values()]
    if not numbers:
        return list(vector)
    factor = Fraction(lcm(*(n.denominator for n in numbers)), gcd(*(n.numerator for n in numbers)))
    return [{key: value * factor for key, value in terms.items()} for terms in vector]

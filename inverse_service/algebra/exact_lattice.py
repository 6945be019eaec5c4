"""Linear relations over Q among the arguments of functions.

exp(2x) and exp(x), sin(a - b) and sin a, sin b are dependent because their arguments are. A basis of
the arguments, scaled so that every argument is an integer combination, gives independent generators.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import fmpz

from inverse_service.algebra.rational_functions import Quotient, TooLarge, as_fraction

Coordinates = Mapping[Any, Fraction]
# Of a basis element; powers of a generator are expanded.
_LARGEST_MULTIPLE = 1_000


@dataclass(frozen=True, slots=True)
class ArgumentBasis:
    """Arguments u_k = sum_b coefficients[k][b] * u_(chosen[b]) / scales[b], coefficients integer."""

    chosen: tuple[int, ...]
    scales: tuple[int, ...]
    coefficients: tuple[tuple[int, ...], ...]


def coordinates_of(argument: Quotient) -> Coordinates:
    """The argument as a combination of monomials over its denominator."""
    terms = argument.numerator.terms()
    return {(argument.exponents, monomial): as_fraction(value) for monomial, value in terms}


def factor_coordinates(argument: Quotient) -> Coordinates:
    """The exponents of the prime numbers, irreducible numerator factors and denominators."""
    content, factors = argument.numerator.factor()
    constant = as_fraction(content)
    table: dict[Any, Fraction] = {(0, repr(factor)): Fraction(power) for factor, power in factors}
    table |= {(1, index): Fraction(-power) for index, power in argument.exponents}
    for sign, value in ((1, abs(constant.numerator)), (-1, constant.denominator)):
        table |= {(2, int(ell)): Fraction(sign * int(power)) for ell, power in fmpz(value).factor()}
    return table


def argument_basis(vectors: Sequence[Coordinates]) -> ArgumentBasis:
    """A basis taken from the vectors themselves, simplest first."""
    order = sorted(range(len(vectors)), key=lambda index: (_size(vectors[index]), index))
    chosen: list[int] = []
    expressed: dict[int, list[Fraction]] = {}
    for index in order:
        combination = _solve([vectors[other] for other in chosen], vectors[index])
        if combination is None:
            combination = [Fraction(0)] * len(chosen) + [Fraction(1)]
            chosen.append(index)
        expressed[index] = combination
    rows = [_padded(expressed[index], len(chosen)) for index in range(len(vectors))]
    scales = tuple(math.lcm(*(row[column].denominator for row in rows)) for column in range(len(chosen)))
    integers = tuple(tuple(int(c * m) for c, m in zip(row, scales, strict=True)) for row in rows)
    if any(abs(k) > _LARGEST_MULTIPLE for row in integers for k in row):
        raise TooLarge("the arguments of exponentials or angles are too large multiples of a common one")
    return ArgumentBasis(tuple(chosen), scales, integers)


def _size(vector: Coordinates) -> tuple[int, int]:
    return len(vector), sum(abs(c.numerator) + c.denominator for c in vector.values())


def _padded(row: list[Fraction], length: int) -> list[Fraction]:
    return row + [Fraction(0)] * (length - len(row))


def _solve(basis: Sequence[Coordinates], target: Coordinates) -> list[Fraction] | None:
    """Coefficients c with target = sum c_b basis_b for independent basis vectors, or None."""
    keys = sorted({key for vector in (*basis, target) for key in vector}, key=repr)
    rows = [[vector.get(key, Fraction(0)) for vector in (*basis, target)] for key in keys]
    for column in range(len(basis)):
        pivot = next(index for index in range(column, len(rows)) if rows[index][column])
        rows[column], rows[pivot] = rows[pivot], rows[column]
        lead = rows[column][column]
        rows[column] = [value / lead for value in rows[column]]
        for index, row in enumerate(rows):
            if index != column and row[column]:
                factor = row[column]
                rows[index] = [a - factor * b for a, b in zip(row, rows[column], strict=True)]
    if any(row[-1] for row in rows[len(basis) :]):
        return None
    return [rows[column][-1] for column in range(len(basis))]

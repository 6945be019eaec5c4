"""Truncated multivariate power series over a prime field, by homogeneous components.

A series of order D in m displacements is the tuple (y_0, …, y_D) of its homogeneous components,
each a python-flint nmod_mpoly; products cost no terms beyond degree D. Functions come from the
Euler operator E y = (0 y_0, 1 y_1, 2 y_2, …): for y = exp(u), E y = y E u reads
k y_k = sum_j j u_j y_{k-j}; powers, logarithms and trigonometric functions alike (Knuth, TAOCP 2, 4.7).
The constant y_0 of a transcendental function is an argument: who calls chooses it consistently.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from flint import Ordering, nmod_mpoly, nmod_mpoly_ctx

Series = tuple[nmod_mpoly, ...]


class SingularPoint(ArithmeticError):
    """A division by a series without constant term: the point is not generic enough."""


@dataclass(frozen=True, slots=True)
class SeriesRing:
    """Series of order `order` in `size` displacements modulo `prime`."""

    prime: int
    size: int
    order: int

    @property
    def context(self) -> nmod_mpoly_ctx:
        return _context(self.prime, self.size)

    def constant(self, value: int) -> Series:
        zero = self.context.constant(0)
        return (self.context.constant(value % self.prime),) + (zero,) * self.order

    def variable(self, index: int, value: int) -> Series:
        """value + the displacement number `index`."""
        series = list(self.constant(value))
        if self.order:
            series[1] = self.context.gen(index)
        return tuple(series)

    def invert_number(self, value: int) -> int:
        if value % self.prime == 0:
            raise SingularPoint("division by zero modulo the prime")
        return pow(value, -1, self.prime)


@lru_cache(maxsize=64)
def _context(prime: int, size: int) -> nmod_mpoly_ctx:
    names = tuple(f"d{index}" for index in range(size))
    return nmod_mpoly_ctx.get(names, modulus=prime, ordering=Ordering.degrevlex)


def value_at_point(series: Series) -> int:
    """The constant term."""
    terms = series[0].to_dict()
    return int(next(iter(terms.values()))) if terms else 0


def gradient(series: Series) -> list[int]:
    """The first derivatives at the point by all displacements."""
    values = [0] * series[1].context().nvars()
    for exponents, value in series[1].to_dict().items():
        values[exponents.index(1)] = int(value)
    return values


def add(left: Series, right: Series) -> Series:
    return tuple(a + b for a, b in zip(left, right, strict=True))


def subtract(left: Series, right: Series) -> Series:
    return tuple(a - b for a, b in zip(left, right, strict=True))


def scale(series: Series, factor: int) -> Series:
    return tuple(a * factor for a in series)


def multiply(left: Series, right: Series) -> Series:
    """The product, truncated."""
    size, zero = len(left), left[0] * 0
    factors = [(k, y) for k, y in enumerate(right) if y]
    result: list[nmod_mpoly | None] = [None] * size
    for j, x in enumerate(left):
        if not x:
            continue
        for k, y in factors:
            if j + k >= size:
                break
            before = result[j + k]
            result[j + k] = x * y if before is None else before + x * y
    return tuple(zero if part is None else part for part in result)


def _convolve(left: Series, right: Series, degree: int, first: int = 0) -> nmod_mpoly:
    """sum_{j=first}^{degree} left_j right_{degree-j}."""
    total = left[0] * 0
    for j in range(first, degree + 1):
        if left[j] and right[degree - j]:
            total += left[j] * right[degree - j]
    return total


def euler(series: Series) -> Series:
    """The Euler operator: component k times k."""
    return tuple(a * k for k, a in enumerate(series))


def inverse(ring: SeriesRing, series: Series) -> Series:
    """1/series; SingularPoint where the constant term is 0."""
    factor = ring.invert_number(value_at_point(series))
    result = [ring.context.constant(factor)]
    for degree in range(1, len(series)):
        padded = (*result, series[0] * 0)
        result.append(_convolve(series, padded, degree, first=1) * (-factor))
    return tuple(result)


def power(ring: SeriesRing, base: Series, exponent: Fraction, start: int) -> Series:
    """base^exponent with constant term `start`: b_0 k y_k = sum_{j>=1} (exponent j - (k-j)) b_j y_{k-j}."""
    factor = ring.invert_number(value_at_point(base))
    rational = exponent.numerator * ring.invert_number(exponent.denominator) % ring.prime
    result = [ring.context.constant(start)]
    for k in range(1, len(base)):
        total = base[0] * 0
        for j in range(1, k + 1):
            if base[j] and result[k - j]:
                total += base[j] * result[k - j] * ((rational * j - (k - j)) % ring.prime)
        result.append(total * (factor * ring.invert_number(k) % ring.prime))
    return tuple(result)


def integer_power(ring: SeriesRing, base: Series, exponent: int) -> Series:
    """base^exponent for any integer; works where base vanishes at the point, for exponent >= 0."""
    if exponent < 0:
        return integer_power(ring, inverse(ring, base), -exponent)
    if exponent > 4 and value_at_point(base):
        return power(ring, base, Fraction(exponent), pow(value_at_point(base), exponent, ring.prime))
    result = ring.constant(1)
    for digit in bin(exponent)[2:]:
        result = multiply(result, result)
        if digit == "1":
            result = multiply(result, base)
    return result


def exponential(ring: SeriesRing, argument: Series, start: int) -> Series:
    """exp(argument) with exp(argument_0) = start."""
    slope = euler(argument)
    result = [ring.context.constant(start)]
    for k in range(1, len(argument)):
        total = sum((slope[j] * result[k - j] for j in range(1, k + 1) if slope[j]), argument[0] * 0)
        result.append(total * ring.invert_number(k))
    return tuple(result)


def sine_cosine(ring: SeriesRing, argument: Series, sine: int, cosine: int) -> tuple[Series, Series]:
    """sin and cos of the argument, given their values at its constant term."""
    slope = euler(argument)
    s, c = [ring.context.constant(sine)], [ring.context.constant(cosine)]
    for k in range(1, len(argument)):
        factor = ring.invert_number(k)
        parts = [j for j in range(1, k + 1) if slope[j]]
        next_s = sum((slope[j] * c[k - j] for j in parts), argument[0] * 0) * factor
        next_c = sum((slope[j] * s[k - j] for j in parts), argument[0] * 0) * (-factor)
        s.append(next_s)
        c.append(next_c)
    return tuple(s), tuple(c)


def logarithm(ring: SeriesRing, argument: Series, start: int) -> Series:
    """log(argument) with the given constant term: E y = E u / u."""
    return antiderivative(ring, multiply(euler(argument), inverse(ring, argument)), start)


def arctangent(ring: SeriesRing, argument: Series, start: int) -> Series:
    """atan(argument) with the given constant term: E y = E u / (1 + u^2)."""
    denominator = add(ring.constant(1), multiply(argument, argument))
    return antiderivative(ring, multiply(euler(argument), inverse(ring, denominator)), start)


def antiderivative(ring: SeriesRing, slope: Series, start: int) -> Series:
    """y with E y = slope (slope_0 = 0) and y_0 = start."""
    tail = tuple(a * ring.invert_number(k) for k, a in enumerate(slope) if k)
    return (ring.context.constant(start), *tail)


def compose(ring: SeriesRing, arguments: Sequence[Series], jet: Callable[[tuple[int, ...]], int]) -> Series:
    """A(arguments) for an arbitrary function with partial derivatives jet(orders) at their values."""
    moved = [subtract(u, ring.constant(value_at_point(u))) for u in arguments]
    powers = [_powers(ring, u) for u in moved]
    total = ring.constant(0)
    for orders in itertools.product(range(ring.order + 1), repeat=len(arguments)):
        if sum(orders) > ring.order:
            continue
        term = ring.constant(1)
        for table, k in zip(powers, orders, strict=True):
            term = multiply(term, table[k]) if k else term
        factorials = math.prod(math.factorial(k) for k in orders)
        total = add(total, scale(term, jet(orders) * ring.invert_number(factorials) % ring.prime))
    return total


def _powers(ring: SeriesRing, series: Series) -> list[Series]:
    table = [ring.constant(1)]
    for _ in range(ring.order):
        table.append(multiply(table[-1], series))
    return table


def derivative(series: Series, index: int) -> Series:
    """The partial derivative; its top component (unknown) is dropped, so the order falls by one."""
    return tuple(component.derivative(index) if component else component for component in series[1:])


def along(field: Iterable[tuple[int, Series]], series: Series) -> Series:
    """sum_a X^a d_a y for the components (a, X^a) of a field, one order less; what is not known there is dropped."""
    length = len(series) - 1
    total = scale(series, 0)[:length]
    for index, part in field if any(series) else ():
        slope = derivative(series, index)
        if any(slope):
            total = add(total, multiply(part[:length], slope))
    return total


def terms(series: Series) -> Mapping[tuple[int, ...], int]:
    """All coefficients as {exponents: value}."""
    table: dict[tuple[int, ...], int] = {}
    for component in series:
        table.update((key, int(value)) for key, value in component.to_dict().items())
    return table

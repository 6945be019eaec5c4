"""Members with exact rational coefficients: projections on linear conditions, and short numbers
beside a nearest point.

A linear set K c + k = 0 is projected on in rational arithmetic, c = c0 - C K^T (K C K^T)^-1 (K c0 +
k). A member in short numbers has rational values for the coefficients that the conditions leave
free, and the others follow from them exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from inverse_service.fitting.fitted import FittedSystem, Floats, fraction_of, rational_matrix

Rows = Sequence[Sequence[Fraction]]  # (k, K), one for each condition
Numbers = tuple[Fraction, ...]
# A member may be farther than the nearest by this part of its distance, or by so much of an error.
CLOSE, CLOSE_ERRORS, CLOSE_RELATIVE = 1e-6, 1e-3, 1e-7
MOST_DIGITS = 15
NICE_DENOMINATORS = (1, 2, 3, 4, 6, 8, 10, 12, 20, 50, 100, 200, 500, 1000)


@dataclass(frozen=True, slots=True)
class LinearSet:
    """The solutions of K c + k = 0: c = offset + free values times `basis`, the columns `free`
    being those values themselves.
    """

    free: tuple[int, ...]
    bound: tuple[int, ...]
    # bound[a] = constants[a] + sum_b slopes[a][b] * c[free[b]]
    constants: Numbers
    slopes: tuple[Numbers, ...]

    def point(self, values: Sequence[Fraction]) -> Numbers:
        """The solution with these free coefficients."""
        found = [Fraction(0)] * (len(self.free) + len(self.bound))
        for place, value in zip(self.free, values, strict=True):
            found[place] = value
        for place, constant, row in zip(self.bound, self.constants, self.slopes, strict=True):
            found[place] = constant + sum(
                (a * b for a, b in zip(row, values, strict=True) if a), Fraction(0)
            )
        return tuple(found)


def solutions(rows: Rows, size: int, order: Sequence[int]) -> LinearSet | None:
    """The solutions of K c + k = 0, None if there are none; coefficients that come first in `order`
    are determined by the later ones.
    """
    if not rows:
        return LinearSet(tuple(range(size)), (), (), ())
    turned = [[*(row[1 + k] for k in order), -row[0]] for row in rows]
    reduced, rank = rational_matrix(turned).rref()
    table = [[fraction_of(reduced[i, j]) for j in range(size + 1)] for i in range(rank)]
    pivots = [next(j for j, value in enumerate(row) if value) for row in table]
    if size in pivots:
        return None
    free = sorted((j for j in range(size) if j not in pivots), key=lambda j: order[j])
    return LinearSet(
        tuple(order[j] for j in free),
        tuple(order[j] for j in pivots),
        tuple(row[-1] for row in table),
        tuple(tuple(-row[j] for j in free) for row in table),
    )


def projection(rows: Rows, fitted: FittedSystem) -> Numbers | None:
    """The exact nearest solution of K c + k = 0; None if there is none."""
    size = len(fitted.values)
    found = solutions(rows, size, range(size))
    if found is None:
        return None
    # c = p + N z; N^T C^-1 N z = N^T C^-1 (c0 - p) has the size of what is free, K C K^T that of
    # what is bound: the smaller system is solved.
    covariance = fitted.metric.covariance
    independent = [[Fraction(int(j == place)) for j in range(size)] for place in found.bound]
    for line, constant, slopes in zip(independent, found.constants, found.slopes, strict=True):
        for place, slope in zip(found.free, slopes, strict=True):
            line[place] = -slope
        line.append(-constant)
    if not independent:
        return fitted.values
    k = rational_matrix([line[:-1] for line in independent])
    rest = rational_matrix([[line[-1]] for line in independent])
    c = rational_matrix([[value] for value in fitted.values])
    spread = rational_matrix(covariance)
    turned = spread * k.transpose()
    moved = turned * (k * turned).solve(k * c + rest)
    return tuple(value - fraction_of(moved[place, 0]) for place, value in enumerate(fitted.values))


def weighted_point(found: LinearSet, fitted: FittedSystem) -> Floats:
    """The free coefficients of the nearest solution, in floating point."""
    size = len(fitted.values)
    basis = np.zeros((size, len(found.free)))
    offset = np.zeros(size)
    basis[list(found.free), range(len(found.free))] = 1.0
    if found.bound:
        offset[list(found.bound)] = [float(value) for value in found.constants]
        basis[list(found.bound)] = np.array(found.slopes, dtype=float).reshape(
            len(found.bound), len(found.free)
        )
    root = fitted.metric.root
    left = np.linalg.solve(root, basis)
    right = np.linalg.solve(root, fitted.fitted - offset)
    return np.asarray(np.linalg.lstsq(left, right, rcond=None)[0])


def roundings(
    values: Sequence[float] | Floats, spread: Sequence[float] | Floats
) -> Iterator[Numbers]:
    """Ever closer decimals, beginning with a third of the spread of each value."""
    for digits in range(MOST_DIGITS):
        found = list[Fraction]()
        for value, width in zip(values, spread, strict=True):
            unit = 0 if width <= 0 else int(np.floor(np.log10(width / 3)))
            found.append(_rounded(float(value), unit - digits))
        yield tuple(found)


def _rounded(value: float, place: int) -> Fraction:
    scale = Fraction(10) ** place
    return round(Fraction(value) / scale) * scale


def nice_fractions(
    values: Sequence[float] | Floats, spread: Sequence[float] | Floats
) -> Iterator[Numbers]:
    """Ever finer fractions: of denominators 1, 2, 3, ..., 0 for what is within its width of it."""
    for most in NICE_DENOMINATORS:
        yield tuple(
            Fraction(0) if abs(value) < width else Fraction(float(value)).limit_denominator(most)
            for value, width in zip(values, spread, strict=True)
        )


def is_close(distance: float, least: float, fitted: FittedSystem) -> bool:
    """Whether a member is as near as the nearest, but for rounding."""
    small = CLOSE_ERRORS if fitted.metric.are_errors else CLOSE_RELATIVE
    return distance <= least * (1 + CLOSE) + small


def first_close(
    tries: Iterator[Numbers],
    member: Callable[[Numbers], Numbers | None],
    fitted: FittedSystem,
    is_good: Callable[[float], bool],
) -> tuple[Numbers, float] | None:
    """The first member of these that is near enough, and its distance."""
    for values in tries:
        found = member(values)
        if found is None:
            continue
        distance = fitted.distance(found)
        if is_good(distance):
            return found, distance
    return None

"""Where the coefficients of a truncated series stand, and where those of products and derivatives go.

A series of order D in m displacements is one array of C(m + D, D) words, its homogeneous components
one after the other, monomials of one degree as in `exponents_of_degree`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.monomials import exponents_of_degree, products_of_degree, raised_places

Integers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]


def coefficients(size: int, order: int) -> int:
    """C(size + order, order), the number of coefficients of one series."""
    return math.comb(size + order, order)


def products(size: int, order: int) -> int:
    """C(2 size + order, order), the number of pairs of coefficients whose product is not cut off."""
    return math.comb(2 * size + order, order)


@dataclass(frozen=True, slots=True)
class SeriesTables:
    """Tables for `size` displacements to degree `order`.

    Degree d has counts[d] monomials from starts[d] on; the last of `starts` is the number of all. The product
    of monomial i of degree j and monomial k of degree l stands, within degree j + l, at
    products[product_starts[j (order + 1) + l] + i counts[l] + k]. For monomial i of degree d < order,
    x_a times it stands at raised[raised_starts[d] + i size + a], its exponent of x_a in `exponents` there.
    """

    size: int
    order: int
    counts: Integers
    starts: Integers
    product_starts: Integers
    products: Places
    raised_starts: Integers
    raised: Integers
    exponents: Integers


@lru_cache(maxsize=64)
def series_tables(size: int, order: int) -> SeriesTables:
    """The tables, made once; for large sizes they hold `products(size, order)` numbers."""
    degrees = range(order + 1)
    counts = np.array([len(exponents_of_degree(size, d)) for d in degrees], np.int64)
    pairs = [products_of_degree(size, k, j).ravel() if j + k <= order else _NONE for j in degrees for k in degrees]
    raised = [raised_places(size, d).ravel() for d in range(order)]
    exponents = [exponents_of_degree(size, d).ravel().astype(np.int64) + 1 for d in range(order)]
    nothing = np.empty(0, np.int64)
    return SeriesTables(
        size, order, counts, _ends(counts), _ends([len(part) for part in pairs]), np.concatenate(pairs),
        _ends([len(part) for part in raised]), np.concatenate([nothing, *raised]),
        np.concatenate([nothing, *exponents]),
    )  # fmt: skip


_NONE = np.empty(0, np.int32)


def _ends(lengths: list[int] | Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)

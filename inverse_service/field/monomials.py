"""Monomials in m displacements as 64-bit keys, sums of exponents being sums of keys.

Where the coefficients of a truncated series stand, and where those of products and derivatives go.

A series of order D in m displacements is one array of C(m + D, D) words, its homogeneous components
one after the other, monomials of one degree as in `exponents_of_degree`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class MonomialKeys:
    """Keys for exponents in `size` variables, each of floor(63/size) bits."""

    size: int

    @property
    def bits(self) -> int:
        return 63 // self.size

    @property
    def largest_degree(self) -> int:
        return (1 << self.bits) - 1

    def key(self, exponents: Sequence[int]) -> int:
        return sum(int(e) << (self.bits * k) for k, e in enumerate(exponents))


@lru_cache(maxsize=2048)
def exponents_of_degree(size: int, degree: int) -> npt.NDArray[np.int8]:
    """All exponent vectors of a total degree in ascending order, (count, size)."""
    if size == 1:
        table = np.array([[degree]], np.int8)
    else:
        parts = [exponents_of_degree(size - 1, degree - first) for first in range(degree + 1)]
        firsts = np.repeat(np.arange(degree + 1, dtype=np.int8), [len(part) for part in parts])
        table = np.column_stack([firsts, np.concatenate(parts)])
    table.setflags(write=False)
    return table


@lru_cache(maxsize=128)
def raised_places(size: int, degree: int) -> npt.NDArray[np.int64]:
    """Where alpha + e_a stands among the exponents of degree + 1, (count, size)."""
    table, above = exponents_of_degree(size, degree), exponents_of_degree(size, degree + 1)
    monomials = MonomialKeys(size)
    known = keys_of(monomials, above)
    order = np.argsort(known)
    raised = keys_of(monomials, table)[:, None] + np.array([1 << (monomials.bits * a) for a in range(size)])
    places: npt.NDArray[np.int64] = order[np.searchsorted(known, raised, sorter=order)]
    places.setflags(write=False)
    return places


def keys_of(monomials: MonomialKeys, exponents: npt.NDArray[np.int8]) -> npt.NDArray[np.int64]:
    """The keys of rows of exponents."""
    shifts = np.array([1 << (monomials.bits * k) for k in range(monomials.size)], np.int64)
    return exponents.astype(np.int64) @ shifts


def places_among(size: int, known: npt.NDArray[np.int8], keys_wanted: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Where monomials with these keys stand among the known ones; all are there."""
    keys = keys_of(MonomialKeys(size), known)
    order = np.argsort(keys)
    found: npt.NDArray[np.int64] = order[np.searchsorted(keys, keys_wanted, sorter=order)]
    return found


@lru_cache(maxsize=256)
def products_of_degree(size: int, low: int, high: int) -> npt.NDArray[np.int32]:
    """The place of m m' among the monomials of degree low + high, (monomials m of `high`, those m' of `low`)."""
    monomials = MonomialKeys(size)
    left, right = (keys_of(monomials, exponents_of_degree(size, d)) for d in (high, low))
    table = exponents_of_degree(size, low + high)
    found = places_among(size, table, left[:, None] + right).astype(np.int32)
    found.setflags(write=False)
    return found


Integers = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]


def coefficients(size: int, order: int) -> int:
    """C(size + order, order), the number of coefficients of one series."""
    return math.comb(size + order, order)


def products(size: int, order: int) -> int:
    """C(2 size + order, order), the number of pairs of coefficients whose product is not cut off."""
    return math.comb(2 * size + order, order)


class SeriesTables(NamedTuple):
    """Tables for `size` displacements to degree `order`.

    Degree d has counts[d] monomials from starts[d] on; the last of `starts` is the number of all. The product
    of monomial i of degree j and monomial k of degree l stands, within degree j + l, at
    products[product_starts[j (order + 1) + l] + i counts[l] + k]. For monomial i of degree d < order,
    x_a times it occurs at raised[raised_starts[d] + i size + a], its exponent of x_a in `exponents` there.
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
    found = SeriesTables(
        size, order, counts, _ends(counts), _ends([len(part) for part in pairs]), np.concatenate(pairs),
        _ends([len(part) for part in raised]), np.concatenate([nothing, *raised]),
        np.concatenate([nothing, *exponents]),
    )  # fmt: skip
    freeze(found)
    return found


def freeze(tables: Iterable[Any]) -> None:
    """Make the arrays among these read-only: they are shared by all callers."""
    for table in tables:
        if isinstance(table, np.ndarray):
            table.setflags(write=False)


_NONE = np.empty(0, np.int32)


def _ends(lengths: list[int] | Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)

"""Monomials in m displacements as 64-bit keys, sums of exponents being sums of keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

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


def places_among(size: int, known: npt.NDArray[np.int8], sought: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Where monomials with these keys stand among the known ones; all are there."""
    keys = keys_of(MonomialKeys(size), known)
    order = np.argsort(keys)
    found: npt.NDArray[np.int64] = order[np.searchsorted(keys, sought, sorter=order)]
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

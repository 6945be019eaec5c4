"""Determinants over any commutative ring, by minors."""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations
from typing import TypeVar

T = TypeVar("T")
Terms = list[tuple[int, T, T]]  # of a sum: a sign, and two factors


def by_minors(
    matrix: Sequence[Sequence[T]],
    one: T,
    is_zero: Callable[[T], bool],
    total: Callable[[Terms[T]], T],
) -> T:
    """The determinant by expansion along the rows, those with fewest entries first, with each minor
    computed once; `one` for a matrix without rows.

    `total` is the sum of (sign, entry, minor), which has no term where a row is zero.
    """
    size = len(matrix)
    entries = [sum(not is_zero(entry) for entry in row) for row in matrix]
    order = sorted(range(size), key=entries.__getitem__)

    @cache
    def minor(columns: tuple[int, ...]) -> T:
        """The minor of the last rows of the order and of `columns`."""
        if not columns:
            return one
        row = matrix[order[size - len(columns)]]
        return total(
            [
                ((-1) ** k, row[column], minor((*columns[:k], *columns[k + 1 :])))
                for k, column in enumerate(columns)
                if not is_zero(row[column])
            ]
        )

    whole = minor(tuple(range(size)))
    swaps = sum(a > b for a, b in combinations(order, 2))
    return total([(-1, one, whole)]) if swaps % 2 else whole

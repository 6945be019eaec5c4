"""The block triangular form of a square pattern: which unknowns must be solved for together."""

from __future__ import annotations

from collections.abc import Collection, Sequence


def matching(pattern: Sequence[Collection[int]]) -> list[int | None]:
    """For each column a row of its own in which it occurs (augmenting paths), None where none is left."""
    row_of: list[int | None] = [None] * len(pattern)

    def assign(row: int, seen: set[int]) -> bool:
        for column in pattern[row]:
            if column in seen:
                continue
            seen.add(column)
            other = row_of[column]
            if other is None or assign(other, seen):
                row_of[column] = row
                return True
        return False

    for row in range(len(pattern)):
        assign(row, set())
    return row_of


def blocks(pattern: Sequence[Collection[int]], row_of: Sequence[int]) -> list[list[int]]:
    """Groups of columns in an order in which each depends only on itself and earlier ones.

    `row_of[c]` is the row matched to column c. The groups are the strongly connected components of
    "the row of c contains d" (Tarjan 1972), which gives them in this order.
    """
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    result: list[list[int]] = []

    def visit(column: int) -> None:
        index[column] = low[column] = len(index)
        stack.append(column)
        for other in pattern[row_of[column]]:
            if other not in index:
                visit(other)
                low[column] = min(low[column], low[other])
            elif other in stack:
                low[column] = min(low[column], index[other])
        if low[column] == index[column]:
            start = stack.index(column)
            result.append(sorted(stack[start:]))
            del stack[start:]

    for column in range(len(pattern)):
        if column not in index:
            visit(column)
    return result

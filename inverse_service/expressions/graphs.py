"""Graph algorithms on the names in equations: match equations to unknowns, and order them for
solving.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import TypeVar

Name = TypeVar("Name", int, str)


def matching(pattern: Sequence[Collection[Name]]) -> dict[Name, int]:
    """A maximum matching of names to rows in which they occur (augmenting paths)."""
    row_of: dict[Name, int] = {}

    def assign(row: int, seen: set[Name]) -> bool:
        for name in pattern[row]:
            if name in seen:
                continue
            seen.add(name)
            if name not in row_of or assign(row_of[name], seen):
                row_of[name] = row
                return True
        return False

    for row in range(len(pattern)):
        assign(row, set())
    return row_of


def components(graph: Mapping[Name, Collection[Name]]) -> list[list[Name]]:
    """Strongly connected components, each after its dependencies, with its members in the order of
    the graph.
    """
    index: dict[Name, int] = {}
    low: dict[Name, int] = {}
    stack: list[Name] = []
    found: list[list[Name]] = []

    def visit(node: Name) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph[node]:
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            cut = stack.index(node)
            found.append(sorted(stack[cut:], key=list(graph).index))
            del stack[cut:]

    for node in graph:
        if node not in index:
            visit(node)
    return found

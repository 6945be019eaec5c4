"""The Helmholtz conditions as sums of a series times an entry of g, the same for all systems of one size.

H2_ij  sum_a X^a d_a g_ij - sum_k (g_ik N^k_j + g_jk N^k_i)    i <= j
H3_ij  sum_k (g_ik Phi^k_j - g_jk Phi^k_i)                     i <  j
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from inverse_service.inverse_problem.decision.emission import NO_DERIVATIVE, TermTable

Kind = Literal["H2", "H3"]
KINDS: tuple[Kind, ...] = ("H2", "H3")


@dataclass(frozen=True, slots=True)
class Equations:
    """The equations of one kind, H2 (i <= j) or H3 (i < j): their index pairs, and the terms of all."""

    kind: str
    pairs: tuple[tuple[int, int], ...]
    table: TermTable


@dataclass(frozen=True, slots=True)
class Summand:
    """(-) s g_ij or (-) s d_a g_ij in one equation, i <= j; s is X^row, N^row_column or Phi^row_column."""

    equation: int
    i: int
    j: int
    derivative: int
    row: int
    column: int = 0
    negative: bool = False


@lru_cache(maxsize=64)
def pairs_of(kind: Kind, n: int) -> tuple[tuple[int, int], ...]:
    """(i, j) of each equation."""
    return tuple((i, j) for i in range(n) for j in range(i if kind == "H2" else i + 1, n))


@lru_cache(maxsize=64)
def summands(kind: Kind, n: int, size: int) -> tuple[Summand, ...]:
    """Of all equations of a kind for n coordinates and `size` displacements; those with a derivative have X."""
    found = []
    for equation, (i, j) in enumerate(pairs_of(kind, n)):
        if kind == "H2":
            found += [Summand(equation, i, j, a, a) for a in range(size)]
        for k in range(n):
            for a, b, negative in ((i, j, kind == "H2"), (j, i, True)):
                found.append(Summand(equation, min(a, k), max(a, k), NO_DERIVATIVE, k, b, negative))
    return tuple(found)

"""Gauss-Legendre collocation, the implicit Runge-Kutta methods of order 2 s: our own reference.

J. C. Butcher, Math. Comp. 18 (1964) 50. Nodes and weights are computed to forty digits and rounded once.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from mpmath import mp

STAGES = 6
Rows = tuple[tuple[float, ...], ...]


@lru_cache(maxsize=8)
def collocation(stages: int = STAGES) -> tuple[Rows, Rows, tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """(A, A A, b, b A, c): the last forms serve q'' = f(q, q') without a detour."""
    with mp.workdps(40):
        nodes = _nodes(stages)
        powers = mp.matrix(stages, stages)
        integrals = mp.matrix(stages, stages)
        for i, node in enumerate(nodes):
            for k in range(stages):
                powers[i, k] = node**k
                integrals[i, k] = node ** (k + 1) / (k + 1)
        inverse = powers**-1
        matrix = integrals * inverse
        weights = mp.matrix([[mp.mpf(1) / (k + 1) for k in range(stages)]]) * inverse
        return (
            _rounded(matrix), _rounded(matrix * matrix), _rounded(weights)[0], _rounded(weights * matrix)[0],
            tuple(float(node) for node in nodes),
        )  # fmt: skip


def _nodes(stages: int) -> list[Any]:
    """Zeros of the Legendre polynomial by Newton, moved to [0, 1]."""
    zeros = [mp.cos(mp.pi * (mp.mpf(k) + 0.75) / (stages + 0.5)) for k in range(stages)]
    for _ in range(8):
        zeros = [zero - _newton_step(zero, stages) for zero in zeros]
    return sorted((1 + zero) / 2 for zero in zeros)


def _newton_step(x: Any, stages: int) -> Any:
    before, value = mp.mpf(1), x
    for k in range(2, stages + 1):
        before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
    return value * (x * x - 1) / (stages * (x * value - before))


def _rounded(matrix: Any) -> Rows:
    return tuple(tuple(float(matrix[i, j]) for j in range(matrix.cols)) for i in range(matrix.rows))

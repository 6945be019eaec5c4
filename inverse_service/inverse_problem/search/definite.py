"""Weights that make a positive definite Hessian of several, where the simplest regular sums are indefinite.

By alternating projections at one real point: onto the span of the Hessians, and onto the matrices
whose eigenvalues are at least `_FLOOR`. Then the weights are made few and short.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

_FLOOR = 0.25
_ROUNDS = 60
# Of the largest eigenvalue, the least that counts as positive.
_POSITIVE = 1e-3
_DENOMINATORS = (1, 2, 3, 4, 6, 12)
MOST_PARTS = 40


def definite_weights(hessians: Sequence[Matrix]) -> list[list[Fraction]]:
    """Weights w with sum w_k H_k positive definite: nearest to the identity, and as few as will do.

    H_k are symmetric of shape (n, n), finite and not zero; at most `MOST_PARTS` of them.
    """
    if not 0 < len(hessians) <= MOST_PARTS:
        return []
    hessians = _balanced(hessians)
    sizes = [float(np.abs(matrix).max()) for matrix in hessians]
    units = [matrix / size for matrix, size in zip(hessians, sizes, strict=True)]
    weights = _projected(units)
    if weights is None:
        return []
    near = [w / size for w, size in zip(weights, sizes, strict=True)]
    found = [_short(near, hessians), _short(_few(near, hessians), hessians)]
    return [one for k, one in enumerate(found) if one is not None and one not in found[:k]]


def _balanced(hessians: Sequence[Matrix]) -> list[Matrix]:
    """All in units, powers of 1000, in which the rows are of like size; a sum is definite in all units or in none."""
    rows = np.max([np.abs(np.diagonal(matrix)) for matrix in hessians], axis=0)
    rows = np.where(rows > 0, rows, np.max([np.abs(matrix).max(axis=1) for matrix in hessians], axis=0))
    units = 1000.0 ** -np.round(np.log10(np.where(rows > 0, rows, 1.0)) / 6)
    return [units[:, None] * matrix * units for matrix in hessians]


def _projected(units: Sequence[Matrix]) -> list[float] | None:
    n = len(units[0])
    columns = np.stack([matrix.ravel() for matrix in units], axis=1)
    target = np.eye(n)
    for _ in range(_ROUNDS):
        weights = np.linalg.lstsq(columns, target.ravel(), rcond=None)[0]
        whole = (columns @ weights).reshape(n, n)
        if _is_definite(whole):
            return [float(w) for w in weights]
        values, vectors = np.linalg.eigh((whole + whole.T) / 2)
        target = (vectors * np.maximum(values, _FLOOR)) @ vectors.T
    return None


def _is_definite(matrix: Matrix) -> bool:
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    return bool(values[0] > _POSITIVE * max(values[-1], -values[0]))


def _sum(weights: Sequence[float], hessians: Sequence[Matrix]) -> Matrix:
    total = np.zeros_like(hessians[0])
    for weight, matrix in zip(weights, hessians, strict=True):
        total = total + weight * matrix
    return total


def _few(weights: list[float], hessians: Sequence[Matrix]) -> list[float]:
    """Without those that are not needed, the smallest left out first."""
    kept = list(weights)
    for k in sorted(range(len(kept)), key=lambda k: abs(weights[k])):
        without = [0.0 if j == k else w for j, w in enumerate(kept)]
        if _is_definite(_sum(without, hessians)):
            kept = without
    return kept


def _short(weights: Sequence[float], hessians: Sequence[Matrix]) -> list[Fraction] | None:
    """Multiples of 1/d for the least d that will do; equal weights stay equal."""
    largest = max(map(abs, weights))
    for d in _DENOMINATORS:
        rounded = [Fraction(round(w / largest * d), d) for w in weights]
        if _is_definite(_sum([float(w) for w in rounded], hessians)):
            return rounded
    return None

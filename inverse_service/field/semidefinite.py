"""Does a linear space of symmetric matrices hold a definite one? An exact answer, with a matrix that proves it.

It does not exactly if some Y >= 0, not 0, has tr(Y w) = 0 for all w of the space. An interior point method for
max {s : sum c_k w_k - s >= 0, |c| <= 1} comes near a w with s > 0 or, where s = 0, near the Y of largest rank
(Y = mu (sum c_k w_k - s)^-1 on the central path). It only proposes: w, or Y on the face of its own kernel (facial
reduction), are rounded to fractions inside their spaces and tested exactly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

Matrix = tuple[tuple[Fraction, ...], ...]
Floats = NDArray[np.float64]
MOST = 8  # rows
_ROUNDING = (1, 2, 6, 60, 1_000, 100_000, 10**8)
_STEPS, _FINEST, _SHRINK = 40, 1e-9, 0.2
_SOON, _INSIDE = 1e-3, 0.05
_SMALL = 1e-4  # of the largest eigenvalue, those of Y that go to zero with mu


def definite_or_orthogonal(space: Sequence[Matrix], size: int) -> tuple[Matrix | None, Matrix | None]:
    """(w, None) with w definite in the space, (None, Y) with Y orthogonal to it, (None, None) where rounding fails."""
    space = [w for w in space if any(map(any, w))]
    if not space:
        return None, _matrix([1 if i == j else 0 for i, j in _places(size)], size)
    flat = np.array([[float(x) for row in w for x in row] for w in space])
    flat /= np.abs(flat).max(axis=1)[:, None]
    _, lengths, units = np.linalg.svd(flat, full_matrices=False)
    basis = units[lengths > 1e-10 * lengths[0]].reshape(-1, size, size)
    try:
        with np.errstate(all="ignore"):
            for weights, orthogonal in _central_path(basis):
                member = np.tensordot(weights, basis, 1)
                for w in _rounded(member, space, size) if np.linalg.eigvalsh(member)[0] > 0 else ():
                    if rank_if_semidefinite(w) == size:
                        return w, None
                for y in _on_faces(orthogonal, space, size):
                    if rank_if_semidefinite(y):
                        return None, y
    except np.linalg.LinAlgError:
        pass
    return None, None


def rank_if_semidefinite(matrix: Sequence[Sequence[Fraction]]) -> int | None:
    """By symmetric elimination: no pivot is negative, and where one is zero its whole row is."""
    rows, rank = [list(row) for row in matrix], 0
    for k, row in enumerate(rows):
        if row[k] < 0 or (not row[k] and any(row[k:])):
            return None
        rank += row[k] > 0
        for other in rows[k + 1 :] if row[k] else ():
            factor = other[k] / row[k]
            other[:] = [a - factor * b for a, b in zip(other, row, strict=True)]
    return rank


def _central_path(basis: Floats) -> Iterator[tuple[Floats, Floats]]:
    """(c, Y) on the path of max s/mu + log det(sum c_k w_k - s) + log(1 - |c|^2): soon, and at its end."""
    m, n, _ = basis.shape
    x, mu = np.append(np.zeros(m), -1.0), 1.0
    directions = np.concatenate([basis, -np.eye(n)[None]])
    inverse = np.eye(n)
    while mu > _FINEST:
        for _ in range(_STEPS):
            inverse = np.linalg.inv(np.tensordot(x, directions, 1))
            turned = inverse @ directions
            room = 1 - x[:m] @ x[:m]
            gradient = np.trace(turned, axis1=1, axis2=2)
            gradient[:m] -= 2 * x[:m] / room
            gradient[m] += 1 / mu
            hessian = np.einsum("aij,bji->ab", turned, turned)
            hessian[:m, :m] += 2 * np.eye(m) / room + 4 * np.outer(x[:m], x[:m]) / room**2
            step = np.linalg.lstsq(hessian, gradient, rcond=1e-15)[0]
            decrement = max(float(gradient @ step), 0.0)
            step *= 1.0 if decrement < 0.05 else 1 / (1 + decrement**0.5)
            if decrement < 1e-6 or not _is_inside(x + step, directions):
                break
            x = x + step
        if x[m] > _INSIDE or mu < _SOON <= mu / _SHRINK or mu * _SHRINK <= _FINEST:
            yield x[:m], mu * inverse
        mu *= _SHRINK


def _is_inside(x: Floats, directions: Floats) -> bool:
    return bool(x[:-1] @ x[:-1] < 1 and np.linalg.eigvalsh(np.tensordot(x, directions, 1))[0] > 0)


def _on_faces(y: Floats, space: Sequence[Matrix], size: int) -> Iterator[Matrix]:
    """Y rounded among the matrices orthogonal to the space that have its kernel, then among all."""
    values, vectors = np.linalg.eigh(y / np.trace(y))
    rows = [[w[i][j] * (1 if i == j else 2) for i, j in _places(size)] for w in space]
    null = vectors[:, values < _SMALL * values[-1]].T
    for denominator in (12, 1_000) if len(null) else ():
        face = [
            [_at(v, i, j, r, size) for i, j in _places(size)] for v in _echelon(null, denominator) for r in range(size)
        ]
        yield from _rounded(y, [_matrix(k, size) for k in kernel([*rows, *face], len(rows[0]))], size)
    yield from _rounded(y, [_matrix(k, size) for k in kernel(rows, len(rows[0]))], size)


def _at(v: Sequence[Fraction], i: int, j: int, row: int, size: int) -> Fraction:
    """The coefficient of Y_ij in (Y v)_row."""
    return (v[j] if row == i else Fraction(0)) + (v[i] if row == j and i != j else Fraction(0))


def _echelon(vectors: Floats, denominator: int) -> list[list[Fraction]]:
    """A basis of the span in reduced echelon form, rounded."""
    rows, found = vectors.copy(), 0
    for column in range(rows.shape[1]):
        pivot = found + int(np.argmax(np.abs(rows[found:, column]))) if found < len(rows) else -1
        if pivot < 0 or abs(rows[pivot, column]) < 1e-3:
            continue
        rows[[found, pivot]] = rows[[pivot, found]]
        rows[found] /= rows[found, column]
        others = [k for k in range(len(rows)) if k != found]
        rows[others] -= np.outer(rows[others, column], rows[found])
        found += 1
    return [[Fraction(float(x)).limit_denominator(denominator) for x in row] for row in rows[:found]]


def _rounded(near: Floats, space: Sequence[Matrix], size: int) -> Iterator[Matrix]:
    """Members of the space near a matrix, those with small denominators first."""
    if not space:
        return
    columns = np.array([[float(x) for row in w for x in row] for w in space]).T
    weights = np.linalg.lstsq(columns, near.ravel(), rcond=None)[0]
    largest = float(np.abs(weights).max()) or 1.0
    for d in _ROUNDING:
        short = [Fraction(round(float(c) / largest * d), d) for c in weights]
        entries = [sum((c * w[i][j] for c, w in zip(short, space, strict=True)), Fraction(0)) for i, j in _places(size)]
        yield _matrix(entries, size)


def echelon_of(rows: Sequence[Sequence[Fraction]], width: int) -> list[tuple[int, list[Fraction]]]:
    """The reduced echelon form: (column of the pivot, row with 1 in it)."""
    zero = Fraction(0)
    table = fmpq_mat(len(rows), width)
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            if entry:
                table[i, j] = fmpq(*entry.as_integer_ratio())
    reduced, rank = table.rref()
    found = [[Fraction(int(x.p), int(x.q)) if x else zero for x in row] for row in reduced.tolist()[:rank]]
    return [(next(j for j, x in enumerate(row) if x), row) for row in found]


def kernel(rows: Sequence[Sequence[Fraction]], width: int) -> list[list[Fraction]]:
    """A basis of {x : rows x = 0}."""
    table = dict(echelon_of(rows, width))
    found = []
    for free in (j for j in range(width) if j not in table):
        vector = [Fraction(int(j == free)) for j in range(width)]
        for pivot, row in table.items():
            vector[pivot] = -row[free]
        found.append(vector)
    return found


def _places(size: int) -> list[tuple[int, int]]:
    return list(combinations_with_replacement(range(size), 2))


def _matrix(entries: Sequence[Fraction | int], size: int) -> Matrix:
    table = dict(zip(_places(size), entries, strict=True))
    return tuple(tuple(Fraction(table[min(i, j), max(i, j)]) for j in range(size)) for i in range(size))

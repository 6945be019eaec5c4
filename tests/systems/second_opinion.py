"""Nonexistence confirmed without the package: the algebraic conditions at a point.

SymPy derives everything from the definitions and evaluates it at a random point to 60 digits.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from typing import Any

import mpmath
import sympy

from tests.systems.reading import DIGITS, TIME, Formulas, point, values

Matrix = sympy.Matrix
Row = list[Any]


def _along(e: sympy.Expr, given: Formulas) -> sympy.Expr:
    triples = zip(given.coordinates, given.velocities, given.accelerations, strict=True)
    return e.diff(TIME) + sum(v * e.diff(q) + f * e.diff(v) for q, v, f in triples)


def algebraic_conditions(given: Formulas, derivatives: int, seed: int = 5) -> tuple[int, bool]:
    """(dimension of the remaining g at a point, whether all are singular), from Phi, nabla^k Phi,
    R, and nabla R.
    """
    n = len(given.coordinates)
    slopes = Matrix(n, n, lambda i, j: given.accelerations[i].diff(given.velocities[j]))
    forces = Matrix(n, n, lambda i, j: given.accelerations[i].diff(given.coordinates[j]))
    connection = -slopes / 2
    tensors = [slopes.applyfunc(lambda e: _along(e, given)) - 2 * forces - slopes * slopes / 2]
    for _ in range(derivatives):
        last = tensors[-1]
        tensors.append(
            last.applyfunc(lambda e: _along(e, given)) + connection * last - last * connection
        )
    curvatures = [_curvature(tensor, given) for tensor in tensors[: 2 if n > 2 else 0]]
    flat = [e for tensor in tensors for e in tensor] + [
        e for curvature in curvatures for e in curvature
    ]
    with mpmath.workdps(DIGITS):
        numbers = values(flat, point(given, seed))
        rows = list(_rows(numbers, n, len(tensors)))
        return _left_over(rows, n)


def _curvature(tensor: Matrix, given: Formulas) -> list[sympy.Expr]:
    """R^j_kl at index ((j n) + k) n + l."""
    v, span = given.velocities, range(len(given.velocities))
    return [
        tensor[j, k].diff(v[m]) - tensor[j, m].diff(v[k]) for j in span for k in span for m in span
    ]


def _place(i: int, j: int, n: int) -> int:
    low, high = sorted((i, j))
    return low * n - low * (low - 1) // 2 + high - low


def _rows(numbers: Sequence[Any], n: int, tensors: int) -> Iterator[Row]:
    size, span = n * (n + 1) // 2, range(n)
    for begin in range(0, tensors * n * n, n * n):
        for i, k in itertools.combinations(span, 2):
            row = [mpmath.mpf(0)] * size
            for j in span:
                row[_place(i, j, n)] += numbers[begin + n * j + k]
                row[_place(k, j, n)] -= numbers[begin + n * j + i]
            yield row
    for begin in range(tensors * n * n, len(numbers), n**3):
        for i, k, m in itertools.combinations(span, 3):
            row = [mpmath.mpf(0)] * size
            for j, (a, b, c) in itertools.product(span, ((i, k, m), (m, i, k), (k, m, i))):
                row[_place(a, j, n)] += numbers[begin + (j * n + b) * n + c]
            yield row


def _left_over(rows: list[Row], n: int) -> tuple[int, bool]:
    """Gauss with full pivoting; then the determinant of two random solutions."""
    size, small = n * (n + 1) // 2, mpmath.mpf(10) ** -22
    rest = [
        [x / scale for x in row]
        for row in rows
        if (scale := max(map(abs, row))) > mpmath.mpf(10) ** -40
    ]
    free, solved = list(range(size)), list[tuple[int, Row]]()
    while rest and free:
        value, number, column = max((abs(row[c]), r, c) for r, row in enumerate(rest) for c in free)
        if value < small:
            break
        chosen = rest.pop(number)
        chosen = [x / chosen[column] for x in chosen]
        rest = [[x - row[column] * y for x, y in zip(row, chosen, strict=True)] for row in rest]
        solved = [
            (c, [x - row[column] * y for x, y in zip(row, chosen, strict=True)])
            for c, row in solved
        ]
        solved.append((column, chosen))
        free.remove(column)
    generator = random.Random(9)
    return len(free), all(_is_singular(free, solved, n, generator) for _ in range(2))


def _is_singular(
    free: Sequence[int], solved: Sequence[tuple[int, Row]], n: int, generator: random.Random
) -> bool:
    g = {c: mpmath.mpf(generator.randint(-1000, 1000)) / 777 + mpmath.mpf(1) / 7 for c in free}
    g |= {c: -sum((row[k] * g[k] for k in free), mpmath.mpf(0)) for c, row in solved}
    matrix = mpmath.matrix([[g[_place(i, j, n)] for j in range(n)] for i in range(n)])
    return bool(abs(mpmath.det(matrix)) < mpmath.mpf(10) ** -15)

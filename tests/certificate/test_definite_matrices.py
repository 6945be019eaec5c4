"""Definite and semidefinite matrices, against their principal minors (Sylvester)."""

from __future__ import annotations

import itertools
from fractions import Fraction

import flint

from inverse_service.certificate.kinds import is_definite

PAIRS = [(i, j) for i in range(3) for j in range(i, 3)]


def minor(matrix: list[list[int]], chosen: tuple[int, ...]) -> int:
    return int(flint.fmpz_mat([[matrix[i][j] for j in chosen] for i in chosen]).det())


def test_elimination_judges_as_the_principal_minors_do() -> None:
    """All symmetric 3 x 3 matrices with these entries; a zero on the diagonal needs a zero row."""
    judged = 0
    for entries in itertools.product((-1, 0, 1), repeat=len(PAIRS)):
        matrix = [[0] * 3 for _ in range(3)]
        for (i, j), value in zip(PAIRS, entries, strict=True):
            matrix[i][j] = matrix[j][i] = value
        places = [one for size in (1, 2, 3) for one in itertools.combinations(range(3), size)]
        rational = [[Fraction(value) for value in row] for row in matrix]
        semi = all(minor(matrix, one) >= 0 for one in places)
        assert is_definite(rational, "with_their_rows") is semi, matrix
        assert is_definite(rational) is all(
            minor(matrix, tuple(range(size))) > 0 for size in (1, 2, 3)
        ), matrix
        judged += semi
    assert judged > 20

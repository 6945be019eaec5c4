"""Kernels over a prime field: their reduced bases, rational vectors, and further equations."""

from __future__ import annotations

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest

from inverse_service.algebra.echelon_kernels import Words
from inverse_service.inverse_problem.search.null_vectors import kernel, restricted, settled_kernel

PRIME = 2**31 - 1


def matrix_of(rank: int, rows: int, width: int, seed: int) -> Words:
    """A random matrix with this rank at most."""
    generator = random.Random(seed)
    left = [[generator.randrange(PRIME) for _ in range(rank)] for _ in range(rows)]
    right = [[generator.randrange(PRIME) for _ in range(width)] for _ in range(rank)]
    entries = [[sum(a * b for a, b in zip(row, column, strict=True)) % PRIME for column in zip(*right, strict=True)]
               for row in left]  # fmt: skip
    return np.array(entries, np.uint64).reshape(rows, width)


@pytest.mark.parametrize(("rank", "rows", "width"), [(1, 1, 1), (2, 3, 5), (4, 9, 4), (3, 8, 11)])
def test_the_basis_is_annihilated_and_each_vector_has_its_last_column_to_itself(
    rank: int, rows: int, width: int
) -> None:
    matrix = matrix_of(rank, rows, width, 5)
    found = kernel(matrix, PRIME)
    assert found.nullity == width - rank
    basis = [[int(x) for x in row] for row in found.basis.tolist()]
    for vector, column in zip(basis, found.columns, strict=True):
        assert not any(sum(int(a) * b for a, b in zip(row, vector, strict=True)) % PRIME for row in matrix)
        assert vector[column] == 1
        assert not any(vector[column + 1 :])
    for column in found.columns:
        assert sum(1 for vector in basis if vector[column]) == 1


def test_further_equations_leave_the_same_basis_as_all_at_once() -> None:
    first, second = matrix_of(3, 6, 12, 1), matrix_of(4, 4, 12, 2)
    inside = restricted(kernel(first, PRIME), second)
    together = kernel(np.concatenate([first, second]), PRIME)
    assert inside.columns == together.columns
    assert inside.basis == together.basis
    assert inside.nullity == 5


def test_samples_are_added_until_the_kernel_stays() -> None:
    whole = matrix_of(7, 40, 10, 3)
    whole[:9] = matrix_of(2, 9, 10, 4)
    asked: list[tuple[int, int]] = []

    def equations(begin: int, end: int) -> Words:
        asked.append((begin, end))
        return whole[begin:end]

    assert settled_kernel(equations, PRIME, 6, lambda nullity: nullity).nullity == 1
    assert asked[0] == (0, 6)
    assert all(a[1] == b[0] for a, b in itertools.pairwise(asked))


def test_only_vectors_of_small_rationals_are_rational() -> None:
    prime = 2**61 - 1
    half = pow(2, -1, prime)
    matrix = np.array([[1, 0, prime - half, 1_234_567_890_123_456_789]], np.uint64)
    assert kernel(matrix, prime).nullity == 3
    vectors = kernel(matrix, prime).rational_vectors()
    assert vectors == [{1: Fraction(1)}, {0: Fraction(1, 2), 2: Fraction(1)}]

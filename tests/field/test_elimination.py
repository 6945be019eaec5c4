"""Echelon forms and kernels by compiled loops are those of FLINT."""

import numpy as np
import pytest
from flint import nmod_mat

from inverse_service.field import elimination, matrices

# For large primes the rows after the first dependent one are tested before they are reduced.
SMALL, FLOW, WIDE = 1_009, 2_147_454_839, 1_291_690_269_576_787_079


@pytest.mark.parametrize("prime", [SMALL, FLOW, WIDE])
@pytest.mark.parametrize(
    ("rows", "width", "rank"),
    [(1, 1, 0), (1, 1, 1), (3, 5, 2), (9, 4, 4), (30, 21, 21), (40, 33, 17), (25, 60, 25)],
)
def test_kernels_and_pivots_are_those_of_flint(
    prime: int, rows: int, width: int, rank: int
) -> None:
    """Also where dependent rows and columns come between the others, and where no row is."""
    draw = np.random.default_rng(rows * width + rank)
    left, right = draw.integers(0, 1000, (rows, rank)), draw.integers(0, 1000, (rank, width))
    right[:, width // 2] = 0
    left[rows // 3 :: 4] = 0
    matrix = (left @ right % prime).astype(np.uint64)
    ours = elimination.echelon(matrix, prime)
    reduced, expected = nmod_mat(matrix.tolist(), prime).rref()
    assert ours.pivots == matrices.leading_columns(reduced, expected)
    assert sorted([*ours.pivots, *ours.free]) == [*range(width)]
    basis = matrices.kernel_of(nmod_mat(matrix.tolist(), prime))
    assert elimination.kernel(ours).tolist() == [list(map(int, row)) for row in basis.tolist()]


@pytest.mark.parametrize("prime", [SMALL, FLOW, WIDE])
def test_rows_that_are_independent_after_a_dependent_one_are_found(prime: int) -> None:
    """The vector for tests vanishes on the rows before only."""
    rows = [[1, 2, 3, 4], [2, 4, 6, 8], [3, 6, 9, 12], [0, 1, 5, 7], [1, 3, 8, 11], [0, 0, 0, 9]]
    assert elimination.echelon(np.array(rows, np.uint64), prime).pivots == [0, 1, 3]


@pytest.mark.parametrize("prime", [SMALL, FLOW, WIDE])
def test_products_of_rows_are_those_of_integers(prime: int) -> None:
    draw = np.random.default_rng(3)
    left, right = (draw.integers(0, prime, (size, 70), dtype=np.uint64) for size in (3, 2))
    whole = left.astype(object) @ right.T.astype(object) % prime
    assert elimination.products(left, right, prime).tolist() == whole.tolist()

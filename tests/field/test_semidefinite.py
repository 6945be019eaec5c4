"""Either a space of symmetric matrices contains a definite one, or a semidefinite matrix is
orthogonal to it.
"""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
import pytest

from inverse_service.field.matrices import (
    Matrix,
    definite_or_orthogonal,
    kernel,
    rank_if_semidefinite,
)


def symmetric(entries: list[int] | list[Fraction], n: int) -> Matrix:
    table = dict(zip(combinations_with_replacement(range(n), 2), entries, strict=True))
    return tuple(tuple(Fraction(table[min(i, j), max(i, j)]) for j in range(n)) for i in range(n))


def any_space(rng: random.Random, n: int) -> list[Matrix]:
    size = n * (n + 1) // 2
    return [
        symmetric([rng.randint(-3, 3) for _ in range(size)], n) for _ in range(rng.randint(1, size))
    ]


def gram(rng: random.Random, n: int, rank: int) -> np.ndarray:
    root = np.array([[rng.randint(-2, 2) for _ in range(rank)] for _ in range(n)])
    return root @ root.T


def space_with_definite(rng: random.Random, n: int) -> list[Matrix]:
    """A planted definite matrix, hidden among sums."""
    hidden = gram(rng, n, n) + np.eye(n, dtype=int)
    member = tuple(tuple(Fraction(int(x)) for x in row) for row in hidden)
    others = any_space(rng, n)[:3]
    return [tuple(tuple(x + 2 * y for x, y in zip(*rows, strict=True)) for rows in zip(w, member, strict=True))
            for w in others] + [member]  # fmt: skip


def space_below_a_face(rng: random.Random, n: int) -> list[Matrix]:
    """Matrices orthogonal to a planted semidefinite one, of any rank."""
    hidden = gram(rng, n, rng.randint(1, n))
    hidden[0, 0] += 1
    places = list(combinations_with_replacement(range(n), 2))
    row = [Fraction(int(hidden[i, j])) * (1 if i == j else 2) for i, j in places]
    vectors = kernel([row], len(places))
    found = []
    for _ in range(rng.randint(0, len(vectors))):
        weights = [rng.randint(-2, 2) for _ in vectors]
        found.append(symmetric([sum((c * v[k] for c, v in zip(weights, vectors, strict=True)), Fraction(0))
                                for k in range(len(places))], n))  # fmt: skip
    return [w for w in found if any(map(any, w))]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_planted_spaces_are_settled_with_an_exact_proof(seed: int) -> None:
    rng = random.Random(seed)
    n = rng.randint(1, 8)
    has = bool(seed % 2)
    space = space_with_definite(rng, n) if has else space_below_a_face(rng, n)
    member, orthogonal = definite_or_orthogonal(space, n)
    if has:
        assert member is not None
        assert rank_if_semidefinite(member) == len(member)
        assert np.linalg.matrix_rank(
            np.array([np.ravel(w) for w in [*space, member]], float)
        ) <= len(space)
    else:
        assert orthogonal is not None
        assert any(map(any, orthogonal))
        assert rank_if_semidefinite(orthogonal)
        for w in space:
            assert sum(orthogonal[i][j] * w[i][j] for i in range(n) for j in range(n)) == 0


def test_an_irrational_face_stays_open() -> None:
    """S K symmetric for K with characteristic polynomial x^3 - 2: the only Y has entries in
    Q(2^(1/3)).
    """
    rows = []
    K = ((0, 0, 2), (1, 0, 0), (0, 1, 0))
    places = list(combinations_with_replacement(range(3), 2))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        row = [Fraction(0)] * 6
        for k in range(3):
            row[places.index((min(i, k), max(i, k)))] += K[k][j]
            row[places.index((min(j, k), max(j, k)))] -= K[k][i]
        rows.append(row)
    space = [symmetric(v, 3) for v in kernel(rows, 6)]
    assert definite_or_orthogonal(space, 3) == (None, None)


@pytest.mark.parametrize(
    ("entries", "semidefinite", "definite"),
    [([1, 0, 1], True, True), ([0, 0, 1], True, False), ([0, 1, 1], False, False), ([1, 2, 1], False, False),
     ([1, 1, 1], True, False), ([0, 0, 0], True, False)],
)  # fmt: skip
def test_semidefinite_is_recognized_exactly(
    entries: list[int], semidefinite: bool, definite: bool
) -> None:
    matrix = symmetric(entries, 2)
    assert (rank_if_semidefinite(matrix) is not None) is semidefinite
    assert (rank_if_semidefinite(matrix) == len(matrix)) is definite

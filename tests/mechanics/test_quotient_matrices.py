"""Determinants over a field of quotients agree with those of FLINT."""

from __future__ import annotations

import random

import pytest
from flint import fmpq_mat

from inverse_service.field.exact_field import Budget, ExactRing, QuotientField
from inverse_service.field.matrices import determinant

FIELD = QuotientField.with_generators(1, Budget(10_000, float("inf"), 10**9))
RING = ExactRing(FIELD, (), 0, slopes=False)


@pytest.mark.parametrize("share", [1, 3])
@pytest.mark.parametrize("size", range(8))
def test_determinants_are_those_of_flint(size: int, share: int) -> None:
    draw = random.Random(size).randint
    entries = [[draw(-5, 5) * (draw(1, share) == 1) for _ in range(size)] for _ in range(size)]
    found = determinant(
        [[RING.constant(entry) for entry in row] for row in entries], RING.constant(1)
    )
    expected = (
        fmpq_mat(size, size, [entry for row in entries for entry in row]).det() if size else 1
    )
    assert (found - RING.constant(int(expected))).is_zero


def test_twelve_coordinates_without_zeros_have_a_determinant() -> None:
    """Expanding 12! products would not finish."""
    rows = [[RING.constant(1 + (i == j)) for j in range(12)] for i in range(12)]
    assert (determinant(rows, RING.constant(1)) - RING.constant(13)).is_zero

"""Montgomery products and powers agree with Python's integers."""

from __future__ import annotations

import random

import numpy as np
import pytest

from inverse_service.field import modular
from inverse_service.field.modular import safe_prime

RADIX = 1 << 64


@pytest.mark.slow
@pytest.mark.parametrize(
    "prime", [3, 101, safe_prime(1), safe_prime(2), (1 << 61) - 1, (1 << 62) - 57]
)
def test_products_are_those_of_integers(prime: int) -> None:
    field = modular.field_of(prime)
    generator = random.Random(prime)
    edges = [0, 1, prime - 1, prime // 2]
    for a in [*edges, *(generator.randrange(prime) for _ in range(40))]:
        for b in [*edges, generator.randrange(prime)]:
            found = modular.multiply(np.uint64(a), np.uint64(b), field)
            assert int(found) == a * b * pow(RADIX, -1, prime) % prime
            assert int(modular.plus(np.uint64(a), np.uint64(b), field)) == (a + b) % prime
            assert int(modular.minus(np.uint64(a), np.uint64(b), field)) == (a - b) % prime
    assert int(field.one) == RADIX % prime
    assert int(field.square) == RADIX * RADIX % prime


@pytest.mark.slow
@pytest.mark.parametrize("exponent", [0, 1, 2, 63, safe_prime(1) - 2])
def test_powers_are_those_of_integers(exponent: int) -> None:
    prime = safe_prime(1)
    field = modular.field_of(prime)
    # numba returns Python integers, which it would take for signed ones
    base = np.uint64(modular.multiply(np.uint64(123456789), field.square, field))
    found = modular.montgomery_power(base, np.uint64(exponent), field)
    assert int(found) * pow(RADIX, -1, prime) % prime == pow(123456789, exponent, prime)

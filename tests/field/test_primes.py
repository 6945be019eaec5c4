"""Safe primes and the group of "positive" residues: the laws of positive reals."""

from __future__ import annotations

from fractions import Fraction

import pytest
from flint import fmpz
from hypothesis import given, strategies as st

from inverse_service.field.modular import (
    is_positive,
    positive_power,
    prime_factors,
    reconstruct,
    root_exponent,
    safe_prime,
)

P = safe_prime(1)
EXPONENTS = st.fractions(min_value=-7, max_value=7, max_denominator=12)
SQUARES = st.integers(2, P - 2).map(lambda x: pow(x, 2, P))


@pytest.mark.parametrize("seed", range(6))
def test_the_prime_and_half_of_it_are_prime(seed: int) -> None:
    prime = safe_prime(seed)
    assert fmpz(prime).is_prime()
    assert fmpz((prime - 1) // 2).is_prime()
    assert prime % 4 == 3
    assert 2**60 < prime < 2**61


@pytest.mark.parametrize("ell", [2, 3, 5, 7, 11, 13])
def test_small_primes_are_positive_and_their_negatives_are_not(ell: int) -> None:
    for seed in range(4):
        assert is_positive(ell, safe_prime(seed))
        assert not is_positive(-ell, safe_prime(seed))


def test_further_primes_are_positive_on_demand() -> None:
    wanted = frozenset({17, 19, 101})
    prime = safe_prime(3, wanted)
    assert all(pow(x, (prime - 1) // 2, prime) == 1 for x in wanted)


def test_seeds_choose_the_prime_and_repeat_it() -> None:
    assert len({safe_prime(seed) for seed in range(20)}) == 20
    assert safe_prime.__wrapped__(5) == safe_prime(5)


@given(SQUARES, SQUARES, EXPONENTS)
def test_powers_of_products_are_products_of_powers(x: int, y: int, a: Fraction) -> None:
    assert positive_power(x * y % P, a, P) == positive_power(x, a, P) * positive_power(y, a, P) % P


@pytest.mark.slow
@given(SQUARES, EXPONENTS, EXPONENTS)
def test_exponents_add_and_multiply(x: int, a: Fraction, b: Fraction) -> None:
    assert positive_power(x, a, P) * positive_power(x, b, P) % P == positive_power(x, a + b, P)
    assert positive_power(positive_power(x, a, P), b, P) == positive_power(x, a * b, P)


@given(SQUARES, EXPONENTS)
def test_powers_of_positive_numbers_are_positive(x: int, a: Fraction) -> None:
    assert is_positive(positive_power(x, a, P), P)


@given(st.integers(2, P - 2))
def test_the_root_of_a_square_is_the_positive_one_of_the_two(x: int) -> None:
    root = positive_power(x * x % P, Fraction(1, 2), P)
    assert root in (x, P - x)
    assert is_positive(root, P)


@given(st.integers(2, P - 2), st.sampled_from([3, 5, 7, 9]))
def test_odd_roots_exist_for_all_residues_and_are_odd_functions(x: int, k: int) -> None:
    root = positive_power(x, Fraction(1, k), P)
    assert pow(root, k, P) == x
    assert positive_power(P - x, Fraction(1, k), P) == P - root


@given(st.integers(1, P - 1), EXPONENTS)
def test_one_integer_is_the_exponent_of_a_root_of_every_residue_that_has_one(
    x: int, a: Fraction
) -> None:
    base = x if a.denominator % 2 else x * x % P
    assert pow(base, root_exponent(a, P), P) == positive_power(base, a, P)


@pytest.mark.parametrize(
    "exponent", [Fraction(1, 2), Fraction(3, 4), Fraction(-1, 2), Fraction(5, 6)]
)
def test_even_roots_of_negative_residues_are_refused(exponent: Fraction) -> None:
    with pytest.raises(ValueError, match="even root"):
        positive_power(-4 % P, exponent, P)


@pytest.mark.parametrize("exponent", [Fraction(-1), Fraction(0), Fraction(-1, 3)])
def test_zero_to_a_power_that_is_not_positive_is_refused(exponent: Fraction) -> None:
    with pytest.raises(ValueError, match="zero"):
        positive_power(0, exponent, P)


def test_zero_to_a_positive_power_is_zero() -> None:
    assert positive_power(P, Fraction(2, 3), P) == 0


@given(st.integers(-(10**6), 10**6), st.integers(1, 10**6))
def test_fractions_come_back_from_their_residues(a: int, b: int) -> None:
    assert reconstruct(a * pow(b, -1, P) % P, P) == Fraction(a, b)


def test_random_residues_are_no_small_fractions() -> None:
    assert all(reconstruct(pow(3, 10**9 + k, P), P, 1000) is None for k in range(50))


@given(st.integers(1, 10**12))
def test_prime_factors_multiply_to_the_number(value: int) -> None:
    product = 1
    for ell, k in prime_factors(value):
        product *= ell**k
    assert product == value

"""Safe primes P = 2Q + 1 and the group of "positive" residues modulo them.

Modulo a safe prime P = 3 mod 4 the quadratic residues form a group of odd prime order Q, in which
every element has exactly one k-th root for each k < Q, and exactly one of w, -w is a residue. Residues
therefore behave under products and rational powers as positive reals do: sqrt(xy) = sqrt(x) sqrt(y)
for positive x, y, (x^2)^(1/2) = |x|, x^(1/2) x^(1/3) = x^(5/6). Taking every root there respects all
multiplicative relations among roots without knowing them. P = -1 modulo 4 l makes the prime l a
residue, so that sqrt(2), sqrt(3), … exist.
"""

from __future__ import annotations

import random
from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache

from flint import fmpz

# -1 modulo this: 2, 3, 5, 7, 11 and 13 are residues.
_MODULUS = 8 * 3 * 5 * 7 * 11 * 13
_BITS = 61


@lru_cache(maxsize=256)
def safe_prime(seed: int, residues: frozenset[int] = frozenset()) -> int:
    """A random safe prime of 61 bits modulo which 2 … 13 and all of `residues` (primes) are residues."""
    generator = random.Random(f"prime {seed}")
    low, high = 2 ** (_BITS - 1) // _MODULUS, 2**_BITS // _MODULUS
    while True:
        candidate = generator.randrange(low, high) * _MODULUS - 1
        if not _is_safe_prime(candidate):
            continue
        if all(is_positive(ell, candidate) for ell in residues):
            return candidate


def _is_safe_prime(candidate: int) -> bool:
    half = (candidate - 1) // 2
    if any(half % ell == 0 for ell in (17, 19, 23, 29, 31, 37, 41, 43)):
        return False
    return bool(fmpz(half).is_prime()) and bool(fmpz(candidate).is_prime())


def is_positive(value: int, prime: int) -> bool:
    """Whether a nonzero residue class is a square."""
    return int(fmpz(value).jacobi(prime)) == 1


def positive_power(value: int, exponent: Fraction, prime: int) -> int:
    """value^exponent; for a fraction the root that is itself a square (odd roots: the only root).

    Raises ValueError where no such root exists: an even root of a nonsquare, 0 to a negative power.
    """
    if value % prime == 0:
        if exponent <= 0:
            raise ValueError("zero to a negative power")
        return 0
    if exponent.denominator == 1:
        return pow(value, exponent.numerator, prime)
    order = (prime - 1) // 2
    if not is_positive(value, prime):
        if exponent.denominator % 2 == 0:
            raise ValueError("even root of a negative residue")
        sign = -1 if exponent.numerator % 2 else 1
        return sign * positive_power(-value % prime, exponent, prime) % prime
    return pow(value, exponent.numerator * pow(exponent.denominator, -1, order) % order, prime)


def prime_factors(value: int) -> Iterable[tuple[int, int]]:
    """(prime, multiplicity) of a positive integer."""
    return [(int(ell), int(k)) for ell, k in fmpz(value).factor()]


def reconstruct(residue: int, prime: int, bound: int = 10**6) -> Fraction | None:
    """The fraction a/b with |a|, b <= bound that is `residue` modulo `prime` (Wang), or None."""
    r0, s0, r1, s1 = prime, 0, residue % prime, 1
    while r1 > bound:
        quotient = r0 // r1
        r0, s0, r1, s1 = r1, s1, r0 - quotient * r1, s0 - quotient * s1
    if s1 == 0 or abs(s1) > bound:
        return None
    return Fraction(r1, s1)

"""Numerators of divisors of proofs are found from few values."""

import flint

from inverse_service.certificate.exceptions import Finding

PRIME = (1 << 61) - 1


def finding() -> Finding:
    found = Finding.__new__(Finding)
    found.prime = PRIME
    return found


def values_at(places: int, exponent: int) -> tuple[flint.nmod_poly, flint.nmod_poly]:
    """prod (s - k), and the polynomial with the values of (s - 2)^2 (s + 5)/(s^2 + 3)^exponent."""
    modulus = flint.nmod_poly([1], PRIME)
    for k in range(places):
        modulus *= flint.nmod_poly([-k % PRIME, 1], PRIME)
    numerator = flint.nmod_poly([-2 % PRIME, 1], PRIME) ** 2 * flint.nmod_poly([5, 1], PRIME)
    _, inverse, _ = flint.nmod_poly([3, 0, 1], PRIME).xgcd(modulus)
    return modulus, numerator * inverse**exponent % modulus


def test_high_powers_of_denominators_are_cleared() -> None:
    """2 * 30 + 3 degrees take 67 values without, 7 with the denominator."""
    modulus, polynomial = values_at(16, 30)
    assert finding().simplest(modulus, polynomial)[1] > 12
    found = finding().cleared(modulus, polynomial, [flint.nmod_poly([3, 0, 1], PRIME)])
    assert found * pow(int(found.leading_coefficient()), -1, PRIME) == (
        flint.nmod_poly([-2 % PRIME, 1], PRIME) ** 2 * flint.nmod_poly([5, 1], PRIME)
    )


def test_other_denominators_leave_the_values_as_they_are() -> None:
    modulus, polynomial = values_at(16, 30)
    assert finding().cleared(modulus, polynomial, [flint.nmod_poly([7, 1], PRIME)]) == polynomial


def test_powers_that_are_too_many_are_divided_out() -> None:
    modulus, polynomial = values_at(16, 10)
    below = [flint.nmod_poly([3, 0, 1], PRIME), flint.nmod_poly([3, 0, 1], PRIME)]
    found = finding().cleared(modulus, polynomial, below)
    assert found.degree() == 3

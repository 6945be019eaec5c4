"""Power series over a prime field: the defining identities of each operation."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

from inverse_service.field import point as ps
from inverse_service.field.modular import positive_power, safe_prime
from inverse_service.field.point import Series, SeriesRing, SingularPoint

P = safe_prime(2)
SHAPES = [(1, 0), (1, 1), (1, 7), (2, 0), (2, 4), (3, 3), (5, 2)]


@pytest.fixture(params=SHAPES, ids=str)
def ring(request: pytest.FixtureRequest) -> SeriesRing:
    return SeriesRing(P, *request.param)


def random_series(ring: SeriesRing, seed: int, constant: int | None = None) -> Series:
    """All coefficients random, the constant term as given."""
    generator = random.Random(f"{ring}/{seed}")
    total = ring.constant(generator.randrange(1, P))
    for _ in range(4):
        term = ring.constant(generator.randrange(P))
        for _ in range(generator.randint(1, 4)):
            term = ps.multiply(term, ring.variable(generator.randrange(ring.size), generator.randrange(P)))
        total = ps.add(total, term)
    if constant is None:
        return total
    return ps.add(total, ring.constant(constant - ps.value_at_point(total)))


def test_multiplication_is_that_of_polynomials_cut_off(ring: SeriesRing) -> None:
    a, b = random_series(ring, 1), random_series(ring, 2)
    product: dict[tuple[int, ...], int] = {}
    for left, x in ps.terms(a).items():
        for right, y in ps.terms(b).items():
            exponents = tuple(i + j for i, j in zip(left, right, strict=True))
            if sum(exponents) <= ring.order:
                product[exponents] = (product.get(exponents, 0) + x * y) % P
    assert ps.terms(ps.multiply(a, b)) == {k: x for k, x in product.items() if x}


def test_a_variable_is_its_value_and_a_displacement(ring: SeriesRing) -> None:
    last = ring.size - 1
    expected = {(0,) * ring.size: 5}
    if ring.order:
        expected[(0,) * last + (1,)] = 1
    assert ps.terms(ring.variable(last, 5)) == expected


def test_the_inverse_times_the_series_is_one(ring: SeriesRing) -> None:
    a = random_series(ring, 3)
    assert ps.multiply(a, ps.inverse(ring, a)) == ring.constant(1)


def test_a_series_without_constant_term_has_no_inverse(ring: SeriesRing) -> None:
    with pytest.raises(SingularPoint):
        ps.inverse(ring, random_series(ring, 4, constant=0))


def test_exponential_of_logarithm_is_the_series(ring: SeriesRing) -> None:
    a = random_series(ring, 5)
    logarithm = ps.logarithm(ring, a, 17)
    assert ps.exponential(ring, logarithm, ps.value_at_point(a)) == a


def test_logarithm_of_exponential_is_the_series(ring: SeriesRing) -> None:
    a = random_series(ring, 6)
    assert ps.logarithm(ring, ps.exponential(ring, a, 99), ps.value_at_point(a)) == a


def test_exponential_turns_sums_into_products(ring: SeriesRing) -> None:
    a, b = random_series(ring, 7), random_series(ring, 8)
    together = ps.exponential(ring, ps.add(a, b), 15)
    assert together == ps.multiply(ps.exponential(ring, a, 3), ps.exponential(ring, b, 5))


def test_exponential_of_a_displacement_has_the_coefficients_one_over_factorial() -> None:
    ring = SeriesRing(P, 1, 9)
    found = ps.terms(ps.exponential(ring, ring.variable(0, 0), 1))
    assert found == {(k,): pow(math.factorial(k), -1, P) for k in range(10)}


def circle(seed: int) -> tuple[int, int]:
    t = random.Random(seed).randrange(P)
    factor = pow(1 + t * t, -1, P)
    return 2 * t * factor % P, (1 - t * t) * factor % P


def test_squares_of_sine_and_cosine_add_to_one(ring: SeriesRing) -> None:
    s, c = ps.sine_cosine(ring, random_series(ring, 9), *circle(1))
    assert ps.add(ps.multiply(s, s), ps.multiply(c, c)) == ring.constant(1)


def test_sines_of_sums_follow_the_addition_theorem(ring: SeriesRing) -> None:
    a, b = random_series(ring, 10), random_series(ring, 11)
    (s1, c1), (s2, c2) = circle(2), circle(3)
    first, second = ps.sine_cosine(ring, a, s1, c1), ps.sine_cosine(ring, b, s2, c2)
    both = ps.sine_cosine(ring, ps.add(a, b), (s1 * c2 + c1 * s2) % P, (c1 * c2 - s1 * s2) % P)
    assert both[0] == ps.add(ps.multiply(first[0], second[1]), ps.multiply(first[1], second[0]))
    assert both[1] == ps.subtract(ps.multiply(first[1], second[1]), ps.multiply(first[0], second[0]))


def test_arctangent_of_the_tangent_is_the_angle(ring: SeriesRing) -> None:
    a = random_series(ring, 12)
    s, c = ps.sine_cosine(ring, a, *circle(4))
    assert ps.arctangent(ring, ps.multiply(s, ps.inverse(ring, c)), ps.value_at_point(a)) == a


@pytest.mark.parametrize("exponent", [Fraction(1, 2), Fraction(-2, 3), Fraction(5, 6), Fraction(7), Fraction(-3)])
def test_powers_multiply_by_adding_exponents(ring: SeriesRing, exponent: Fraction) -> None:
    value = pow(random.Random(5).randrange(P), 2, P)
    a = random_series(ring, 13, constant=value)
    first = ps.power(ring, a, exponent, positive_power(value, exponent, P))
    rest = ps.power(ring, a, 2 - exponent, positive_power(value, 2 - exponent, P))
    assert ps.multiply(first, rest) == ps.multiply(a, a)


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 5, 9])
def test_integer_powers_are_repeated_products_also_where_the_base_vanishes(ring: SeriesRing, exponent: int) -> None:
    for base in (random_series(ring, 14), random_series(ring, 15, constant=0)):
        expected = ring.constant(1)
        for _ in range(exponent):
            expected = ps.multiply(expected, base)
        assert ps.integer_power(ring, base, exponent) == expected


def test_negative_powers_of_what_vanishes_at_the_point_are_refused(ring: SeriesRing) -> None:
    with pytest.raises(SingularPoint):
        ps.integer_power(ring, random_series(ring, 16, constant=0), -2)
    with pytest.raises(SingularPoint):
        ps.power(ring, random_series(ring, 16, constant=0), Fraction(1, 2), 0)


def test_the_derivative_of_a_product_follows_leibniz() -> None:
    ring = SeriesRing(P, 3, 4)
    a, b = random_series(ring, 17), random_series(ring, 18)
    for index in range(3):
        left = ps.add(ps.multiply(ps.derivative(a, index), b[:-1]), ps.multiply(a[:-1], ps.derivative(b, index)))
        assert ps.derivative(ps.multiply(a, b), index) == left


def test_partial_derivatives_commute_and_lower_the_order() -> None:
    a = random_series(SeriesRing(P, 3, 5), 19)
    both = ps.derivative(ps.derivative(a, 0), 2)
    assert both == ps.derivative(ps.derivative(a, 2), 0)
    assert len(both) == len(a) - 2


@pytest.mark.parametrize(("size", "order"), [(1, 0), (1, 5), (2, 4), (3, 2)])
def test_composition_with_the_jet_of_a_polynomial_is_substitution(size: int, order: int) -> None:
    ring = SeriesRing(P, size, order)
    u, w = random_series(ring, 20), random_series(ring, 21)
    place = (ps.value_at_point(u), ps.value_at_point(w))

    def jet(orders: tuple[int, ...]) -> int:
        """The partial derivatives of a^3 b^2."""
        (i, j), (a, b) = orders, place
        if i > 3 or j > 2:
            return 0
        return math.perm(3, i) * math.perm(2, j) * pow(a, 3 - i, P) * pow(b, 2 - j, P) % P

    expected = ps.multiply(ps.integer_power(ring, u, 3), ps.integer_power(ring, w, 2))
    assert ps.compose(ring, [u, w], jet) == expected


def test_composition_with_the_jet_of_the_exponential_is_the_exponential() -> None:
    ring = SeriesRing(P, 2, 5)
    u = random_series(ring, 22)
    assert ps.compose(ring, [u], lambda orders: 77) == ps.exponential(ring, u, 77)

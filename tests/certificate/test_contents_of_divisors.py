"""Numerators of divisors of proofs are found from few values."""

import random
import time

import flint

from inverse_service.certificate.checker import proven_question
from inverse_service.certificate.exceptions import Finding
from inverse_service.certificate.question import Tools

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


def of_lagrangian(text: str) -> Finding:
    """The search for the exceptions of the proof of x'' = y'' = 0 by this Lagrangian."""
    document = {
        "format": "inverse-service/certificate/2",
        "system": {
            "coordinates": ["x", "y"],
            "equations": {"x": "0", "y": "0"},
            "parameters": ["a", "b", "c"],
        },
        "question": "autonomous",
        "claim": "variational",
        "kind": "lagrangian",
        "lagrangian": text,
    }
    tools = Tools(random.Random(7), time.thread_time() + 30)
    asked, _ = proven_question(document, tools)
    assert asked.generic is not None
    return Finding(asked, asked.generic, asked.own_parameters, 1e9)


MIXED = "(a*x'^2 + c*x'*y' + b*y'^2)/(a - b)"


def test_contents_on_several_lines_are_those_on_each() -> None:
    found = of_lagrangian(MIXED)
    lines = [found.direction() for _ in range(5)]
    for one, other in zip(found.contents(lines), map(found.content, lines), strict=True):
        assert one.degree() == other.degree() > 0
        assert (one % other).degree() < 0


def test_a_divisor_at_many_places_is_one_divisor() -> None:
    found = of_lagrangian(MIXED)
    counts = set()
    for places in (3, 12):
        drawn = [found.question.generator.randrange(1, found.prime) for _ in range(places)]
        ((rows,), _) = found.divisors(found.seeds[0], [found.direction()], drawn, last=False)
        counts.add(len(rows[0]))
    assert len(counts) == 1
    assert counts.pop() > 0

"""Numerators of divisors of proofs are found from few values."""

import random
import time
from dataclasses import replace

import flint
import pytest
from flint import nmod_poly

import inverse_service
from inverse_service.certificate.checker import proven_question
from inverse_service.certificate.exceptions import Finding, divisors_of
from inverse_service.certificate.lines import Displaced, OnLine, Special
from inverse_service.certificate.numbers import Undefined
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


def test_a_divisor_along_a_line_is_one_divisor() -> None:
    """Its value at the start of the line is that of the same computation there alone."""
    found = of_lagrangian(MIXED)
    direction, (seed, _) = found.direction(), found.seeds
    there = Special(
        found.question, found.prime, seed, dict(zip(found.names, found.base, strict=True))
    )
    alone = divisors_of(found.generic, found.question.expansion(there, found.generic.degree))
    for count in (3, 12):
        series, _ = found.divisors(seed, direction, count, last=False)
        assert [int(one[0]) for one in series] == alone
        assert any(one.degree() == count - 1 for one in series)


def test_series_along_a_line_are_those_of_the_values() -> None:
    """The sums, products, quotients, and determinants of series, at a small place s."""
    size, start = 6, nmod_poly([3, 1], PRIME)
    one, other = Displaced(start, size), Displaced(start * start + 1, size)
    line = OnLine.__new__(OnLine)
    line.prime, line.field, line.divisors, line.denominators = PRIME, None, None, []
    whole = nmod_poly([1], PRIME).left_shift(size)
    assert (one * other - 2 * one + 7).part == (start * (start * start + 1) - 2 * start + 7) % whole
    assert ((5 - one) * line.inverse(5 - one)).part == nmod_poly([1], PRIME)
    assert line.moderate_power(one, -2) == line.inverse(one * one)
    matrix = [[one, 2, other], [0, one, 5], [other, 1, one]]
    (a, b, c), (d, e, f), (g, h, i) = matrix
    expanded = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    assert line.determinant(matrix) == expanded
    with pytest.raises(Undefined):
        line.inverse(one - 3)
    with pytest.raises(Undefined):
        line.root_of(other, 2)


@pytest.mark.parametrize(
    ("equations", "failing", "fewer"),
    [
        (["x'' = a*y^2 + b*x'*y'", "y'' = c*x + d*y'^2*x"], {"bd", "abc", "acd"}, False),
        (["x'' = y^2 + a*x + b*y*x'", "y'' = x' + c*x + d*x*y'"], set(), True),
    ],
)
def test_where_large_sets_have_full_rank_small_ones_are_not_tried(
    equations: list[str], failing: set[str], fewer: bool
) -> None:
    """The sets found are the same as where each set is tried."""
    names = ["a", "b", "c", "d"]
    document = {"coordinates": ["x", "y"], "equations": equations, "parameters": names}
    certificate = inverse_service.solve(document | {"first_integrals": False})["certificate"]
    assert certificate["kind"] == "nonexistence"
    asked, _ = proven_question(certificate, Tools(random.Random(7), time.thread_time() + 30))
    assert asked.generic is not None
    evaluated = []
    for generic in (asked.generic, replace(asked.generic, is_full=None)):
        found = Finding(asked, generic, asked.own_parameters, 1e9)
        sets = found.small_failing([], range(4))
        assert {"".join(names[k] for k in one) for one in sets} == failing
        evaluated.append(found.done)
    assert (evaluated[0] < evaluated[1]) == fewer

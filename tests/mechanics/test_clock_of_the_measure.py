"""Chaplygin's clock: dtau = N dt with N^(k - 1) the density of the invariant measure of the momenta,
for k free coordinates (Chaplygin 1911).
"""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest

from inverse_service.constrained.reduced import chaplygin_factor
from inverse_service.expressions import calculus, tree as ex
from inverse_service.mechanics.nonholonomic_integrals import MeasureDensity
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.reading import names as nm, reader


def system(count: int) -> SecondOrderSystem:
    names = [f"r{k}" for k in range(1, count + 1)]
    return read_system(names, dict.fromkeys(names, "0"), ["m"])


def density(text: str) -> MeasureDensity:
    names = nm.Names(("r1", "r2", "s"), ("m",))
    return MeasureDensity("found", reader.read_formula(text, names))


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("rho", ["1/sqrt(m + r1^2)", "(1 + r1^2)^3/(2 + r2^2)"])
def test_a_power_of_the_clock_is_the_density(count: int, rho: str) -> None:
    found = chaplygin_factor(system(count), density(rho))
    assert not isinstance(found, str)
    tree = density(rho).momenta
    assert tree is not None
    place = {ex.Symbol(name): mpmath.mpf(value) for name, value in (("r1", 2), ("r2", 3), ("m", 5))}
    power, value = (
        calculus.evaluate(one, dict(place)) for one in (found ** Fraction(count - 1), tree)
    )
    assert abs(power - value) < 1e-12 * abs(value)


@pytest.mark.parametrize(
    ("count", "rho", "words"),
    [
        (1, "1 + r1^2", "any clock"),
        (2, "1 + s^2", "other coordinates"),
        (2, "m^2", "no other clock"),
    ],
)
def test_why_a_measure_gives_no_clock(count: int, rho: str, words: str) -> None:
    found = chaplygin_factor(system(count), density(rho))
    assert isinstance(found, str)
    assert words in found

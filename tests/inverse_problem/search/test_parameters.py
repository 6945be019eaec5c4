"""Symbolic parameters: coefficients are found as polynomials in them."""

from __future__ import annotations

import time

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.search.ladder import search
from inverse_service.mechanics.reading import read_system

PENDULA = (
    "(m1+m2)*l1*a'' + m2*l2*b''*cos(a-b) + m2*l2*b'^2*sin(a-b) + (m1+m2)*g*sin(a);"
    "l2*b'' + l1*a''*cos(a-b) - l1*a'^2*sin(a-b) + g*sin(b)"
)
SYSTEMS = {
    "double pendulum": (["a", "b"], PENDULA, ["m1", "m2", "l1", "l2", "g"]),
    "pendulum on a cart": (
        ["x", "a"],
        "(M+m)*x'' + m*l*a''*cos(a) - m*l*a'^2*sin(a) + k*x; l*a'' + x''*cos(a) + g*sin(a)",
        ["M", "m", "l", "k", "g"],
    ),
    "three coupled masses": (
        ["x", "y", "z"],
        "m1*x'' + k1*(x-y); m2*y'' + k1*(y-x) + k2*(y-z); m3*z'' + k2*(z-y)",
        ["m1", "m2", "m3", "k1", "k2"],
    ),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_symbolic_system_gets_a_lagrangian_that_the_checker_confirms(name: str) -> None:
    coordinates, equations, parameters = SYSTEMS[name]
    analysis = analyse(read_system(coordinates, equations, parameters, {}, name))
    outcome = search(analysis, False, 1, time.monotonic() + 60, lambda _: None)
    assert outcome.found is not None
    certificate = certify.of_lagrangian(analysis, outcome.found.lagrangians[0], False)
    assert check_certificate(certificate).verdict == "valid"
    assert certificate["system"]["parameters"] == parameters


def test_a_system_without_lagrangian_gets_none_with_symbols() -> None:
    analysis = analyse(read_system(["x", "y"], {"x": "a*x' + y", "y": "b*y'^2 - x"}, ["a", "b"], {}, ""))
    assert search(analysis, False, 1, time.monotonic() + 60, lambda _: None).found is None


POWERS = {
    "a power law": (["x"], "x'' = -k*x^n"),
    "powers side by side": (["x"], "x'' = -k*x^(n-3) - x^(k+2)"),
    "Emden and Fowler": (["x"], "x'' = -k*x'/t - x^n"),
    "a central power law": (["x", "y"], "x'' = -k*x*(x^2+y^2)^n; y'' = -k*y*(x^2+y^2)^n"),
    "an exponential beside": (["x"], "x'' = -k*n*x^(n-1) - exp(k*x)"),
}


@pytest.mark.parametrize("name", POWERS)
def test_a_force_with_a_symbolic_exponent_has_its_potential(name: str) -> None:
    coordinates, equations = POWERS[name]
    analysis = analyse(read_system(coordinates, equations, ["k", "n"], {}, name))
    with_time = "t" in equations
    outcome = search(analysis, with_time, 1, time.monotonic() + 60, lambda _: None)
    assert outcome.found is not None
    certificate = certify.of_lagrangian(analysis, outcome.found.lagrangians[0], with_time)
    assert check_certificate(certificate).verdict == "valid"

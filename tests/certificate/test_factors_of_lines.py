"""For equations that are too long to solve, each divided by a constant, the certificate names the
factors.
"""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service

# Three pendulums on a cart (Arnold, Mathematical Methods of Classical Mechanics, section 23), lines
# divided by m l.
LINES = [
    "x'' + k1*cos(a)*a'' + k2*cos(b)*b'' + k3*cos(c)*c'' - k1*sin(a)*a'^2 - k2*sin(b)*b'^2 - k3*sin(c)*c'^2 = 0",
    "A*a'' + cos(a)*x'' + p*cos(a-b)*b'' + r*cos(a-c)*c'' + p*sin(a-b)*b'^2 + r*sin(a-c)*c'^2 + g*sin(a) = 0",
    "B*b'' + cos(b)*x'' + p*k1/k2*cos(a-b)*a'' + s*cos(b-c)*c'' - p*k1/k2*sin(a-b)*a'^2 + s*sin(b-c)*c'^2"
    " + g*sin(b) = 0",
    "C*c'' + cos(c)*x'' + r*k1/k3*cos(a-c)*a'' + s*k2/k3*cos(b-c)*b'' - r*k1/k3*sin(a-c)*a'^2 - s*k2/k3*sin(b-c)*b'^2"
    " + g*sin(c) = 0",
]


@pytest.fixture(scope="module")
def certificate() -> dict[str, Any]:
    document = {"coordinates": ["x", "a", "b", "c"], "equations": LINES, "parameters": "guess"}
    result = inverse_service.solve({**document, "first_integrals": False})
    assert result["checked"] == "valid"
    return dict(result["certificate"])


@pytest.mark.slow
def test_the_factors_are_named_and_checked(certificate: dict[str, Any]) -> None:
    assert certificate["factors"] == ["1", "k1", "k2", "k3"]
    assert inverse_service.check(certificate)["verdict"] == "valid"


@pytest.mark.parametrize(
    "factors",
    [
        ["1", "k1", "k2", "k2"],
        ["1", "k1", "k2", "0"],
        ["1", "k1", "k2", "k3*cos(c)"],
        ["1", "k1", "k2", "c''"],
        ["1"],
    ],
)
def test_other_factors_prove_nothing(certificate: dict[str, Any], factors: list[str]) -> None:
    assert inverse_service.check(certificate | {"factors": factors})["verdict"] != "valid"


def test_without_factors_it_proves_nothing(certificate: dict[str, Any]) -> None:
    plain = {key: value for key, value in certificate.items() if key != "factors"}
    assert inverse_service.check(plain)["verdict"] != "valid"


@pytest.mark.slow
def test_lines_come_in_any_order() -> None:
    """The line of x is typed first, where x is the last coordinate."""
    document = {"coordinates": ["a", "b", "c", "x"], "equations": LINES, "parameters": "guess"}
    result = inverse_service.solve(document)
    assert result["checked"] == "valid"
    assert "cos(a - b)*a'*b'" in result["lagrangian"]["text"]
    assert inverse_service.check(result)["verdict"] == "valid"
    other = result.to_dict()
    other["system"]["given"]["equations"][2] = LINES[2].replace("+ g*sin(b)", "+ 2*g*sin(b)")
    assert inverse_service.check(other)["verdict"] != "valid"

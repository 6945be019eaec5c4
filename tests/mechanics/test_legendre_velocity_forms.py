"""Momenta of Lagrangians written in linear forms of the velocities are solved in these forms."""

from __future__ import annotations

import pytest

from inverse_service.expressions.names import Names
from inverse_service.expressions.text import parse
from inverse_service.expressions.tree import Velocity, walk
from inverse_service.inverse_problem.finding import hamiltonian_of
from inverse_service.mechanics.legendre.transform import legendre
from inverse_service.mechanics.legendre.velocity_forms import in_velocity_forms

NAMES = Names(("r", "u"), (), {}, time=True)
FIRST, SECOND = "(cos(u)*r' - r*sin(u)*u')", "(sin(u)*r' + r*cos(u)*u')"
SOLVED = [
    f"{FIRST}*log({FIRST}) + 2*{SECOND}*log({SECOND}) - cos(r*sin(u))",
    f"-sqrt(1 - {FIRST}^2) - 2*sqrt(1 - {SECOND}^2) - r^2",
]


@pytest.mark.parametrize("text", SOLVED)
def test_the_hamiltonian_is_closed_and_holds_no_velocity(text: str) -> None:
    lagrangian = parse(text, NAMES)
    assert legendre(lagrangian, ("r", "u")).implicit
    found = hamiltonian_of(lagrangian, ("r", "u"))
    assert found is not None
    assert not found.implicit
    assert [symbol.name for symbol in found.symbols] == ["p_r", "p_u"]
    assert not any(isinstance(node, Velocity) for node in walk(found.expression))


@pytest.mark.parametrize("text", ["r'*u' + exp(r') + exp(u') + r'^4", f"({FIRST})^2 + exp({FIRST}*u') + u'^6"])
def test_what_does_not_separate_stays_implicit(text: str) -> None:
    lagrangian = parse(text, NAMES)
    given = legendre(lagrangian, ("r", "u"))
    assert given.implicit
    assert in_velocity_forms(lagrangian, given, ("r", "u")) is given

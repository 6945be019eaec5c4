"""Momenta of Lagrangians written in linear forms of the velocities are solved in these forms."""

from __future__ import annotations

import pytest

from inverse_service.expressions.tree import Velocity, walk
from inverse_service.inverse_problem.explanation.finding import hamiltonian_of
from inverse_service.mechanics.legendre.transform import legendre
from inverse_service.mechanics.legendre.velocity_forms import in_velocity_forms
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

NAMES = Names(("r", "u"), (), {}, time=True)
FIRST, SECOND = "(cos(u)*r' - r*sin(u)*u')", "(sin(u)*r' + r*cos(u)*u')"
SOLVED = [
    f"{FIRST}*log({FIRST}) + 2*{SECOND}*log({SECOND}) - cos(r*sin(u))",
    f"-sqrt(1 - {FIRST}^2) - 2*sqrt(1 - {SECOND}^2) - r^2",
    "(r' + 4*u*u')^2/2 + u'^2/2 + (r' + 4*u*u')^4/36 + u'^4/3 - cos(r + 2*u^2)",
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


def test_the_branches_of_all_forms_are_named() -> None:
    """p = w - w^3 has three inverses, for each of the two forms w."""
    lagrangian = parse("(r' + 4*u*u')^2/2 - (r' + 4*u*u')^4/4 + u'^2/2 - u'^4/4", NAMES)
    found = hamiltonian_of(lagrangian, ("r", "u"))
    assert found is not None
    assert not found.implicit
    assert "1 - 3*u'^2 > 0" in found.note
    assert found.note.count("> 0") == 2


def test_digits_lost_in_large_exponentials_are_no_objection() -> None:
    lagrangian = parse("-3*exp(r' + 2*u*u') + 2*exp(2*u') - u*r'", NAMES)
    assert not legendre(lagrangian, ("r", "u")).implicit


@pytest.mark.parametrize("text", ["r'*u' + exp(r') + exp(u') + r'^4", f"({FIRST})^2 + exp({FIRST}*u') + u'^6"])
def test_what_does_not_separate_stays_implicit(text: str) -> None:
    lagrangian = parse(text, NAMES)
    given = legendre(lagrangian, ("r", "u"))
    assert given.implicit
    assert in_velocity_forms(lagrangian, given, ("r", "u")) is given

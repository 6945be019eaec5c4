"""Coefficients of L that hold parameters, and coordinates that f does not hold: classes that a fixed list had lost."""

from __future__ import annotations

import pytest

from inverse_service.deadline import now
from inverse_service.expressions.printing import to_text
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.ladder import search
from inverse_service.inverse_problem.search.reductions import is_damped
from inverse_service.mechanics.reading import read_system
from tests.inverse_problem.search.given import material
from tests.systems.reading import formulas, known_systems
from tests.systems.second_opinion import is_lagrangian

KNOWN = {known.id: known for known in known_systems()}
NAMES = (
    *("lagrange-top", "berger-sphere", "weber-plane", "implicit-cart-pole"),
    *("free-particle-sheared", "lie-heisenberg-5-dilated", "calogero-moser-three"),
)


@pytest.mark.parametrize("name", NAMES)
def test_the_search_finds_what_sympy_confirms(name: str) -> None:
    document = KNOWN[name].document
    system = read_system(document.get("coordinates"), document["equations"], document.get("parameters") or ())
    found = search(analyze(system), False, 1, now() + 120, lambda _: None).found
    assert found is not None
    text = {name: to_text(f) for name, f in zip(system.coordinates, system.accelerations, strict=True)}
    given = formulas({**document, "coordinates": list(system.coordinates)}, text)
    assert is_lagrangian(to_text(found.lagrangians[0]), given)


def test_damping_is_taken_away_from_kinetic_energies_of_several_coordinates_only() -> None:
    assert is_damped(material({"x": "-x'-x^3", "y": "-y'-y^3"}, with_time=True))
    assert not is_damped(material({"x": "-x'-x^3", "y": "-y'-y^3"}))
    assert not is_damped(material({"x": "-x'-x^3"}, with_time=True))
    assert not is_damped(material({"x": "-x'*sqrt(1-x'^2)-x", "y": "-y'-y"}, with_time=True))

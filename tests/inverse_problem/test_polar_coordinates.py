"""Plane systems with rotations, in r and phi."""

from __future__ import annotations

import pytest

from inverse_service.decision import deciding
from inverse_service.field import real_branch
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.search import material as mt, reductions
from inverse_service.statements.questions import PLAIN

KEPLER = ("-x/(x^2+y^2)^(3/2)", "-y/(x^2+y^2)^(3/2)")


def material(equations: tuple[str, str]) -> mt.Material:
    system = read_system(["x", "y"], dict(zip("xy", equations, strict=True)))
    return mt.gather_material(deciding.analyze(system), PLAIN)


@pytest.mark.parametrize(
    ("equations", "rotational"),
    [
        (KEPLER, True),
        (("y'-x*(x'^2+y'^2)", "-x'-y*(x'^2+y'^2)"), True),  # a magnetic field
        (("-x/(x^2+2*y^2)^(3/2)", "-2*y/(x^2+2*y^2)^(3/2)"), False),
        (("x'+y*x", "y'-x^2"), False),
    ],
)
def test_rotations_are_seen(equations: tuple[str, str], rotational: bool) -> None:
    assert reductions.is_rotational(material(equations)) is rotational


def test_the_equations_in_polar_coordinates_are_those_of_books() -> None:
    """r'' = r phi'^2 - 1/r^2, phi'' = -2 r' phi'/r."""
    (smaller,) = reductions.into_polar(material(KEPLER), 1)
    (found,) = smaller.systems
    book = read_system(["x", "y"], {"x": "x*y'^2-1/x^2", "y": "-2*x'*y'/x"})
    pairs = zip(found.accelerations, book.accelerations, strict=True)
    assert all(real_branch.vanishes(one - other) for one, other in pairs)

"""Groups that act on a plane: the invariant form of the group stands in denominators."""

from __future__ import annotations

import pytest

from inverse_service.decision import deciding
from inverse_service.field import real_branch
from inverse_service.mechanics import euler_lagrange
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
from inverse_service.search import ladder, material as mt, with_integrals
from inverse_service.statements.questions import PLAIN

NAMES = ("x", "y", "z", "u", "w")
# The canonical connection of the special affine group of the plane (A5,40).
AFFINE = {
    "x": "-2*x'*y*z'-y'*z'",
    "y": "4*x'*y^2*z'-2*x'*y'+2*y*y'*z'",
    "z": "2*x'*z'",
    "u": "-2*u'*x'*y*z-u'*x'-u'*y'*z-2*w'*x'*y-w'*y'",
    "w": "2*u'*x'*y*z^2+2*u'*x'*z+u'*y'*z^2-u'*z'+2*w'*x'*y*z+w'*x'+w'*y'*z",
}
FORM = "x'^2+y'*z'+2*y*x'*z'"
BY_HAND = (
    f"({FORM})/2-u'*w+((x'*z+x'*y*z^2+y'*z^2/2-z'/2)*u'^2+(x'+2*x'*y*z+y'*z)*u'*w'"
    f"+(x'*y+y'/2)*w'^2)/({FORM})"
)


def gathered(equations: dict[str, str]) -> mt.Material:
    system = read_system(list(equations), equations)
    return mt.gather_material(deciding.analyze(system), PLAIN)


def test_the_group_has_equations_of_its_own() -> None:
    material = gathered(AFFINE)
    assert with_integrals.applies(material)
    assert [part.coordinates for part in with_integrals.closed_parts(material.analysis.system)] == [
        ("x", "y", "z")
    ]


@pytest.mark.parametrize(
    "equations",
    [
        {"x": "-x", "y": "x*y'^2"},  # not of degree 2
        {"x": "x'*y'", "y": "x'*y'"},  # no part has equations of its own
        {"x": "x'^2/x", "y": "x'*y'", "z": "y'*z'"},  # a quotient
    ],
)
def test_other_systems_are_left_to_other_methods(equations: dict[str, str]) -> None:
    assert not with_integrals.applies(gathered(equations))


def test_the_form_of_the_group_divides_a_lagrangian() -> None:
    """Derived by hand from the invariance of the form; its Euler-Lagrange expressions vanish."""
    system = read_system(list(AFFINE), AFFINE)
    tree = reader.read_formula(BY_HAND, nm.Names(NAMES, (), {}))
    assert ladder.holds_numerically(deciding.analyze(system), tree, 1)


@pytest.mark.slow
def test_a_lagrangian_of_the_special_affine_group_is_found() -> None:
    material = gathered(AFFINE)
    found = next(iter(with_integrals.propose(material, 1)))
    system = material.analysis.system
    for residual in euler_lagrange.euler_lagrange_sums(found, NAMES, system.accelerations):
        assert real_branch.vanishes(residual)

"""Systems with rotations, in r and phi of a plane."""

from __future__ import annotations

import pytest

from inverse_service.decision import deciding
from inverse_service.field import real_branch
from inverse_service.mechanics import euler_lagrange
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
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


WEBER = [
    f"-{q}*((x'^2+y'^2+z'^2)*(x^2+y^2+z^2)*(-2)+3*(x*x'+y*y'+z*z')^2-2*(x^2+y^2+z^2))"
    "/(2*(x^2+y^2+z^2)^2*(sqrt(x^2+y^2+z^2)-1))"
    for q in "xyz"
]
IN_SPACE = {
    "Kepler": ([f"-{q}/(x^2+y^2+z^2)^(3/2)" for q in "xyz"], "x'^2/2+x^2*y'^2/2+1/x"),
    "Weber": (WEBER, "x'^2/2+x^2*y'^2/2-(1+x'^2/2)/x"),
}


@pytest.mark.parametrize("name", IN_SPACE)
def test_a_lagrangian_of_the_plane_is_one_in_space(name: str) -> None:
    """Weber (1846): L = v^2/2 - (1 + r'^2/2)/r; in the plane it is written with r = x, phi' = y'."""
    equations, polar = IN_SPACE[name]
    system = read_system(["x", "y", "z"], dict(zip("xyz", equations, strict=True)))
    gathered = mt.gather_material(deciding.analyze(system), PLAIN)
    assert reductions.is_rotational(gathered)
    (smaller,) = reductions.into_polar(gathered, 1)
    plane = reader.read_formula(polar, nm.Names(("x", "y"), (), {}))
    (flat,) = smaller.systems
    for residual in euler_lagrange.euler_lagrange_sums(plane, ("x", "y"), flat.accelerations):
        assert real_branch.vanishes(residual)
    (lifted,) = smaller.lift([[plane]])
    for residual in euler_lagrange.euler_lagrange_sums(
        lifted, ("x", "y", "z"), system.accelerations
    ):
        assert real_branch.vanishes(residual)


def test_a_motion_that_leaves_its_plane_has_no_equations_in_one() -> None:
    """A charge in the field of a magnetic pole moves on a cone."""
    cross = ["y*z'-z*y'", "z*x'-x*z'", "x*y'-y*x'"]
    equations = {q: f"({c})/(x^2+y^2+z^2)^(3/2)" for q, c in zip("xyz", cross, strict=True)}
    system = read_system(["x", "y", "z"], equations)
    gathered = mt.gather_material(deciding.analyze(system), PLAIN)
    assert reductions.is_rotational(gathered)
    assert list(reductions.into_polar(gathered, 1)) == []


def test_along_paths_functions_hold_the_time_of_the_paths() -> None:
    """With u' = const, F(u, x) is F(t, x) in x'' over u'^2."""
    forces = {"u": "0", "x": "u'^2*F(u, x)"}
    system = read_system(["u", "x"], forces, functions={"F": ["u", "x"]})
    found = mt.gather_material(deciding.analyze(system), PLAIN)
    paths, own = {u: both for u, *both in reductions._along(found)}["u"]
    assert paths.coordinates == ("x",)
    assert paths.functions == (("F", ("t", "x")),)
    assert own.coordinates == ("u",)

"""The picture of a motion follows from what is known of it, and what its caption says is true."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest

from inverse_service import catalogue, solve
from inverse_service.expressions import calculus, tree as ex
from inverse_service.mechanics import conditions
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import printed_pages
from inverse_service.web.pages import pictures, preview, starts

KEPLER = "r'' = r*phi'^2 - 1/r^2; phi'' = -2*r'*phi'/r"
COUPLED = "theta1'' = -sin(theta1) + theta2 - theta1; theta2'' = -sin(theta2) + theta1 - theta2"
DOUBLE = "(m1+m2)/2*l1^2*a'^2 + m2/2*l2^2*b'^2 + m2*l1*l2*cos(a-b)*a'*b' + (m1+m2)*g*l1*cos(a) + m2*g*l2*cos(b)"
TRIPLE = "3*a'^2/2 + b'^2 + c'^2/2 + 2*a'*b'*cos(a-b) + a'*c'*cos(a-c) + b'*c'*cos(b-c) + 3*cos(a) + 2*cos(b) + cos(c)"
CART_OF_TWO = (
    "3*x'^2/2 + a'^2 + b'^2/2 + 2*cos(a)*x'*a' + cos(b)*x'*b' + cos(a-b)*a'*b' + 2*cos(a) + cos(b)"
)
TWO_BODIES = "m*(x1'^2+y1'^2)/2 + M*(x2'^2+y2'^2)/2 + k/sqrt((x1-x2)^2+(y1-y2)^2)"
CART = "(M+m)/2*x'^2 + m/2*l^2*theta'^2 + m*l*cos(theta)*x'*theta' + m*g*l*cos(theta)"
TOP = "A/2*(th'^2 + ph'^2*sin(th)^2) + C/2*(ps' + ph'*cos(th))^2 - m*cos(th)"
SPRUNG = "(r'^2 + r^2*phi'^2)/2 + r*cos(phi) - (r - 1)^2"
KNIFE = {"lagrangian": "(x'^2+y'^2+p'^2)/2", "constraints": ["x'*sin(p)-y'*cos(p)"]}


@cache
def solved(text: str, integrals: bool = True) -> Any:
    if "''" not in text:  # whose equations are all that is asked
        return solve({"lagrangian": text, "parameters": "guess"})
    return solve({"equations": text, "parameters": "guess", "first_integrals": integrals})


def shown(document: Any, reveals: bool = True) -> preview.Shown | None:
    result = solved(document) if isinstance(document, str) else solve(document)
    return preview.motion_of_result(result, reveals=reveals)


def kind(document: Any, reveals: bool = True) -> str:
    """The picture without first integrals."""
    of_text = isinstance(document, str)
    result = solved(document, False) if of_text else solve({**document, "first_integrals": False})
    found = preview.motion_of_result(result, reveals=reveals)
    return "" if found is None else str(found.data["picture"])


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        ("y'' = -9.81", "well"),
        ("x'' = x - x^3", "well"),
        ("x'' = -x - x'", "spring"),
        ("x'' = -abs(x)", "cases"),
        ("x'' = -x - 2*x*y; y'' = -y - x^2 + y^2", "path"),
        ("x'' = (1+x/2)*y'; y'' = -(1+x/2)*x'", "charge"),
        (KEPLER.replace("phi", "p"), "central"),  # by its kinetic energy
        ("x'' = -x - x'^2*y; y'' = -y + x'*y'", "none"),
        ("(x1'^2 + x2'^2 + x3'^2 - (x1 - x2)^2 - (x2 - x3)^2)/2", "lines"),
        (DOUBLE, "rods"),
        (TRIPLE, "rods"),
        (
            TRIPLE.replace("b'*c'*cos(b-c)", "b'*c'*cos(b-c)/2"),
            "lines",
        ),  # no chain has these masses
        (TWO_BODIES, "points"),
        (CART, "cart"),
        (TOP, "sphere"),
        (SPRUNG, "central"),
        ("(r'^2 + r^2*a'^2 + r^2*sin(a)^2*b'^2)/2 + 1/r", "space"),
        ("(theta'^2 + 2*sin(theta)^2*phi'^2)/2", "path"),  # an ellipsoid of revolution, or so
        ({"equations": "x'' = F(x)", "functions": {"F": ["x"]}}, ""),
    ],
)
def test_the_picture_is_that_of_what_is_known(document: Any, expected: str) -> None:
    assert kind(document) == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("document", "expected"),
    [
        ("x'' = x - c*x'", "times"),  # no spring pushes away
        ("x'' = -x'^2", "rulers"),
        ("x'' = -x + cos(t)", "history"),
        ("theta'' = -sin(theta)", "pendulum"),
        ("x'' = -tan(x)", "well"),  # no rod passes its walls
        ("x'' = -tanh(x)/cosh(x)^2", "well"),  # V' is sinh / cosh^3
        ("x'' = -x - sign(x')/5", "cases"),
        ("x'' = -x - abs(y); y'' = -y", "cases"),
        ("th'' = sin(th)*cos(th)*ph'^2; ph'' = -2*cos(th)*th'*ph'/sin(th)", "sphere"),
        (CART_OF_TWO, "cart"),
        (COUPLED, "path"),  # two angles, and no double pendulum
        ("x'' = y'; y'' = -x'; z'' = -1", "space"),
        (KNIFE, "knife-edge"),
        (catalogue.document("vertically-rolling-disk"), "disk"),
        (catalogue.document("nonholonomic-particle"), "space"),
        (
            catalogue.atlas()["tilting-disk"]["document"],
            "heading",
        ),  # that it is a disk is in no formula of its constraints
        ("x'' = F(x)*x'", ""),
    ],
)
def test_the_same_for_systems_that_take_longer(document: Any, expected: str) -> None:
    if expected == "" and isinstance(document, str):
        document = {"equations": document, "functions": {"F": ["x"]}}
    assert kind(document) == expected


@pytest.mark.slow
def test_a_center_is_drawn_where_equal_areas_are_proven() -> None:
    text = "x'' = -x/(x^2+y^2)^(3/2); y'' = -y/(x^2+y^2)^(3/2)"
    found = shown(text)
    assert found is not None
    assert (found.data["picture"], kind(text)) == ("central", "path")


BALL = (
    "x' - r*sin(phi)*theta' + r*cos(phi)*sin(theta)*psi'",
    "y' + r*cos(phi)*theta' + r*sin(phi)*sin(theta)*psi'",
)


def of_constraints(*texts: str) -> pictures.Picture:
    names = Names(("psi", "theta", "phi", "x", "y"), ("r",))
    trees = tuple(reader.read_formula(text, names) for text in texts)
    return pictures.picture_of(
        pictures.Facts(names, trees, ("theta", "phi"), values={"r": 1.0}, constraints=trees)
    )


def test_the_drawn_motion_of_an_oscillator_turns_evenly() -> None:
    """x'' = -x turns (x, x') by the same angle in each step; an error of the step is of order 5."""
    drawn = starts.drawn_motion(dict(solve("x'' = -x")))
    assert drawn is not None
    points, names = drawn
    assert names == ("x", "x\u2032")
    angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert np.ptp(np.hypot(*points.T)) < 1e-6
    assert np.diff(angles) == pytest.approx(-starts.STEP, abs=1e-8)


def test_a_ball_is_drawn_where_its_lowest_point_is_at_rest() -> None:
    """With R = Rz(phi) Rx(theta) Rz(psi), the velocity of the lowest point, x' + (R' R^-1)(0, 0, -r), is zero."""
    found = of_constraints(*BALL)
    assert found.kind == "ball"
    assert found.trees["angles"] == [2, 1, 0]
    assert of_constraints(BALL[0], BALL[1].replace("+ r*cos", "- r*cos")).kind != "ball"
    assert of_constraints(BALL[0].replace("+ r*cos", "- r*cos"), BALL[1]).kind != "ball"

    def turned(phi: float, theta: float, psi: float) -> Any:
        def about(axis: int, angle: float) -> Any:
            c, s = np.cos(angle), np.sin(angle)
            i, j = ((1, 2), (2, 0), (0, 1))[axis]
            matrix = np.eye(3)
            matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
            return matrix

        return about(2, phi) @ about(0, theta) @ about(2, psi)

    angles, rates, r, d = np.array([0.4, 1.1, -0.7]), np.array([0.3, -0.8, 1.3]), 1.7, 1e-6
    (phi, theta, _), (_, fall, spin) = angles, rates
    slope = (turned(*(angles + d * rates)) - turned(*(angles - d * rates))) / (2 * d)
    lowest = slope @ turned(*angles).T @ np.array([0, 0, -r])
    right = r * np.sin(phi) * fall - r * np.cos(phi) * np.sin(theta) * spin
    up = -r * np.cos(phi) * fall - r * np.sin(phi) * np.sin(theta) * spin
    assert np.abs(np.array([right, up, 0]) + lowest).max() < 1e-8


def test_a_computed_motion_in_round_coordinates_is_drawn_as_such() -> None:
    """A run has numbers alone, so its picture knows places and forms, and no formula."""
    system = {
        "coordinates": ["r", "a", "b"],
        "parameters": [],
        "constraints": [],
        "equations": None,
    }
    lagrangian = "(r'^2 + r^2*a'^2 + r^2*sin(a)^2*b'^2)/2 + 1/r"
    found = preview.picture_of_texts({**system, "lagrangian": lagrangian})
    assert found == {"picture": "space", "known": {"places": {"list": [0, 1, 2]}, "form": "pole"}}
    found = preview.picture_of_texts(
        {**system, "coordinates": ["a", "b"], "lagrangian": "(a'^2 + sin(a)^2*b'^2)/2 + cos(a)"}
    )
    assert found["picture"] == "sphere"
    assert found["known"]["angles"] == {"list": [0, 1]}


def test_where_the_angles_of_a_sphere_begin_is_said() -> None:
    """A pendulum hangs from the lower pole, a top stands at the upper one."""
    for text, words in (
        ("(a'^2 + sin(a)^2*b'^2)/2 + cos(a)", "a from the lower pole"),
        ("(a'^2 + cos(a)^2*b'^2)/2", "a from the equator"),
        (TOP, "ps, its own turn, is not drawn"),
        (SPRUNG, "phi from below"),
    ):
        found = shown(text)
        assert found is not None
        assert words in printed_pages.plain_text(found.caption)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("(x'^2+y'^2)/(2*y^2)", "the path is a geodesic"),  # a half circle about a point of y = 0
        ("(x'^2 - y'^2)/2 - x*y", "both signs: its energy does not bound the path"),
        ("x'*y' - x*y^2", "both signs: its energy does not bound the path"),
        ("m*(x'^2 - y'^2)/2 - x*y", "The path of (x, y)."),
        ("x'^2*(1+y^2)/2 + y'^2/2 - x^4 - y", "The path of (x, y)."),
        ("(x'^2+y'^2+z'^2)*(1+x^2)", "the path is a geodesic"),
        (  # forced by its constraint, it is none
            {"lagrangian": "(x'^2+y'^2+z'^2)/2", "constraints": ["z' - y*x'"]},
            "down to the plane of x and y.",
        ),
    ],
)
def test_a_path_says_what_the_kinetic_energy_makes_of_it(text: Any, said: str) -> None:
    found = shown(text)
    assert found is not None
    assert printed_pages.plain_text(found.caption).endswith(said.removesuffix(".") + ".")


def of_formulas(names: Names, lagrangian: str, *accelerations: str, integral: str = "") -> Any:
    trees = tuple(reader.read_formula(text, names) for text in accelerations)
    kept = (("", integral, reader.read_formula(integral, names)),) if integral else ()
    read = reader.read_formula(lagrangian, names)
    return pictures.picture_of(
        pictures.Facts(
            names,
            trees,
            values=dict.fromkeys(names.parameters, 1.0),
            lagrangian=read,
            integrals=kept,
        )
    )


def test_free_motion_by_another_ruler_is_drawn_with_both() -> None:
    """L = exp(2 x) x'^2/2 has x'' = -x'^2: (e^x)'' = 0. A potential is no such motion."""
    found = of_formulas(Names(("x",)), "exp(2*x)*x'^2/2", "-x'^2")
    assert found.kind == "rulers"
    assert "exp(x)*x' is constant" in printed_pages.plain_text(found.caption)
    other = of_formulas(Names(("x",)), "exp(2*x)*x'^2/2 - x", "-x'^2 - exp(-2*x)")
    assert other.kind == "times"


@pytest.mark.parametrize(
    ("coordinates", "lagrangian", "expected"),
    [
        (("w", "z"), "(w'^2*(1 + 4*w^2) + w^2*z'^2)/2 - g*w^2", [0, 1]),  # in a paraboloid
        (("w", "z"), "w'^2 + w^2*z'^2/2 + g*w*cos(z) - 2*g*w", [0, 1]),  # Atwood's, one swings
        (("z", "w"), "(w'^2 + w^2*z'^2)/2 + g/w", [1, 0]),
        (("w", "z"), "(w'^2 + w*z'^2)/2", None),
        (("w", "z"), "((1 + z^2)*w'^2 + w^2*z'^2)/2", None),
    ],
)
def test_a_radius_is_what_the_kinetic_energy_makes_one(
    coordinates: tuple[str, ...], lagrangian: str, expected: list[int] | None
) -> None:
    found = of_formulas(Names(coordinates, ("g",)), lagrangian)
    assert found.trees.get("round") == expected


def test_the_arrow_to_the_nearest_point_is_that_of_the_force_alone_that_keeps_it() -> None:
    names, swept = Names(("r", "p"), ("k",)), "r^2*p'"
    turn = "-2*r'*p'/r"
    kepler = of_formulas(names, "(r'^2 + r^2*p'^2)/2 + k/r", "r*p'^2 - k/r^2", turn, integral=swept)
    assert kepler.trees["pull"] == reader.read_formula("k", names)
    other = of_formulas(
        names, "(r'^2 + r^2*p'^2)/2 - k*r^2/2", "r*p'^2 - k*r", turn, integral=swept
    )
    assert "swept" in other.trees
    assert "pull" not in other.trees


def test_bodies_are_known_by_their_constraints_whatever_they_are_called() -> None:
    """A disk at (u, w) with the heading p that has rolled by s; a blade on a slope."""
    names = Names(("u", "w", "p", "s"), ("R", "c"))

    def facts(texts: list[str], lagrangian: str, rates: dict[str, str]) -> pictures.Facts:
        return pictures.Facts(
            names, (), ("p", "s"), values={"R": 1.0, "c": 1.0}, lagrangian=reader.read_formula(lagrangian, names),
            constraints=tuple(reader.read_formula(text, names) for text in texts),
            velocities={name: reader.read_formula(text, names) for name, text in rates.items()},
        )  # fmt: skip

    kinetic = "(u'^2 + w'^2 + p'^2 + s'^2)/2"
    disk = pictures.picture_of(facts(["u' - R*cos(p)*s'", "w' - R*sin(p)*s'"], kinetic, {}))
    assert (disk.kind, disk.trees["plane"], disk.trees["rolled"]) == ("disk", [0, 1], 3)
    blade = pictures.picture_of(facts(["u'*sin(p) - w'*cos(p)"], f"{kinetic} + 3*u", {}))
    assert blade.trees["down"] == [ex.number(3), ex.ZERO]
    assert blade.trees["plane"] == [0, 1]


def test_the_tracks_of_two_wheels_are_as_far_apart_as_their_constraints_say() -> None:
    """Wheels of radius R at the ends of an axle 2 c: v = R (a' + b')/2, p' = R (a' - b')/(2 c)."""
    names = Names(("u", "w", "p", "a", "b"), ("R", "c"))
    rates = {"u": "R/2*cos(p)*(a' + b')", "w": "R/2*sin(p)*(a' + b')", "p": "R/(2*c)*(a' - b')"}
    facts = pictures.Facts(
        names, (), ("a", "b"), values={"R": 1.0, "c": 1.0},
        lagrangian=reader.read_formula("(u'^2 + w'^2 + p'^2 + a'^2 + b'^2)/2", names),
        constraints=tuple(reader.read_formula(f"{q}' - {rate}", names) for q, rate in rates.items()),
        velocities={q: reader.read_formula(rate, names) for q, rate in rates.items()},
    )  # fmt: skip
    found = pictures.picture_of(facts)
    assert (found.kind, found.trees["heading"], found.trees["rolled"]) == ("carriage", 2, 3)
    assert found.trees["half"] == ex.Symbol("c")


@pytest.mark.parametrize(
    ("constraint", "offset"),
    [
        ("x'*sin(p) - y'*cos(p) - a*p'", 0.7),
        ("m*(x'*sin(p) - y'*cos(p)) + m*a*p'", -0.7),
        ("cos(p)*y' - sin(p)*x' - 2*p'/3", -2 / 3),
    ],
)
def test_the_blade_of_a_sleigh_is_drawn_where_it_does_not_move_sideways(
    constraint: str, offset: float
) -> None:
    """d/dt (x + s cos(p), y + s sin(p)) is along (cos(p), sin(p)) for each velocity that the constraint allows."""
    names = Names(("x", "y", "p"), ("a", "m"))
    tree = reader.read_formula(constraint, names)
    found = pictures.picture_of(
        pictures.Facts(names, (), ("p",), values={"a": 0.7, "m": 2.0}, constraints=(tree,))
    )
    assert (found.kind, found.trees["heading"], found.trees["plane"]) == ("sleigh", 2, [0, 1])
    values = {ex.Symbol("a"): mpmath.mpf("0.7"), ex.Symbol("m"): mpmath.mpf(2)}
    s = calculus.evaluate(found.trees["offset"], values)
    assert s == pytest.approx(offset)
    p, turn, along = 0.4, 1.3, 0.9
    x, y = (
        along * np.cos(p) + float(s) * turn * np.sin(p),
        along * np.sin(p) - float(s) * turn * np.cos(p),
    )
    state = {"x": x, "y": y, "p": turn}
    values |= {ex.Velocity(name): mpmath.mpf(float(one)) for name, one in state.items()}
    assert abs(calculus.evaluate(tree, values | {ex.Symbol("p"): mpmath.mpf(p)})) < 1e-12


@pytest.mark.parametrize(
    "constraint",
    [
        "x'*sin(p) - y'*cos(p) - x*p'",
        "x'*sin(p) + y'*cos(p) - p'",
        "x'*sin(p) - y'*cos(p) - p' - 1",
    ],
)
def test_what_is_no_blade_is_not_drawn_as_one(constraint: str) -> None:
    names = Names(("x", "y", "p"))
    tree = reader.read_formula(constraint, names)
    facts = pictures.Facts(names, (), ("p",), constraints=(tree,))
    assert pictures.picture_of(facts).kind == "path"


def test_long_chains_are_drawn_side_by_side() -> None:
    def of(names: tuple[str, ...]) -> str:
        facts = pictures.Facts(
            Names(names), tuple(reader.read_formula("0", Names(names)) for _ in names)
        )
        return pictures.picture_of(facts).kind

    assert of(tuple(f"x{k}" for k in range(1, 13))) == "profile"
    assert of(tuple(f"x{k}" for k in (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 1, 12))) == "profile"
    assert of(tuple(f"x{k}" for k in (*range(1, 12), 13))) == "history"
    assert of(tuple(f"q_{k}" for k in range(12))) == "profile"
    assert of(tuple("abcdefghijkl")) == "history"
    assert of(tuple(f"x{k}" for k in range(1, 9))) == "lines"


def test_the_potential_that_is_drawn_is_that_of_the_force() -> None:
    """m f = -dV/dx for x'' = x - x^3: V = x^4/4 - x^2/2, up to the order of its terms."""
    found = shown("x'' = x - x^3")
    assert found is not None

    def value(tree: Any, x: float) -> float:
        if isinstance(tree, float | int):
            return float(tree)
        if tree == "x":
            return x
        first, *parts = tree
        numbers = [value(part, x) for part in parts]
        if first == "+":
            return sum(numbers)
        if first == "^":
            return float(numbers[0] ** numbers[1])
        assert first == "*"
        product = 1.0
        for number in numbers:
            product *= number
        return product

    for x in (-1.3, 0.4, 2.0):
        assert value(found.data["known"]["potential"], x) == pytest.approx(x**4 / 4 - x**2 / 2)


def test_a_force_besides_the_potential_is_not_drawn_as_a_well() -> None:
    """L = x'^2/2 - x^2/2 is not what x'' = -x - x' has, so no point rolls as high as its energy."""
    found = shown("x'' = -x - x'")
    assert found is not None
    assert "potential" not in found.data["known"]
    assert (
        "changes by the factor exp(-t), which exp(t) in L makes up for"
        in printed_pages.plain_text(found.caption)
    )


@pytest.mark.parametrize("document", ["x'' = x - x^3", KEPLER])
def test_an_exercise_shows_nothing_of_its_answer(document: str) -> None:
    found = shown(document, reveals=False)
    assert found is not None
    assert found.meters == ()
    assert found.data["meters"] == []
    assert not {"potential", "mass", "swept", "pull"} & set(found.data["known"])


def test_conditions_without_a_value_are_not_drawn() -> None:
    """x'' = log(-1 - x^2) y' has no real value anywhere, so nothing is said of three lines."""
    names = Names(("x", "y"))
    nowhere = reader.read_formula("log(-1 - x^2)*y'", names)
    tensor = ((nowhere, nowhere), (nowhere, nowhere))
    facts = pictures.Facts(names, (nowhere, nowhere), tensors=(tensor, tensor))
    assert pictures.picture_of(facts).kind == "path"


@pytest.mark.parametrize(
    ("equations", "lagrangian"),
    [
        (("r*phi'^2 - 1/r^2", "-2*r'*phi'/r"), "(r'^2 + r^2*phi'^2)/2 + 1/r"),
        (("-x - c*x' + y", "-2*y - c*y' + x"), "exp(c*t)*(x'^2 + y'^2 - x^2 - 2*y^2 + 2*x*y)/2"),
        (("t*y - x", "t*x - 2*y"), "(x'^2 + y'^2 - x^2 - 2*y^2 + 2*t*x*y)/2"),
    ],
)
def test_each_condition_on_g_passes_through_that_of_the_lagrangian(
    equations: tuple[str, str], lagrangian: str
) -> None:
    """Phi_12 g_11 + (Phi_22 - Phi_11) g_12 - Phi_21 g_22 = 0, and so for the derivatives of Phi (Douglas, 1941)."""
    names = Names(("r", "phi") if "phi" in lagrangian else ("x", "y"), ("c",))
    forces = tuple(reader.read_formula(text, names) for text in equations)
    found_of = conditions.conditions(SecondOrderSystem(names.coordinates, forces, ("c",)))
    assert found_of.Phi is not None
    assert found_of.nabla_Phi is not None
    tensors = (found_of.Phi, found_of.nabla_Phi)
    read = reader.read_formula(lagrangian, names)
    facts = pictures.Facts(names, forces, values={"c": 0.7}, lagrangian=read, tensors=tensors)
    found = pictures.agreement_of(facts)
    assert found is not None
    leaves = (*map(ex.Symbol, (*names.coordinates, "t")), *map(ex.Velocity, names.coordinates))
    point = {leaf: mpmath.mpf(7 + 3 * k) / 11 for k, leaf in enumerate(leaves)}
    g = [facts.value(part, point) for part in found.trees["g"]]
    for row in found.trees["rows"]:
        parts = [facts.value(part, point) * value for part, value in zip(row, g, strict=True)]
        assert abs(sum(parts)) < 1e-12
    assert pictures.agreement_of(replace(facts, lagrangian=None)) is None


def test_a_meter_says_of_what_it_is() -> None:
    """Two damped oscillators conserve quantities of long formulas, whose names say nothing; a
    number of them says nothing either.
    """
    found = shown("x'' = -x - x'; y'' = -y - 2*y'")
    assert found is not None
    assert found.meters == ()
    told = shown("x'' = -x")
    assert told is not None
    assert [name for name, _ in told.meters] == ["energy"]
    assert len(told.data["meters"]) == 1


def test_a_mass_that_depends_on_the_place_has_its_potential_where_it_turns_back() -> None:
    """(1 + x^2) x'^2/2 - x^2/2, a bead on a turning parabola; with drag besides, E is not its energy."""
    names, bead = Names(("x",)), "(1 + x^2)*x'^2/2 - x^2/2"
    found = of_formulas(names, bead, "-(x*x'^2 + x)/(1 + x^2)")
    assert found.kind == "well"
    assert found.trees["mass"] == reader.read_formula("1 + x^2", names)
    assert of_formulas(names, bead, "-(x*x'^2 + x)/(1 + x^2) - x'").kind == "times"
    ruler = of_formulas(names, "exp(2*x)*x'^2/2", "-x'^2 - x'")
    assert ruler.kind == "times"


def test_a_charge_has_a_meter_of_what_the_field_changes() -> None:
    found = shown("x'' = (1+x/2)*y'; y'' = -(1+x/2)*x'")
    assert found is not None
    assert found.meters[0][0] == "energy"
    assert found.meters[-1][0] == "not kept"
    assert found.data["meters"][-1] == "y'"
    assert len(found.data["meters"]) == len(found.meters)


@pytest.mark.slow
def test_the_energy_of_a_motion_on_constraints_has_a_meter() -> None:
    found = shown(KNIFE)
    assert found is not None
    assert found.meters[0][0] == "energy"


@pytest.mark.parametrize(
    ("document", "name"),
    [
        ("x'' = -x - x'", ""),  # its formula is too long for a meter
        ("y'' = 1 - y'^2", "conserved"),  # exp(2 y) (y'^2 - 1)/2, of a fall with drag
        ("x'' = x - x^3", "energy"),
    ],
)
def test_what_a_damped_oscillator_conserves_is_not_called_energy(document: str, name: str) -> None:
    found = shown(document)
    assert found is not None
    assert [one for one, _ in found.meters][:1] == ([name] if name else [])


def test_multipliers_move_a_picture_only_where_the_accelerations_satisfy_them() -> None:
    names = Names(("x", "y", "a"))
    constraint = reader.read_formula("x'*sin(a) - y'*cos(a)", names)
    moves = ["-tan(a)*x'*a' - g*sin(a)*cos(a)", "x'*a' - g*sin(a)^2", "0"]
    lagrangian = reader.read_formula("(x'^2 + y'^2 + a'^2)/2 - y", names)

    def found(
        gravity: str, constraints: tuple[ex.Expression, ...] = (constraint,)
    ) -> dict[str, Any]:
        forces = (reader.read_formula(text.replace("g", gravity), names) for text in moves)
        return preview.multiplied(
            pictures.Facts(names, tuple(forces), lagrangian=lagrangian, constraints=constraints)
        )

    assert found("1")
    assert not found("2")  # a force besides L
    assert not found("1", ())
    assert not found("1", (constraint, constraint))  # they do not determine the multipliers


def value_of(formula: Any, numbers: dict[str, float]) -> float:
    """The number of a formula as the page gets it: operator first."""
    if isinstance(formula, list):
        first, *parts = [value_of(part, numbers) for part in formula[1:]]
        for part in parts:
            first = first * part if formula[0] == "*" else first**part
        return first
    return numbers[formula] if isinstance(formula, str) else float(formula)


@pytest.mark.parametrize(("text", "ratio"), [(DOUBLE, ("l1", "l2")), (CART, ("l", ""))])
def test_the_rods_of_a_picture_are_as_long_as_those_of_the_lagrangian(
    text: str, ratio: tuple[str, str]
) -> None:
    numbers = {"l1": 2.0, "l2": 3.0, "m1": 5.0, "m2": 7.0, "m": 11.0, "M": 13.0, "l": 17.0}
    found = shown(text)
    assert found is not None
    lengths = [value_of(one, numbers) for one in found.data["known"]["lengths"]["list"]]
    assert lengths[0] / [*lengths, 1.0][1] == pytest.approx(
        numbers[ratio[0]] / numbers.get(ratio[1], 1.0)
    )


@pytest.mark.parametrize(("first", "second"), [(1, 3), (5, 2), (2, 2)])
def test_the_masses_of_a_path_are_those_along_its_axes(first: int, second: int) -> None:
    lagrangian = f"({first}*x'^2 + {second}*y'^2)/2 - x^4 - y^4 - x*y"
    forces = (f"-(4*x^3 + y)/{first}", f"-(4*y^3 + x)/{second}")
    found = of_formulas(Names(("x", "y")), lagrangian, *forces)
    assert found.kind == "path"
    assert found.trees["mass"] == {"first": ex.number(first), "second": ex.number(second)}


def test_the_axis_of_another_time_has_its_letter() -> None:
    """xi of theta'' + (2/xi) theta' = -theta is a Greek letter in the caption and on the axis."""
    result = solve(
        {"equations": "theta'' + 2/xi*theta' + theta = 0", "time": "xi", "first_integrals": False}
    )
    found = preview.motion_of_result(result)
    assert found is not None
    assert found.data["labels"] == {"theta": "θ", "xi": "ξ"}

"""As many functions R(q) as there are free velocities whose motion is a system R'' = G(R, R') of its
own, and what a Lagrangian of that system becomes for the whole motion.
"""

from __future__ import annotations

import pytest
from mpmath import mp, mpf

from inverse_service.constrained import lagrangian as on_constraints
from inverse_service.deadline import now
from inverse_service.decision.solutions import Lagrangian
from inverse_service.expressions import calculus, tree as ex
from inverse_service.mechanics.second_order_system import ConstrainedMotion, read_system
from inverse_service.reading import names as nm, reader
from inverse_service.statements.domains import Domain

COORDINATES = ("x", "y", "z")
NAMES = nm.Names(COORDINATES, ())


def motion(*, x: str, y: str, z: str) -> ConstrainedMotion:
    """x'' and y'' of the free coordinates, and the velocity of z."""
    read = [reader.read_formula(text, NAMES) for text in (x, y, z)]
    return ConstrainedMotion(COORDINATES, ("x", "y"), ("z",), (read[2],), (read[0], read[1]))


@pytest.mark.parametrize(
    "whole",
    [
        motion(x="-x", y="-y", z="x*y'"),
        motion(x="-z", y="-x", z="x'"),
        motion(x="-x", y="z", z="y'"),
        motion(x="-x*y", y="z*x", z="x'"),
        motion(x="-(x + z)", y="y + x", z="x' + y'"),
        motion(x="x'*y'", y="z*y'", z="-x*y'"),
    ],
    ids=lambda one: str(one.free_accelerations),
)
def test_closed_equations_are_those_of_the_motion(whole: ConstrainedMotion) -> None:
    """R'' along the motion is G(R, R') at points of the constraints."""
    closed = [
        *on_constraints.closed_coordinates(whole),
        *on_constraints.closed_functions(whole, now() + 30),
    ]
    point = {
        key: mpf(17 + 5 * k) / 13
        for k, key in enumerate([*map(ex.Symbol, COORDINATES), *map(ex.Velocity, whole.free)])
    }
    with mp.workdps(30):
        for one in closed:
            table = dict[ex.Expression, calculus.Real]()
            for name, tree in one.functions.items():
                table[ex.Symbol(name)] = calculus.evaluate(tree, point)
                table[ex.Velocity(name)] = calculus.evaluate(whole.rate(tree), point)
            for name, force in zip(one.system.coordinates, one.system.accelerations, strict=True):
                bend = calculus.evaluate(whole.rate(whole.rate(one.functions[name])), point)
                assert abs(calculus.evaluate(force, table) - bend) < mpf(10) ** -20


def test_the_domain_of_a_lagrangian_in_functions_is_one_in_coordinates() -> None:
    whole = motion(x="0", y="0", z="x*y'")
    product = reader.read_formula("x*y - z", NAMES)
    closed = on_constraints.ClosedFunctions(
        read_system(["x", "R"], {"x": "0", "R": "0"}, ()), {"x": ex.Symbol("x"), "R": product}
    )
    own = nm.Names(("x", "R"), ())
    tree = reader.read_formula("log(R)*x'^2 + R'^2/x", own)
    domain = Domain(positive=(ex.Symbol("R"),), nonzero=(ex.Symbol("x"),))
    found = on_constraints.on_whole_motion(whole, closed, Lagrangian(tree, (), "", domain=domain))
    assert found.domain == Domain(positive=(product,), nonzero=(ex.Symbol("x"),))

"""What is found of motions with constraints holds at points on the constraints: the equations of
Lagrange and d'Alembert, associated systems and their Lagrangians, the volume that is kept.
"""

from __future__ import annotations

import itertools
import random
from functools import cache
from types import SimpleNamespace
from typing import Any, get_args

import pytest
from mpmath import mp, mpf

from inverse_service.constrained import nonholonomic_study
from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.mechanics import (
    constrained_motion,
    euler_lagrange,
    nonholonomic_integrals,
    paper_class,
)
from inverse_service.reading.declarations import Declared
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.documents import parse_document

DIGITS, ROUND_OFF = 40, mpf(10) ** -25
WHOLE = {
    "masses that change": ("(1 + y^2)*x'^2/2 + m*y'^2/2 + z'^2/2 + x'*z'/4 + a*y*x' - x^2*y - cos(z)",
                          ["z' - x*y' - sin(y)*x'"]),
    "a moving constraint": ("x'^2/2 + y'^2 + exp(x)*z'^2/2 - a*z*x", ["z' - (x + t)*y' - a*t"]),
    "two constraints": ("(x'^2 + y'^2 + m*z'^2 + 2*w'^2)/2 + y*z'/3 - x*w", ["z' - x*y'", "w' + sin(x)*y' - x' - 1/2"]),
    "a sleigh": ("m*(x'^2 + y'^2)/2 + z'^2/2 + y'*z'/3 - a*x", ["x'*sin(z) - y'*cos(z)"]),
    "a moving rail": ("(1 + t)*(x'^2 + y'^2)/2 + z'^2/2", ["z' - x*y' - a"]),
    "an offset": ("(x'^2 + y'^2 + z'^2 + w'^2)/2", ["z' + x*y'", "w' + sin(x)*y' - 1/2"]),
}  # fmt: skip
# s' = -A(r_1) r_2', constant masses.
OF_THE_CLASS = {
    "one": ("(2*x'^2 + m*y'^2 + 3*z'^2)/2", ["z' + x*y'"]),
    "two": ("(x'^2 + m*y'^2 + 3*z'^2 + 2*w'^2)/2", ["z' + cos(x)*y'", "w' - sin(x)*y'"]),
    "a turning plane": ("(x'^2 + 2*y'^2 + 3*z'^2 + m*w'^2)/2", ["z' + x*y'", "w' + x*y'/2"]),
    "a disk": ("(x'^2 + m*y'^2 + 3*z'^2 + 3*w'^2)/2", ["z' - cos(x)*y'", "w' - sin(x)*y'"]),
    "two masses": ("x'^2/2 + y'^2 + 5*z'^2/2 + m*w'^2/2", ["z' - cos(x)*y'", "w' - 2*sin(x)*y'"]),
}  # fmt: skip
ALL = WHOLE | OF_THE_CLASS
Point = dict[ex.Expression, mpf]


@cache
def motion(name: str) -> constrained_motion.EliminatedMotion:
    lagrangian, constraints = ALL[name]
    names = ["x", "y", "z", "w"][: 2 + len(constraints)]
    given = Declared(coordinates=names, parameters=["m", "a"])
    return constrained_motion.eliminated(
        constrained_motion.read_nonholonomic(given, lagrangian, constraints)
    )


def points(found: constrained_motion.EliminatedMotion, count: int = 2) -> list[Point]:
    """Places with free velocities, and the dependent ones that follow."""
    names, source = found.geometry.system.coordinates, random.Random(7)
    made = []
    for _ in range(count):
        leaves = [ex.TIME, *map(ex.Symbol, (*names, "m", "a"))]
        point: Point = {leaf: mpf(source.uniform(0.3, 1.4)) for leaf in leaves}
        for k in found.frame.free:
            point[ex.Velocity(names[k])] = mpf(source.uniform(-2, 2))
        values = [value(found.geometry.tree(one), point) for one in found.velocities]
        made.append(point | dict(zip(map(ex.Velocity, names), values, strict=True)))
    return made


def value(tree: ex.Expression, point: Point) -> mpf:
    return calculus.evaluate(tree, dict(point))


def near(one: Any, other: Any = 0) -> bool:
    return bool(abs(one - other) < ROUND_OFF * (1 + abs(other)))


@pytest.mark.parametrize("name", ALL)
def test_a_motion_obeys_lagrange_and_dalembert(name: str) -> None:
    """The constraints hold and keep holding, M q'' = f + sum lambda w, and G = B^T M B."""
    found = motion(name)
    parts, names = found.geometry, found.geometry.system.coordinates
    accelerations = [parts.tree(one) for one in found.accelerations]
    constraints = parts.system.constraints
    rates: list[tuple[ex.Expression, ex.Expression]] = [
        *zip(map(ex.Symbol, names), map(ex.Velocity, names), strict=True),
        *zip(map(ex.Velocity, names), accelerations, strict=True),
    ]
    sums = euler_lagrange.euler_lagrange_sums(parts.system.lagrangian, names, accelerations)
    slopes = [euler_lagrange.gradient(one, map(ex.Velocity, names)) for one in constraints]
    masses = euler_lagrange.hessian(parts.system.lagrangian, names)
    with mp.workdps(DIGITS):
        for point in points(found):
            for constraint in constraints:
                assert near(value(constraint, point))
                assert near(value(calculus.time_derivative(constraint, rates), point))
            pulls = [value(parts.tree(one), point) for one in found.multipliers]
            for k, own in enumerate(sums):
                force = mp.fdot(
                    pulls, [value(row.get(ex.Velocity(names[k]), ex.ZERO), point) for row in slopes]
                )
                assert near(value(own, point), force)
            basis = mp.matrix(
                [[value(parts.tree(one), point) for one in row] for row in found.frame.basis]
            )
            whole = mp.matrix([[value(entry, point) for entry in row] for row in masses])
            inertia = mp.matrix(
                [[value(parts.tree(one), point) for one in row] for row in found.inertia]
            )
            assert all(near(entry) for entry in basis.T * whole * basis - inertia)


@pytest.mark.parametrize("name", ALL)
def test_what_is_said_of_a_motion_holds_along_it(name: str) -> None:
    """div(N X) = 0 in positions and free velocities; scaled velocities, and the functions that the
    constraints keep, do not change.
    """
    found = motion(name)
    parts, names = found.geometry, found.geometry.system.coordinates
    free = [names[k] for k in found.frame.free]
    rates = [
        (ex.Symbol(one), parts.tree(v)) for one, v in zip(names, found.velocities, strict=True)
    ]
    rates += [
        (ex.Velocity(one), parts.tree(found.accelerations[k]))
        for one, k in zip(free, found.frame.free, strict=True)
    ]
    integrals = [one.expression for one in nonholonomic_integrals.scaled_velocities(found)]
    holonomic = nonholonomic_integrals.integrability(parts, found.frame)
    integrals += holonomic.integrals
    assert holonomic.integrable == (name == "a turning plane")  # z - 2 w
    assert holonomic.count == len(parts.system.constraints)
    for tree in integrals:
        with mp.workdps(DIGITS):
            assert all(
                near(value(calculus.time_derivative(tree, rates), point)) for point in points(found)
            )
    measure = nonholonomic_integrals.measure_density(found)
    if measure.velocities is None:
        assert measure.status != "found"
        return
    spread = ex.add(
        *(calculus.differentiate(measure.velocities * rate, leaf) for leaf, rate in rates)
    )
    spread += calculus.differentiate(measure.velocities, ex.TIME)
    assert measure.momenta is not None
    with mp.workdps(DIGITS):
        for point in points(found):
            assert near(value(spread, point))
            # N det G, up to a constant factor: moved in q alone, both change by the same ratio.
            moved = point | {ex.Symbol(one): point[ex.Symbol(one)] + mpf(1) / 7 for one in names}
            ratios = []
            for place in (point, moved):
                rows = [[value(parts.tree(one), place) for one in row] for row in found.inertia]
                both = (value(one, place) for one in (measure.velocities, measure.momenta))
                ratios.append(mp.fdiv(*both) / mp.det(mp.matrix(rows)))
            assert near(*ratios)


@pytest.mark.parametrize("kind", get_args(paper_class.Kind))
@pytest.mark.parametrize("name", ALL)
def test_associated_systems_have_the_motion_and_their_lagrangians(name: str, kind: Any) -> None:
    """On the constraints f is the motion's; each L has these equations, is regular, and the images
    of the constraints are zero at momenta of velocities that satisfy them.
    """
    found = motion(name)
    seen = paper_class.recognized(found.geometry)
    assert (seen.found is not None) == (name in OF_THE_CLASS)
    made = paper_class.associated(found, seen.found, seen.reason, kind)
    if made.system is None:
        assert kind == "second" or name in WHOLE
        return
    names = found.geometry.system.coordinates
    accelerations = [found.geometry.tree(one) for one in found.accelerations]
    with mp.workdps(DIGITS):
        for point in points(found):
            for own, true in zip(made.system.accelerations, accelerations, strict=True):
                assert near(value(own, point), value(true, point))
        for one in paper_class.propose_lagrangians(seen.found, kind) if seen.found else ():
            tree = one.transform.lagrangian
            sums = euler_lagrange.euler_lagrange_sums(tree, names, made.system.accelerations)
            masses = euler_lagrange.hessian(tree, names)
            for point in points(found):
                extra = set(ex.walk(tree)) - set(point)
                known = point | {leaf: mpf(3) / 4 for leaf in extra if isinstance(leaf, ex.Symbol)}
                away = known | {
                    ex.Velocity(last): known[ex.Velocity(last)] + 1 for last in names[2:]
                }
                try:
                    assert all(near(value(own, away)) for own in sums)
                    table = mp.matrix([[value(entry, away) for entry in row] for row in masses])
                except calculus.NoRealValue:
                    continue
                assert not near(mp.det(table))
                momenta = [value(p, known) for p in one.transform.momenta]
                placed = known | dict(zip(one.transform.symbols, momenta, strict=True))
                assert all(near(value(image, placed)) for image in one.images)
                moved = placed | {one.transform.symbols[-1]: momenta[-1] + 1}
                assert not all(near(value(image, moved)) for image in one.images)
                if one.transform.velocities is not None and not one.transform.conditions:
                    for velocity, name_of in zip(one.transform.velocities, names, strict=True):
                        assert near(value(velocity, placed), known[ex.Velocity(name_of)])


def test_functions_that_moving_constraints_keep_are_found() -> None:
    """z - x y - t, of z' = y x' + x y' + 1, and no other."""
    given = Declared(coordinates=["x", "y", "z", "w"], parameters=["m", "a"])
    texts = ["z' - y*x' - x*y' - 1", "w' - x*y' - t*x'"]
    found = constrained_motion.eliminated(
        constrained_motion.read_nonholonomic(given, "(x'^2 + y'^2 + z'^2 + w'^2)/2", texts)
    )
    seen = nonholonomic_integrals.integrability(found.geometry, found.frame)
    assert (seen.count, seen.integrable, len(seen.integrals)) == (2, 1, 1)
    rates = [
        (ex.Symbol(name), found.geometry.tree(one))
        for name, one in zip(found.geometry.system.coordinates, found.velocities, strict=True)
    ]
    with mp.workdps(DIGITS):
        for point in points(found):
            assert near(value(calculus.time_derivative(seen.integrals[0], rates), point))


@pytest.mark.parametrize("order", list(itertools.permutations(range(4))))
def test_of_associated_systems_one_with_a_lagrangian_is_shown(order: tuple[int, ...]) -> None:
    """Then one that has some, then a no, then what is not defined; of equals the first."""
    some, none = SimpleNamespace(verdict="variational"), SimpleNamespace(verdict="not_variational")
    kinds = [
        SimpleNamespace(answer=SimpleNamespace(**vars(some), lagrangian="L")),
        SimpleNamespace(answer=SimpleNamespace(**vars(some), lagrangian=None)),
        SimpleNamespace(answer=SimpleNamespace(**vars(none), lagrangian=None)),
        SimpleNamespace(answer=None),
    ]
    for least in range(4):
        answers: Any = [kinds[k] for k in order if k >= least]
        assert answers[nonholonomic_study._main(answers)] is kinds[least]
        assert nonholonomic_study._main([*answers, *answers]) == answers.index(kinds[least])


@pytest.mark.parametrize(
    "text", ["phi = z' - y*x' = 0", "z' - y*x' = 0", "z' = y*x'", "0 = z' - y*x'"]
)
def test_a_constraint_may_have_a_name(text: str) -> None:
    """No coordinate, constant, or definition is made of it."""
    found = parse_document({"equations": f"L = (x'^2 + y'^2 + z'^2)/2\n{text}"})
    assert found["coordinates"] == ["x", "y", "z"]
    assert found["parameters"] == []
    (constraint,) = found["constraints"]
    names = Names(("x", "y", "z"), ())
    given, wanted = (read_formula(one, names) for one in (constraint["text"], "z' - y*x'"))
    assert ex.ZERO in (collecting.collect(given - wanted), collecting.collect(given + wanted))

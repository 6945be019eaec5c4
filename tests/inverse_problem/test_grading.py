"""Scalings and reflections of a system, and the products of generators of one degree."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import mpmath
import pytest

from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.mechanics import grading
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system

# The numbers of independent scalings and reflections, by hand.
SYSTEMS = [
    ({"x": "-x", "y": "-y"}, 2, 3),  # x and y alone; t does not scale, but may be reversed
    ({"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"}, 1, 3),  # t^2 ~ r^3
    ({"x": "-sin(x)*y'", "y": "x'^2*cos(x)"}, 0, 1),  # x to -x alone
    ({"x": "exp(x)*y", "y": "0"}, 2, 1),  # exp(x) y ~ t^-2; t to -t
    ({"x": "a*x'*y'", "y": "b*x'^2"}, 3, 3),  # a ~ 1/y, b ~ y/x^2, and t
]


def read(equations: Mapping[str, str]) -> SecondOrderSystem:
    names = [name for name in ("a", "b") if any(name + "*" in text for text in equations.values())]
    return read_system(list(equations), equations, names)


def gradings(system: SecondOrderSystem) -> grading.Gradings:
    pairs = zip(system.coordinates, map(tm.terms_of, system.accelerations), strict=True)
    return grading.gradings_of(grading.second_order(*pair) for pair in pairs)


@pytest.mark.parametrize(("equations", "scalings", "reflections"), SYSTEMS)
def test_all_scalings_and_reflections_map_motions_to_motions(
    equations: dict[str, str], scalings: int, reflections: int
) -> None:
    system = read(equations)
    found = gradings(system)
    for table, factor, count in (
        (found.scalings, 2, scalings),
        (found.reflections, -1, reflections),
    ):
        assert len(table[ex.TIME]) == count
        for k in range(count):
            rate = table[ex.TIME][k]
            before: dict[ex.Expression, mpmath.mpf] = {}
            after: dict[ex.Expression, mpmath.mpf] = {}
            for place, name in enumerate((*system.coordinates, *system.parameters)):
                x, weight = ex.Symbol(name), table.get(ex.Symbol(name), (0,) * count)[k]
                shift = table.get(ex.Apply("exp", x), (0,) * count)[k] * mpmath.log(abs(factor))
                before[x] = mpmath.mpf(3 + place) / 7
                after[x] = before[x] * mpmath.mpf(factor) ** weight + shift
                before[ex.Velocity(name)] = mpmath.mpf(5 - place) / 11
                after[ex.Velocity(name)] = before[ex.Velocity(name)] * mpmath.mpf(factor) ** (
                    weight + rate
                )
            for name, f in zip(system.coordinates, system.accelerations, strict=True):
                whole = mpmath.mpf(factor) ** (table[ex.Symbol(name)][k] + 2 * rate)
                wanted = whole * calculus.evaluate(f, before)
                assert abs(calculus.evaluate(f, after) - wanted) < mpmath.mpf(10) ** -12


def test_products_of_one_degree_are_homogeneous_and_each_product_occurs_once() -> None:
    found = gradings(read({"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"}))
    x, y = ex.Symbol("x"), ex.Symbol("y")
    velocities = [
        grading.Block(tm.monomial(ex.Velocity(name)), range(3), "velocity", moves=True)
        for name in "xy"
    ]
    radius = grading.Block(tm.monomial(x**2 + y**2), [Fraction(k, 2) for k in range(-2, 2)])
    limits = {"velocity": 2}
    groups = list(grading.products_by_degree([*velocities, radius], found, limits, 1_000, 100))
    listed = [key for group in groups for key in group]
    assert len(listed) == len(set(listed)) > 0
    for group in groups:
        assert len({tuple(row) for row in found.degrees_of(group).tolist()}) == 1
    # L = (x'^2 + y'^2)/2 + 1/r is of one degree, and the products with a Hessian decide which
    # degrees are listed.
    kepler = {
        tm.monomial(ex.Velocity("x"), ex.Velocity("x")),
        frozenset([(x**2 + y**2, Fraction(-1, 2))]),
    }
    assert any(kepler <= set(group) for group in groups)


def test_degrees_of_trees_split_the_terms_of_integrals() -> None:
    system = read({"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"})
    x, y, v, w = ex.Symbol("x"), ex.Symbol("y"), ex.Velocity("x"), ex.Velocity("y")
    trees = [v, w, x, y, (x**2 + y**2) ** Fraction(-1, 2)]
    products = [[0, 0], [1, 1], [4], [0, 1], [2, 1], [3, 0], [2, 3, 4]]
    of = grading.Degrees(gradings(system)).of_products(trees, products).tolist()
    energy, angular = of[0], of[4]
    assert of[:3] == [energy] * 3
    assert of[5] == angular != energy
    assert energy not in (of[3], of[6])


def test_gradings_in_which_a_tree_is_not_homogeneous_do_not_count() -> None:
    x, y = ex.Symbol("x"), ex.Symbol("y")
    degrees = grading.Degrees(gradings(read({"x": "-x", "y": "-y"})))
    apart = degrees.of_products([x, y], [[0], [1]]).tolist()
    assert apart[0] != apart[1]
    together = degrees.of_products([x, y, x + y], [[0], [1], [2]]).tolist()
    assert together[0] == together[1] == together[2]


def test_a_constant_of_fixed_value_has_no_degree() -> None:
    system = read({"x": "-a*x^2", "y": "0"})
    equations = zip(system.coordinates, map(tm.terms_of, system.accelerations), strict=True)
    pairs = [grading.second_order(*pair) for pair in equations]
    a, free = ex.Symbol("a"), grading.gradings_of(pairs)
    held = grading.gradings_of(pairs, [a])
    assert any(free.scalings[a])
    assert not any(held.scalings[a])
    assert len(held.scalings[a]) == len(free.scalings[a]) - 1

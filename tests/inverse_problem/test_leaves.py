"""Leaves have exactly the members that satisfy the equations: tried one by one, for constants from
-2 to 2.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import pytest
from flint import fmpq

from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
from inverse_service.solving import closed_members, leaves

LETTERS = ("a", "b", "c")
EQUATIONS = [
    ["a*b"],  # two lines
    ["a*(b - c)", "b*(a + c)"],
    ["a*b - c"],
    ["a*b^2 + c*b + a"],  # initial a, discriminant c^2 - 4 a^2
    ["(a - c)*b^2 + c*b - 2*c"],
    ["a^2 + b^2"],  # real constants: both are 0
    ["a^2 + b^2*c^2 + 4*c^2"],
    ["a^2 + 2*a*b + 2*b^2"],  # discriminant -4 b^2: a = b = 0
    ["a^2 + a*b - 2*b^2"],  # discriminant 9 b^2: two lines, not the point
    ["a^2 - 3*a*b + b^2 + c"],
    ["a^2 - b^2 - c^2"],  # a cone in each direction
    ["b^2 - a^2 - c^2"],
    ["c^2 - a^2 - b^2"],
    ["a*b - c^2", "a^2 + b^2 - c^2 - 1"],  # a = c^2/b, but b = c = 0 leaves a = 1, -1
    ["a*b - c^2", "b^2 + c^2 - a^2 - 1"],
    ["a^3 - b^2"],  # a cusp, where the separants vanish
    ["a^2 - b*c", "b^2 - a*c"],
    ["a^2 + b^2 + 1"],  # empty
    ["a^2 + b^2 - c^2", "a*c - b"],
    ["a^2*b^2 - c^2*b", "a*b*c"],
    ["a*b - c", "b*c - a", "c*a - b"],  # 0 and (1, 1, 1), (1, -1, -1), ...: a basis splits it
    ["a^2 + b*c - 2", "b^2 + c*a - 2", "c^2 + a*b - 2"],
    ["a*b*c - a", "a^2 - b^2", "b*c^2 - b"],
]


@pytest.mark.parametrize("texts", EQUATIONS, ids=lambda texts: ", ".join(texts))
def test_the_members_of_the_leaves_are_those_of_the_equations(texts: list[str]) -> None:
    trees = [reader.read_formula(text, nm.Names((), LETTERS, {})) for text in texts]
    symbols = list(map(ex.Symbol, LETTERS))
    ring = exact_field.exact_ring([*symbols, *trees], [], None, exact_field.Budget())
    unknowns = leaves.Unknowns.of(ring, LETTERS, {})
    equations = [ring.value(tree).numerator for tree in trees]
    found = leaves.split_leaf(leaves.Leaf(unknowns), equations, float("inf"))
    places = {name: index for index, name in unknowns.letters.items()}
    for values in itertools.product(range(-2, 3), repeat=len(LETTERS)):
        point = [0] * len(equations[0].degrees())
        for name, value in zip(LETTERS, values, strict=True):
            point[places[name]] = value
        around = [
            leaf
            for leaf in found
            if not any(equation(*point) for equation in leaf.equations)
            and all(one(*point) for one in leaf.nonzero)
        ]
        assert bool(around) == (not any(equation(*point) for equation in equations)), values
        for rule in (rule for leaf in around for rule in leaf.rules):
            assert rule.initial(*point), values
            assert rule.equation.derivative(rule.leader)(*point), values


# Equations for F(x), and functions that satisfy them or not, singular solutions among them.
FUNCTIONS = [
    ["diff(F(x), x)^2 - 4*F(x)"],  # F = (x + c)^2, with the envelope F = 0
    ["F(x) - x*diff(F(x), x) - diff(F(x), x)^2"],  # Clairaut: c x + c^2, and -x^2/4
    ["diff(F(x), x)^3 - 27*F(x)^2"],  # (x + c)^3, and 0
    ["diff(F(x), x)*diff(diff(F(x), x), x)"],
    ["F(x)*diff(F(x), x) - a*F(x)"],
    ["a*diff(F(x), x) - F(x)^2 + F(x)*a^2"],
    ["diff(F(x), x, 2) - F(x)", "diff(F(x), x)*(diff(F(x), x, 2) - a*F(x) + a)"],
]
MEMBERS: list[tuple[Fraction | int, ...]] = [  # coefficients of 1, x, x^2, x^3
    *((0,), (1,), (4,), (0, 1), (0, 2), (0, -1), (1, 1), (4, 2), (4, -2), (Fraction(1, 4), 2)),
    *((0, 0, Fraction(-1, 4)), (9, 6, 1), (0, 0, 1), (1, 3, 3, 1), (0, 0, 0, 1), (2,)),
]
PLACES = [Fraction(k, 7) for k in range(3, 40)]  # more than the degree of any equation on a member


@pytest.mark.parametrize("texts", FUNCTIONS, ids=lambda texts: ", ".join(texts))
def test_the_functions_of_the_leaves_are_those_that_satisfy_the_equations(texts: list[str]) -> None:
    """Singular solutions, where the separant of an equation vanishes, have leaves of their own: a
    leaf is decided at a point where it does not.
    """
    names = nm.Names(("x",), ("a",), {"F": ("x",)})
    trees = [reader.read_formula(text, names) for text in texts]
    ring = exact_field.exact_ring(trees, [ex.Symbol("x")], 4, exact_field.Budget())
    unknowns = leaves.Unknowns.of(ring, ("a",), {"F": ("x",)})
    equations = [ring.value(tree).numerator for tree in trees]
    found = leaves.split_leaf(leaves.Leaf(unknowns), equations, float("inf"))
    on_some = 0
    for member, value in itertools.product(MEMBERS, (0, 1, 2)):
        points = [[0 * x for _ in equations[0].degrees()] for x in PLACES]
        for (index, tree), (point, x) in itertools.product(
            ring.trees.items(), zip(points, PLACES, strict=True)
        ):
            if isinstance(tree, ex.Arbitrary):
                point[index] = slope(member, tree.orders[0], x)
            else:
                point[index] = x if tree == ex.Symbol("x") else Fraction(value)

        def vanishes(one: Any, points: list[list[Fraction]] = points) -> bool:
            return not any(one(*[fmpq(x.numerator, x.denominator) for x in p]) for p in points)

        around = [
            leaf
            for leaf in found
            if all(map(vanishes, leaf.equations)) and not any(map(vanishes, leaf.nonzero))
        ]
        assert bool(around) == all(map(vanishes, equations)), (member, value)
        on_some += bool(around)
        for rule in (rule for leaf in around for rule in leaf.rules):
            assert not vanishes(rule.initial)
            assert not vanishes(rule.equation.derivative(rule.leader))
    for leaf in found:
        functional = [
            unknowns.jets[rule.leader] for rule in leaf.rules if rule.leader in unknowns.jets
        ]
        assert len({name for name, _ in functional}) == len(
            functional
        )  # of F(x), one is the lowest
    assert 0 < on_some < 3 * len(MEMBERS)


def slope(member: Sequence[Fraction | int], order: int, x: Fraction) -> Fraction:
    """The derivative of this order of a polynomial at x."""
    powers = enumerate(member[order:], start=order)
    return sum((c * math.perm(k, order) * x ** (k - order) for k, c in powers), Fraction(0))


GENERAL = [
    ["a^2 - b^2 - c^2"],  # a root that is no fraction
    ["a^2 - a*b - b^2"],  # a = (1 + sqrt(5)) b/2, of whatever sign b is
    ["a*b - c", "diff(F(x), x) - a*F(x)"],
    ["diff(F(x), x, 2) - a*diff(F(x), x)"],
    ["x*diff(F(x), x, 3) - diff(F(x), x, 2)"],
    ["diff(F(x), x, 3)"],
]


@pytest.mark.parametrize("texts", GENERAL, ids=lambda texts: ", ".join(texts))
def test_the_general_member_in_closed_form_satisfies_the_equations(texts: list[str]) -> None:
    names = nm.Names(("x",), LETTERS, {"F": ("x",)})
    trees = [reader.read_formula(text, names) for text in texts]
    symbols = list(map(ex.Symbol, LETTERS))
    ring = exact_field.exact_ring([*symbols, *trees], [ex.Symbol("x")], 4, exact_field.Budget())
    unknowns = leaves.Unknowns.of(ring, LETTERS, {"F": ("x",)})
    equations = [ring.value(tree).numerator for tree in trees]
    system = read_system(["x"], {"x": "a + b + c + F(x)"}, LETTERS, {"F": ["x"]})
    solved = 0
    for leaf in leaves.split_leaf(leaves.Leaf(unknowns), equations, float("inf")):
        member = closed_members.member_of(system, leaf)
        left = trees
        for one in member.solved if member else ():
            left = [
                closed_members.put_function(tree, one)
                if isinstance(one.left, ex.Arbitrary)
                else ex.substitute(tree, {one.left: one.right})
                for tree in left
            ]
            solved += 1
        if member is not None:
            nodes = [node for one in member.solved for node in ex.walk(one.right)]
            roots = [
                one
                for one in nodes
                if isinstance(one, ex.Power) and one.base == ex.Symbol("b") ** 2
            ]
            assert not roots  # sqrt(b^2)
            assert real_branch.vanish(left, [ex.Symbol("x"), *map(ex.Symbol, letters_of(member))])
    assert solved


def test_a_function_is_not_solved_for_by_what_depends_on_more() -> None:
    """F_uu(x, u) = G(x), u = x', is an equation for F: G(x) is no formula with x'."""
    of = {"F": ["x", "x'"], "G": ["x"]}
    system = read_system(["x"], {"x": "F(x, x') + G(x)"}, [], of)
    names: list[ex.Symbol | ex.Velocity] = [ex.Symbol("x"), ex.Velocity("x")]
    ring = exact_field.exact_ring([*system.accelerations], names, 4, exact_field.Budget())
    unknowns = leaves.Unknowns.of(ring, [], dict(system.functions))
    of_two, of_one = (
        ex.Arbitrary("F", tuple(names), (0, 2)),
        ex.Arbitrary("G", tuple(names[:1]), (0,)),
    )
    equation = (ring.value(of_two) - ring.value(of_one)).numerator
    (leaf,) = leaves.split_leaf(leaves.Leaf(unknowns), [equation], float("inf"))
    assert closed_members.member_of(system, leaf) is None


def letters_of(member: closed_members.Member) -> list[str]:
    return [*LETTERS, *(name for one in member.solved for name in one.new_constants)]


def test_on_a_leaf_all_derivatives_of_its_rule_vanish() -> None:
    """F_y = 0 has F_xy = F_yy = F_xxy = 0; F_x and F_xx are free."""
    names = nm.Names(("x", "y"), (), {"F": ("x", "y")})
    ring = exact_field.exact_ring(
        [reader.read_formula("F(x, y)", names)],
        [ex.Symbol("x"), ex.Symbol("y")],
        3,
        exact_field.Budget(),
    )
    unknowns = leaves.Unknowns.of(ring, (), {"F": ("x", "y")})
    jets = {orders: ring.field.context.gen(k) for k, (_, orders) in unknowns.jets.items()}
    (leaf,) = leaves.split_leaf(leaves.Leaf(unknowns), [jets[0, 1]], float("inf"))
    for orders, jet in jets.items():
        assert leaf.reduced(jet).is_zero() is (orders[1] > 0), orders


def test_functions_of_separate_variables_are_parted_before_they_are_solved_together() -> None:
    """A pure equation for G(x) comes before a shorter one of lower order that also holds F(u), and
    F'(u) = G(x) is known to be constant.
    """
    functions = {"F": ("u",), "G": ("x",)}
    names = nm.Names(("x", "u"), (), functions)
    trees = [
        reader.read_formula(text, names)
        for text in ("F'(u) - G(x)", "G(x)*G'''(x) - 2*G'(x)*G''(x)", "F''(u)", "G'(x)")
    ]
    variables = [ex.Symbol("x"), ex.Symbol("u")]
    ring = exact_field.exact_ring(trees, variables, 2, exact_field.Budget())
    unknowns = leaves.Unknowns.of(ring, (), functions)
    mixed, pure, bent, slope = (ring.value(tree).numerator for tree in trees)
    assert leaves._cost(unknowns, [pure]) < leaves._cost(unknowns, [mixed])
    (leaf,) = leaves.split_leaf(leaves.Leaf(unknowns), [mixed], float("inf"))
    assert leaf.reduced(bent).is_zero()
    assert leaf.reduced(slope).is_zero()

"""Leaves have exactly the members that satisfy the equations: tried one by one, for constants from
-2 to 2.
"""

from __future__ import annotations

import itertools

import pytest

from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field
from inverse_service.reading import names as nm, reader
from inverse_service.solving import leaves

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
]


@pytest.mark.parametrize("texts", EQUATIONS, ids=lambda texts: ", ".join(texts))
def test_the_members_of_the_leaves_are_those_of_the_equations(texts: list[str]) -> None:
    trees = [reader.read_formula(text, nm.Names((), LETTERS, {})) for text in texts]
    symbols = list(map(ex.Symbol, LETTERS))
    ring = exact_field.exact_ring([*symbols, *trees], [], 0, exact_field.Budget(), slopes=False)
    unknowns = leaves.Unknowns.of(ring, LETTERS, {})
    equations = [ring.value(tree).numerator for tree in trees]
    found = leaves.split(leaves.Leaf(unknowns), equations, float("inf"))
    places = {name: index for index, name in unknowns.letters.items()}
    for values in itertools.product(range(-2, 3), repeat=len(LETTERS)):
        point = [0] * len(equations[0].degrees())
        for name, value in zip(LETTERS, values, strict=True):
            point[places[name]] = value
        on_a_leaf = any(
            not any(equation(*point) for equation in leaf.equations)
            and all(one(*point) for one in leaf.nonzero)
            for leaf in found
        )
        assert on_a_leaf == (not any(equation(*point) for equation in equations)), values

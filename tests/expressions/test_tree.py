"""Walks through trees."""

from __future__ import annotations

import itertools
from fractions import Fraction

import pytest

from inverse_service.expressions.tree import (
    Expression,
    Symbol,
    add,
    distinct_nodes,
    multiply,
    number,
    power,
    walk,
)
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula


def formula(text: str) -> Expression:
    return read_formula(text, Names(("x", "y"), ()))


def test_each_node_is_met_once_in_the_order_of_the_walk() -> None:
    trees = [formula("sin(x+y)*(x+y)^2 + x"), formula("x+y"), formula("cos(x)*sin(x+y)")]
    found = list(distinct_nodes(trees))
    assert found == list(dict.fromkeys(node for tree in trees for node in walk(tree)))
    assert len(found) == len(set(found)) < sum(1 for tree in trees for _ in walk(tree))


def test_shared_parts_are_not_entered_again() -> None:
    """Doubled sixty times, the tree has 2^60 paths and some hundred nodes."""
    tree: Expression = Symbol("x")
    for k in range(60):
        tree = add(multiply(tree, Symbol(f"a{k}")), multiply(tree, Symbol(f"b{k}")))
    assert len(list(distinct_nodes([tree]))) < 400


def test_no_trees_have_no_nodes() -> None:
    assert list(distinct_nodes([])) == []


TREES = [
    formula(text) for text in ("x", "2", "0", "-1", "x+1", "1-x", "3*x*y", "x^2", "sqrt(x)", "y/(x+1)", "sin(x)-2")
]


@pytest.mark.parametrize(("left", "right"), [*itertools.product(TREES, repeat=2)])
def test_signs_between_trees_are_the_functions_of_the_same_name(left: Expression, right: Expression) -> None:
    assert left + right == add(left, right)
    assert left - right == add(left, multiply(number(-1), right))
    assert left * right == multiply(left, right)
    assert left / right == multiply(left, power(right, -1))
    assert left**right == power(left, right)
    assert -left == multiply(number(-1), left)


@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize("value", [0, 1, -1, 3, Fraction(-2, 3)])
def test_a_number_beside_a_tree_is_a_tree(tree: Expression, value: int | Fraction) -> None:
    other = number(value)
    assert (tree + value, value + tree) == (tree + other, other + tree)
    assert (tree - value, value - tree) == (tree - other, other - tree)
    assert (tree * value, value * tree) == (tree * other, other * tree)
    assert (tree / value, value / tree) == (tree / other, other / tree)
    assert tree**value == tree**other


def test_what_is_not_exact_is_no_number_of_a_tree() -> None:
    with pytest.raises(TypeError, match="float"):
        Symbol("x") * 0.5  # type: ignore[operator]

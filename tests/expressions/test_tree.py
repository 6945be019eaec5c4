"""Walks through trees."""

from __future__ import annotations

from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import Expression, Symbol, add, distinct_nodes, multiply, walk


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

"""Equations come apart into what can be solved one after the other."""

from __future__ import annotations

import pytest
import symengine

from inverse_service.codegen.planning import determinant, plan, used_only
from inverse_service.codegen.program import Assign, Solve
from inverse_service.codegen.symengine_trees import symbol
from inverse_service.codegen.triangular_form import components
from inverse_service.errors import InputError

h, u, v, w, a = (symbol(name) for name in "huvwa")


def test_constant_pivots_are_eliminated() -> None:
    (statement,) = plan([u - a * h], ["u"], {})
    assert statement == Assign("u", a * h)
    pair = plan([u - h * symengine.sin(v), v - a], ["u", "v"], {})
    assert {statement.name for statement in pair if isinstance(statement, Assign)} == {"u", "v"}


def test_only_what_is_coupled_is_solved() -> None:
    equations = [u * symengine.exp(u) - a, v * symengine.exp(v) - a * u, a * w + symengine.cos(v)]
    statements = plan(equations, ["u", "v", "w"], {})
    assert [s.unknowns for s in statements if isinstance(s, Solve)] == [("u",), ("v",), ("w",)]
    assert [s.affine for s in statements if isinstance(s, Solve)] == [False, False, True]


def test_coupled_equations_stay_together() -> None:
    equations = [symengine.sin(u) + v * v - a, symengine.cos(v) * u - h]
    (block,) = plan(equations, ["u", "v"], {"u": "s"})
    assert isinstance(block, Solve)
    assert set(block.unknowns) == {"u", "v"}
    assert dict(zip(block.unknowns, block.scales, strict=True)) == {"u": "s", "v": ""}


def test_a_pivot_that_may_vanish_is_no_pivot() -> None:
    (block,) = plan([a * u - h], ["u"], {})
    assert isinstance(block, Solve)
    (block,) = plan([h * u - a], ["u"], {})
    assert isinstance(block, Solve), "small steps would make a large difference of increments"


def test_structurally_singular_equations_are_an_error() -> None:
    with pytest.raises(InputError, match="degenerate"):
        plan([symengine.sin(u), symengine.cos(u)], ["u", "v"], {})


def test_what_nothing_needs_is_dropped() -> None:
    statements = (Assign("u", a), Assign("v", u + h), Assign("w", u * u))
    assert used_only(statements, [v]) == statements[:2]
    assert used_only(statements, []) == ()


def test_no_equations() -> None:
    assert plan([], [], {}) == ()


def test_limit_of_the_determinant() -> None:
    (block,) = plan([u - h * symengine.sin(a + u) * u], ["u"], {}, guarded=True)
    assert isinstance(block, Solve)
    assert block.limit == 1
    # Where h -> 0 leaves no finite value there is no guard.
    (block,) = plan([u * u / h - h * symengine.log(u)], ["u"], {}, guarded=True)
    assert isinstance(block, Solve)


def test_components_come_in_order() -> None:
    graph = {"a": ["b"], "b": ["c", "a"], "c": [], "d": ["a"]}
    assert components(graph) == [["c"], ["a", "b"], ["d"]]


def test_determinant() -> None:
    assert determinant([[u, v], [w, a]]) == u * a - v * w
    rows = [[symengine.Integer(x) for x in row] for row in ((2, 0, 1), (1, 3, 2), (1, 1, 4))]
    assert determinant(rows) == 2 * (12 - 2) + (1 - 3)

"""Cells, special exponents, and points of the checker: what a proof does not cover is noticed."""

from __future__ import annotations

import random
import time
from fractions import Fraction
from typing import Any

import pytest

import inverse_service
from inverse_service.certificate import formulas, numbers, question
from inverse_service.decision.solutions import Statement
from inverse_service.expressions import collecting, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import second_order_system
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import accepting
from inverse_service.solving import beyond, solving
from inverse_service.statements.domains import Domain
from inverse_service.statements.questions import PLAIN
from tests.values import slow


def test_points_in_no_solved_cell_are_in_a_set_without_an_answer() -> None:
    """atan(tan(x)) has infinitely many branches, of which two are cells."""
    system = second_order_system.read_system(
        None, {"x": "atan(tan(x))*y' - y^2", "y": "-x*x' - 2*x*y"}
    )
    cells, left = solving.cell_by_cell(
        system, lambda cell, _: (cell, tuple(map(collecting.collect, cell.positive)))
    )
    sets = [*(cell.positive for cell in cells), *(one.domain.positive for one in left)]
    draw = random.Random(3)
    for _ in range(40):
        values = {
            ex.Symbol(name): real_branch.table_at({name: str(draw.uniform(-9, 9))})
            for name in ("x", "y")
        }
        point = {key: value for table in values.values() for key, value in table.items()}
        assert any(real_branch.are_positive(positive, point) for positive in sets)


@pytest.mark.parametrize("names", [("x",), ("x", "y"), ("y", "x", "x'")])
def test_the_other_side_of_each_tree_is_a_cell_too(names: tuple[str, ...]) -> None:
    """A proof that depends on the signs of some trees is made on all sides of all of them."""
    system = second_order_system.read_system(None, {"x": "-x", "y": "-y"})
    trees = [ex.Velocity("x") if name == "x'" else ex.Symbol(name) for name in names]

    def answer(cell: second_order_system.SecondOrderSystem, _: Any) -> tuple[Any, Any]:
        point = solving.point_of(cell)
        assert point is not None
        sides = [tree if point[tree] > 0 else collecting.collect(-tree) for tree in trees]
        return (*cell.positive, *sides), sides

    cells, left = solving.cell_by_cell(system, answer)
    assert not left
    draw = random.Random(5)
    for _ in range(40):
        point = real_branch.table_at({name: str(draw.uniform(-2, 2)) for name in ("x", "y", "x'")})
        assert sum(real_branch.are_positive(positive, point) for positive in cells) == 1


@pytest.mark.parametrize(
    "equations",
    [
        {"x'": "x*p", "p'": "p"},
        {"x'": "x*p", "p'": "1"},
        {"x'": "p/x", "p'": "x^2*p^2"},
        {"x'": "x^2*p", "p'": "-p"},
    ],
)
def test_where_first_order_equations_are_not_solved_is_a_pole(equations: dict[str, str]) -> None:
    """x' = x p gives p = x'/x, so x'' = x'^2/x + x p' says nothing at x = 0, where x stays."""
    text = "; ".join(f"{left} = {right}" for left, right in equations.items())
    ready = accepting.prepared({"equations": text})
    system = accepting.to_system(accepting.to_schema(ready.document))
    assert system.coordinates == ("x",)
    assert ex.Symbol("x") in real_branch.poles(system.accelerations)


@pytest.mark.parametrize("exponent", [2, slow(-3), slow(3)])
def test_an_exponent_at_which_a_force_vanishes_is_an_exception(exponent: int) -> None:
    """With a = exponent nothing is coupled, so there is a Lagrangian; the general member has
    none.
    """
    equations = {"x": f"(x^a - x^({exponent}))*y", "y": "x'"}
    found = inverse_service.solve(
        {"equations": equations, "parameters": ["a"], "first_integrals": False}
    )
    assert found["verdict"] == "not_variational"
    assert f"a = {exponent}" in found["exceptions"]


def test_a_claim_that_is_false_at_some_points_is_refuted() -> None:
    """|x| = x holds for half of all x; the points are random, so the question is repeated."""
    force = formulas.read_tokens("sqrt(x^2) - x", "a formula")
    for seed in range(8):
        tools = question.Tools(random.Random(seed), time.thread_time() + 60)
        asked = question.Question(
            tools, {"coordinates": ["x"], "equations": {"x": "-x"}}, False, {}
        )
        asked.place = numbers.Place(tools.generator, dict.fromkeys(asked.names, Fraction(1)))

        def claims(ring: Any) -> question.Claims:
            asked.held = True  # noqa: B023
            return question.Claims([question.Zero(formulas.value_of(ring, force), "")], [])

        asked.rational, asked.read = False, lambda ring: None
        asked.claimed = claims, 0
        with pytest.raises(formulas.Ended) as ended:
            asked.look_around()
        assert ended.value.verdict == "invalid"


@pytest.mark.parametrize(
    ("text", "is_never"),
    [
        ("x^2 + 2*x*y + y^2", True),
        ("x^2 + 3*x*y + y^2", False),
        ("x*y", False),
        ("x*t + y^2", False),  # the row of x has a zero before what is not zero
        ("x^2 + y", False),
        ("x^2 - sqrt(8)*x*y + 2*y^2", True),  # (x - sqrt(2) y)^2
        ("x^2 - sqrt(8)*x*y + 1.9999999*y^2", False),
        ("a*x + x^2 + a^2", True),
        ("a*x^2", False),
        ("(sqrt(2) - 2)*x^2", False),
        ("(3 - 2*sqrt(2) - (1 - sqrt(2))^2)*x*y + y^2", True),  # no term x y
        ("x^2/y^2 + 1", False),  # no form
    ],
)
def test_squares_of_a_form_are_completed_exactly(text: str, is_never: bool) -> None:
    tree = reader.read_formula(text, nm.Names(("x", "y"), ("a",), {}))
    assert beyond._is_semidefinite(tree) is is_never


def test_sets_beyond_a_domain_have_no_point_in_common() -> None:
    """An answer for x, y, x' > 0 leaves out x < 0, then y < 0 < x, then x' < 0 < x, y."""
    system = second_order_system.read_system(None, {"x": "-x", "y": "-y"})
    positive = (ex.Symbol("x"), ex.Symbol("y"), ex.Velocity("x"))
    answer = Statement(PLAIN, "variational", certificate={"": ""}, domain=Domain(positive))
    sets = [one.domain.positive for one in beyond.left_out(system, answer, (), ())]
    assert len(sets) == 3
    draw = random.Random(7)
    for _ in range(40):
        point = real_branch.table_at({name: str(draw.uniform(-2, 2)) for name in ("x", "y", "x'")})
        inside = [one for one in (positive, *sets) if real_branch.are_positive(one, point)]
        assert len(inside) == 1

"""Cells, special exponents, and points of the checker: what a proof does not cover is noticed."""

from __future__ import annotations

import random
import time
from fractions import Fraction
from typing import Any

import pytest

import inverse_service
from inverse_service.certificate import formulas, numbers, question
from inverse_service.expressions import collecting, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import second_order_system
from inverse_service.solving import solving
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

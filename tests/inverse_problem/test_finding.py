"""What a positive answer says: whole sentences that name the formula, and only what was done."""

from __future__ import annotations

import pytest

from inverse_service.expressions.printing import to_text
from inverse_service.inverse_problem.explanation.finding import not_found
from inverse_service.inverse_problem.search.protocol import SearchOutcome
from inverse_service.inverse_problem.search.rungs import LEAVES, REASONS, REDUCTIONS
from inverse_service.inverse_problem.solutions import Answer, SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system

BY_A_FAMILY = {"x": "-x-2*x*y", "y": "-y-x^2+y^2"}
BY_A_METHOD = {"x": "-x/(x^2+y^2)^2-x'", "y": "-y/(x^2+y^2)^2-y'"}
WITHOUT_L = {"x": "(1-x^2)*x'-x"}
MANY = {name: f"-{name}" for name in "abcdef"}


def answer(equations: dict[str, str]) -> Answer:
    solution = solve(read_system(list(equations), equations, (), None, "test"), SolveOptions(time_limit=30.0))
    assert solution.with_time is not None
    return solution.with_time


@pytest.mark.parametrize("equations", [BY_A_FAMILY, BY_A_METHOD, WITHOUT_L, MANY], ids=lambda given: "".join(given))
def test_every_step_is_a_whole_sentence(equations: dict[str, str]) -> None:
    for step in answer(equations).explanation:
        assert step.text.endswith("."), step.text
        assert ".)" not in step.text
        assert " 1 terms" not in step.text


@pytest.mark.parametrize("equations", [BY_A_FAMILY, BY_A_METHOD], ids=["family", "method"])
def test_the_lagrangian_and_the_hamiltonian_stand_in_the_sentences(equations: dict[str, str]) -> None:
    found = answer(equations)
    assert found.lagrangian is not None
    assert found.hamiltonian is not None
    said = " ".join(step.text for step in found.explanation)
    assert f"L = {to_text(found.lagrangian.expression)}." in said
    assert f"H = p v - L = {to_text(found.hamiltonian.expression)}." in said
    assert "The momenta p = dL/dv are p_x = " in said


def test_a_method_does_not_claim_a_linear_ansatz() -> None:
    found = answer(BY_A_METHOD)
    assert found.lagrangian is not None
    assert found.lagrangian.family in REASONS
    said = " ".join(step.text for step in found.explanation)
    assert REASONS[found.lagrangian.family].replace("`", "") in said
    assert "candidate term" not in said


def test_every_method_says_where_its_lagrangians_come_from() -> None:
    for rung in (*LEAVES, *REDUCTIONS):
        assert rung.reason.endswith("."), rung.name


def test_families_and_methods_tried_are_told_apart() -> None:
    name = LEAVES[0].name
    (step,) = not_found(SearchOutcome(None, (("one", 1), (name, 0), ("two", 5))))
    assert step.text == f"No closed form was found. Families tried: one (1 term); two (5 terms). Methods tried: {name}."
    (step,) = not_found(SearchOutcome(None, (("one", 1), ("two", 0), ("three", 0))))
    assert step.text.endswith("Families tried: one (1 term). Families without a candidate: two; three.")
    (step,) = not_found(SearchOutcome(None, ()))
    assert step.text == "No closed form was found. Families tried: none fits f."


def test_the_products_are_worked_out_for_many_coordinates() -> None:
    said = [step.text for step in answer(MANY).explanation]
    assert "Gamma(g) = 0, and g N + (g N)^T with N = 0 is the same." in said
    assert "det g = 1 is not zero identically: g is a multiplier." in said

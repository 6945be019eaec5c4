"""A system may have a g or an L of its own; the explanation says which is which."""

from __future__ import annotations

from dataclasses import replace

import pytest

from inverse_service.expressions.tree import Symbol
from inverse_service.inverse_problem.explanation.finding import energy_step
from inverse_service.inverse_problem.explanation.wording import Piece, said, with_shared_letters
from inverse_service.inverse_problem.solutions import Solution, SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system

RADIUS = Symbol("R") * Symbol("g_11")


def solved(equations: dict[str, str], parameters: tuple[str, ...] = ()) -> Solution:
    return solve(read_system(list(equations), equations, parameters), SolveOptions(time_limit=30.0))


def first_sentence(solution: Solution) -> str:
    assert solution.with_time is not None
    return solution.with_time.explanation[0].text


def test_the_g_of_gravity_is_told_from_the_multiplier() -> None:
    text = first_sentence(solved({"x": "-g*sin(x)/l"}, ("g", "l")))
    assert text.startswith("In the sentences below, g is the multiplier, the Hessian of L in the velocities; ")
    assert text.endswith("the name g may also be that of the system.")


def test_a_coordinate_and_a_parameter_share_letters_in_one_sentence() -> None:
    text = first_sentence(solved({"L": "-H*L"}, ("H",)))
    assert text == (
        "In the sentences below, L is the Lagrangian, H is the Hamiltonian; inside their formulas these names may also "
        "be those of the system."
    )


@pytest.mark.parametrize(
    ("equations", "parameters"),
    [({"L": "-N*L*y", "y": "-L^2*y^2"}, ("N",)), ({"x": "-R*y'^2", "y": "x*y"}, ("R",))],
)
def test_a_letter_that_only_the_system_uses_has_one_meaning(
    equations: dict[str, str], parameters: tuple[str, ...]
) -> None:
    assert not first_sentence(solved(equations, parameters)).startswith("In the sentences below")


@pytest.mark.parametrize("parameters", [(), ("k",), ("gravity",)])
def test_nothing_is_said_where_no_letter_has_two_meanings(parameters: tuple[str, ...]) -> None:
    factor = parameters[0] if parameters else "2"
    assert not first_sentence(solved({"x": f"-{factor}*sin(x)"}, parameters)).startswith("In the sentences below")


def test_one_answer_to_both_questions_stays_one() -> None:
    solution = solved({"x": "-g*x"}, ("g",))
    assert solution.autonomous is solution.with_time


@pytest.mark.parametrize(
    ("sentence", "is_said"),
    [(("`(Phi)_12`: ", RADIUS, " = 0. As ", Symbol("R"), " is not zero identically, `g_11 = 0`."), False),
     (("`(R)_123`: ", RADIUS, " = 0."), True), (("and `g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0`",), True),
     (("every condition (`Phi`, `nabla R`) holds",), True)],
)  # fmt: skip
def test_a_radius_is_told_from_the_curvature_only_where_that_is_spoken_of(
    sentence: tuple[Piece, ...], is_said: bool
) -> None:
    system = read_system(["x"], {"x": "-R*x"}, ["R"])
    answer = replace(solve(system, SolveOptions(time_limit=30.0)).with_time, explanation=(said(*sentence),))
    assert (len(with_shared_letters(answer, system).explanation) == 2) is is_said


def test_the_sentence_on_energies_uses_letters_that_the_system_leaves_free() -> None:
    said = energy_step(["y", "F", "h"]).text
    assert "`" not in said
    assert "x' int G(e)/x'^2 d x'" in said
    assert "F" not in said.replace("For", "")
    assert "x' int F(h)/x'^2 d x'" in energy_step(()).text

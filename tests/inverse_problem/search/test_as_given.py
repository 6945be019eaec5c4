"""Equations that are Euler-Lagrange equations as written get the writer's own Lagrangian."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import ZERO, Acceleration, Expression, subtract
from inverse_service.inverse_problem.search.row_factors import lagrangian_as_given
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import AS_GIVEN, solve
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums
from inverse_service.mechanics.reading import read_given, read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

# Equation, parameters, the L that goes with it (Goldstein, Classical Mechanics; Landau and Lifshitz, Mechanics).
TEXTBOOK = [
    (["m*x'' + k*x = 0"], ["m", "k"], "m*x'^2/2 - k*x^2/2"),
    (["-m*x'' - k*x = 0"], ["m", "k"], "m*x'^2/2 - k*x^2/2"),
    (["m*x'' = -k*(x - y)", "M*y'' = k*(x - y)"], ["m", "M", "k"], "m*x'^2/2 + M*y'^2/2 - k*(x - y)^2/2"),
    (["m*l^2*theta'' = -m*g*l*sin(theta)"], ["m", "l", "g"], "m*l^2*theta'^2/2 + m*g*l*cos(theta)"),
    (["m*r'' - m*r*phi'^2 + k/r^2 = 0", "m*r^2*phi'' + 2*m*r*r'*phi' = 0"], ["m", "k"],
     "m*(r'^2 + r^2*phi'^2)/2 + k/r"),
    (["exp(c*t)*(m*x'' + m*c*x' + k*x) = 0"], ["m", "c", "k"], "exp(c*t)*(m*x'^2 - k*x^2)/2"),
    (["m*x'' = e*B*y' - k*x/(x^2+y^2)^(3/2)", "m*y'' = -e*B*x' - k*y/(x^2+y^2)^(3/2)"], ["m", "e", "B", "k"],
     "m*(x'^2 + y'^2)/2 + e*B*x*y' + k/sqrt(x^2 + y^2)"),
    (["x'' = -398600.4418*x/(x^2+y^2)^(3/2)", "y'' = -398600.4418*y/(x^2+y^2)^(3/2)"], [],
     "(x'^2 + y'^2)/2 + 398600.4418/sqrt(x^2 + y^2)"),
    (["3*x'^2*x'' = -x"], [], "x'^4/4 - x^2/2"),
]  # fmt: skip


def _difference_is_constant(one: Expression, other: Expression, names: Sequence[str]) -> bool:
    """Whether the Euler-Lagrange expressions are the same: they are evaluated where the accelerations are letters."""
    letters = [Acceleration(name) for name in names]
    pairs = zip(euler_lagrange_sums(one, names, letters), euler_lagrange_sums(other, names, letters), strict=True)
    return all(collect(subtract(left, right)) == ZERO for left, right in pairs)


@pytest.mark.parametrize(("equations", "parameters", "known"), TEXTBOOK, ids=lambda value: str(value)[:40])
def test_masses_and_signs_are_those_of_the_writer(equations: list[str], parameters: list[str], known: str) -> None:
    system = read_system(None, equations, parameters)
    found = lagrangian_as_given(system, read_given(None, equations, parameters).residuals)
    assert found is not None
    wanted = parse(known, Names(system.coordinates, system.parameters, {}))
    assert _difference_is_constant(found, wanted, system.coordinates), to_text(found)


def test_the_order_of_the_equations_does_not_matter() -> None:
    given = read_given(["x", "y"], ["M*y'' = -y - x", "m*x'' = -x - y"], ["m", "M"])
    system = read_system(["x", "y"], ["M*y'' = -y - x", "m*x'' = -x - y"], ["m", "M"])
    found = lagrangian_as_given(system, given.residuals)
    assert found is not None
    assert to_text(found) == "M*y'^2/2 + m*x'^2/2 - x^2/2 - y^2/2 - x*y"


@pytest.mark.parametrize(
    "equations",
    [["x'' = -x - x'^3"], ["x'' = -x^2*y", "y'' = -x"], ["x'' = x'^2*y'", "y'' = -x"]],
)
def test_equations_of_another_kind_are_left_to_the_search(equations: list[str]) -> None:
    system = read_system(None, equations)
    assert lagrangian_as_given(system, read_given(None, equations).residuals) is None


def test_it_is_the_answer_and_its_proof_is_the_plain_one() -> None:
    equations = ["m*x'' + k*x = 0"]
    given = read_given(None, equations, ["m", "k"]).residuals
    answer = solve(read_system(None, equations, ["m", "k"]), SolveOptions(given=given)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.lagrangian.family == AS_GIVEN
    assert answer.checked == "valid"
    assert answer.explanation[0].text == (
        "dL/dx' = m*x', d/dt dL/dx' = m*x'' and dL/dx = -k*x, so the Euler-Lagrange equation d/dt dL/dx' - dL/dx = 0 "
        "reads k*x + m*x'' = 0. Divided by m, that is x'' = -k*x/m."
    )


def test_an_integrating_factor_as_written_answers_the_question_with_time_only() -> None:
    equations = ["exp(c*t)*(x'' + c*x' + x) = 0"]
    given = read_given(None, equations, ["c"]).residuals
    solution = solve(read_system(None, equations, ["c"]), SolveOptions(given=given))
    assert solution.with_time is not None
    assert solution.with_time.lagrangian is not None
    assert solution.with_time.lagrangian.family == AS_GIVEN
    assert solution.autonomous is None or solution.autonomous.lagrangian != solution.with_time.lagrangian

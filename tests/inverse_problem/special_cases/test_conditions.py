"""The conditions of a case as people read them: both sides positive, no common factor, values where there are any."""

from __future__ import annotations

import random

import pytest

from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.special_cases.case_tree import Node, special_cases
from inverse_service.inverse_problem.special_cases.cases import condition_texts, equation_texts
from inverse_service.inverse_problem.special_cases.side_conditions import has_one_everywhere
from inverse_service.inverse_problem.special_cases.splitting import split
from inverse_service.inverse_problem.special_cases.strata import ParameterSpace
from inverse_service.mechanics.reading import read_system


def variational(node: Node) -> set[tuple[str, ...]]:
    own = {tuple(condition_texts(node.case))} if node.case.with_time == "variational" else set()
    return own.union(*map(variational, node.children))


@pytest.mark.parametrize(
    ("damping", "conditions"),
    [
        # x'' = -a x' + y, y'' = -c y' + x has a Lagrangian exactly where a = c or a = -c
        (("a*b", "1"), {("a*b = 1",), ("a*b + 1 = 0",)}),
        (("a^2", "2*b^2"), {("a^2 = 2*b^2",), ("a^2 + 2*b^2 = 0",)}),
        (("a^2 + b^2 - 1", "0"), {("a^2 + b^2 = 1",)}),
        (("a", "b"), {("a = b",), ("a = -b",)}),
        (("6*a", "4*b"), {("a = 2*b/3",), ("a = -2*b/3",)}),
    ],
)
def test_the_two_dampings_have_to_agree_up_to_sign(damping: tuple[str, str], conditions: set[tuple[str, ...]]) -> None:
    equations = {"x": f"-({damping[0]})*x' + y", "y": f"-({damping[1]})*y' + x"}
    found = variational(special_cases(read_system(["x", "y"], equations, ["a", "b"]), True).root)
    assert found
    assert found <= conditions


def test_what_no_parameter_can_be_solved_from_is_named() -> None:
    equations = {"x": "-(a^3 - b^3 + c^3 + 5)*x' + y", "y": "x"}
    found = special_cases(read_system(["x", "y"], equations, list("abc")), True)
    assert found.reasons == ("not solved for a parameter: a^3 + c^3 + 5 = b^3",)
    assert not found.complete


def test_a_function_and_the_parameters_have_a_condition_each() -> None:
    equations = {"x": "-A(x)*x' + a*b*y", "y": "-x' - y'"}
    found = variational(special_cases(read_system(["x", "y"], equations, ["a", "b"], {"A": ["x"]}), True).root)
    assert ("A(x) = A_0", "a = 0") in found
    assert any(texts[0] == "A(x) = A_0" and "a*b" in texts[1] for texts in found)


def test_sides_are_positive_and_without_a_common_factor() -> None:
    space = ParameterSpace(("a", "b"))
    a, b = space.context.gens()
    (everywhere,) = split(space, [])
    equations = [6 * a - 4 * b**2, -a - b, a / 2 - 3, a * 0]
    assert equation_texts(everywhere, equations) == ["3*a = 2*b^2", "a + b = 0", "a = 6", "0 = 0"]


@pytest.mark.parametrize("seed", range(6))
def test_what_the_theorem_says_of_linear_systems_is_what_is_decided(seed: int) -> None:
    drawn = random.Random(seed)
    a = [[drawn.choice((-1, 0, 1, 2)) for _ in range(2)] for _ in range(2)]
    p, q = drawn.choice((0, 1, -3)), drawn.choice((0, 2))
    b = [[p * (i == j) + q * a[i][j] for j in range(2)] for i in range(2)]
    texts = [f"{p}*x' + ({q})*y' + ({r})*x + ({s})*y + 1" for (p, q), (r, s) in zip(a, b, strict=True)]
    system = read_system(["x", "y"], dict(zip("xy", texts, strict=True)), [])
    assert has_one_everywhere(system)
    assert decide(system, False).verdict == "variational"


def test_the_theorem_needs_matrices_that_commute() -> None:
    assert not has_one_everywhere(read_system(["x", "y"], {"x": "-a*x' + y", "y": "-c*y' + x"}, ["a", "c"]))
    assert not has_one_everywhere(read_system(["x", "y"], {"x": "-a*x' + x*y", "y": "-a*y' + x"}, ["a"]))
    assert has_one_everywhere(read_system(["x", "y"], {"x": "k*x^3*x' - x", "y": "-k*y' + 2"}, ["k"]))

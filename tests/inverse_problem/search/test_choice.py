"""The simplest regular Lagrangian of a space is chosen, gauge terms dropped, squares first."""

from __future__ import annotations

from fractions import Fraction

import pytest

from inverse_service.inverse_problem.search.choice import (
    complexity,
    gauge_of,
    hessians,
    reduced,
    regular_members,
    scaled,
    signature,
)
from inverse_service.inverse_problem.search.linear_ansatz import Combination, LagrangianSpace
from inverse_service.inverse_problem.search.terms import terms_of, tree_of
from inverse_service.mechanics.euler_lagrange import hessian
from tests.inverse_problem.search.given import lagrangians, monomial_of, tree

ISOTROPIC = ({"x": "-x", "y": "-y"}, ["x'^2", "y'^2", "x^2", "y^2", "x'*y'", "x*y", "x*x'"])


def combination(text: str) -> Combination:
    return terms_of(tree(text))


def shown(space: LagrangianSpace, members: tuple[int, ...]) -> Combination:
    total: Combination = {}
    for k in members:
        total = {**total, **space.combinations[k]}
    return total


def test_a_sum_of_squares_is_preferred_to_a_mixed_product() -> None:
    space = lagrangians(*ISOTROPIC)
    chosen = [shown(space, members) for members in regular_members(space, 3)]
    squares = {monomial_of(text) for text in ("x'^2", "y'^2", "x^2", "y^2")}
    assert any(set(one) == squares for one in chosen)
    assert all(monomial_of("x*x'") not in one for one in chosen)


def test_every_choice_is_regular() -> None:
    space = lagrangians(*ISOTROPIC)
    found = regular_members(space, 3)
    assert found
    for members in found:
        entries = hessian(tree_of(shown(space, members)), ("x", "y"))
        assert entries[0][0] != entries[0][1] or entries[1][1] != entries[1][0]


@pytest.mark.parametrize(
    ("equations", "candidates"),
    [({"x": "-x", "y": "-4*y"}, ["x'^2", "x^2"]), ({"x": "-x"}, ["x*x'", "x'"]), ({"x": "-x-x'"}, ["x'^2", "x^2"])],
)
def test_a_space_without_a_regular_member_offers_none(equations: dict[str, str], candidates: list[str]) -> None:
    assert regular_members(lagrangians(equations, candidates), 3) == []


def test_a_hessian_modulo_the_prime_is_that_of_the_formula() -> None:
    space = lagrangians({"x": "0", "y": "0"}, ["x'^2", "x'*y'"])
    prime, found = hessians(space, 3)
    assert prime > 2**60
    assert found == [[[2, 0], [0, 0]], [[0, 1], [1, 0]]]


def test_gauge_terms_have_no_hessian_and_are_taken_off() -> None:
    space = lagrangians({"x": "-x"}, ["x'^2", "x^2", "x*x'", "x'"])
    gauge = gauge_of(space, 3)
    assert sorted(map(len, gauge)) == [1, 1]
    total = combination("x'^2 - x^2 + 3*x*x' - x'/7")
    assert reduced(total, gauge) == combination("x'^2 - x^2")


def test_reducing_never_makes_it_longer() -> None:
    total, longer = combination("x'^2 - x^2"), combination("x^2 + x*y*x' + y*x'")
    assert reduced(total, [longer]) == total
    assert complexity(reduced(combination("x'^2 + x*x'"), [combination("x*x'")])) < complexity(
        combination("x'^2 + x*x'")
    )


def test_the_kinetic_term_gets_one_half() -> None:
    assert scaled(combination("3*x'^2 - 3*x^2")) == combination("x'^2/2 - x^2/2")
    assert scaled(combination("-4*x'*log(x') + x'")) == combination("x'*log(x') - x'/4")


@pytest.mark.parametrize(
    ("lagrangian", "expected"), [("x'^2 + y'^2", (2, 0)), ("x'*y'", (1, 1)), ("-x'^2", (0, 1)), ("(x'+y')^2", (1, 0))]
)
def test_the_signature_is_that_of_the_hessian(lagrangian: str, expected: tuple[int, int]) -> None:
    space = lagrangians({"x": "0", "y": "0"}, ["x'^2"])
    assert signature(space, hessian(tree(lagrangian), ("x", "y"))) == expected


def test_the_weight_of_a_combination_grows_with_its_terms() -> None:
    weights = [complexity(combination(text)) for text in ("x'^2", "x'^2 - x^2", "x'^2/x^3 - sqrt(1+x^2)")]
    assert weights == sorted(weights)
    assert isinstance(weights[0][0], Fraction)

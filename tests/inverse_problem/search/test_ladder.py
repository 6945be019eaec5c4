"""Families are tried in their order, the caller's own terms first; what was tried is reported."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from inverse_service.deadline import now, until
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.search import rungs
from inverse_service.inverse_problem.search.families import NAME, monomials_of, own_family
from inverse_service.inverse_problem.search.ladder import search
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.protocol import Leaf, SearchOutcome
from inverse_service.inverse_problem.search.rungs import ANSATZ
from inverse_service.inverse_problem.search.terms import terms_of
from tests.inverse_problem.search.forty_digits import same_value
from tests.inverse_problem.search.given import material, tree

PARTICLE = {"x": "0", "y": "-x*x'*y'/(1+x^2)", "z": "x'*z'/x-x*x'*z'/(1+x^2)"}
OWN = ["x'^2", "sqrt(1+x^2)*y'^2/x'", "sqrt(1+x^2)*z'^2/(x*x')"]


def searched(
    equations: dict[str, str], own: Sequence[str] = (), seconds: float = 20.0, reports: list[str] | None = None
) -> SearchOutcome:
    said = [] if reports is None else reports
    analysis = material(equations).analysis
    with until(now() + seconds):
        return search(analysis, False, 1, math.inf, said.append, [tree(text) for text in own])


def test_families_are_reported_one_by_one_until_one_holds_a_regular_lagrangian() -> None:
    reports: list[str] = []
    outcome = searched(PARTICLE, reports=reports)
    assert outcome.found is not None
    assert outcome.found.family == "Laurent monomials in the velocities"
    assert reports[-1] == f"ansatz: {outcome.tried[-1][0]}"
    said = [line.split(": ", 1)[1] for line in reports]
    without = [name for name, count in outcome.tried if not count]
    counted = dict.fromkeys(name for name, count in outcome.tried if count)  # one in several stages is there as often
    assert [name for name in said if name not in without] == [*counted]
    assert (ANSATZ[1].name, 0) in outcome.tried  # no multiplier without velocities


def test_no_time_means_nothing_tried() -> None:
    assert searched(PARTICLE, seconds=-1.0) == SearchOutcome(None, ())


def test_own_terms_are_tried_first() -> None:
    outcome = searched(PARTICLE, OWN)
    assert outcome.found is not None
    assert outcome.tried == ((NAME, 3),)
    assert outcome.found.family == NAME
    expected = tree("x'^2/2 + sqrt(1+x^2)*(y'^2 + z'^2/x)/(2*x')")
    assert same_value(outcome.found.lagrangians[0], expected)


@pytest.mark.parametrize("own", [["x'^2 + y'^2"], ["x'^2", "y'^2", "cos(x*y)"], ["x'^2 + y'^2 - 7*cos(x*y) + x*y'"]])
def test_potentials_go_with_own_kinetic_terms_given_or_not(own: list[str]) -> None:
    outcome = searched({"x": "-y*sin(x*y)", "y": "-x*sin(x*y)"}, own)
    assert outcome.found is not None
    assert outcome.found.family == NAME
    assert same_value(outcome.found.lagrangians[0], tree("x'^2/2 + y'^2/2 + cos(x*y)"))


def test_a_given_potential_that_is_no_antiderivative_of_a_term_is_used() -> None:
    """The user's own terms are a family of their own; nothing else is tried before it."""
    outcome = searched({"x": "1/(1+x^2)"}, ["x'^2", "atan(x)"])
    assert outcome.found is not None
    assert outcome.found.family == NAME
    assert same_value(outcome.found.lagrangians[0], tree("x'^2/2 + atan(x)"))


@pytest.mark.parametrize("own", [["x'*y'*z'"], ["sqrt(-1-x^2)*x'^2"], ["x"], ["t*x'^2"], ["0"], ["asin(2+x^2)*x'^2"]])
def test_own_terms_that_do_not_help_do_no_harm(own: list[str]) -> None:
    outcome = searched({"x": "-x", "y": "-4*y", "z": "0"}, own)
    assert outcome.found is not None
    assert outcome.found.family != NAME


def test_own_terms_are_split_into_monomials_and_long_ones_kept_whole() -> None:
    assert own_family([]) is None
    assert own_family([tree("0")]) is None
    assert set(monomials_of(tree("2*x'^2 - 3*x*y'"))) == set(terms_of(tree("x'^2 + x*y'")))
    long = tree("*".join(f"(x^{k} + y^{k} + z^{k} + a^{k})" for k in range(1, 9)))
    assert len(monomials_of(long)) == 1


def test_antiderivatives_of_functions_in_f_are_factors_of_powers_of_velocities() -> None:
    outcome = searched({"x": "-log(x)*y'", "y": "0"})
    assert outcome.found is not None
    assert same_value(outcome.found.lagrangians[0], tree("x'^2/(2*sqrt(y')) - (x*log(x) - x)*sqrt(y')"))


def leaf(name: str, cost: float, accepts: bool, proposed: Sequence[Expression] | None) -> Leaf:
    """One that proposes these, or (None) finds that atoms cannot be reduced."""

    def propose(_: Material, seed: int) -> Sequence[Expression]:
        if proposed is None:
            raise IrreducibleAtoms("no")
        return proposed

    return Leaf(name, cost, lambda _: accepts, propose, "For a test.")


def test_special_methods_have_their_place_on_the_ladder(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = tree("x'^2/2 - x^2/2")
    silent = leaf("not meant", 0.1, False, [answer])
    broken = leaf("broken", 0.2, True, None)
    empty = leaf("empty", 0.3, True, [])
    right = leaf("right", 0.4, True, [answer, tree("x'^2 - x^2"), tree("x'^2 + x^2")])
    monkeypatch.setattr(rungs, "RUNGS", (right, empty, silent, broken))
    outcome = searched({"x": "-x"})
    assert outcome.found is not None
    assert outcome.found.lagrangians[0] == answer
    assert [name for name, _ in outcome.tried] == ["broken", "empty", "right"]
    assert outcome.found.family == "right"


def test_no_special_method_leaves_the_families(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rungs, "RUNGS", ANSATZ[1:])
    outcome = searched({"x": "-x"})
    assert outcome.found is not None
    assert outcome.tried == ((ANSATZ[1].name, outcome.tried[0][1]),)


def test_of_equal_lagrangians_a_positive_one_comes_first() -> None:
    outcome = searched({"x": "-x", "y": "-y"})
    assert outcome.found is not None
    assert same_value(outcome.found.lagrangians[0], tree("x'^2/2 + y'^2/2 - x^2/2 - y^2/2"))


def test_a_family_whose_lagrangians_do_not_hold_is_passed_over() -> None:
    analysis = material({"x": "-x"}).analysis
    refused: list[Expression] = []

    def holds(tree: Expression) -> bool:
        refused.append(tree)
        return len(refused) > 1

    outcome = search(analysis, False, 1, now() + 20, lambda _: None, (), holds)
    assert outcome.found is not None
    assert outcome.found.lagrangians[0] == refused[1]
    assert search(analysis, False, 1, now() + 20, lambda _: None, (), lambda _: False).found is None


@pytest.mark.slow
def test_a_metric_given_by_a_frame_has_entries_of_many_letters() -> None:
    """L = w'^2/2 + x'^2/2 + z'^2/2 + (w^2 + 1) (y' + y z')^2/2 - V: g_zz holds w^2 y^2 beside other letters."""
    force = "2*w - 6*z^2 - 3*x*y + 3*y^3 - (w^2+1)*(y' + y*z')^2"
    equations = {
        "w": "w*(y' + y*z')^2 + 2*z",
        "x": "3*y",
        "y": f"y'*z' + y*z'^2 - 2*w*w'*(y' + y*z')/(w^2+1) - y'*z' + (3*x - 3*y^2)/(w^2+1) - y*({force})",
        "z": force,
    }
    outcome = searched(equations)
    assert outcome.found is not None
    expected = "w'^2/2 + x'^2/2 + z'^2/2 + (w^2+1)*(y' + y*z')^2/2 + 2*w*z - 2*z^3 - y^3 + 3*x*y"
    assert same_value(outcome.found.lagrangians[0], tree(expected))

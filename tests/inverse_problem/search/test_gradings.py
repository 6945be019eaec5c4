"""Terms of different factors under scalings and reflections solve an ansatz group by group, and lose nothing."""

from __future__ import annotations

import pytest

from inverse_service.inverse_problem.search import linear_ansatz, multiplier_ansatz
from inverse_service.inverse_problem.search.gradings import factors, graded
from inverse_service.inverse_problem.search.ladder import _sampler
from inverse_service.inverse_problem.search.linear_ansatz import Combination, solve_ansatz
from inverse_service.inverse_problem.search.multiplier_ansatz import solve_multiplier
from tests.inverse_problem.search.given import material, monomial_of

# Equations, candidates (at least eight), the least number of groups.
CASES = [
    ({"x": "-x"}, ["x'^2", "x^2", "x*x'", "x'", "x'^3", "x^4", "x^2*x'^2", "x'^4", "x*x'^2", "x^3"], 5),
    ({"x": "-a*x"}, ["x'^2", "x^2", "a*x^2", "x'^2/a", "x'^4", "a*x^2*x'^2", "a^2*x^4", "x*x'", "x"], 5),
    ({"x": "x'^2/x"}, ["log(x')*x'", "log(x)*x'", "x'^2/x^2", "x'*log(x')/x", "x'*log(x)/x", "x", "log(x)", "x'^2"], 4),
    ({"x": "-A'(x)/A(x)*x'^2/2"},
     ["A(x)*x'^2", "x'^2", "A(x)^2*x'^2", "A(x)", "x'", "x'^4", "A(x)*x'^4", "x'*A(x)"], 6),
    ({"x": "0", "y": "-x*x'*y'/(1+x^2)"},
     ["x'^2", "sqrt(1+x^2)*y'^2/x'", "y'^2", "y'^2/x'", "y'*x'", "x*y'^2", "y*x'^2", "x*x'^2", "y'^3/x'"], 4),
    ({"x": "-sin(x)", "y": "-sin(y)*cos(x)"},
     ["x'^2", "y'^2", "cos(x)", "cos(y)", "sin(x)", "x'*y'", "sin(x)*x'^2", "x'*sin(y)", "cos(x)*x'^2"], 3),
    ({"x": "x*exp(y)", "y": "y'^2"},
     ["x'^2", "y'^2", "exp(y)", "x", "exp(-y)*y'^2", "x^2*exp(y)", "x'*y'", "exp(-2*y)*y'^2", "x'^2*exp(y)"], 2),
    ({"x": "-x/(x^2+y^2)^(3/2)", "y": "-y/(x^2+y^2)^(3/2)"},
     ["x'^2", "y'^2", "x*y'", "y*x'", "1/sqrt(x^2+y^2)", "x'*y'", "x^2", "y^2", "x'^4", "x*y"], 4),
]  # fmt: skip


def found(equations: dict[str, str], candidates: list[str]) -> tuple[tuple[Combination, ...], tuple[Combination, ...]]:
    keys = [monomial_of(text) for text in candidates]
    sampler = _sampler(material(equations), keys)
    return solve_multiplier(sampler, keys, 3).combinations, solve_ansatz(sampler, keys, 3).combinations


@pytest.mark.parametrize(("equations", "candidates", "least"), CASES)
def test_groups_find_what_all_candidates_together_find(
    equations: dict[str, str], candidates: list[str], least: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = [monomial_of(text) for text in candidates]
    assert len(graded(material(equations).analysis.system, keys)) >= least
    in_groups = found(equations, candidates)
    for module in (linear_ansatz, multiplier_ansatz):
        monkeypatch.setattr(module, "graded", lambda _, terms, *__: [list(range(len(terms)))])
    assert found(equations, candidates) == in_groups
    assert any(in_groups)


@pytest.mark.parametrize(("equations", "candidates", "least"), CASES)
def test_groups_hold_each_candidate_once(equations: dict[str, str], candidates: list[str], least: int) -> None:
    groups = graded(material(equations).analysis.system, [monomial_of(text) for text in candidates])
    assert sorted(k for group in groups for k in group) == list(range(len(candidates)))


@pytest.mark.parametrize(
    ("equations", "left", "right"),
    [
        ({"x": "-x"}, "x'^2", "x^2"),  # t has no scale here
        ({"x": "-x^3"}, "x'^2", "x^4"),
        ({"x": "-a*sin(x)"}, "x'^2", "a*cos(x)"),
        ({"x": "-a/x^2-b"}, "a/x", "b*x"),
        ({"x": "x'^2/x"}, "x'*log(x')", "x'*log(x)"),  # their difference scales, neither does alone
        ({"x": "x'^2"}, "exp(-x)*x'^2", "exp(-2*x)*x'^2"),  # e^x forbids that x scales, t does not part these
    ],
)
def test_terms_that_can_be_added_have_one_factor(equations: dict[str, str], left: str, right: str) -> None:
    one, other = factors(material(equations).analysis.system, [monomial_of(left), monomial_of(right)])
    assert one == other


@pytest.mark.parametrize(
    ("equations", "left", "right"),
    [
        ({"x": "-x"}, "x'^2", "x'^3"),
        ({"x": "-x"}, "x'^2", "x*x'"),  # t -> -t
        ({"x": "-x^3"}, "x'^2", "x^2"),
        ({"x": "-a*sin(x)"}, "cos(x)", "sin(x)"),
        ({"x": "0", "y": "0"}, "x'^2", "y'^2"),
    ],
)
def test_terms_of_different_factors_are_told_apart(equations: dict[str, str], left: str, right: str) -> None:
    one, other = factors(material(equations).analysis.system, [monomial_of(left), monomial_of(right)])
    assert one != other


def test_a_root_forbids_the_reflection_of_what_stands_under_it() -> None:
    system = material({"x": "x'^2/x"}).analysis.system
    plain = factors(system, [monomial_of("x'^2"), monomial_of("x'^2*x")])
    rooted = factors(system, [monomial_of("x'^2"), monomial_of("x'^2*x"), monomial_of("x'^2*sqrt(x)")])
    assert plain[0][1] != plain[1][1]
    assert rooted[0][1] == rooted[1][1]


def test_ansaetze_without_further_atoms_have_their_points_in_common() -> None:
    here = material({"x": "-sin(x)"})
    first, second = (_sampler(here, [monomial_of(text)]) for text in ("x'^2", "cos(x)"))
    other = _sampler(here, [monomial_of("log(x)")])
    assert first.points(3) is second.points(3)
    assert other.points(3) is not first.points(3)

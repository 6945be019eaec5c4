"""The nearest systems with a Lagrangian: conditions, projections, and answers through the doors."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from benchmarks.nearest import fit_of
from benchmarks.variational_systems import SYSTEMS, Known, parts_of, sp, terms_of
from inverse_service import check, errors, nearest, solve
from inverse_service.decision.solutions import SolveOptions
from inverse_service.fitting import (
    exact_members,
    fitted as ft,
    multipliers,
    nearest_members,
    special_leaves,
)
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import accepting, nearest_parts


def system_of(equations: dict[str, str]) -> SecondOrderSystem:
    document = {"coordinates": list(equations), "parameters": [], "equations": equations}
    return accepting.to_system(accepting.to_schema(accepting.prepared(document).document))


# q'' = f from L = e^s (q' G q'/2 + A q' - V), by hand: G, (g0, g), f.
KNOWN = [
    ([[1, 0], [0, 1]], [0, 0, 0], {"x": "-2*x + y - 3*x^2*y", "y": "x - y - x^3"}),
    ([[1, 0], [0, 2]], [0, 0, 0], {"x": "-x + (1 + x)*y'", "y": "-y - (1 + x)*x'/2"}),
    ([[1, 1], [1, 3]], [0, 0, 0], {"x": "-3*x + y", "y": "x - y"}),
    ([[0, 1], [1, 0]], [0, 0, 0], {"x": "-x - x'/2", "y": "-y + y'/2"}),
    ([[1, 0], [0, 3]], ["1/5", 0, 0], {"x": "-x*y - x'/5", "y": "-x^2/6 - y'/5"}),
    # L = e^x (x'^2 + y'^2)/2: x'' = -x'^2/2 + y'^2/2, y'' = -x'*y'
    ([[1, 0], [0, 1]], [0, 1, 0], {"x": "(y'^2 - x'^2)/2", "y": "-x'*y'"}),
    # L = e^(x + t) (x'^2 + y'^2)/2
    ([[1, 0], [0, 1]], [1, 1, 0], {"x": "(y'^2 - x'^2)/2 - x'", "y": "-x'*y' - y'"}),
]


@pytest.mark.parametrize(("matrix", "rates", "equations"), KNOWN)
def test_members_of_a_kind_satisfy_its_conditions_exactly(
    matrix: list[list[int]], rates: list[Any], equations: dict[str, str]
) -> None:
    fitted = ft.of_terms(system_of(equations), {})
    conditions = multipliers.fitted_conditions(fitted)
    exact = [[Fraction(value) for value in row] for row in matrix]
    rows = multipliers.linear_conditions(conditions, exact, [Fraction(rate) for rate in rates])
    left = [
        row[0] + sum(a * c for a, c in zip(row[1:], fitted.values, strict=True)) for row in rows
    ]
    assert rows
    assert not any(left)
    wrong = multipliers.linear_conditions(
        conditions, exact, [Fraction(7), *map(Fraction, rates[1:])]
    )
    assert any(
        row[0] + sum(a * c for a, c in zip(row[1:], fitted.values, strict=True)) for row in wrong
    )


def test_the_projection_on_a_linear_kind_is_that_of_least_squares() -> None:
    """f = -dV/dq + B J v with V = a x^2 + b x y + c y^2 + d x^2 y and B = e + h x, fitted directly."""
    equations = {
        "x": "-1.1*x + 0.4*y + 0.7*x*y + 0.9*y' + 0.2*x*y'",
        "y": "0.6*x - 2.3*y + 0.31*x^2 - 1.2*x' - 0.13*x*x'",
    }
    spread = [Fraction(k, 37) for k in range(3, 13)]
    fitted = ft.of_terms(system_of(equations), {})
    fitted = ft.FittedSystem(
        fitted.system, fitted.letters, fitted.names, fitted.values,
        ft.diagonal(spread, True), fitted.fixed, fitted.columns,
    )  # fmt: skip
    columns = np.zeros((10, 6))
    entries = [
        ("x'': x", 0, 1), ("x'': y", 1, 1), ("y'': x", 1, 1), ("y'': y", 2, 1), ("x'': x*y", 3, 2),
        ("y'': x^2", 3, 1), ("x'': y'", 4, 1), ("y'': x'", 4, -1), ("x'': x*y'", 5, 1),
        ("y'': x*x'", 5, -1),
    ]  # fmt: skip
    for name, column, value in entries:
        columns[fitted.names.index(name), column] = value
    weights = 1 / np.array(spread, dtype=float)
    least = np.linalg.lstsq(weights[:, None] * columns, weights * fitted.fitted, rcond=None)[0]
    conditions = multipliers.fitted_conditions(fitted)
    unit = [[Fraction(1), Fraction(0)], [Fraction(0), Fraction(1)]]
    rows = multipliers.linear_conditions(conditions, unit, [Fraction(0)] * 3)
    found = exact_members.projection(rows, fitted)
    assert found is not None
    assert np.abs(np.array(found, dtype=float) - columns @ least).max() < 1e-10


EQUAL = [one for one in SYSTEMS if one.kind == "equal_masses"]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.001, 0.01, 0.05])
@pytest.mark.parametrize("known", EQUAL, ids=[one.name for one in EQUAL])
def test_projections_of_known_systems_are_those_of_least_squares(
    known: Known, noise: float
) -> None:
    """f = -dV/dq + B(q) v by numpy: V and B = -B^T have the terms whose slopes are terms of the fit."""
    fit = fit_of(known, noise, 7)
    document = accepting.to_schema(accepting.prepared(fit.document).document)
    fitted = nearest_parts.fitted_system(document)
    parts = parts_of(known)
    q, v = parts.positions, parts.velocities
    places = {term: row for row, term in enumerate(fit.terms.values())}
    potentials, columns = set(), []
    for _, term in fit.terms.values():
        if not term.has(*v):
            potentials.update(sp.integrate(term, one).as_coeff_Mul()[1] for one in q)
    fields = {term / rate for _, term in fit.terms.values() for rate in v if term.has(rate)}
    forces = [[-sp.diff(one, position) for position in q] for one in potentials]
    for one in fields:
        for i, j in itertools.combinations(range(len(q)), 2):
            force = [sp.S(0)] * len(q)
            force[i], force[j] = one * v[j], -one * v[i]
            forces.append(force)
    for force in forces:
        column, whole = np.zeros(len(places)), True
        for place, f in enumerate(force):
            for term, value in terms_of(f).items():
                row = places.get((place, term))
                whole = whole and row is not None
                if row is not None:
                    column[row] = float(value)
        if whole:  # a letter whose terms the fit has
            columns.append(column)
    scale = 1 / np.array([float(one) for one in fit.document["nearest"]["errors"].values()])
    table = np.array(columns).T
    given = np.array([float(one) for one in fit.fitted.values()])
    least = table @ np.linalg.lstsq(scale[:, None] * table, scale * given, rcond=None)[0]
    conditions = multipliers.fitted_conditions(fitted)
    n = len(q)
    unit = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
    found = exact_members.projection(
        multipliers.linear_conditions(conditions, unit, [Fraction(0)] * (1 + n)), fitted
    )
    assert found is not None
    by_name = dict(zip(fitted.names, map(float, found), strict=True))
    assert np.abs(np.array([by_name[name] for name in fit.terms]) - least).max() < 1e-10


@pytest.mark.parametrize(
    ("curve", "point", "is_reached"),
    [
        ({(0, 2): 1, (2, 0): -1, (0, 0): -4}, (1.52, (4 + 1.52**2) ** 0.5), True),
        ({(2, 0): 2, (0, 2): 3, (0, 0): -5}, (-(1.25**0.5), (5 / 6) ** 0.5), True),
        ({(2, 0): 1, (1, 1): 1, (0, 2): 1, (1, 0): -1, (0, 1): -2}, (1.0, (1 + 5**0.5) / 2 - 0.618034), True),
        ({(2, 0): 1, (0, 2): 1, (0, 0): -3}, (1.0, 2**0.5), False),  # no rational point
        # y^2 = x^2 (x + 1), and its image under (x, y) -> (x - 2, y - 1/3): a double point.
        ({(0, 2): 1, (2, 0): -1, (3, 0): -1}, (0.25, 0.25 * 1.25**0.5), True),
        ({(0, 2): 1, (0, 1): "-2/3", (0, 0): "37/9", (3, 0): -1, (2, 0): 5, (1, 0): -8},
         (2.5, 1 / 3 + 0.5 * 1.5**0.5), True),
        # (x + y)(1 + (x - y)^2) = 8, linear in x + y alone: a double point at infinity.
        ({(3, 0): 1, (2, 1): -1, (1, 2): -1, (0, 3): 1, (1, 0): 1, (0, 1): 1, (0, 0): -8},
         ((8 / 1.25 + 0.5) / 2, (8 / 1.25 - 0.5) / 2), True),
        ({(3, 0): 1, (0, 3): 1, (0, 0): -1}, (0.5, 0.875 ** (1 / 3)), False),  # Fermat: x y = 0 alone
    ],
)  # fmt: skip
def test_a_rational_curve_has_exact_members_beside_a_point(
    curve: dict[tuple[int, int], int | str], point: tuple[float, float], is_reached: bool
) -> None:
    """They satisfy the equation in rational numbers, also where it is linear in no coefficient."""
    equation = special_leaves.Polynomial(tuple(curve), tuple(map(Fraction, curve.values())))
    chart = special_leaves._chart([equation], np.array(point))
    assert (chart is not None) is is_reached
    if chart is None:
        return
    free, member = chart
    tried = [Fraction(value).limit_denominator(10**4) for value in point]
    found = member(tuple(tried))
    assert free == [0, 1]
    assert found is not None
    assert equation.exact(found) == 0
    assert max(abs(a - b) for a, b in zip(found, tried, strict=True)) < Fraction(1, 100)


@pytest.mark.slow
def test_a_fitted_system_and_its_nearest_ones_are_checked() -> None:
    """Springs with masses 1:2: natural needs y'' to have no friction, and equal masses b = c."""
    result = nearest("x'' = -1.02*x + 0.51*y; y'' = 0.248*x - 0.99*y - 0.01*y'", errors=0.02)
    assert result.verdict == "not_variational"
    first = result["nearest"][0]
    assert first["kind"] == "natural"
    assert (first["degrees"], first["within"]) == (1, True)
    assert first["distance"] == pytest.approx(0.5, rel=1e-3)
    for part in result["nearest"]:
        assert part["chi2"] == pytest.approx(part["distance"] ** 2)
        assert part["distance"] >= part["least"] * (1 - 1e-9)
        timed = part["result"].get("with_time") or part["result"]
        assert "valid" in (part["result"]["checked"], timed["checked"])
    equal = next(part for part in result["nearest"] if part["kind"] == "equal_masses")
    assert equal["projection"]
    assert equal["distance"] ** 2 == pytest.approx((0.131**2 * 2 + 0.01**2) / 0.02**2, rel=1e-6)


@pytest.mark.parametrize(
    ("least", "distance", "free", "are_errors", "is_offered"),
    [
        (0.3, 0.319, 2, False, True),  # without errors, 2 % of the sizes more
        (0.3, 0.321, 2, False, False),
        (1.0, 7**0.5 - 0.01, 2, True, True),  # 1 + 2 + 2 sqrt(2*2) of chi-square
        (1.0, 7**0.5 + 0.01, 2, True, False),
    ],
)
def test_fractions_are_offered_where_the_true_member_is_expected(
    least: float, distance: float, free: int, are_errors: bool, is_offered: bool
) -> None:
    plain = ft.of_terms(system_of({"x": "-x"}), {})
    fitted = replace(plain, metric=replace(plain.metric, are_errors=are_errors))
    assert nearest_members.is_offered(distance, least, free, fitted) is is_offered


@pytest.fixture(scope="module")
def spring() -> dict[str, Any]:
    """The result about a spring with a friction that is within its error of 0."""
    result = solve(
        {
            "equations": {"x": "-k*x - c*x'"},
            "parameters": {"k": "1.02", "c": "0.003"},
            "nearest": {"errors": {"k": "0.02", "c": "0.01"}},
            "first_integrals": False,
        }
    )
    return dict(json.loads(json.dumps(result)))


def test_what_moved_says_which_system_the_member_is(spring: dict[str, Any]) -> None:
    natural = next(part for part in spring["nearest"] if part["kind"] == "natural")
    assert natural["moved"] == {"c": {"from": "0.003", "to": "0", "sigmas": pytest.approx(-0.3)}}
    assert natural["result"]["system"]["equations"] == {"x": "-1.02*x"}
    assert natural["constraints"] == {
        "coefficients": ["k", "c"], "matrix": [["0", "1"]], "values": ["0"]
    }  # fmt: skip


def of_kinds(fitted: ft.FittedSystem) -> list[nearest_members.Member]:
    """The nearest members in their order, without those on leaves."""
    found = nearest_members.of_kinds(fitted, SolveOptions(), float("inf"), False)
    members = [one for one in found if isinstance(one, nearest_members.Member)]
    return [*nearest_members.by_distance(nearest_members.distinct(members, fitted), fitted)]


@pytest.mark.parametrize(
    "equations",
    [
        "x'' = -x; y'' = -y",
        "x'' = -2*x; y'' = -3*y",
        pytest.param("x'' = -2*x; y'' = -3*y; z'' = -z", marks=pytest.mark.slow),
    ],
)
def test_nothing_is_asked_of_systems_whose_terms_are_all_allowed(equations: str) -> None:
    """No value of their coefficients breaks a condition: they are their own nearest ones."""
    result = solve({"equations": equations, "nearest": True})
    found = [(one["kind"], one["distance"], one["equations"]) for one in result["nearest"]]
    assert found == [("equal_masses", 0.0, [])]
    assert check(result)["verdict"] == "valid"


def test_three_coordinates_are_parted_in_each_of_five_ways() -> None:
    fitted = ft.of_terms(system_of({name: f"-{name}" for name in "xyz"}), {})
    found = [*multipliers._partitions(3, fitted)]
    assert len({frozenset(map(frozenset, parts)) for parts in found}) == len(found) == 5
    assert all(sorted(q for part in parts for q in part) == [0, 1, 2] for parts in found)


def test_an_exact_member_has_the_distance_zero_of_its_smallest_kind() -> None:
    fitted = ft.of_terms(system_of({"x": "-1.5*x + 0.5*y", "y": "0.25*x - y"}), {})
    first = of_kinds(fitted)[0]
    assert first.kind == "natural"
    assert first.distance == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("distance", "degrees", "chance"),
    [(1.0, 1, 0.31731), (3.0, 1, 0.0026998), (2.0, 2, 0.135335), (4.0, 16, 0.45296), (0.0, 0, 1.0)],
)
def test_chances_are_those_of_tables_of_chi_square(
    distance: float, degrees: int, chance: float
) -> None:
    assert nearest_members.chance(distance, degrees) == pytest.approx(chance, rel=1e-4)


def test_a_chance_is_a_number_that_results_can_hold() -> None:
    """e^(-d^2/2) for two equations: 7e-318 at a distance of 38.2 errors, which no reader of results accepts."""
    assert nearest_members.chance(37.0, 2) == pytest.approx(np.exp(-(37.0**2) / 2))
    assert nearest_members.chance(38.21589637091685, 2) == 0


SPRINGS = {"x": "-a*x + y", "y": "x - b*y"}


@pytest.mark.parametrize(
    ("question", "pointer"),
    [
        ({"errors": {"c": "0.1"}}, "/nearest/errors/c"),
        ({"errors": {"a": "-0.1"}}, "/nearest/errors"),
        ({"errors": ["0.1"]}, "/nearest/errors"),
        ({"errors": 0.1, "weights": 3}, "/nearest"),
        ({"covariance": [["1", "2"], ["2", "1"]]}, "/nearest/covariance"),
        ({"covariance": [["1", "0.5"], ["0", "1"]]}, "/nearest/covariance"),
        ({"covariance": [["1", "0"]]}, "/nearest/covariance"),
        ({"library": ["x^2"]}, "/nearest/library"),
        ({"errors": "much"}, "/nearest/errors"),
        ({"errors": {"a": None}}, "/nearest/errors/a"),
        ({"errors": {"a": "0.1"}}, "/nearest/errors"),  # that of b is missing
        ({"errors": {}}, "/nearest/errors"),
        ({"errors": True}, "/nearest/errors"),
        ("much", "/nearest"),
        # Floating-point numbers hold no distances in such errors.
        ({"errors": "1e-140"}, "/nearest"),
        ({"errors": "1e140"}, "/nearest"),
        (
            {"covariance": [["1", "0.99999999999999999999"], ["0.99999999999999999999", "1"]]},
            "/nearest/covariance",
        ),
    ],
)
def test_a_wrong_question_is_refused_at_its_place(question: dict[str, Any], pointer: str) -> None:
    document = {"equations": SPRINGS, "parameters": {"a": 2, "b": "3.1"}, "nearest": question}
    with pytest.raises(errors.InputError) as refusal:
        solve(document)
    assert refusal.value.pointer == pointer


def test_a_system_without_coefficients_is_refused() -> None:
    with pytest.raises(errors.InputError, match="no coefficient that could move") as refusal:
        nearest("x'' = 0")
    assert refusal.value.pointer == "/equations"


@pytest.mark.parametrize(
    ("question", "said"),
    [
        ({"covariance": np.zeros((2, 2))}, "positive definite"),
        ({"errors": np.zeros(2)}, "positive numbers"),
        ({"weights": np.float64(-1)}, "positive numbers"),
    ],
)
def test_numbers_may_be_arrays(question: dict[str, Any], said: str) -> None:
    with pytest.raises(errors.InputError, match=said):
        nearest("x'' = -x - x'", coefficients=["x'': x", "x'': x'"], **question)


def test_letters_without_numbers_are_asked_back() -> None:
    document = {"equations": SPRINGS, "parameters": {"a": 2, "b": None}, "nearest": True}
    with pytest.raises(errors.InputError, match="give `b` a value"):
        solve(document)


def test_the_check_finds_a_wrong_distance_and_another_system(spring: dict[str, Any]) -> None:
    found = check(spring)
    assert found["verdict"] == "valid"
    assert "/nearest/0/distance" not in found["not_checked"]
    wrong = json.loads(json.dumps(spring))
    wrong["nearest"][0]["distance"] /= 2
    wrong["nearest"][1]["moved"]["c"] = {"from": "0.003", "to": "0.001", "sigmas": -0.2}
    assert {"/nearest/0/distance", "/nearest/1/moved"} <= fields(check(wrong))


def fields(answer: dict[str, Any]) -> set[str]:
    assert answer["verdict"] == "invalid"
    return {one["field"] for one in answer["contradictions"]}


def test_simple_fractions_are_on_the_set_itself() -> None:
    """4 c - 4 a + b^2 = 0, linear in a and c: two of three numbers are simple, and the third one follows exactly."""
    fitted = ft.of_terms(system_of({"x": "-1.02*x - 0.24*x'", "y": "-1.03*y"}), {})
    assert fitted.names == ("x'': x", "x'': x'", "y'': y")
    curve = special_leaves.Polynomial(
        ((0, 0, 1), (1, 0, 0), (0, 2, 0)), (Fraction(4), Fraction(-4), Fraction(1))
    )
    away = special_leaves.Polynomial(((0, 1, 0),), (Fraction(1),))
    point = np.array([-1.0176, -0.24, -1.032])
    found = special_leaves._nice(
        [curve], [away], point, 0.01, fitted, lambda d, _, free: free == 2 and d < 0.2
    )
    assert found is not None
    assert curve.exact(found) == 0
    assert found[1]
    assert max(value.denominator for value in found) <= 400


def test_the_member_on_a_curve_is_the_nearest_point_of_it() -> None:
    """x'' = -3 x, y'' = -y and a^2 + b^2 = 4: the nearest point of the circle is 2 (-3, -1)/sqrt(10),
    the farthest one is stationary, too.
    """
    fitted = ft.of_terms(system_of({"x": "-3*x", "y": "-y"}), {})
    fitted = replace(fitted, metric=ft.diagonal([Fraction(1), Fraction(1)], True))
    circle = special_leaves.Polynomial(((2, 0), (0, 2), (0, 0)), tuple(map(Fraction, (1, 1, -4))))
    rule = SimpleNamespace(equation=circle)
    leaf = SimpleNamespace(leaf=SimpleNamespace(rules=[rule], nonzero=[]))
    with mock.patch.object(special_leaves, "polynomial_of", lambda _, __, one: one):
        found = special_leaves.nearest_on(leaf, fitted, 8, 1)  # type: ignore[arg-type]
    assert found is not None
    assert found.distance == pytest.approx(np.sqrt(10) - 2, rel=1e-9)
    assert found.coefficients == pytest.approx(np.array([-3, -1]) * 2 / np.sqrt(10), rel=1e-9)


@pytest.mark.parametrize(("are_errors", "is_near"), [(True, True), (False, False)])
def test_a_member_is_near_in_the_unit_of_the_distance(are_errors: bool, is_near: bool) -> None:
    """A ten-thousandth of a standard error is nothing; of the size of a coefficient it counts."""
    metric = ft.diagonal([Fraction(1)], are_errors)
    fitted = replace(ft.of_letters(system_of({"x": "-x"}), {}), metric=metric)
    assert exact_members.is_close(1e-4, 0.0, fitted) is is_near


def test_a_zero_has_the_middle_size_of_its_equation_whatever_the_signs() -> None:
    values = [Fraction(one) for one in (-8, 4, -2, 0, 100, 0)]
    metric = ft.relative(values, [0, 0, 0, 0, 1, 1])
    assert [row[k] for k, row in enumerate(metric.covariance)] == [64, 16, 4, 16, 10_000, 10_000]
    metric = ft.relative([Fraction(one) for one in (-8, -2, 0)], [0, 0, 0])
    assert metric.covariance[2][2] == 64

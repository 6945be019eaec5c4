"""The factor e^(ct) of a Lagrangian follows from the divergence of f."""

from __future__ import annotations

from fractions import Fraction

import pytest

from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.integrating import (
    divergence_factor,
    hidden_damping,
    is_free_of_divergence,
)
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.reading import read_system
from inverse_service.service.documents.documents import solve_document
from tests.inverse_problem.search.given import material, monomial_of

DAMPED = [
    ({"x": "-x-x'"}, "exp(t)"),
    ({"x": "-x-2*a*x'"}, "exp(2*a*t)"),
    ({"x": "-x+x'/3"}, "exp(-t/3)"),
    ({"x": "-x-2*x*y-a*x'", "y": "-y-x^2+y^2-a*y'"}, "exp(a*t)"),
    ({"x": "-x'^2/x - 3*x' - x"}, "exp(3*t)"),
    ({"x": "-x^3 - x'*a/b"}, "exp(a/b*t)"),
]


@pytest.mark.parametrize(("equations", "factor"), DAMPED)
def test_a_damped_system_has_its_factor(equations: dict[str, str], factor: str) -> None:
    found = divergence_factor(material(equations, with_time=True), 3)
    assert found is not None
    assert found == monomial_of(factor)


@pytest.mark.parametrize(
    "equations",
    [
        {"x": "-x"},
        {"x": "-sin(x)*x'^2"},
        {"x": "-x-2*x*y", "y": "-y-x^2+y^2"},
        {"x": "-x*x'^3"},
        {"x": "-x-(a+b)*x'"},
        # Gamma(log x - log x') is the constant rate: no e^(ct) is needed
        {"x": "x'^2/x - a*x'"},
    ],
)
def test_without_one_constant_damping_there_is_none(equations: dict[str, str]) -> None:
    assert divergence_factor(material(equations, with_time=True), 3) is None


def test_the_rate_is_shared_by_all_coordinates() -> None:
    """det g grows as e^(n c t) with n c the negative divergence, however it is spread."""
    found = divergence_factor(material({"x": "-x", "y": "-y-a*y'"}, with_time=True), 3)
    assert found == monomial_of("exp(a*t/2)")


def test_two_rates_are_no_single_factor() -> None:
    assert divergence_factor(material({"x": "-x-a*x'", "y": "-y-b*y'"}, with_time=True), 3) is None


def test_an_atom_of_a_parameter_in_the_divergence_has_a_value() -> None:
    """exp(-a) stands in the divergence among the constants and nowhere among the letters."""
    found = divergence_factor(material({"x": "exp(-a)*y'*A(x)*x'", "y": "0"}, with_time=True), 3)
    assert found is None


def test_a_rate_of_unwieldy_numbers_is_not_taken() -> None:
    assert divergence_factor(material({"x": "-x-1234567/7654321*x'"}, with_time=True), 3) is None


@pytest.mark.parametrize(
    ("equations", "free"),
    [
        ({"x": "-sin(x)"}, True),
        ({"x": "-x'"}, False),
        ({"x": "a*x'*y", "y": "-a*y*y'"}, True),
        ({"x": "x'*y'", "y": "x^2"}, False),
        ({"x": "1/(sin(x)^2+cos(x)^2-1)"}, False),
    ],
)
def test_the_divergence_is_seen_to_vanish_or_not(equations: dict[str, str], free: bool) -> None:
    analysis = analyze(read_system(list(equations), equations, ["a"]))
    assert is_free_of_divergence(analysis, 3) is free


def test_where_the_divergence_has_no_value_there_is_no_factor() -> None:
    assert divergence_factor(material({"x": "-x' + 0*x/(sin(x)^2+cos(x)^2-1)"}, with_time=True), 3) is None


@pytest.mark.parametrize(
    ("equations", "rate"),
    [
        ({"x": "(x'^3 - x'^2 - x'*y')/(x' + y') - sin(y)", "y": "x'^2 - y'"}, 1),
        ({"x": "-3*x'/2 + sqrt(x'^2 + y'^2)*x'", "y": "-3*y'/2"}, Fraction(3, 2)),
        ({"x": "-x'", "y": "-2*y'"}, None),
        ({"x": "x'^3 - x'", "y": "-y'"}, None),
        ({"x": "x'*y'", "y": "-x"}, None),
        ({"x": "-x*x' - x'", "y": "-x*y' - y'"}, None),
    ],
)
def test_a_common_damping_beside_a_quotient_of_velocities_is_seen(
    equations: dict[str, str], rate: Fraction | None
) -> None:
    assert hidden_damping(analyze(read_system(list(equations), equations))) == rate


@pytest.mark.slow
def test_a_damped_quotient_of_velocities_is_found() -> None:
    """e^t (x'^2 sin y + y'^3/x'), its damping hidden in sums over one denominator."""
    given = solve_document({"lagrangian": "exp(t)*(x'^2*sin(y) + y'^3/x')", "coordinates": ["x", "y"]}, SolveOptions())
    equations = {name: formula["text"] for name, formula in given["equations"].items()}
    result = solve_document({"equations": equations}, SolveOptions(time_limit=60))
    assert "exp(t)" in result["with_time"]["lagrangian"]["text"]


R = "sqrt(x^2 + y^2)"


@pytest.mark.parametrize(
    ("phi", "slope"),
    [("1 + 1/r", "-1/(r^2*(r + 1))"), ("1 + r", "1/r/(1 + r)"), ("r/(1 + r)^2", "(1/r - 2/(1 + r))/r")],
)
def test_a_conformal_metric_may_hold_a_root_among_sums(phi: str, slope: str, caplog: pytest.LogCaptureFixture) -> None:
    """Geodesics of phi(r) (dx^2 + dy^2), slope = phi'/(r phi), as those of Jacobi for the Kepler problem."""
    h = f"({slope.replace('r', R)})"
    equations = {q: f"-{h}*(x*x' + y*y')*{q}' + {h}*{q}*(x'^2 + y'^2)/2" for q in "xy"}
    result = solve_document({"coordinates": ["x", "y"], "equations": equations}, SolveOptions())
    assert result["lagrangian"]["family"] == "one function times a constant matrix"
    assert not caplog.records  # nothing was proposed that the checker refuses

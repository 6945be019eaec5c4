"""The series written for people is a regular solution too: it is put before the checker."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import pytest

from inverse_service import bounds
from inverse_service.certificate.checker import check_certificate
from inverse_service.expressions.tree import Symbol, Velocity
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import Analysis, analyze
from inverse_service.inverse_problem.decision.deciding import Decision, decide
from inverse_service.inverse_problem.decision.power_series import RationalSeries, rational_series
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system

PRIME = 2**61 - 1
SYSTEMS = [
    ({"x": "-x+(1-x^2)*x'"}, False, 5),
    ({"x": "-x+(1-x^2)*x'"}, True, 2),
    ({"x": "-a*x'^3 - x'*x/(1+x^2)"}, False, 3),
    ({"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, False, 3),
    ({"x": "0", "y": "-x*x'*y'/(1+x^2)"}, False, 2),
]


def found(equations: dict[str, str], with_time: bool, order: int) -> tuple[Analysis, Decision, RationalSeries]:
    analysis = analyze(read_system(list(equations), equations, ["a"]))
    decision = decide(analysis.system, with_time, analysis=analysis)
    series = rational_series(analysis, with_time, order, decision.order - 1 - decision.degree)
    assert series is not None
    return analysis, decision, series


def document(series: RationalSeries, prime: int | None) -> dict[str, Any]:
    names = {s: f"{s.coordinate}'" if isinstance(s, Velocity) else s.name for s in series.point}
    terms = [[list(index), str(value)] for index, value in series.coefficients.items()]
    point = {names[s]: value for s, value in series.point.items()}
    return {"order": series.order, "point": point, "prime": prime, "terms": terms}


@pytest.mark.parametrize(("equations", "with_time", "order"), SYSTEMS)
@pytest.mark.parametrize("prime", [PRIME, None])
def test_the_checker_confirms_it_modulo_a_prime_and_in_real_numbers(
    equations: dict[str, str], with_time: bool, order: int, prime: int | None
) -> None:
    analysis, decision, series = found(equations, with_time, order)
    certificate = certify.of_decision(analysis, decision) | {"series": document(series, prime)}
    checked = check_certificate(certificate, seed=3)
    assert checked.verdict == "valid", checked.reasons
    assert "The series solves the rows." in checked.reasons[0]


def test_a_changed_coefficient_is_refused() -> None:
    analysis, decision, series = found(*SYSTEMS[0])
    wrong = document(series, PRIME)
    wrong["terms"][2][1] = "7/3"
    certificate = certify.of_decision(analysis, decision)
    assert check_certificate(certificate | {"series": wrong}, seed=3).verdict == "invalid"


def test_a_longer_series_begins_with_the_shorter_one() -> None:
    _, _, short = found(SYSTEMS[0][0], False, 2)
    _, _, long = found(SYSTEMS[0][0], False, 4)
    assert dict(short.coefficients) == {i: a for i, a in long.coefficients.items() if sum(i) <= 4}


@pytest.mark.parametrize("force", ["-sin(x)", "-sqrt(x)", "-pi*x"])
def test_systems_that_are_not_rational_over_the_rationals_have_none(force: str) -> None:
    assert rational_series(analyze(read_system(["x"], {"x": force})), False, 2) is None


def test_the_explanation_shows_it_where_no_closed_form_was_found() -> None:
    system = read_system(["x"], SYSTEMS[0][0])
    answer = solve(system, SolveOptions(time_dependent=False)).autonomous
    assert answer is not None
    assert answer.lagrangian is None
    (step,) = [step for step in answer.explanation if step.text.startswith("Near x = 2, x' = 3")]
    assert step.latex.startswith(r"L = \frac{\left(\dot{x} - 3\right)^{2}}{2}")
    assert step.latex.endswith(r"\dots")


def series_of(equations: dict[str, str], order: int = 2, spare: int = 0) -> RationalSeries | None:
    return rational_series(analyze(read_system(list(equations), equations)), False, order, spare)


@pytest.mark.parametrize(
    "equations",
    [
        {"x": "-x'/(x-2)"},
        {"x": "-x'/((x-2)*(x-4)) - x/((x-3)*(x'-4))"},
        # four orders about (2, 3) this is two separate oscillators, which have more Lagrangians
        {"x": "-x-4*(x-2)^3*(y-3)^4", "y": "-2*y-4*(x-2)^4*(y-3)^3"},
    ],
)
def test_a_point_that_is_singular_or_special_is_left_for_the_next(equations: dict[str, str]) -> None:
    found = series_of(equations)
    assert found is not None
    (first,) = [value for symbol, value in found.point.items() if symbol == Symbol("x")]
    assert first > 2


def test_there_is_none_where_all_points_are_singular() -> None:
    factors = "*".join(f"(x-{k})" for k in range(2, 2 + bounds.ATTEMPTS))
    assert series_of({"x": f"1/({factors})"}) is None


def test_there_is_none_without_a_regular_solution() -> None:
    assert series_of({"x": "x^2+y^2", "y": "0"}) is None


def test_coefficients_of_many_digits_are_found_whole() -> None:
    """For x'' = a x'^2 there is L = exp(-2 a x) x'^2/2, cut off: its derivatives are powers of 2 a."""
    rate = Fraction(10**20, 3)
    found = series_of({"x": "10^20/3*x'^2"}, order=3)
    assert found is not None
    index = {symbol: k for k, symbol in enumerate(found.variables)}
    value, slope = [0, 0], [0, 0]
    value[index[Velocity("x")]] = slope[index[Velocity("x")]] = 2
    slope[index[Symbol("x")]] = 1
    ratio = found.coefficients[tuple(slope)] / found.coefficients[tuple(value)]
    assert abs(ratio.numerator) >= 10**20
    assert ratio.denominator % rate.denominator == 0


def test_numbers_beyond_all_primes_are_not_guessed() -> None:
    assert series_of({"x": "10^60/3*x'^2"}, order=3) is None

"""A power series is a regular solution of the rows, and the beginning of longer ones."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from inverse_service.certificate import checker
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import SolveOptions
from inverse_service.field import tower
from inverse_service.linear_pde import equations as pde
from inverse_service.mechanics import second_order_system
from inverse_service.solving import solving
from inverse_service.statements.questions import PLAIN, TIMED, Question, narrowest

HENON_HEILES = {"x": "-x-2*x*y", "y": "-y-x^2+y^2"}
VAN_DER_POL = {"x": "-x+(1-x^2)*x'"}
SYSTEMS = [
    (VAN_DER_POL, (), False),
    (VAN_DER_POL, (), True),
    (HENON_HEILES, (), False),
    ({"x": "-x-2*x*y-x'", "y": "-y-x^2+y^2-y'"}, (), True),
    ({"x": "a*pi*x'^2/x - b*x^3"}, ("a", "b"), False),
    ({"x": "-t*x*x'^2 - 1/x"}, (), True),
    ({"x": "0", "y": "x'*y'/x", "z": "-x'*z'/(1+x)"}, (), False),
    ({"x": "-2*x-y", "y": "-x-a*y", "z": "-z", "w": "-w*w'^2/(1+w^2)"}, ("a",), True),
]


def decided(
    equations: dict[str, str], parameters: tuple[str, ...], with_time: bool
) -> tuple[deciding.Analysis, deciding.Decision]:
    system = second_order_system.read_system(list(equations), equations, parameters)
    analysis = deciding.analyze(system)
    return analysis, deciding.decide(system, narrowest(with_time), analysis=analysis)


def certificate(
    equations: dict[str, str], parameters: tuple[str, ...], with_time: bool, order: int
) -> dict[str, Any]:
    analysis, decision = decided(equations, parameters, with_time)
    return certify.of_decision(analysis, decision, series_order=order)


@pytest.mark.slow
@pytest.mark.parametrize(("equations", "parameters", "with_time"), SYSTEMS)
@pytest.mark.parametrize("order", [1, 3])
def test_the_checker_confirms_the_series(
    equations: dict[str, str], parameters: tuple[str, ...], with_time: bool, order: int
) -> None:
    found = certificate(equations, parameters, with_time, order)
    assert found["series"]["order"] == order
    checked = checker.check_certificate(found, seed=3)
    assert checked.verdict == "valid", checked.reasons
    assert "The series solves the" in checked.reasons[0]


def test_a_changed_coefficient_is_refused() -> None:
    right = certificate(HENON_HEILES, (), False, 2)
    assert checker.check_certificate(right, seed=3).verdict == "valid"
    for k in range(len(right["series"]["terms"])):
        wrong = copy.deepcopy(right)
        wrong["series"]["terms"][k][1] = str(int(wrong["series"]["terms"][k][1]) + 1)
        assert checker.check_certificate(wrong, seed=3).verdict == "invalid"


def test_another_point_or_system_is_refused() -> None:
    for path, value in (("x", "5"), ("x'", "7")):
        wrong = certificate(VAN_DER_POL, (), False, 3)
        wrong["series"]["point"][path] = value
        assert checker.check_certificate(wrong, seed=3).verdict == "invalid"


def test_a_series_without_its_first_terms_is_refused() -> None:
    wrong = certificate(VAN_DER_POL, (), False, 3)
    wrong["series"]["terms"] = [term for term in wrong["series"]["terms"] if sum(term[0]) > 2]
    assert checker.check_certificate(wrong, seed=3).verdict == "invalid"


def test_a_series_that_is_prolonged_far_enough_continues() -> None:
    """Its terms of low degree satisfy the consequences that rows of higher order have on them."""
    analysis, decision = decided(HENON_HEILES, (), False)
    spare = decision.order - 1 - decision.degree
    assert spare > 0
    series = deciding.regular_series(analysis, PLAIN, 1, seed=5, spare=spare)
    longer = deciding.prolonged(analysis, tower.draw_point(analysis.tower, 5), PLAIN, 4)
    indices = [
        index for degree in range(5) for _, index in pde.unknown_names(longer.unknowns, degree)
    ]
    values = {tuple(index): int(value) for index, value in series["terms"]}
    assert tower.draw_point(analysis.tower, 5).prime == series["prime"]
    for row in longer.echelon.rows_within(0, longer.width(1)).values():
        assert (
            sum(value * values.get(indices[k], 0) for k, value in row.items()) % series["prime"]
            == 0
        )


@pytest.mark.parametrize("question", [PLAIN, TIMED])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_unknowns_are_counted_right(n: int, question: Question) -> None:
    equations = {name: f"-{name}" for name in "xyz"[:n]}
    analysis = deciding.analyze(second_order_system.read_system(list(equations), equations))
    prolongation = deciding.prolonged(analysis, tower.draw_point(analysis.tower, 1), question, 3)
    assert [deciding.count_coefficients(n, question, order) for order in range(4)] == [
        prolongation.width(order) for order in range(4)
    ]


@pytest.mark.parametrize("force", ["sin(x)", "sqrt(x)", "exp(x')", "x^(1/3)", "log(x)*x'", "A(x)"])
def test_only_rational_systems_have_a_series(force: str) -> None:
    analysis = deciding.analyze(
        second_order_system.read_system(["x"], {"x": force}, (), {"A": ["x"]})
    )
    assert not deciding.is_rational(analysis)
    with pytest.raises(ValueError, match="rational"):
        deciding.regular_series(analysis, PLAIN, 2, seed=1)
    decision = deciding.decide(analysis.system, PLAIN, analysis=analysis)
    assert "series" not in certify.of_decision(analysis, decision)


def test_a_long_series_is_cut_to_a_bearable_order() -> None:
    equations = {name: f"-{name}" for name in "xyzw"}
    analysis, decision = decided(equations, (), True)
    series = certify.of_decision(analysis, decision, series_order=8)["series"]
    assert (
        deciding.count_coefficients(4, TIMED, series["order"])
        <= 5_000
        < deciding.count_coefficients(4, TIMED, series["order"] + 1)
    )


@pytest.mark.slow
def test_where_no_closed_form_is_found_the_series_has_the_order_asked_for() -> None:
    system = second_order_system.read_system(["x"], VAN_DER_POL)
    answer = solving.solve(system, SolveOptions(time_dependent=False, series_order=5)).main
    assert answer is not None
    assert answer.verdict == "variational"
    assert answer.lagrangian is None
    assert answer.certificate is not None
    assert answer.certificate["series"]["order"] == 5
    assert answer.checked == "valid"

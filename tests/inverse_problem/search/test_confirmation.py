"""A Lagrangian of ours that the checker refuses is logged, and the search goes on without it."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from inverse_service.certificate.checker import CheckResult, check_certificate
from inverse_service.inverse_problem import confirming
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.reading import read_system


def test_a_refused_lagrangian_is_logged_and_the_next_one_taken(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[Any] = []

    def first_refused(certificate: Any, **options: Any) -> CheckResult:
        seen.append(certificate)
        return CheckResult("invalid", ("made up",)) if len(seen) == 1 else check_certificate(certificate, **options)

    monkeypatch.setattr(confirming, "check_certificate", first_refused)
    with caplog.at_level(logging.WARNING):
        answer = solve(read_system(["x"], {"x": "-x"}), SolveOptions(time_dependent=False)).autonomous
    assert answer is not None
    assert answer.checked == "valid"
    assert answer.lagrangian is not None
    assert "refused" in caplog.text
    assert "made up" in caplog.text


def test_a_square_in_a_denominator_is_seen_as_one() -> None:
    """The potential of 1/(x + y)^2 is 1/(x + y), not a root of the square with a sign of its own."""
    force = "1/(x^2 + 2*x*y + y^2)"
    for seed in range(3):
        options = SolveOptions(time_dependent=False, seed=seed)
        answer = solve(read_system(["x", "y"], {"x": force, "y": force}), options).autonomous
        assert answer is not None
        assert answer.lagrangian is not None
        assert not answer.lagrangian.positive


@pytest.mark.slow
def test_a_sum_of_a_parameter_and_velocities_is_no_constant_to_divide_by(caplog: pytest.LogCaptureFixture) -> None:
    """(c^2 - v^2)^(1/2) had been taken out of L like a power of c, and the checker had refused what was left."""
    root, moved = "(c^2 - x'^2 - y'^2)^(1/2)", "(x*x' + y*y')/c^2"
    equations = {"x": f"{root}*(x'*{moved} - x)", "y": f"{root}*(y'*{moved} - y)"}
    with caplog.at_level(logging.WARNING):
        answer = solve(read_system(["x", "y"], equations, ["c"]), SolveOptions(time_dependent=False)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert caplog.text == ""

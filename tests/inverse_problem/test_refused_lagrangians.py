"""A Lagrangian that the checker refused is logged, counted and never shown to it again; numbers of any size pass it."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from inverse_service import check, solve
from inverse_service.certificate.checker import CheckResult
from inverse_service.inverse_problem import confirming, solving
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.reading import read_system


@pytest.mark.slow
def test_a_refused_lagrangian_is_an_event_not_a_die(monkeypatch: pytest.MonkeyPatch, caplog: Any) -> None:
    """A checker that refuses every Lagrangian but none twice the same: each is shown once."""
    right, seen = confirming.check_certificate, list[str]()

    def refusing(certificate: Any, **options: Any) -> CheckResult:
        if certificate["kind"] != "lagrangian":
            return right(certificate, **options)
        seen.append(f"{certificate['question']} {certificate['lagrangian']}")
        return CheckResult("invalid", ("refused",))

    monkeypatch.setattr(confirming, "check_certificate", refusing)
    system = read_system(["x", "y"], {"x": "-x", "y": "-2*y"})
    with caplog.at_level(logging.WARNING):
        found = solving.solve(system, SolveOptions(time_limit=20.0))
    assert found.autonomous is not None
    assert found.autonomous.lagrangian is None
    assert len(seen) == len(set(seen)) == found.provenance["refused_lagrangians"]
    assert "refused" in caplog.text


@pytest.mark.slow
@pytest.mark.parametrize(
    "equations",
    [
        {"x": "-sin(x)-1.1e-68*y'", "y": "-sin(y)+1.1e-68*x'"},
        {"x": "y'-sin(x)", "y": "-exp(-150)*x'-2*y"},
        {"x": "-1e70*sin(x)+y", "y": "-1e70*sin(y)+x'"},
        {"x": "-exp(-1000*x^2)*y'", "y": "-exp(-1000*x^2)*x-y"},
        {"x": "exp(x')+y^200", "y": "y"},
        {"x": "-x*sqrt(1025)", "y": "-log(y + 3000)"},
    ],
    ids=str,
)
def test_numbers_of_any_size_get_their_verdict(equations: dict[str, str]) -> None:
    result = solve({"coordinates": ["x", "y"], "equations": equations})
    assert result["verdict"] in ("variational", "not_variational"), result["reason"]
    assert {check(result)["verdict"] for _ in range(3)} == {"valid"}


@pytest.mark.slow
def test_four_relativistic_particles_get_the_lagrangian_that_was_refused() -> None:
    """sqrt(1 - v^2) of four velocities, each between -1 and 1 (relativistic-7-29 of the generator)."""
    forces = {"u": "phi^2/2", "v": "-theta", "phi": "2*(phi*u - sin(phi))", "theta": "-3*v/2"}
    equations = {name: f"({force})*(1 - {name}'^2)^(3/2)" for name, force in forces.items()}
    result = solve({"coordinates": list(forces), "equations": equations})
    assert result["lagrangian"] is not None
    assert "refused_lagrangians" not in result["provenance"]
    assert check(result)["verdict"] == "valid"

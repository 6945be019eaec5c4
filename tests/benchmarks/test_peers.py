"""What the peers are given is the Helmholtz system, and what they say is read rightly."""

from __future__ import annotations

import shutil

import pytest
import sympy

from benchmarks.decision_benchmark import read
from benchmarks.peers import maxima, singular
from benchmarks.peers.helmholtz import UNDERIVED, LinearSystem, linear_system
from benchmarks.peers.systems import peer_systems
from benchmarks.peers_benchmark import Answer, PeerRow, summary
from inverse_service.inverse_problem.decision.deciding import decide

SYSTEMS = {document["name"]: (document, verdict) for document, verdict in peer_systems()}


def residues(problem: LinearSystem, g: sympy.Matrix) -> list[sympy.Expr]:
    """What is left of the equations for a matrix of functions of the variables."""
    found = []
    for equation in problem.equations:
        total = sympy.Integer(0)
        for (i, j, axis), coefficient in equation.items():
            total += coefficient * (g[i, j] if axis == UNDERIVED else sympy.diff(g[i, j], problem.variables[axis]))
        found.append(sympy.expand(total))
    return found


@pytest.mark.slow
def test_the_metric_solves_the_equations_of_its_geodesics_and_another_matrix_does_not() -> None:
    problem = linear_system(read(SYSTEMS["geodesics of a non-diagonal metric, n = 3"][0]))
    y = problem.variables[1]
    metric = sympy.Matrix([[1 + y**2, 0, y], [0, 1, 0], [y, 0, 1]])
    assert not any(residues(problem, metric))
    assert any(residues(problem, metric + sympy.diag(y, 0, 0)))


def test_a_constant_multiplier_of_a_rational_force_solves_the_cleared_equations() -> None:
    problem = linear_system(read({"coordinates": ["x", "y"], "equations": {"x": "-x/(x^2+y)", "y": "-1/(2*(x^2+y))"}}))
    assert not any(residues(problem, sympy.eye(2)))
    assert all(sympy.denom(sympy.together(c)) == 1 for equation in problem.equations for c in equation.values())


def test_transcendental_systems_are_not_given_to_the_peers() -> None:
    with pytest.raises(ValueError, match="rational"):
        linear_system(read({"coordinates": ["x"], "equations": {"x": "sin(x)"}}))


@pytest.mark.parametrize("name", SYSTEMS)
def test_our_decision_agrees_with_the_verdict_in_the_table(name: str) -> None:
    document, verdict = SYSTEMS[name]
    assert decide(read(document), False).verdict == verdict


@pytest.mark.skipif(shutil.which("Singular") is None, reason="Singular is not installed")
def test_singular_is_read_rightly() -> None:
    for name in ("Henon-Heiles, n = 2", "coupled, not symmetric, n = 2"):
        document, verdict = SYSTEMS[name]
        assert singular.measured(document)["verdict"] == verdict


@pytest.mark.skipif(shutil.which("maxima") is None, reason="Maxima is not installed")
def test_maxima_is_read_rightly() -> None:
    document, verdict = SYSTEMS["nonholonomic particle, first associated system"]
    assert maxima.measured(document)["verdict"] == verdict


def test_the_summary_counts_right_peers_only() -> None:
    wrong = PeerRow("a", 2, "variational", Answer("variational", 0.5), {
        "differential_algebra": Answer("not_variational", 0.001), "singular": Answer("variational", 1.0),
        "maxima": Answer("variational", 0.0001),
    })  # fmt: skip
    assert wrong.fastest_complete == 1.0
    assert "right on 1 of 1" in summary([wrong])
    assert "on 1 of the 1" in summary([wrong])

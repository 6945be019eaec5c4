"""Systems that fall apart are solved block by block."""

from __future__ import annotations

from inverse_service import solve
from inverse_service.certificate.checker import check_certificate
from inverse_service.deadline import now
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.ladder import search
from inverse_service.inverse_problem.search.reductions import decoupled_blocks
from inverse_service.mechanics.reading import read_system


def test_coordinates_belong_together_when_one_leads_to_the_other() -> None:
    system = read_system(["x", "y", "z", "w"], {"x": "y'", "y": "-y", "z": "-w", "w": "0"})
    assert sorted(sorted(block.coordinates) for block in decoupled_blocks(system)) == [["w", "z"], ["x", "y"]]


def test_a_chain_of_dependences_is_one_block() -> None:
    system = read_system(["x", "y", "z"], {"x": "y", "y": "z", "z": "0"})
    assert [set(block.coordinates) for block in decoupled_blocks(system)] == [{"x", "y", "z"}]


def test_each_coordinate_of_free_motion_is_a_block() -> None:
    assert len(decoupled_blocks(read_system(["x", "y", "z"], {"x": "0", "y": "0", "z": "0"}))) == 3


def test_the_sum_of_the_blocks_lagrangians_is_a_lagrangian() -> None:
    equations = {"x": "-3*x*x' - x^3", "y": "y*z'^2", "z": "-2*y'*z'/y", "w": "-sin(w)"}
    analysis = analyze(read_system(list(equations), equations))
    outcome = search(analysis, False, 1, now() + 60, lambda _: None)
    assert outcome.found is not None
    certificate = certify.of_lagrangian(analysis, outcome.found.lagrangians[0], False)
    assert check_certificate(certificate).verdict == "valid"


def test_blocks_damped_at_three_rates_have_a_lagrangian() -> None:
    """That of the first two needs e^(-t/2), the others e^(t/2) and e^(-t/3) to powers of their own."""
    equations = {"q1": "q1'*(q1*q1'^2*sqrt(q4') - 1)/2", "q2": "q2'*(-1/2 + q2'/q2)", "q3": "q3'/3"}
    equations["q4"] = "2*q4'*(-2*q1^2 + 4*q1*q1' - 1)/(2*q1^2 + 1)"
    result = solve({"equations": equations})
    assert (result["verdict"], result["with_time"]["checked"]) == ("not_variational", "valid")
    assert result["with_time"]["lagrangian"] is not None


def test_a_block_without_a_closed_form_leaves_the_system_without_one() -> None:
    equations = {"x": "(1 - x^2)*x' - x", "y": "-y"}
    analysis = analyze(read_system(list(equations), equations))
    assert search(analysis, False, 1, now() + 60, lambda _: None).found is None


def test_blocks_with_the_same_force_have_integrals_by_names_of_their_own() -> None:
    force = {name: f"-F({name}) - k*{name}" for name in "xyz"}
    result = solve({"equations": force, "functions": {"F": ["x"]}, "parameters": ["k"]})
    names = {slope["derivatives"][x]: name for name, slope in result["integrals"].items() for x in slope["derivatives"]}
    assert set(names) == {"F(x)", "F(y)", "F(z)"}
    assert len({*names.values()}) == 3
    assert all(f"{names[f'F({x})']}({x})" in result["lagrangian"]["text"] for x in "xyz")
    assert (result["checked"], result.check()["verdict"]) == ("valid", "valid")

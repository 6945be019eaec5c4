"""Which nonholonomic motions have any regular Lagrangian, and for which there is provably none."""

from __future__ import annotations

import random
from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.inverse_problem.constrained.existence import analyze_motion, decide_motion
from inverse_service.inverse_problem.constrained.motion_certificate import of_finding
from inverse_service.inverse_problem.constrained.motion_sentences import finding_steps, freedom
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.kinds import bivectors
from inverse_service.linear_pde.involutive_form import Finding
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion
from inverse_service.mechanics.reading import read_system
from tests.inverse_problem.constrained.motions import (
    BLADE,
    SLEIGH,
    analyzed,
    disk,
    given,
    heisenberg,
    knife_edge,
    motion_of,
    particle,
)

FREE_OF = {"coordinates": ["phi", "x", "y"], "constraints": BLADE}

# (document, L(q, q'), order): the orders are those at which it is settled.
ANSWERS: dict[str, tuple[dict[str, Any], bool, int]] = {
    "particle": (particle("0"), True, 3),
    "knife edge": (knife_edge("0"), True, 3),
    "Heisenberg": (heisenberg("0"), True, 2),
    "knife edge on an inclined plane": (knife_edge("-x"), True, 4),
    "Chaplygin sleigh": (FREE_OF | {"lagrangian": SLEIGH + "+J*phi'^2/2", "parameters": ["a", "J"]}, False, 2),
    "Chaplygin sleigh, J = 0": (FREE_OF | {"lagrangian": SLEIGH, "parameters": ["a"]}, True, 2),
    "z' = x y x' + x y'": (heisenberg("0") | {"constraints": ["z'-x*y*x'-x*y'"]}, False, 2),
    "particle, x": (particle("x"), True, 4),
    "particle, y": (particle("y"), False, 2),
    "particle, z": (particle("z"), True, 4),
    "particle, x^2": (particle("x^2"), False, 2),
    "particle, y^2": (particle("y^2"), False, 2),
    "particle, z^2": (particle("z^2"), False, 2),
    "Heisenberg, z": (heisenberg("z"), False, 3),
    "Heisenberg, x^2 + y^2": (heisenberg("x^2+y^2"), True, 4),
    "knife edge, V(phi)": (knife_edge("V(phi)", functions={"V": ["phi"]}), False, 2),
    "knife edge, x^2": (knife_edge("x^2"), False, 2),
    "knife edge, x^2 + y^2": (knife_edge("x^2+y^2"), True, 4),
    "disk": (disk("0"), True, 3),
    "disk, x^2": (disk("x^2"), False, 0),
    "disk on an incline": (disk("-x"), True, 5),
}


def decided(motion: ConstrainedMotion, with_time: bool = False) -> Finding:
    return decide_motion(analyze_motion(motion), with_time, 1, float("inf"), lambda _: None)


@pytest.mark.parametrize("name", ANSWERS)
def test_each_motion_has_its_answer(name: str) -> None:
    document, exists, order = ANSWERS[name]
    found = decide_motion(analyzed(document), False, 1, float("inf"), lambda _: None)
    assert (found.exists, found.order) == (exists, order)
    assert bool(found.rows) == (not exists)
    assert not exists or found.ranks[0] == 2


@pytest.mark.parametrize("name", [name for name, (_, exists, _) in ANSWERS.items() if not exists])
def test_letting_the_lagrangian_depend_on_time_helps_none_of_these(name: str) -> None:
    found = decide_motion(analyzed(ANSWERS[name][0]), True, 1, float("inf"), lambda _: None)
    assert found.exists is False


@pytest.mark.parametrize("name", ["particle", "Chaplygin sleigh", "z' = x y x' + x y'", "particle, x", "Heisenberg, z"])
def test_the_equations_of_the_bivectors_follow_from_the_others(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without them the same is found, with the same dimensions, at a higher order."""
    document, exists, order = ANSWERS[name]
    motion = analyzed(document)
    found = decide_motion(motion, False, 1, float("inf"), lambda _: None)
    monkeypatch.setattr(bivectors, "last_of", lambda shape: 0)
    alone = decide_motion(motion, False, 1, float("inf"), lambda _: None)
    assert (alone.exists, alone.order > order) == (exists, True)
    assert not exists or alone.history[-1][: found.degree + 1] == found.history[-1][: found.degree + 1]


@pytest.mark.parametrize("name", ["Chaplygin sleigh", "particle, x", "knife edge, V(phi)"])
@pytest.mark.parametrize("with_time", [False, True])
def test_the_checker_agrees_in_seconds(name: str, with_time: bool) -> None:
    """It forms the equations of the bivectors itself."""
    motion = analyzed(ANSWERS[name][0])
    found = decide_motion(motion, with_time, 1, float("inf"), lambda _: None)
    certificate = of_finding(motion, found, with_time)
    assert check_certificate(certificate, 60.0, seed=1).verdict == "valid"
    assert len(found.rows) < 1_000
    changed = certificate | {"bivectors": 1}
    assert check_certificate(changed, 60.0, seed=1).verdict == "invalid"


@pytest.mark.slow
def test_existence_with_eight_coordinates_on_the_constraints_is_confirmed() -> None:
    kinetic, chain = "(x'^2+y'^2+a'^2+b'^2+c'^2+d'^2)/2", ["a'-y*x'", "b'-a*x'", "c'-b*x'", "d'-c*x'"]
    motion = analyzed({"coordinates": [*"xyabcd"], "lagrangian": kinetic, "constraints": chain})
    found = decide_motion(motion, False, 1, float("inf"), lambda _: None)
    assert found.exists
    assert check_certificate(of_finding(motion, found, False), 60.0, seed=1).verdict == "valid"


@pytest.mark.parametrize("name", ["Chaplygin sleigh", "particle, y", "Heisenberg, z"])
def test_a_no_says_which_equations_of_the_bivectors_prove_it(name: str) -> None:
    motion = analyzed(ANSWERS[name][0])
    found = decide_motion(motion, False, 1, float("inf"), lambda _: None)
    used = [row[0] for row in of_finding(motion, found, False)["rows"] if row[0].startswith("B")]
    highest = max(int(name[1:].split("_")[0]) for name in used)
    texts = [step.text for step in finding_steps(motion, found, False)]
    assert any(f"of which {len(used)} are used, to order {highest}." in text for text in texts)
    yes = decide_motion(analyzed(ANSWERS["particle"][0]), False, 1, float("inf"), lambda _: None)
    assert not any("bivectors" in step.text for step in finding_steps(motion, yes, False))


@pytest.mark.parametrize("force", ["0", "-x*x'", "z*x'^2+sin(x)", "exp(z)*x'^3"])
@pytest.mark.parametrize("rate", ["x'", "z*x'", "x'*sin(x)+z", "x"])
def test_one_free_velocity_always_has_a_lagrangian(force: str, rate: str) -> None:
    assert decided(given({"x": force}, {"z": rate})).exists


PLAIN = [
    {"x": "-x"},
    {"x": "-x", "y": "-2*y"},
    {"x": "-x-2*x*y", "y": "-y-x^2+y^2"},
    {"x": "x*y'", "y": "y*x'^2"},
    {"x": "2*x'/y'+2*x'", "y": "2*x'^2/y'+x'/y'"},
    {"x": "-x-2*x*y-x'", "y": "-y-x^2+y^2-y'"},
    {"x": "y'*z", "y": "x'*z'", "z": "x*y"},
    {"x": "-2*x+y", "y": "x-2*y+z", "z": "y-2*z"},
]


@pytest.mark.parametrize("equations", PLAIN)
@pytest.mark.parametrize("with_time", [False, True])
def test_without_constraints_it_is_the_inverse_problem_itself(equations: dict[str, str], with_time: bool) -> None:
    expected = decide(read_system(list(equations), equations), with_time).verdict
    assert decided(given(equations, {}), with_time).exists == (expected == "variational")


@pytest.mark.parametrize("seed", range(6))
def test_integrable_constraints_are_no_obstacle_where_they_are_as_many_as_the_free_velocities(seed: int) -> None:
    """By doubling: l = 0, lambda_a first integrals (Bateman)."""
    generator = random.Random(seed)
    forces = {name: f"{generator.randint(1, 5)}*x*y'+{generator.randint(1, 5)}*y*x'^2" for name in "xy"}
    assert decide(read_system(["x", "y"], forces), False).verdict == "not_variational"
    found = decided(given(forces, {"z": "0", "w": "0"}))
    assert found.exists
    assert found.ranks == (2, found.ranks[1])


def test_the_rank_on_the_constraints_is_told_apart_from_that_of_the_whole() -> None:
    regular, doubled = decided(given({"x": "-x", "y": "-y"}, {"z": "0", "w": "0"})), PLAIN[3]
    assert regular.ranks == (2, 2)
    assert decided(given(doubled, {"z": "0", "w": "0"})).ranks == (2, 0)


# By hand: Omega = dE ^ dtau + h(X) dX ^ dY, E = e(w) + ..., and g(a) da ^ dtheta/2 + d(e(w) - w G(a)/(2 nu)) ^ dphi for
# the two knife edges; h(E) dE ^ dtau and a constant for the particle; L = phi(x') for x'' = 0.
FREEDOM = {
    "knife edge on an inclined plane": (motion_of(knife_edge("-x")), "2 functions of 1 variable"),
    "knife edge, x^2 + y^2": (motion_of(knife_edge("x^2+y^2")), "2 functions of 1 variable"),
    "particle, x": (motion_of(particle("x")), "1 function of 1 variable"),
    "one free coordinate": (given({"x": "0"}, {}), "1 function of 1 variable"),
    "Henon-Heiles": (given(PLAIN[2], {}), "1 constant"),
    "two oscillators": (given(PLAIN[1], {}), "2 functions of 1 variable"),
}


@pytest.mark.parametrize("name", FREEDOM)
def test_total_derivatives_do_not_count_as_freedom(name: str) -> None:
    motion, expected = FREEDOM[name]
    assert freedom(decided(motion), len(motion.coordinates), False) == expected


def test_constraints_that_move_and_contain_time_are_decided() -> None:
    moving = given({"x": "0", "y": "x'*y'*t"}, {"z": "x*y'+t"})
    assert moving.depends_on_time
    assert decided(moving, True).exists is not None


def test_a_limit_is_told_with_how_far_it_came() -> None:
    found = decide_motion(analyzed(particle("y")), False, 1, 0.0, lambda _: None)
    assert found.exists is None
    assert "time limit" in found.reason

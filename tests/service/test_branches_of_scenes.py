"""A Lagrangian of one branch of the equations is used only on that branch."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_system
from inverse_service.service.scenes.simulating import simulate

METHODS = ["variational", {"method": "variational", "form": "raw", "alpha": 0.3}, "stormer-verlet"]
# The force, the start and its velocity, the L of the branch of the start, and the end of that
# branch.
FORCES = [
    ("-sign(x)", 1.0, 0.0, "x'^2/2 - x", 0.0),
    ("-sign(x)", -1.0, 0.0, "x'^2/2 + x", 0.0),
    ("-asin(sin(x))", 1.0, 2.0, "x'^2/2 - x^2/2", 1.5707963267948966),
    ("-atan(tan(x))", 1.0, 2.0, "x'^2/2 - x^2/2", 1.5707963267948966),
    ("-sqrt(x^2+2*x+1)", 1.0, -4.0, "x'^2/2 - x*(x + 2)/2", -1.0),
    ("-(x^3)^(1/3)", 1.0, -2.0, "x'^2/2 - x^2/2", 0.0),
    ("piecewise((-x, x > 0), (-4*x, true))", 1.0, 0.0, "x'^2/2 - x^2/2", 0.0),
    ("-cosh(acosh(x))", 2.0, -2.0, "x'^2/2 - x^2/2", 1.0),
]


def scene(force: str, position: float, velocity: float, **more: Any) -> dict[str, Any]:
    return {
        "system": {"coordinates": ["x"], "equations": {"x": force}},
        "initial": {"positions": {"x": position}, "velocities": {"x": velocity}},
        "step": 0.1,
        "time": 5,
        "methods": METHODS,
        "observe": ["trajectory", "energy"],
        **more,
    }


@pytest.mark.slow
@pytest.mark.parametrize(("force", "position", "velocity", "lagrangian", "end"), FORCES)
def test_a_run_ends_where_the_branch_of_its_lagrangian_ends(
    force: str, position: float, velocity: float, lagrangian: str, end: float
) -> None:
    for method in simulate(scene(force, position, velocity))["methods"]:
        assert method["free_lagrangian"] == lagrangian
        assert method["outcome"] == "off_domain"
        assert (method["final"]["positions"]["x"] - end) * (position - end) > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "position", "velocity", "lagrangian"), [case[:4] for case in FORCES]
)
def test_a_lagrangian_that_is_given_is_held_against_the_equations(
    force: str, position: float, velocity: float, lagrangian: str
) -> None:
    for method in simulate(scene(force, position, velocity, free_lagrangian=lagrangian))["methods"]:
        assert method["outcome"] == "off_domain"


def test_a_result_is_simulated_on_the_branch_of_the_start() -> None:
    result = solve_system({"coordinates": ["x"], "equations": {"x": "-sign(x)"}}, SolveOptions())
    for start, lagrangian in ((1.0, "x'^2/2 - x"), (-1.0, "x'^2/2 + x")):
        given = scene("", start, 0.0) | {"system": {"result": result}}
        assert {method["free_lagrangian"] for method in simulate(given)["methods"]} == {lagrangian}


def test_the_energy_of_one_branch_judges_no_run_over_two() -> None:
    """x'' = -sign(x) from rest at 1: x(t) has period 4 sqrt(2), and x(5) = 1 - (4 sqrt(2) -
    5)^2/2.
    """
    (method,) = simulate(scene("-sign(x)", 1.0, 0.0, methods=["adaptive"]))["methods"]
    assert method["outcome"] == "completed"
    assert method["final"]["positions"]["x"] == pytest.approx(
        1 - (4 * 2**0.5 - 5) ** 2 / 2, abs=1e-9
    )
    assert method["max_energy_error"] is None
    assert "ends where x = 0" in method["energy_note"]


@pytest.mark.slow
def test_drag_against_the_motion_has_its_lagrangian_in_each_direction() -> None:
    """x'' = -x'|x'|: x(t) = x_0 + s log(1 + |v_0| t)."""
    for velocity in (1.0, -1.0):
        (method,) = simulate(
            scene("-x'*abs(x')", 0.5, velocity, methods=["variational"], step=0.01)
        )["methods"]
        assert method["outcome"] == "completed"
        assert method["final"]["positions"]["x"] == pytest.approx(
            0.5 + velocity * 1.791759469228055, abs=1e-4
        )

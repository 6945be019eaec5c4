"""Constraint forces, periods, constants of damped motions, and drawings of bodies."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk

from inverse_service.cli import simulate_command
from inverse_service.expressions import arrays, calculus, tree as ex
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.scenes import views
from inverse_service.service.scenes.simulating import simulate, simulate_tables
from tests.golden.runs import SCENES
from tests.values import slow

PENDULUM: dict[str, Any] = {
    "system": {"coordinates": ["a"], "lagrangian": "a'^2/2 + cos(a)"},
    "initial": {"positions": {"a": 1}, "velocities": {"a": 0}}, "step": 0.02, "time": 20, "methods": ["adaptive"],
}  # fmt: skip


def only(scene: dict[str, Any]) -> dict[str, Any]:
    (found,) = simulate(scene)["methods"]
    return dict(found)


def test_a_constraint_exerts_the_force_that_the_motion_has() -> None:
    """A bead on the line y = x under gravity: the line exerts m g cos(45 degrees), normal to
    itself.
    """
    scene = {
        "system": {"coordinates": ["x", "y"], "lagrangian": "m*(x'^2 + y'^2)/2 - m*g*y", "constraints": ["y' - x'"]},
        "parameters": {"m": 2, "g": 9.81}, "initial": {"positions": {"x": 0, "y": 0}, "velocities": {"x": 0, "y": 0}},
        "step": 0.01, "steps": 50, "observe": ["constraint_forces"],
    }  # fmt: skip
    for method in ("nonholonomic", "adaptive"):
        found = only(scene | {"methods": [method]})
        columns = found["points"]["columns"]
        assert columns["force_x"] == pytest.approx([-9.81] * 51, abs=1e-12)
        assert columns["force_y"] == pytest.approx([9.81] * 51, abs=1e-12)
        assert columns["lambda_1"] == pytest.approx([9.81] * 51, abs=1e-12)
        assert "g" in found["constraint_forces"]["formulas"]["lambda_1"]


@pytest.mark.parametrize(
    "method", ["adaptive", "reference", {"method": "stormer-verlet", "order": 8}]
)
def test_the_period_of_a_pendulum_is_an_elliptic_integral(method: Any) -> None:
    period = only(PENDULUM | {"methods": [method], "observe": ["period"]})["period"]
    assert period["mean"] == pytest.approx(4 * ellipk(np.sin(0.5) ** 2), abs=1e-9)
    assert period["apart"] < 1e-9
    turning = {"positions": {"a": 1}, "velocities": {"a": 3}}
    assert only(PENDULUM | {"initial": turning, "observe": ["period"]})["period"]["returns"] == 8


def test_the_other_end_of_a_swing_is_not_a_return() -> None:
    """A planar pendulum starts at rest on one side and is at rest on the other side after half a
    period.
    """
    system = {
        "coordinates": ["x", "y"],
        "lagrangian": "(x'^2 + y'^2)/2 - y",
        "constraints": ["x*x' + y*y'"],
    }
    start = {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 0}}
    period = only(PENDULUM | {"system": system, "initial": start, "observe": ["period"]})["period"]
    assert period["mean"] == pytest.approx(4 * ellipk(0.5), abs=1e-9)


def test_a_motion_that_does_not_return_has_no_period() -> None:
    free = {"coordinates": ["a"], "lagrangian": "a'^2/2"}
    initial = {"positions": {"a": 1}, "velocities": {"a": 1}}
    found = only(PENDULUM | {"system": free, "initial": initial, "observe": ["period"]})
    assert found["period"] is None
    assert "does not return" in found["period_note"]


@pytest.mark.parametrize(("x", "v"), [(0.51, 1), slow(0.51, -1), slow(1.25**0.5, 0), slow(0.5, 1)])
def test_a_period_may_lead_over_a_bounce_but_not_begin_there(x: float, v: float) -> None:
    bounce = {"when": "a - 0.5", "direction": -1, "do": {"set": {"a'": "-a'"}}}
    start = {"positions": {"a": x}, "velocities": {"a": v}}
    spring = PENDULUM | {
        "system": {"coordinates": ["a"], "lagrangian": "(a'^2 - a^2)/2"},
        "initial": start,
    }
    period = only(spring | {"observe": ["period"], "events": [bounce]})["period"]
    assert (
        period is None
        if x == 0.5
        else period["mean"] == pytest.approx(2 * np.arccos(0.5 / np.hypot(x, v)))
    )


def test_a_damped_oscillator_keeps_what_the_solver_found() -> None:
    """T + V falls, and H is constant to round-off on each side of x = 0; a method of order 2 shows
    its drift.
    """
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}, "rayleigh": "c*x'^2/2",
        "parameters": {"c": 0.1}, "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "step": 0.02, "time": 20,
        "observe": ["energy"],
    }  # fmt: skip
    exact, rough = (only(scene | {"methods": [method]}) for method in ("adaptive", "variational"))
    assert (
        exact["conserved"]["H"]["max_error"]
        < 1e-13
        < 1e-7
        < rough["conserved"]["H"]["max_error"]
        < 1e-3
    )
    assert exact["points"]["columns"]["energy"][-1] < 0.2 * exact["points"]["columns"]["energy"][0]
    assert max(map(abs, exact["points"]["columns"]["conserved_1"])) < 1e-13
    drift = rough["points"]["columns"]["conserved_1"]
    assert drift[0] == 0
    assert max(map(abs, drift)) == rough["conserved"]["H"]["max_error"]


@pytest.mark.parametrize(("force", "is_kept"), [("0", True), ("-r*phi'/10", False)])
def test_a_momentum_on_which_a_force_acts_is_not_called_kept(force: str, is_kept: bool) -> None:
    """p_phi = r^2 phi' of a planet, which the variational method keeps to round-off."""
    scene = {
        "system": {
            "coordinates": ["r", "phi"],
            "lagrangian": "(r'^2 + r^2*phi'^2)/2 + 1/r",
        },
        "forces": {"phi": force},
        "initial": {"positions": {"r": 1, "phi": 0}, "velocities": {"r": 0, "phi": 1}},
        "step": 0.05,
        "time": 1,
        "methods": ["variational"],
        "observe": ["momenta"],
    }
    found = only(scene)
    momenta = found["points"]["columns"]["p_phi"]
    drift = max(abs(one - momenta[0]) for one in momenta)
    assert found["max_momentum_drift"] == (drift if is_kept else None)
    assert (drift < 1e-13) is is_kept


def test_bodies_are_columns_and_a_moving_picture(tmp_path: Path) -> None:
    scene = PENDULUM | {
        "points": {"bob": ["l*sin(a)", "-l*cos(a)"]},
        "parameters": {"l": 2},
        "time": 0.4,
    }
    result = simulate(scene | {"observe": ["trajectory"]})
    assert result["bodies"] == {"bob": ["bob_x", "bob_y"]}
    columns = result["methods"][0]["points"]["columns"]
    assert columns["bob_x"] == pytest.approx(2 * np.sin(columns["a"]))
    assert columns["bob_y"] == pytest.approx(-2 * np.cos(columns["a"]))
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(scene))
    assert (
        simulate_command.simulate(str(path), tmp_path, figures=False, moving=tmp_path / "bob.gif")
        == 0
    )
    assert (tmp_path / "bob.gif").read_bytes().startswith(b"GIF8")


def test_forces_of_constraint_hold_what_pushes() -> None:
    """On y = 0, a force of 3 along y has to be held by -3."""
    found = simulate_tables(
        {
            "system": {
                "coordinates": ["x", "y"],
                "lagrangian": "(x'^2 + y'^2)/2",
                "constraints": ["y'"],
            },
            "forces": {"y": "3"},
            "initial": {"positions": {"x": 0, "y": 0}, "velocities": {"x": 1, "y": 0}},
            "step": 0.1,
            "steps": 3,
            "methods": ["nonholonomic"],
            "observe": ["constraint_forces"],
        }
    )
    (table,) = found["tables"].values()
    assert table["force_y"] == pytest.approx(-3 * np.ones(4))
    assert table["force_x"] == pytest.approx(np.zeros(4))


def test_a_path_with_a_matching_circle_is_drawn_in_the_plane_of_the_circle() -> None:
    found = simulate_tables(SCENES["knife edge"] | {"methods": ["nonholonomic"]})
    shown = views.path_view(found["result"], found["tables"])
    assert shown is not None
    assert "Path in the plane" in shown.values()


def test_the_action_of_an_oscillation_is_the_integral_of_l() -> None:
    """x = sin t: L = (cos^2 t - sin^2 t)/2, whose integral is sin(2 t)/4."""
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
        "initial": {"positions": {"x": 0}, "velocities": {"x": 1}},
        "step": 0.01,
        "steps": 200,
        "methods": ["adaptive"],
        "observe": ["action"],
    }
    found = only(scene)
    times, action = (np.array(found["points"]["columns"][name]) for name in ("t", "action"))
    assert action == pytest.approx(np.sin(2 * times) / 4, abs=1e-8)
    assert found["action"] == action[-1]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"system": {"coordinates": ["x"], "equations": {"x": "-x"}}}, "a given L"),
        ({"events": [{"when": "x", "do": {"set": {"x'": "-x'"}}}]}, "at once"),
    ],
)
def test_an_action_that_is_not_computed_is_null_and_says_why(
    change: dict[str, Any], why: str
) -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.01,
        "steps": 20,
        "methods": ["runge-kutta"],
        "observe": ["action"],
    }
    found = only(scene | change)
    assert found["action"] is None
    assert why in found["action_note"]


@pytest.mark.parametrize(("power", "potential"), [(2, "x^2/2"), (4, "x^4/4"), (1, "(x^2)^(1/2)")])
def test_the_means_of_the_energies_over_a_period_are_those_of_the_virial_theorem(
    power: int, potential: str
) -> None:
    """2 <T> = n <V> for V homogeneous of degree n; their sum is the energy at each point."""
    system = {"coordinates": ["x"], "lagrangian": f"x'^2/2 - {potential}"}
    start = {"positions": {"x": 1}, "velocities": {"x": 0}}
    asked = {"methods": ["adaptive"], "observe": ["period"]}
    scene = {"system": system, "initial": start, "step": 0.01, "time": 12} | asked
    period = 2**2.5 if power == 1 else only(scene)["period"]["mean"]
    found = only(scene | {"step": period / 1000, "time": period, "observe": ["energy_parts"]})
    parts, columns = found["energy_parts"], found["points"]["columns"]
    assert 2 * parts["mean_kinetic"] == pytest.approx(power * parts["mean_potential"], rel=1e-4)
    whole = np.add(columns["kinetic_part"], columns["potential_part"])
    assert whole == pytest.approx(np.full(1001, 1 / power), abs=1e-9)


@pytest.mark.parametrize(
    "lagrangian",
    ["exp(t/5)*(x'^2/2 - x^2/2) + x*x'", "-(1 - x'^2)^(1/2) - x^2/2", slow("x'^4/4 + t*x'^2 - x")],
)
def test_the_energies_of_the_parts_add_up_to_the_energy(lagrangian: str) -> None:
    """Those of the terms that are linear in the velocities are zero."""
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": lagrangian}, "start_time": 1,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0.5}}, "step": 0.1, "steps": 5,
        "methods": ["variational"], "observe": ["trajectory", "velocities", "energy_parts"],
    }  # fmt: skip
    given = read_formula(lagrangian, Names(("x",)))
    energy = ex.Velocity("x") * calculus.differentiate(given, ex.Velocity("x")) - given
    columns = only(scene)["points"]["columns"]
    values = {name: np.array(column) for name, column in columns.items()}
    table: dict[ex.Expression, Any] = {
        ex.TIME: values["t"],
        ex.Symbol("x"): values["x"],
        ex.Velocity("x"): values["v_x"],
    }
    whole = values["kinetic_part"] + values["potential_part"]
    assert whole == pytest.approx(arrays.array_value(energy, table), rel=1e-12)


def test_energies_that_jump_have_no_means() -> None:
    ball = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - 10*x"}, "step": 0.05, "time": 1,
        "initial": {"positions": {"x": 0.2}, "velocities": {"x": 0}}, "methods": ["adaptive"],
        "contacts": [{"gap": "x"}], "observe": ["energy_parts"],
    }  # fmt: skip
    found = only(ball)
    assert found["energy_parts"] is None
    assert "change the velocities at once" in found["energy_parts_note"]
    assert found["points"]["columns"]["potential_part"][0] == 2


def test_what_is_observed_is_drawn_on_the_page() -> None:
    """A momentum, and a formula of the scene under its own name; files: tests/golden/runs.py."""
    scene = PENDULUM | {
        "time": 1, "methods": ["variational"], "units": {"L_z": "J s"},
        "observe": ["momenta", {"L_z": "2*a'"}],
    }  # fmt: skip
    found = simulate_tables(scene)
    (figure,) = (one for one in views.figures_of(found["result"]) if one["name"] == "observed")
    shown = {view["y"]: view["lines"][0]["y"] for view in figure["views"]}
    assert shown.keys() == {"p a", "L_z [J s]"}
    assert shown["L_z [J s]"] == pytest.approx(2 * found["tables"]["variational-0.5"]["p_a"])

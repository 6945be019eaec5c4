"""A completed run with a wrong trajectory has a `doubt`, for any observed quantities."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from inverse_service.cli.simulate_command import page
from inverse_service.service.scenes.simulating import simulate
from inverse_service.web.pages.simulations import simulation_result
from tests.values import slow

KEPLER = {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 + 1/sqrt(x^2 + y^2)"}
FIXED = ["stormer-verlet", {"method": "stormer-verlet", "order": 4}, "runge-kutta", "reference"]


def orbit(eccentricity: float, **changes: Any) -> dict[str, Any]:
    speed = np.sqrt((1 + eccentricity) / (1 - eccentricity))
    initial = {
        "positions": {"x": 1 - eccentricity, "y": 0},
        "velocities": {"x": 0, "y": float(speed)},
    }
    return {
        "system": KEPLER,
        "initial": initial,
        "time": 40,
        "methods": FIXED,
        "observe": ["trajectory"],
    } | changes


def true_orbit(eccentricity: float, times: list[float]) -> Any:
    def slope(_: float, s: Any) -> Any:
        return [s[2], s[3], *(-s[:2] / np.hypot(s[0], s[1]) ** 3)]

    start = [1 - eccentricity, 0, 0, np.sqrt((1 + eccentricity) / (1 - eccentricity))]
    return solve_ivp(slope, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-12).y[:2]


@pytest.mark.parametrize("eccentricity", [0.3, *(slow(one) for one in (0.6, 0.9))])
@pytest.mark.parametrize("step", [0.2, *(slow(h) for h in (0.05, 0.01))])
def test_who_is_a_tenth_of_the_range_off_says_so(eccentricity: float, step: float) -> None:
    """A run that is off by a twelfth does not; in between both are allowed."""
    for found in simulate(orbit(eccentricity, step=step))["methods"]:
        if found["outcome"] != "completed":
            continue
        columns = found["points"]["columns"]
        true = true_orbit(eccentricity, columns["t"])
        off = np.abs(np.array([columns["x"], columns["y"]]) - true).max(axis=1) / np.ptp(
            true, axis=1
        )
        assert off.max() < 0.12 or "With half the step" in found["doubt"], found["label"]
        assert off.max() > 0.08 or "doubt" not in found, found["label"]


@pytest.mark.parametrize("symmetrised", [False, True])
@pytest.mark.parametrize("method", ["variational", "nonholonomic"])
@pytest.mark.parametrize("step", [0.5, 0.1])
def test_a_method_of_order_1_says_its_error_too(
    method: str, symmetrised: bool, step: float
) -> None:
    """The run with half the step differs by only half of the error. The motion is x = cos(t)."""
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
        "step": step,
        "time": 20,
    }
    scene |= {"initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "start_time": 1}
    choice = {"method": method, "alpha": 0, "symmetrised": symmetrised}
    (found,) = simulate(scene | {"methods": [choice]})["methods"]
    columns = {name: np.array(column) for name, column in found["points"]["columns"].items()}
    error = np.abs(columns["x"] - np.cos(columns["t"] - 1)).max()
    assert found["estimated_error"] == pytest.approx(error, rel=0.3)
    assert found["estimated_error_share"] == pytest.approx(error / 2, rel=0.3)
    assert ("With half the step" in found.get("doubt", "")) == (
        found["estimated_error_share"] > 0.1
    )


@pytest.mark.parametrize(
    "method", [*FIXED, "adaptive", "stiff", {"method": "adaptive", "tolerance": 1e-5}]
)
def test_the_error_of_each_run_is_estimated(method: Any) -> None:
    scene = orbit(0.3, step=0.1, methods=[method], observe=["trajectory", "error"])
    (found,) = simulate(scene)["methods"]
    assert (
        found["max_error"] / 2 - 1e-12 < found["estimated_error"] < 2 * found["max_error"] + 1e-12
    )
    assert "estimated_until" not in found


@pytest.mark.parametrize("method", ["variational", "nonholonomic"])
def test_an_error_is_estimated_where_the_guard_ends_the_run_with_half_the_step(method: str) -> None:
    """A force that acts a step too early from rest: four steps of h/2 end far from the result of
    shorter ones.
    """
    system = {"coordinates": ["x"], "lagrangian": "0.33*x'^2 + 1.11*x*cos(0.72*t)"}
    scene = {
        "system": system,
        "step": 0.1,
        "time": 200,
        "methods": [{"method": method, "alpha": 1}],
    }
    scene |= {
        "initial": {"positions": {"x": -0.507}, "velocities": {"x": -0.09}},
        "observe": ["error"],
    }
    (found,) = simulate(scene)["methods"]
    assert found["estimated_error"] == pytest.approx(found["max_error"], rel=0.05)
    assert found["doubt"].startswith("With half the step, the trajectory differs")
    assert "doubt" in simulate(scene | {"observe": ["trajectory"]})["methods"][0]


@pytest.mark.slow
def test_the_order_of_a_method_is_reported() -> None:
    """The order in the positions: 1 if a step is not symmetric or begins with the discrete
    velocity.
    """
    orders: list[tuple[Any, int | None]] = [
        ("variational", 2), ({"method": "variational", "alpha": 0}, 1),
        ({"method": "variational", "alpha": 1, "symmetrised": True}, 2), ({"method": "variational", "order": 6}, 6),
        ({"method": "variational", "start": "discrete_constraint"}, 1), ("stormer-verlet", 2), ("nonholonomic", 2),
        ("runge-kutta", 4), ({"method": "runge-kutta", "order": 5}, 5), ("reference", 12), ("adaptive", None),
        ("stiff", 4), ("heyoka", None), ("exact", None),
    ]  # fmt: skip
    found = simulate(orbit(0.3, step=0.05, time=10, methods=[method for method, _ in orders]))[
        "methods"
    ]
    assert [method["order"] for method in found] == [order for _, order in orders]
    (half,) = simulate(orbit(0.3, step=0.005, time=10, methods=[orders[4][0]], observe=["error"]))[
        "methods"
    ]
    (whole,) = simulate(orbit(0.3, step=0.01, time=10, methods=[orders[4][0]], observe=["error"]))[
        "methods"
    ]
    assert whole["max_error"] / half["max_error"] == pytest.approx(2, rel=0.1)


@pytest.mark.parametrize(
    ("potential", "angle"), [("cos(x)", True), ("cos(2*x) - sin(x)", True), ("cos(x/2)", False)]
)
def test_an_angle_that_is_off_by_a_turn_is_lost(potential: str, angle: bool) -> None:
    """A pendulum that turns more than once in each step is off by one turn in a thousand."""
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": f"x'^2/2 + {potential}"},
        "step": 0.1,
        "time": 100,
    }
    scene |= {
        "initial": {"positions": {"x": 0}, "velocities": {"x": 100}},
        "methods": ["stormer-verlet", "adaptive"],
    }
    rough, good = simulate(scene | {"observe": ["error"]})["methods"]
    assert rough["max_error"] > 1
    assert ("doubt" in rough) == angle
    assert "doubt" not in good


@pytest.mark.parametrize("step", [0.1, 1, 4])
def test_a_taylor_series_estimates_its_error_at_any_step(step: float) -> None:
    """Its own steps, and so the run, are the same to the last bit for all coarser grids."""
    pytest.importorskip("heyoka")
    system = {
        "coordinates": ["x", "y"],
        "lagrangian": "(x'^2+y'^2)/2 - (x^2+y^2)/2 - x^2*y + y^3/3",
    }
    initial = {"positions": {"x": 0, "y": 0.1}, "velocities": {"x": 0.57, "y": 0}}
    scene = {
        "system": system,
        "initial": initial,
        "step": step,
        "time": 2000,
        "methods": ["heyoka"],
    }
    assert 1e-14 < simulate(scene)["methods"][0]["estimated_error"] < 1e-9


def test_of_a_long_run_it_says_until_when() -> None:
    scene = orbit(
        0.3, step=1e-3, steps=2_000_000, record_every=1000, methods=["stormer-verlet"]
    ) | {"time": None}
    (found,) = simulate(scene)["methods"]
    assert found["estimated_until"] == pytest.approx(1000)
    assert found["estimated_error"] < 1e-3


def test_the_energy_of_a_run_is_reported_if_it_is_not_constant() -> None:
    (found,) = simulate(
        orbit(0.9, step=2 * np.pi / 200, methods=["stormer-verlet"], observe=["energy"])
    )["methods"]
    assert found["outcome"] == "completed"
    assert found["max_energy_error"] > 0.4
    assert "The energy should be constant" in found["doubt"]


def test_a_tolerance_that_is_too_large_is_reported() -> None:
    loose, tight = ({"method": "stiff", "tolerance": size} for size in (1e-2, 1e-9))
    found = simulate(orbit(0.6, step=0.2, methods=[loose, tight]))["methods"]
    assert "tenth of the tolerance" in found[0]["doubt"] or found[0]["outcome"] == "unresolved"
    assert (found[1]["outcome"], found[1].get("doubt")) == ("completed", None)


@pytest.mark.slow
def test_members_of_an_ensemble_are_compared() -> None:
    """Slow members fall close to the center; the circle at speed sqrt(2) is easy."""
    members = {"initial": {"velocities": {"y": [0.7, 2**0.5]}}}
    scene = orbit(0.5, step=0.02, time=10, ensemble=members, methods=["stormer-verlet", "adaptive"])
    rough, good = simulate(scene)["methods"]
    assert rough["doubt"].startswith("1 of 2 members differ with half the step")
    assert rough["doubt"].endswith("member 0.")
    assert "doubt" not in good
    for k, speed in enumerate(members["initial"]["velocities"]["y"]):
        alone = scene | {
            "initial": {"positions": {"x": 0.5, "y": 0}, "velocities": {"x": 0, "y": speed}}
        }
        del alone["ensemble"]
        for member, method in zip((rough, good), simulate(alone)["methods"], strict=True):
            assert member["members_columns"]["estimated_error"][k] == pytest.approx(
                method["estimated_error"], rel=1e-2
            )
    scene |= {
        "methods": ["runge-kutta"],
        "ensemble": {"initial": {"velocities": {"y": [1.4, 2**0.5]}}},
    }
    (pushed,) = simulate(scene | {"forces": {"x": "100*exp(-((t - 3.333)/0.0001)^2)"}})["methods"]
    assert (
        "Member 0: With `adaptive`, stopping at the peaks of the forces, the traj"
        in pushed["doubt"]
    )


def test_command_and_page_show_it_next_to_the_outcome() -> None:
    scene = orbit(0.6, step=0.2, methods=["stormer-verlet", "adaptive"])
    result = simulate(scene)
    rough, good = result["methods"]
    assert f"stormer-verlet: {rough['doubt']}" in page(result)
    job = {"id": "1", "kind": "simulate", "status": "successful", "result": result}
    html = bytes(simulation_result("http://here", job, json.dumps(scene)).body).decode()
    row, reason = html.split('<b class="open">completed</b>')[1].split('<tr class="reason">')[:2]
    assert "</tr>" in row
    assert "half the step" not in row
    assert 'class="note">With half the step' in reason.partition("</tr>")[0]
    assert html.count('<b class="yes">completed</b>') == 1
    assert "doubt" not in good


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-8])
def test_steps_of_its_own_that_the_grid_shortens_are_doubted_too(tolerance: float) -> None:
    """A chaotic double pendulum, where no step exceeds that of the grid at any tolerance."""
    system = {
        "coordinates": ["a", "b"],
        "lagrangian": "a'^2 + b'^2/2 + a'*b'*cos(a - b) + 9.81*(2*cos(a) + cos(b))",
    }
    initial = {"positions": {"a": -2.8534, "b": 1.0169}, "velocities": {"a": 0, "b": 0}}
    scene = {"system": system, "initial": initial, "step": 0.03, "time": 40, "observe": ["error"]}
    (found,) = simulate(scene | {"methods": [{"method": "adaptive", "tolerance": tolerance}]})[
        "methods"
    ]
    until = found.get("error_until") or {"max_error": found["max_error"]}
    assert until["max_error"] > 3
    assert "half the step and" in found["doubt"]


def test_an_energy_error_of_a_tenth_is_not_shown_without_a_word() -> None:
    """A skate on an incline: the change is large relative to E_0 and small relative to the kinetic
    energy.
    """
    system = {"coordinates": ["x", "y", "th"], "constraints": ["-sin(th)*x' + cos(th)*y'"]}
    system["lagrangian"] = "(x'^2 + y'^2)/2 + th'^2 + th'*(-sin(th)*x' + cos(th)*y')/2 - x"
    initial = {
        "positions": {"x": 0, "y": 0, "th": 2.82},
        "velocities": {"x": -1.2475, "th": -0.2586},
    }
    scene = {"system": system, "initial": initial, "step": 0.16, "time": 12, "observe": ["energy"]}
    rough, good = simulate(
        scene | {"methods": [{"method": "nonholonomic", "alpha": 0}, "nonholonomic"]}
    )["methods"]
    assert rough["max_energy_error"] > 0.1 > good["max_energy_error"]
    assert "The energy should be constant" in rough["doubt"]
    assert "The energy" not in good.get("doubt", "")


def test_the_page_says_when_a_run_stopped_and_what_to_do() -> None:
    scene = orbit(0.6, step=0.02, methods=["adaptive"]) | {
        "system": {"equations": ["x'' = 6*x^2", "y'' = -y"]}
    }
    result = simulate(
        scene | {"initial": {"positions": {"x": 1, "y": 0}, "velocities": {"x": 2, "y": 1}}}
    )
    html = bytes(simulation_result("http://here", {"id": "1", "kind": "simulate", "status": "successful",
                                                   "result": result}, json.dumps(scene)).body).decode()  # fmt: skip
    assert "Stopped at t = " in html
    assert result["methods"][0]["stopped"]["sentence"].startswith("Stopped at t = ")

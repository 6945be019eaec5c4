"""Invalid scenes are rejected with one sentence, and valid scenes run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate

PLANE = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2"}


def scene(system: dict[str, Any], methods: list[Any], **more: Any) -> dict[str, Any]:
    initial = {
        "positions": dict.fromkeys(system["coordinates"], 0.5),
        "velocities": dict.fromkeys(system["coordinates"], 0),
    }
    return {
        "system": system,
        "initial": initial,
        "step": 0.05,
        "steps": 100,
        "methods": methods,
    } | more


@pytest.mark.parametrize(
    ("constraints", "sentence"),
    [
        (["x' - y'", "2*x' - 2*y'"], "only 1 of the 2 constraints are independent"),
        (["x'^2 + y'^2 - 1"], "constraint 1 is not linear in the velocities"),
        (["x'", "y'"], "2 constraints on 2 coordinates leave no motion"),
        (["x^2 - y^2 - 1/2"], "restricts the positions"),
        (["0"], "has no velocity in it: leave it out"),
    ],
)
def test_constraints_that_cannot_be_meant_are_named(constraints: list[str], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        simulate(scene(PLANE | {"constraints": constraints}, ["nonholonomic"]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["friction", "Drag", "damping", "dissipation"])
def test_a_term_of_the_lagrangian_is_not_friction(name: str) -> None:
    document = scene(PLANE, ["variational"], terms={name: "-x'^2/8"})
    with pytest.raises(InputError, match="dissipates no energy"):
        simulate(document)
    assert simulate(document | {"as_lagrangian": True})["methods"][0]["outcome"] == "completed"


def test_a_degenerate_lagrangian_is_refused_by_every_method() -> None:
    system = {"coordinates": ["x", "y"], "lagrangian": "x'^2/2 - x^2/2 - x*y"}
    for method in simulate(scene(system, ["nonholonomic", "variational", "runge-kutta"]))[
        "methods"
    ]:
        assert method["outcome"] == "unavailable"
        assert "singular" in method["reason"]


@pytest.mark.slow
@pytest.mark.parametrize("turning", [0, 1])
def test_parameters_that_leave_no_motion_are_said_as_such(turning: float) -> None:
    """I + M R^2 = 0: no method may complete from any start, and each asks to change parameters."""
    start = {
        "positions": {"phi": 0.1, "theta": 0, "x": 0, "y": 0},
        "velocities": {"phi": turning, "theta": 1},
    }
    document = {
        "system": {"catalogue": "vertically-rolling-disk"}, "parameters": {"M": -1, "I": 1, "J": 1, "R": 1},
        "initial": start, "step": 0.05, "steps": 5,
        "methods": ["variational", "nonholonomic", "modified", "exact", "runge-kutta", "reference"],
    }  # fmt: skip
    for method in simulate(document)["methods"]:
        assert method["outcome"] == "unavailable"
        assert "other parameters" in method["reason"]


@pytest.mark.slow
def test_a_ball_on_a_turntable_is_run_geometrically() -> None:
    """Constraints with a part without velocities: the ball moves on a circle at 2/7 of the table's
    rate (Routh).
    """
    rate = 0.5
    system = {
        "coordinates": ["x", "y", "u", "w"], "lagrangian": "(x'^2+y'^2)/2 + (u'^2+w'^2)/5",
        "constraints": ["x' - w' + 0.5*y", "y' + u' - 0.5*x"],
    }  # fmt: skip
    start = {"positions": {"x": 1, "y": 0, "u": 0, "w": 0}, "velocities": {"x": 0.1, "y": 0.2}}
    methods = ["nonholonomic", {"method": "nonholonomic", "order": 4}]
    document = scene(
        system,
        methods,
        initial=start,
        observe=["trajectory", "energy", "error", "constraints"],
        steps=400,
    )
    found = simulate(document)["methods"]
    columns = found[1]["points"]["columns"]
    angle = 2 / 7 * rate * np.array(columns["t"])
    velocity = (0.1 + 0.2j) * np.exp(1j * angle)
    path = 1 + (0.1 + 0.2j) * (np.exp(1j * angle) - 1) / (2j / 7 * rate)
    assert np.abs(np.gradient(path, 0.05, edge_order=2) - velocity).max() < 1e-4
    assert np.abs(np.array(columns["x"]) + 1j * np.array(columns["y"]) - path).max() < 1e-9
    assert found[0]["max_constraint"] < 1e-14
    assert found[0]["max_error"] < 1e-4
    assert found[0]["max_energy_error"] is None
    assert "may do work" in found[0]["energy_note"]


def test_a_time_off_the_grid_is_noted() -> None:
    document = scene(PLANE, ["variational"], time="2*pi")
    del document["steps"]
    assert any("The run takes 6.3" in note for note in simulate(document)["notes"])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["heyoka", "adaptive", {"method": "stormer-verlet", "order": 8}])
def test_an_atom_in_seconds_is_as_accurate(method: Any) -> None:
    """Times of 1e-17 s: the coefficients of a series of order 20 in seconds overflow."""
    pytest.importorskip("heyoka")
    scene = {
        "system": {"coordinates": ["x", "y"], "lagrangian": "m*(x'^2 + y'^2)/2 + k/sqrt(x^2 + y^2)"},
        "parameters": {"m": "9.1e-31", "k": "2.3e-28"},
        "initial": {"positions": {"x": "5.3e-11", "y": 0}, "velocities": {"x": 0, "y": "2.2e6"}},
        "step": "1e-18", "time": "1e-15", "methods": [method], "observe": ["error", "energy"],
    }  # fmt: skip
    result = simulate(scene)
    assert result["truth"]["by"] == "heyoka, checked by adaptive"
    (found,) = result["methods"]
    assert found["outcome"] == "completed"
    assert found["max_energy_error"] < 1e-13
    assert found["max_error"] < 1e-10 * 5e-11


def test_a_part_that_costs_no_measurable_time_has_none() -> None:
    document = scene(PLANE, ["variational"], observe=["energy", "constraints", "momenta", "cost"])
    cost = simulate(document)["methods"][0]["cost"]
    assert cost["operations"] > 0
    assert cost["steps"] > 0
    for part in cost["parts"]:
        assert part["step_ns"] is None or part["step_ns"] >= 0


@pytest.mark.slow
def test_twelve_masses_on_a_chain_are_simulated() -> None:
    """Fermi, Pasta, Ulam and Tsingou: the harmonic chain has frequencies 2 sin(k pi/2(n+1))."""
    n = 12
    names = [f"x{k}" for k in range(n)]
    springs = [f"({names[k + 1]}-{names[k]})^2/2" for k in range(n - 1)] + [
        f"{names[0]}^2/2",
        f"{names[-1]}^2/2",
    ]
    lagrangian = "+".join(f"{name}'^2/2" for name in names) + "-(" + "+".join(springs) + ")"
    mode = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
    start = {
        "positions": dict(zip(names, map(float, mode), strict=True)),
        "velocities": dict.fromkeys(names, 0),
    }
    system = {"coordinates": names, "lagrangian": lagrangian}
    document = scene(
        system, [{"method": "runge-kutta", "order": 4}], initial=start, observe=["trajectory"]
    )
    columns = simulate(document)["methods"][0]["points"]["columns"]
    expected = mode[3] * np.cos(2 * np.sin(np.pi / 2 / (n + 1)) * np.array(columns["t"]))
    assert np.abs(np.array(columns["x3"]) - expected).max() < 1e-6


def test_the_lagrangian_that_runs_for_ever_is_preferred() -> None:
    """A damped oscillator: the autonomous L~ ends at the first x = 0, the one with t does not."""
    autonomous = {"text": "atan(x'/x)*x'/x - log(x^2 + x'^2)/2", "latex": ""}
    driven = {"text": "exp(t/5)*(x'^2 - x^2)/2", "latex": ""}
    result = {
        "system": {"coordinates": ["x"], "equations": {"x": "-x - x'/5"}, "parameters": []},
        "lagrangian": autonomous, "hamiltonian": {"text": "x", "implicit": False},
        "with_time": {"lagrangian": driven, "hamiltonian": {"text": "x", "implicit": False}},
    }  # fmt: skip
    start = {"positions": {"x": 1}, "velocities": {"x": 0}}
    document = {
        "system": {"result": result},
        "initial": start,
        "step": 0.02,
        "time": 20,
        "methods": ["variational"],
    }
    (found,) = simulate(document)["methods"]
    assert found["outcome"] == "completed"
    assert "exp" in found["free_lagrangian"]

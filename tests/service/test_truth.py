"""The uncertainty of the reference solution bounds its error, and no error is given where the
reference fails.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpmath import findroot, mp

from inverse_service.service.scenes.simulating import simulate

KEPLER = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2 + 1/sqrt(x^2+y^2)"}


def kepler(
    eccentricity: float, step: float, methods: list[Any], time: float = 20
) -> dict[str, Any]:
    speed = ((1 + eccentricity) / (1 - eccentricity)) ** 0.5
    initial = {"positions": {"x": 1 - eccentricity, "y": 0}, "velocities": {"x": 0, "y": speed}}
    scene = {"system": KEPLER, "initial": initial, "step": step, "time": time, "methods": methods}
    return simulate(scene | {"observe": ["error", "trajectory", "energy"]})


def kepler_position(eccentricity: float, time: float) -> tuple[float, float]:
    """The position from Kepler's equation in forty digits, for exactly the start of the scene."""
    with mp.workdps(40):
        x = mp.mpf(1 - eccentricity)
        speed = mp.mpf(((1 + eccentricity) / (1 - eccentricity)) ** 0.5)
        axis = 1 / (2 / x - speed**2)
        e = 1 - x / axis
        mean = time / axis ** mp.mpf(1.5)
        anomaly = findroot(lambda u: u - e * mp.sin(u) - mean, mean)
        return float(axis * (mp.cos(anomaly) - e)), float(
            axis * mp.sqrt(1 - e**2) * mp.sin(anomaly)
        )


@pytest.mark.slow
@pytest.mark.parametrize("eccentricity", [0.5, 0.9, 0.999])
def test_near_collisions_end_right_or_typed(eccentricity: float) -> None:
    found = kepler(
        eccentricity,
        0.01,
        ["adaptive", "variational", {"method": "runge-kutta", "order": 8}, "reference"],
    )
    true = kepler_position(eccentricity, 20.0)
    for method in found["methods"]:
        assert method["outcome"] in ("completed", "unresolved"), method["label"]
        if method["outcome"] != "completed":
            continue
        columns = method["points"]["columns"]
        own = np.hypot(columns["x"][-1] - true[0], columns["y"][-1] - true[1])
        assert own <= 1.5 * (method["max_error"] + method["error_uncertainty"])
        assert method["max_energy_error"] < 1
    assert found["methods"][0]["max_error"] < 1e-6
    assert found["truth"]["uncertainty"] < 1e-7


@pytest.mark.slow
def test_errors_and_their_uncertainty_have_one_unit() -> None:
    """The earth around the sun in meters: both are in meters."""
    scene = {
        "system": {"coordinates": ["x", "y"], "parameters": ["m", "G"],
                   "lagrangian": "m*(x'^2+y'^2)/2 + G*m/sqrt(x^2+y^2)"},
        "parameters": {"m": 5.97e24, "G": 1.327e20},
        "initial": {"positions": {"x": 1.496e11, "y": 0}, "velocities": {"x": 0, "y": 29780}},
        "step": 86400, "steps": 730, "methods": ["reference", "adaptive"], "observe": ["error"],
    }  # fmt: skip
    for method in simulate(scene)["methods"]:
        assert 1e-6 < method["error_uncertainty"] < 1
        assert method["max_error"] < 1


@pytest.mark.slow
def test_a_chaotic_motion_is_known_for_a_while() -> None:
    scene = {
        "system": {"coordinates": ["a", "b"], "parameters": {"g": 9.81},
                   "lagrangian": "a'^2 + b'^2/2 + a'*b'*cos(a-b) + 2*g*cos(a) + g*cos(b)"},
        "initial": {"positions": {"a": 2, "b": 2.5}, "velocities": {"a": 0, "b": 0}},
        "step": 0.01, "time": 60, "methods": ["reference"], "observe": ["error"],
    }  # fmt: skip
    result = simulate(scene)
    (method,) = result["methods"]
    assert method["max_error"] is None
    assert method["error_uncertainty"] is None
    assert "known until t = " in method["error_note"]
    assert 8 < method["error_until"]["time"] < 40
    assert method["error_until"]["max_error"] < 0.1


@pytest.mark.slow
def test_more_than_a_million_steps_have_an_error() -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 1e-4, "steps": 1_500_007, "methods": ["variational"], "observe": ["error"],
    }  # fmt: skip
    (method,) = simulate(scene)["methods"]
    # The midpoint rule turns too slowly by h^2/12.
    assert method["max_error"] == pytest.approx(150 * 1e-8 / 12, rel=0.02)
    assert method["error_uncertainty"] < 1e-11


@pytest.mark.slow
def test_a_truth_that_ends_early_ends_the_errors_too() -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - log(x)"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.02, "time": 5, "methods": ["adaptive", "variational"], "observe": ["error"],
    }  # fmt: skip
    result = simulate(scene)
    assert "reason" in result["truth"]
    for method in result["methods"]:
        assert method["outcome"] != "completed"
        assert method["stopped"]["time"] == pytest.approx(1.2533, abs=0.03)


@pytest.mark.slow
def test_without_heyoka_our_own_two_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    from inverse_service.errors import InputError
    from inverse_service.simulation import peers

    def missing() -> None:
        raise InputError("not here")

    monkeypatch.setattr(peers, "load_heyoka", missing)
    peers.taylor_integrator.cache_clear()
    found = kepler(0.6, 0.05, ["adaptive"])
    assert found["truth"]["by"].startswith("adaptive")
    assert found["truth"]["uncertainty"] < 1e-10

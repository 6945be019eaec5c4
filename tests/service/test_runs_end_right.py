"""Hard scenes end with a correct trajectory or a named outcome, and do not affect other methods."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate

FREE = {"coordinates": ["x", "y", "z"], "lagrangian": "(x'^2+y'^2+z'^2)/2"}
DISK = {
    "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "step": 0.05,
    "steps": 40,
}
OSCILLATOR = {
    "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
    "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
    "step": 0.1,
}


def methods(document: dict[str, Any], limit: float = 60.0) -> dict[str, dict[str, Any]]:
    return {method["label"]: method for method in simulate(document, None, limit)["methods"]}


def outcomes(document: dict[str, Any]) -> dict[str, str]:
    return {label: method["outcome"] for label, method in methods(document).items()}


def test_one_method_that_fails_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """An internal error in a method is the outcome of that method only."""
    from inverse_service.simulation import running

    whole = running.run_method

    def broken(scene: Any, requested: Any, *rest: Any) -> Any:
        return 1 / 0 if requested.method == "reference" else whole(scene, requested, *rest)

    monkeypatch.setattr(running, "run_method", broken)
    found = methods(OSCILLATOR | {"steps": 10, "methods": ["reference", "variational"]})
    assert found["reference"]["outcome"] == "failed"
    assert "fault of the program" in found["reference"]["reason"]
    assert found["variational-0.5"]["outcome"] == "completed"


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.02, 0.01])
def test_what_falls_into_a_pole_ends_there(step: float) -> None:
    """L = x'^2/2 - log(x) from rest at x = 1: x = 0 at t = sqrt(pi/2), where E and the motion
    end.
    """
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - log(x)"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": step,
        "time": 5,
        "methods": [
            "reference",
            "runge-kutta",
            {"method": "runge-kutta", "order": 8},
            "variational",
        ],
        "observe": ["energy", "trajectory"],
    }
    for method in methods(scene).values():
        assert method["outcome"] in ("singular", "no_convergence"), method["label"]
        assert method["stopped"]["time"] == pytest.approx(np.sqrt(np.pi / 2), abs=2 * step)
        assert None not in method["points"]["columns"]["energy"]
        assert min(method["points"]["columns"]["x"]) > 0


def test_a_first_step_that_does_not_converge_is_not_called_singular() -> None:
    scene = OSCILLATOR | {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 + cos(3*x)"}, "step": 30, "steps": 10,
        "methods": [{"method": "variational", "guard": False}],
    }  # fmt: skip
    (found,) = methods(scene).values()
    assert found["outcome"] == "completed" or found["stopped"]["value"] != 0


def test_the_energy_error_is_of_one_quantity_for_every_method() -> None:
    """The implicit midpoint rule conserves the energy of the oscillator exactly, and the table
    shows it.
    """
    alike = ["variational", {"method": "variational", "form": "raw"}, "nonholonomic"]
    scene = OSCILLATOR | {"time": 100, "observe": ["energy"], "methods": [*alike, "runge-kutta"]}
    found = methods(scene)
    for label in ("variational-0.5", "variational-0.5-raw", "nonholonomic-0.5"):
        assert found[label]["max_energy_error"] < 1e-14
        assert found[label]["max_discrete_energy_error"] == pytest.approx(2.49e-3, rel=0.01)
    assert found["runge-kutta"]["max_energy_error"] == pytest.approx(1.39e-5, rel=0.02)
    assert "max_discrete_energy_error" not in found["runge-kutta"]


@pytest.mark.parametrize("method", ["heyoka"])
def test_a_series_whose_steps_shrink_without_end_is_stopped(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("heyoka")
    from inverse_service.simulation import peers

    monkeypatch.setattr(peers, "MOST_STEPS", 50)
    found = methods(OSCILLATOR | {"time": 1000, "methods": [method, "variational"]})
    assert found[method]["outcome"] == "unresolved"
    assert "50 internal steps" in found[method]["stopped"]["quantity"]
    assert found["variational-0.5"]["outcome"] == "completed"


def test_the_time_limit_stops_heyoka() -> None:
    pytest.importorskip("heyoka")
    found = methods(OSCILLATOR | {"steps": 100, "methods": ["heyoka"]}, limit=0.0)
    assert found["heyoka"]["outcome"] == "cancelled"


def test_heyoka_is_compiled_once() -> None:
    pytest.importorskip("heyoka")
    from inverse_service.simulation import peers

    compiled = []
    for name in "ab":
        requested = [{"method": "heyoka", "label": name}]
        assert outcomes(OSCILLATOR | {"steps": 100, "methods": requested}) == {name: "completed"}
        compiled.append(peers.taylor_integrator.cache_info().misses)
    assert compiled[0] == compiled[1] > 0


EVERY = [
    "variational",
    "stormer-verlet",
    "nonholonomic",
    "runge-kutta",
    "reference",
    "adaptive",
    "stiff",
    "heyoka",
]


FIXED = ["variational", "stormer-verlet", "runge-kutta", "adaptive"]


@pytest.mark.slow
@pytest.mark.parametrize("observe", [[], ["error"]])
def test_a_force_far_faster_than_the_step_is_doubted(observe: list[str]) -> None:
    """Its mean is 0; sampled at the steps it looks like a slow force, which changes the motion."""
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 + sin(1000*t)*x^2/2"}
    start = {"positions": {"x": 1}, "velocities": {"x": 1}}
    scene = OSCILLATOR | {
        "system": system,
        "initial": start,
        "step": 0.05,
        "steps": 200,
        "methods": FIXED,
    }
    found = methods(scene | {"observe": observe})
    assert found["adaptive"]["outcome"] == "completed"
    assert "doubt" not in found.pop("adaptive")
    assert all(method["outcome"] == "unresolved" or method["doubt"] for method in found.values())


def test_a_pole_of_an_event_is_not_a_zero() -> None:
    events = [{"when": "1/x"}, {"when": "x"}]
    (method,) = methods(
        OSCILLATOR | {"steps": 50, "methods": ["adaptive"], "events": events}
    ).values()
    assert [event["count"] for event in method["events"]] == [0, 2]


def test_a_start_at_which_the_momenta_are_singular_is_named() -> None:
    """The top upright: in Euler's angles det g = sin(theta)^2 = 0."""
    system = {
        "coordinates": ["phi", "theta"],
        "lagrangian": "(theta'^2 + phi'^2*sin(theta)^2)/2 - cos(theta)",
    }
    start = {"positions": {"phi": 0, "theta": 0}, "velocities": {"phi": 1, "theta": 0}}
    found = methods(
        OSCILLATOR | {"system": system, "initial": start, "steps": 5, "methods": ["variational"]}
    )
    assert "singular there" in found["variational-0.5"]["reason"]


@pytest.mark.parametrize("final", [{"t": 0, "positions": {"x": "evil"}, "velocities": {"x": 0}},
                                   {"t": 0, "positions": [1], "velocities": [1]},
                                   {"t": float("inf"), "positions": {"x": 1}, "velocities": {"x": 1}}])  # fmt: skip
def test_a_restart_without_a_point_is_rejected(final: dict[str, Any]) -> None:
    scene = {key: value for key, value in OSCILLATOR.items() if key != "initial"}
    with pytest.raises(InputError):
        simulate(
            scene
            | {"steps": 5, "methods": ["adaptive"], "restart": {"methods": [{"final": final}]}}
        )


def begun_at_zero(force: str, velocity: float, method: str) -> dict[str, Any]:
    initial = {"positions": {"x": 0}, "velocities": {"x": velocity}}
    scene = {
        "system": {"equations": [f"x'' = {force}"]},
        "initial": initial,
        "step": 0.1,
        "time": 1,
    }
    return methods(scene | {"methods": [method]})[method]


@pytest.mark.parametrize("force", ["sqrt(x)", "6*x^(1/3)", "1 + sqrt(x)"])
def test_what_leaves_the_root_at_once_is_the_one_motion(force: str) -> None:
    """v dv = f dx gives the time as an integral over x; a method that solves by slopes loses the
    velocity here.
    """
    energy = {"sqrt(x)": lambda x: 4 / 3 * x**1.5, "6*x^(1/3)": lambda x: 9 * x ** (4 / 3)}.get(
        force, lambda x: 2 * x + 4 / 3 * x**1.5
    )
    found = begun_at_zero(force, 1, "adaptive")
    passed, _ = quad(
        lambda u: 3 * u**2 / math.sqrt(1 + energy(u**3)),
        0,
        found["final"]["positions"]["x"] ** (1 / 3),
    )
    assert abs(passed - 1) < 1e-9
    assert begun_at_zero(force, 1, "stiff")["outcome"] == "singular"


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0, "1/2", 1])
def test_methods_with_the_same_equations_pass_a_kink_alike(alpha: Any) -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - 3*abs(x)"}
    scene = OSCILLATOR | {"system": system, "steps": 40}
    found = methods(
        scene
        | {
            "methods": [
                {"method": name, "alpha": alpha} for name in ("variational", "nonholonomic")
            ]
        }
    )
    switches = [method["switches"]["columns"] for method in found.values()]
    assert switches[0]["to"] == switches[1]["to"]
    assert switches[0]["to"][:2] == ["below", "above"]
    assert switches[0]["t"] == pytest.approx(switches[1]["t"], abs=1e-9)


@pytest.mark.slow
def test_a_constrained_motion_passes_a_kink_of_the_potential() -> None:
    """A step of 0.05 that passes the two kinks unseen ends 0.09 from the motion."""
    system = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2+y'^2+z'^2+x'*y')/2 - 2*abs(x-y)",
        "constraints": ["z' - y*x'"],
    }
    start = {"positions": {"x": 0, "y": 0.5, "z": 0}, "velocities": {"x": 0, "y": 0}}
    found = methods(
        {
            "system": system,
            "initial": start,
            "step": 0.05,
            "time": 1,
            "methods": ["nonholonomic", "adaptive"],
        }
    )
    assert {method["outcome"] for method in found.values()} == {"completed"}
    ends = [method["final"]["positions"]["x"] for method in found.values()]
    assert ends == pytest.approx([0.324499, 0.324499], abs=1e-3)  # DOP853 with events at 1e-12

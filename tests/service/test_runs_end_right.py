"""Scenes that once ended `completed` and were wrong, or took their neighbors with them: now right, or typed."""

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


@pytest.mark.slow
@pytest.mark.parametrize("roll", [1, 0])
def test_a_disk_that_does_not_turn_keeps_the_methods_that_can_run(roll: int) -> None:
    """The class of the paper excludes r1' = 0: L~ says so, and the others run."""
    initial = {"positions": {"phi": 0.1, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 0, "theta": roll}}
    found = methods(DISK | {"initial": initial, "methods": ["variational", "nonholonomic", "modified", "exact"]})
    assert found["variational-0.5"]["outcome"] == found["modified-0.5"]["outcome"] == "off_domain"
    assert found["variational-0.5"]["stopped"]["quantity"] == "phi'"
    assert found["nonholonomic-0.5"]["outcome"] == found["exact"]["outcome"] == "completed"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "positions", "velocities", "kept"),
    [
        (FREE | {"constraints": ["z' + x*y'"]}, {"x": 1, "y": 0, "z": 0}, {"x": 0, "y": 1}, "completed"),
        (FREE | {"constraints": ["x*z' - x^2*y'"]}, {"x": 0, "y": 0, "z": 0}, {"x": 1, "y": 1, "z": 1}, "singular"),
        ({"coordinates": ["phi", "x", "y"], "lagrangian": "(x'^2+y'^2+phi'^2)/2",
          "constraints": ["sin(phi)*x' - cos(phi)*y'"]}, {"phi": 0.3, "x": 0, "y": 0}, {"phi": 0, "x": 1}, "completed"),
    ],
    ids=["particle", "rank 0", "knife edge"],
)  # fmt: skip
def test_motions_that_the_class_excludes_are_typed(
    system: dict[str, Any], positions: dict[str, float], velocities: dict[str, float], kept: str
) -> None:
    scene = {"system": system, "initial": {"positions": positions, "velocities": velocities}}
    found = outcomes(scene | {"step": 0.05, "steps": 40, "methods": ["variational", "nonholonomic"]})
    assert found == {"variational-0.5": "off_domain", "nonholonomic-0.5": kept}


def test_one_method_that_fails_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault of ours in a method is that method's outcome."""
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
@pytest.mark.parametrize("order", [2, 8])
@pytest.mark.parametrize("step", [0.02, 0.01])
def test_a_run_ends_where_the_free_hamiltonian_ends(order: int, step: float) -> None:
    """A charged particle with drag: the catalogue's H~ is that of L~ only while x' > 0."""
    initial = {"positions": {"x": 0.394, "y": 0.893}, "velocities": {"x": 0.528, "y": -0.49}}
    method = {"method": "variational", "order": order}
    scene = {"system": {"catalogue": "magnetic-drag-b-x"}, "initial": initial, "step": step, "time": 6}
    (found,) = methods(scene | {"methods": [method], "observe": ["error"]}).values()
    assert found["outcome"] in ("singular", "off_domain")
    assert 1 < found["stopped"]["time"] < 2
    assert found["max_error"] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("alpha", ["0", "1/4", "1/3", "1"])
@pytest.mark.parametrize(("order", "bound"), [(4, 2e-6), (6, 1e-8), (8, 1e-12)])
def test_symmetrised_steps_are_composed(alpha: str, order: int, bound: float) -> None:
    """In the Hamiltonian form too, and at alpha = 0, where they are the steps of Stormer and Verlet."""
    method = {"method": "variational", "alpha": alpha, "symmetrised": True, "order": order}
    (found,) = methods(OSCILLATOR | {"time": 10, "methods": [method], "observe": ["error"]}).values()
    assert found["outcome"] == "completed"
    assert found["max_error"] < bound


@pytest.mark.slow
@pytest.mark.parametrize("alpha", ["0", "1/4", "1"])
def test_symmetrised_steps_are_composed_with_constraints(alpha: str) -> None:
    initial = {"positions": {"phi": 0.3, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 0.5}}
    method = {"method": "variational", "alpha": alpha, "symmetrised": True, "order": 4}
    constants = {"C_x": 0.01, "C_y": 0.01}
    scene = DISK | {"initial": initial, "steps": 20, "constants": constants, "methods": [method], "observe": ["error"]}
    (found,) = methods(scene).values()
    assert found["outcome"] == "completed"
    assert found["max_error"] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.02, 0.01])
def test_what_falls_into_a_pole_ends_there(step: float) -> None:
    """L = x'^2/2 - log(x) from rest at x = 1: x = 0 at t = sqrt(pi/2), where E and the motion end."""
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - log(x)"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": step,
        "time": 5,
        "methods": ["reference", "runge-kutta", {"method": "runge-kutta", "order": 8}, "variational"],
        "observe": ["energy", "trajectory"],
    }
    for method in methods(scene).values():
        assert method["outcome"] in ("singular", "no_convergence"), method["label"]
        assert method["stopped"]["time"] == pytest.approx(np.sqrt(np.pi / 2), abs=2 * step)
        assert None not in method["points"]["columns"]["energy"]
        assert min(method["points"]["columns"]["x"]) > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coordinates", "constraints"),
    [
        ("xyz", ["x*z' - x*y'"]),
        ("xyz", ["x*y' - sin(x)*z'"]),
        ("xyzw", ["y' - z'", "y' - (1+x)*z' + x*w'"]),
    ],
)
def test_a_loss_of_rank_ends_the_run(coordinates: str, constraints: list[str]) -> None:
    system = {
        "coordinates": list(coordinates),
        "lagrangian": "+".join(f"{name}'^2/2" for name in coordinates),
        "constraints": constraints,
    }
    scene = {
        "system": system,
        "initial": {"positions": {"x": -1, "y": 0, "z": 0, "w": 0}, "velocities": {"x": 1, "y": 0.5}},
        "step": 0.02,
        "time": 3,
        "methods": ["variational", {"method": "variational", "order": 4}, {"method": "variational", "alpha": 0},
                    "nonholonomic", "runge-kutta"],
        "observe": ["energy"],
    }  # fmt: skip
    scene["initial"]["positions"] = {name: -1 if name == "x" else 0 for name in coordinates}  # type: ignore[index]
    for method in methods(scene).values():
        assert method["outcome"] in ("singular", "unresolved")
        assert method["stopped"]["time"] == pytest.approx(1, abs=0.05)
        assert method["max_energy_error"] < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("k", [1e4, 1e6, 1e8])
@pytest.mark.parametrize("resolution", [0.1, 0.5, 1, 1.9])
def test_stiff_steps_converge_to_their_own_noise(k: float, resolution: float) -> None:
    """A stiff spring pendulum from its rest length: the force is known to k times the round-off of the place."""
    scene = {
        "system": {"coordinates": ["x", "y"], "parameters": ["k", "g"],
                   "lagrangian": "(x'^2+y'^2)/2 - k*(sqrt(x^2+y^2)-1)^2/2 - g*y"},
        "parameters": {"k": k, "g": 1},
        "initial": {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 0.3 if k == 1e6 else 0}},
        "step": resolution / k**0.5,
        "steps": 2000,
        "methods": ["variational", {"method": "variational", "order": 4}, {"method": "variational", "form": "raw"}],
        "observe": ["energy"],
    }  # fmt: skip
    for method in methods(scene).values():
        assert method["outcome"] == "completed", method
        assert method["max_energy_error"] < 1e-3


def test_a_first_step_that_does_not_converge_is_not_called_singular() -> None:
    scene = OSCILLATOR | {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 + cos(3*x)"}, "step": 30, "steps": 10,
        "methods": [{"method": "variational", "guard": False}],
    }  # fmt: skip
    (found,) = methods(scene).values()
    assert found["outcome"] == "completed" or found["stopped"]["value"] != 0


def test_the_energy_error_is_of_one_quantity_for_every_method() -> None:
    """The implicit midpoint rule keeps the energy of the oscillator exactly, and the table says so."""
    alike = ["variational", {"method": "variational", "form": "raw"}, "nonholonomic"]
    scene = OSCILLATOR | {"time": 100, "observe": ["energy"], "methods": [*alike, "runge-kutta"]}
    found = methods(scene)
    for label in ("variational-0.5", "variational-0.5-raw", "nonholonomic-0.5"):
        assert found[label]["max_energy_error"] < 1e-14
        assert found[label]["max_discrete_energy_error"] == pytest.approx(2.49e-3, rel=0.01)
    assert found["runge-kutta"]["max_energy_error"] == pytest.approx(1.39e-5, rel=0.02)
    assert "max_discrete_energy_error" not in found["runge-kutta"]


@pytest.mark.parametrize("method", ["heyoka"])
def test_a_series_whose_steps_shrink_without_end_is_stopped(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("heyoka")
    from inverse_service.simulation import peers

    monkeypatch.setattr(peers, "MOST_STEPS", 50)
    found = methods(OSCILLATOR | {"time": 1000, "methods": [method, "variational"]})
    assert found[method]["outcome"] == "unresolved"
    assert "50 steps" in found[method]["stopped"]["quantity"]
    assert found["variational-0.5"]["outcome"] == "completed"


def test_the_time_limit_stops_heyoka() -> None:
    pytest.importorskip("heyoka")
    found = methods(OSCILLATOR | {"steps": 100, "methods": ["heyoka"]}, limit=0.0)
    assert found["heyoka"]["outcome"] == "cancelled"


@pytest.mark.parametrize("center", [10**9, 10])
def test_the_rounding_of_a_place_far_off_is_no_jump_of_the_energy(center: int) -> None:
    pytest.importorskip("heyoka")
    document = {
        "system": {"lagrangian": f"x'^2/2 - (x - {center})^2/2", "coordinates": ["x"]},
        "initial": {"positions": {"x": center + 1}, "velocities": {"x": 0}},
        "step": 0.05, "steps": 200, "methods": [{"method": "heyoka"}], "observe": ["energy"],
    }  # fmt: skip
    assert outcomes(document) == {"heyoka": "completed"}


def test_heyoka_is_compiled_once() -> None:
    pytest.importorskip("heyoka")
    scene = OSCILLATOR | {"steps": 100, "methods": [{"method": "heyoka", "label": name} for name in "ab"]}
    found = methods(scene)
    assert found["b"]["seconds"]["compile"] < 0.01


EVERY = ["variational", "stormer-verlet", "nonholonomic", "runge-kutta", "reference", "adaptive", "stiff", "heyoka"]


@pytest.mark.slow
@pytest.mark.parametrize("lagrangian", ["x'^2/2 - x^2/2", "x'^2/2 - (x - 1)^2", "x'^2/2", "x'^2/2 - x^2/2 + log(x)"])
def test_what_is_at_rest_stays_at_rest(lagrangian: str) -> None:
    place = 0 if lagrangian.endswith("x^2/2") else 1
    start = {"positions": {"x": place}, "velocities": {"x": 0}}
    scene = OSCILLATOR | {"system": {"coordinates": ["x"], "lagrangian": lagrangian}, "initial": start, "steps": 20}
    for label, method in methods(scene | {"methods": EVERY}).items():
        assert method["outcome"] == "completed", label
        assert method["final"]["positions"]["x"] == pytest.approx(place, abs=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("size", ["abs(x')", "sqrt(x'^2 + y'^2)"])
def test_a_fall_with_quadratic_drag_begins_at_rest(size: str) -> None:
    """v = -u tanh(g t/u), u = sqrt(m g/k), while y stays at rest."""
    system = {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 - 10*x"}
    start = {"positions": {"x": 0, "y": 0}, "velocities": {"x": 0, "y": 0}}
    forces = {"x": f"-x'*{size}/10", "y": f"-y'*{size.replace('x', 'y', size.count('abs'))}/10"}
    chosen = ["variational", "nonholonomic", "adaptive"] + ["stiff"] * ("abs" not in size)
    scene = {"system": system, "forces": forces, "initial": start, "step": 0.01, "time": 1, "methods": chosen}
    for label, method in methods(scene).items():
        assert method["outcome"] == "completed", label
        assert method["final"]["positions"]["x"] == pytest.approx(-10 * math.log(math.cosh(1)), rel=1e-4)
        assert method["final"]["positions"]["y"] == 0


@pytest.mark.slow
def test_a_barrier_that_a_step_jumps_over_ends_the_run() -> None:
    """V rises from -1 to 1 at x = 1 within 0.002; a mass of energy 1/2 - 1 comes back."""
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - tanh(1000*(x - 1))"}
    start = {"positions": {"x": 0}, "velocities": {"x": 1}}
    scene = OSCILLATOR | {"system": system, "initial": start, "steps": 30, "methods": EVERY, "observe": ["energy"]}
    for label, method in methods(scene).items():
        if method["outcome"] == "completed":
            assert method["final"]["positions"]["x"] == pytest.approx(-1, abs=1e-2), label
        else:
            assert method["outcome"] in ("unresolved", "no_convergence", "guard"), label


def test_a_narrow_barrier_that_is_low_is_passed() -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - exp(-(1000*(x - 1.03))^2)/100"}
    start = {"positions": {"x": 0}, "velocities": {"x": 1}}
    found = outcomes(OSCILLATOR | {"system": system, "initial": start, "steps": 30, "methods": ["variational"]})
    assert found == {"variational-0.5": "completed"}


FIXED = ["variational", "stormer-verlet", "runge-kutta", "adaptive"]


@pytest.mark.slow
@pytest.mark.parametrize("observe", [[], ["error"]])
def test_a_force_far_faster_than_the_step_is_doubted(observe: list[str]) -> None:
    """Its mean is 0; at the steps it is that of a slow force, which throws the motion elsewhere."""
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 + sin(1000*t)*x^2/2"}
    start = {"positions": {"x": 1}, "velocities": {"x": 1}}
    scene = OSCILLATOR | {"system": system, "initial": start, "step": 0.05, "steps": 200, "methods": FIXED}
    found = methods(scene | {"observe": observe})
    assert found["adaptive"]["outcome"] == "completed"
    assert "doubt" not in found.pop("adaptive")
    assert all(method["outcome"] == "unresolved" or method["doubt"] for method in found.values())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "step", "steps"),
    [("-x + cos(t)/2", 0.3, 3000), ("-x + sin(1000*t)/10000", 0.05, 2000), ("-sin(x) + sin(t)/2", 0.05, 4000),
     ("-x + sin(1000*t)", 0.05, 200), ("-x + tanh(100*(t - 5))", 0.1, 3000)],
    ids=["coarse and long", "fast and weak", "chaotic", "fast and harmless", "switched"],
)  # fmt: skip
def test_coarse_runs_with_a_force_that_they_see_go_to_the_end(force: str, step: float, steps: int) -> None:
    start = {"positions": {"x": 1}, "velocities": {"x": 0}}
    scene = OSCILLATOR | {"system": {"equations": {"x": force}}, "initial": start, "step": step, "steps": steps}
    assert set(outcomes(scene | {"methods": FIXED[2:]}).values()) == {"completed"}


@pytest.mark.slow
def test_a_pole_written_as_a_square_is_not_jumped_over() -> None:
    """(x - y)^2, multiplied out or not, shows no change of sign."""
    start = {"positions": {"x": 0, "y": 1}, "velocities": {"x": 3, "y": 0}}
    for pole in ("x^2 - 2*x*y + y^2", "100*(x - y)^2"):
        system = {"coordinates": ["x", "y"], "lagrangian": f"(x'^2 + y'^2)/2 + 1/({pole})"}
        scene = OSCILLATOR | {"system": system, "initial": start, "step": 0.3, "steps": 10, "methods": EVERY}
        assert "completed" not in outcomes(scene).values()


@pytest.mark.slow
def test_a_pole_in_the_first_step_is_not_jumped_over() -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 + 1/(100*(x - 1)^2)"}
    start = {"positions": {"x": 0}, "velocities": {"x": 5}}
    scene = OSCILLATOR | {"system": system, "initial": start, "step": 0.5, "steps": 4, "methods": EVERY}
    assert "completed" not in outcomes(scene).values()


def test_a_pole_of_an_event_is_no_zero() -> None:
    events = [{"when": "1/x"}, {"when": "x"}]
    (method,) = methods(OSCILLATOR | {"steps": 50, "methods": ["adaptive"], "events": events}).values()
    assert [event["count"] for event in method["events"]] == [0, 2]


def test_a_start_at_which_the_momenta_are_singular_is_named() -> None:
    """The top upright: in Euler's angles det g = sin(theta)^2 = 0."""
    system = {"coordinates": ["phi", "theta"], "lagrangian": "(theta'^2 + phi'^2*sin(theta)^2)/2 - cos(theta)"}
    start = {"positions": {"phi": 0, "theta": 0}, "velocities": {"phi": 1, "theta": 0}}
    found = methods(OSCILLATOR | {"system": system, "initial": start, "steps": 5, "methods": ["variational"]})
    assert "singular there" in found["variational-0.5"]["reason"]


@pytest.mark.parametrize("final", [{"t": 0, "positions": {"x": "evil"}, "velocities": {"x": 0}},
                                   {"t": 0, "positions": [1], "velocities": [1]},
                                   {"t": float("inf"), "positions": {"x": 1}, "velocities": {"x": 1}}])  # fmt: skip
def test_a_restart_from_no_point_is_refused(final: dict[str, Any]) -> None:
    scene = {key: value for key, value in OSCILLATOR.items() if key != "initial"}
    with pytest.raises(InputError):
        simulate(scene | {"steps": 5, "methods": ["adaptive"], "restart": {"methods": [{"final": final}]}})


def test_a_force_without_a_value_at_the_start_is_named_with_its_time() -> None:
    """Not that a smaller step would help, and not t = 0 where the scene begins later."""
    free = {"coordinates": ["x"], "lagrangian": "x'^2/2"}
    start = {"positions": {"x": 1}, "velocities": {"x": 0}}
    every = [name for name in EVERY if name not in ("stormer-verlet", "heyoka")]
    for force in ("1/(t - 2)", "log(x - 1)"):
        scene = {"system": free, "initial": start, "step": 0.1, "steps": 9, "start_time": 2, "forces": {"x": force}}
        for method in methods(scene | {"methods": every}).values():
            assert method["outcome"] == "off_domain"
            assert method["stopped"]["time"] == 2
            assert "t = 2, which has no value" in method["stopped"]["quantity"]
            assert "smaller step" not in method["stopped"]["remedy"]


@pytest.mark.parametrize("start", [1, 0.1, 0])
def test_dry_friction_brings_a_block_to_rest(start: float) -> None:
    """Stages on both sides of x' = 0 canceled, and order 4 of one length slid on for ever."""
    system = {"coordinates": ["x"], "equations": {"x": "-sign(x')"}}
    initial = {"positions": {"x": 1}, "velocities": {"x": start}}
    found = methods({"system": system, "initial": initial, "step": 0.3, "steps": 20, "methods": ["runge-kutta"]})
    assert found["runge-kutta"]["outcome"] == "completed"
    assert found["runge-kutta"]["final"]["positions"]["x"] == pytest.approx(1 + start**2 / 2, abs=1e-12)
    assert found["runge-kutta"]["final"]["velocities"]["x"] == pytest.approx(0, abs=1e-12)


@pytest.mark.slow
def test_a_motion_far_faster_than_its_grid_is_not_called_singular() -> None:
    scene = OSCILLATOR | {"system": {"coordinates": ["x"], "equations": ["x'' = -10^16*x"]}, "step": 1.0, "steps": 3}
    for method in methods(scene | {"methods": ["adaptive", "heyoka"]}).values():
        assert method["outcome"] == "unresolved"
        assert "steps" in method["stopped"]["quantity"]


def test_a_lagrangian_of_the_scene_that_ends_is_not_said_to_be_another_one() -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - log(x)"}
    found = methods(OSCILLATOR | {"system": system, "time": 2, "step": 0.02, "methods": ["stormer-verlet"]})
    assert found["stormer-verlet"]["outcome"] == "singular"
    assert "free Lagrangian" not in found["stormer-verlet"]["stopped"]["remedy"]


ROOTS = [("sqrt(x)", 0), ("6*x^(1/3)", 0), ("-sqrt(abs(x))", 0), ("sqrt(x')", 0)]


def begun_at_zero(force: str, velocity: float, method: str) -> dict[str, Any]:
    initial = {"positions": {"x": 0}, "velocities": {"x": velocity}}
    scene = {"system": {"equations": [f"x'' = {force}"]}, "initial": initial, "step": 0.1, "time": 1}
    return methods(scene | {"methods": [method]})[method]


@pytest.mark.parametrize("method", ["adaptive", "stiff", "reference"])
@pytest.mark.parametrize(("force", "velocity"), ROOTS)
def test_no_run_chooses_one_of_many_motions(force: str, velocity: float, method: str) -> None:
    """x'' = sqrt(x) has x = 0 and x = (t - s)^4/144 from x = x' = 0 (Peano's example for the second order)."""
    found = begun_at_zero(force, velocity, method)
    assert found["outcome"] == "singular"
    assert "more than one motion" in found["stopped"]["quantity"]


@pytest.mark.parametrize("force", ["sqrt(x)", "6*x^(1/3)", "1 + sqrt(x)"])
def test_what_leaves_the_root_at_once_is_the_one_motion(force: str) -> None:
    """v dv = f dx gives the time as an integral over x; the method that solves by slopes lost the velocity here."""
    energy = {"sqrt(x)": lambda x: 4 / 3 * x**1.5, "6*x^(1/3)": lambda x: 9 * x ** (4 / 3)}.get(
        force, lambda x: 2 * x + 4 / 3 * x**1.5
    )
    found = begun_at_zero(force, 1, "adaptive")
    passed, _ = quad(lambda u: 3 * u**2 / math.sqrt(1 + energy(u**3)), 0, found["final"]["positions"]["x"] ** (1 / 3))
    assert abs(passed - 1) < 1e-9
    assert begun_at_zero(force, 1, "stiff")["outcome"] == "singular"


@pytest.mark.parametrize("force", ["abs(x)", "sqrt(x^2)", "x*sqrt(x)", "x*log(1 + abs(x))"])
def test_a_kink_or_a_weaker_root_has_one_motion(force: str) -> None:
    assert begun_at_zero(force, 0, "adaptive")["final"]["positions"] == {"x": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("method", ["adaptive", "stiff", "reference", "runge-kutta", "heyoka"])
@pytest.mark.parametrize(
    ("force", "velocity", "end"), [("x'^2", 1, 1), ("x'^2", 2, 0.5), ("2*x'^2/(1 + x)", 1, 1), ("2*x^3", 1, 1)]
)
def test_a_motion_that_ends_with_the_run_is_not_completed(force: str, velocity: float, end: float, method: str) -> None:
    """x' = 1/(1 - t) from x'(0) = 1, and x = 1/(1 - t) of x'' = 2 x^3: infinite at the last point of the grid."""
    place = 1 if force == "2*x^3" else 0
    initial = {"positions": {"x": place}, "velocities": {"x": velocity}}
    scene = {"system": {"equations": [f"x'' = {force}"]}, "initial": initial, "step": end / 50, "time": end}
    found = methods(scene | {"methods": [method]})[method]
    assert found["outcome"] != "completed"
    assert found.get("final", {"t": 0})["t"] < end


@pytest.mark.parametrize("method", ["adaptive", "reference", "runge-kutta", "stiff"])
@pytest.mark.parametrize("force", ["atan(x'/x)", "exp(-1/x^2)", "tanh(1/x)", "atan(log(x))", "1/(1 + 1/x^2)"])
def test_no_run_begins_where_its_formula_has_no_value(force: str, method: str) -> None:
    """In doubles 1/0 is infinite and atan(1/0) a number, for x < 0 of the wrong sign."""
    assert begun_at_zero(force, -1, method)["outcome"] == "off_domain"


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0, "1/2", 1])
def test_methods_with_the_same_equations_pass_a_kink_alike(alpha: Any) -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - 3*abs(x)"}
    scene = OSCILLATOR | {"system": system, "steps": 40}
    found = methods(scene | {"methods": [{"method": name, "alpha": alpha} for name in ("variational", "nonholonomic")]})
    switches = [method["switches"]["columns"] for method in found.values()]
    assert switches[0]["to"] == switches[1]["to"]
    assert switches[0]["to"][:2] == ["below", "above"]
    assert switches[0]["t"] == pytest.approx(switches[1]["t"], abs=1e-9)


@pytest.mark.slow
def test_a_constrained_motion_passes_a_kink_of_the_potential() -> None:
    """A step of 0.05 once went by two kinks here and ended 0.09 from the motion."""
    system = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2+y'^2+z'^2+x'*y')/2 - 2*abs(x-y)",
        "constraints": ["z' - y*x'"],
    }
    start = {"positions": {"x": 0, "y": 0.5, "z": 0}, "velocities": {"x": 0, "y": 0}}
    found = methods(
        {"system": system, "initial": start, "step": 0.05, "time": 1, "methods": ["nonholonomic", "adaptive"]}
    )
    assert {method["outcome"] for method in found.values()} == {"completed"}
    ends = [method["final"]["positions"]["x"] for method in found.values()]
    assert ends == pytest.approx([0.324499, 0.324499], abs=1e-3)  # DOP853 with events at 1e-12


def test_a_board_at_rest_needs_no_force() -> None:
    """The rotor of a snakeboard turns and the board rests: multipliers that are 0 but for round-off are no failure."""
    board = "m*(x'^2 + y'^2)/2 + m*r^2*th'^2/2 + J*psi'^2/2 + J*psi'*th' + J1*phi'^2"
    wheels = ["-sin(th+phi)*x' + cos(th+phi)*y' - r*cos(phi)*th'", "-sin(th-phi)*x' + cos(th-phi)*y' + r*cos(phi)*th'"]
    names = ["x", "y", "th", "psi", "phi"]
    found = methods(
        {
            "system": {"coordinates": names, "lagrangian": board, "constraints": wheels},
            "parameters": {"m": 1, "r": 1, "J": 0.3, "J1": 0.1},
            "initial": {
                "positions": dict.fromkeys(names, 0) | {"phi": 0.3}, "velocities": {"psi": 2, "phi": 0.2, "x": 0},
            },
            "step": 0.02, "time": 4, "methods": ["nonholonomic", {"method": "nonholonomic", "order": 4}],
        }
    )  # fmt: skip
    for one in found.values():
        assert one["outcome"] == "completed"
        assert one["final"]["positions"] == pytest.approx({"x": 0, "y": 0, "th": 0, "psi": 8, "phi": 1.1}, abs=1e-12)

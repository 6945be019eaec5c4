"""Systems with t: every method converges to the known solution with its order, and no energy is
reported.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate

W = 2.0
FORCED: dict[str, Any] = {
    "system": {
        "coordinates": ["x"],
        "lagrangian": "x'^2/2 - x^2/2 + x*cos(w*t)",
        "parameters": ["w"],
    },
    "parameters": {"w": W},
    "initial": {"positions": {"x": "1/2"}, "velocities": {"x": 1}},
}
DAMPED: dict[str, Any] = {
    "system": {"coordinates": ["x"], "equations": {"x": "-x - c*x'"}, "parameters": ["c"]},
    "parameters": {"c": "1/5"},
    "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
}
GIVEN = DAMPED | {"free_lagrangian": "exp(c*t)*(x'^2 - x^2)/2"}


def forced(t: Any) -> Any:
    """x'' + x = cos(w t), x(0) = 1/2, x'(0) = 1."""
    part = 1 / (1 - W**2)
    return (0.5 - part) * np.cos(t) + np.sin(t) + part * np.cos(W * t)


def damped(t: Any) -> Any:
    """x'' + c x' + x = 0, x(0) = 1, x'(0) = 0."""
    rate, turn = 0.1, np.sqrt(1 - 0.01)
    return np.exp(-rate * t) * (np.cos(turn * t) + rate / turn * np.sin(turn * t))


def errors(scene: dict[str, Any], method: dict[str, Any], true: Any, steps: int) -> float:
    found = simulate(scene | {"step": 10 / steps, "steps": steps, "methods": [method]})["methods"][
        0
    ]
    assert found["outcome"] == "completed"
    columns = found["points"]["columns"]
    return float(np.abs(np.array(columns["x"]) - true(np.array(columns["t"]))).max())


def test_a_driven_force_is_taken_in_the_middle_of_an_explicit_step() -> None:
    """Stormer and Verlet: order 2, as without t; at the start of the step it would be 1."""
    verlet = {"method": "stormer-verlet"}
    coarse, fine = (errors(FORCED, verlet, forced, steps) for steps in (50, 100))
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.12)


def test_a_stiff_method_needs_no_more_steps_where_t_is_no_coordinate() -> None:
    """Without the slope of the force in t, an error estimate of lower order asks for 100 times as
    many."""
    initial = {"positions": {"x": "1/2", "s": 0}, "velocities": {"x": 1, "s": 1}}
    lifted = {"coordinates": ["x", "s"], "equations": {"x": "-x + cos(w*s)", "s": "0"}}
    lifted |= {"parameters": ["w"]}
    counts = []
    for scene in (FORCED, FORCED | {"system": lifted, "initial": initial}):
        (found,) = simulate(scene | {"step": 0.2, "steps": 50, "methods": ["stiff"]})["methods"]
        columns = found["points"]["columns"]
        times, places = (np.array(columns[name]) for name in ("t", "x"))
        assert np.abs(places - forced(times)).max() < 1e-7
        counts.append(found["force_evaluations"])
    assert counts[0] < 1.5 * counts[1]


METHODS: list[tuple[dict[str, Any], float]] = [
    ({"method": "variational", "alpha": 0}, 1),
    ({"method": "variational", "alpha": "1/3"}, 1),
    ({"method": "variational"}, 2),
    ({"method": "variational", "form": "raw"}, 2),
    ({"method": "variational", "order": 4}, 4),
    ({"method": "runge-kutta"}, 4),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "true"), [(FORCED, forced), (GIVEN, damped)], ids=["forced", "damped"]
)
@pytest.mark.parametrize(("method", "order"), METHODS, ids=[str(method) for method, _ in METHODS])
def test_methods_have_their_order(
    scene: dict[str, Any], true: Any, method: dict[str, Any], order: float
) -> None:
    coarse, fine = (errors(scene, method, true, steps) for steps in (400, 800))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "true"), [(FORCED, forced), (DAMPED, damped)], ids=["forced", "damped"]
)
@pytest.mark.parametrize("method", ["reference", "heyoka"])
def test_references_meet_the_known_solution(scene: dict[str, Any], true: Any, method: str) -> None:
    if method == "heyoka":
        pytest.importorskip("heyoka")
    assert errors(scene, {"method": method}, true, 200) < 1e-13


def test_a_lagrangian_method_with_nonholonomic_name_takes_t_too() -> None:
    assert errors(FORCED, {"method": "nonholonomic"}, forced, 800) < 1e-3


@pytest.mark.slow
def test_the_lagrangian_of_a_damped_system_is_found_with_t() -> None:
    found = simulate(DAMPED | {"step": 0.1, "steps": 5, "methods": ["variational"]})["methods"][0]
    assert "t" in found["free_lagrangian"]


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order"), [({"method": "nonholonomic"}, 2), ({"method": "runge-kutta"}, 4),
                                               ({"method": "nonholonomic", "order": 4}, 4)])  # fmt: skip
def test_a_driven_constrained_system_keeps_constraint_and_order(
    method: dict[str, Any], order: int
) -> None:
    driven = {
        "system": {"coordinates": ["phi", "theta", "x", "y"],
                   "constraints": ["x' - cos(phi)*theta'", "y' - sin(phi)*theta'"],
                   "lagrangian": "(x'^2 + y'^2)/2 + theta'^2/4 + phi'^2/8 + x*cos(t)/3 + phi*sin(t)*y'/10"},
        "initial": {"positions": {"phi": 0.1, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 1}},
        "methods": [method], "observe": ["error", "constraints"],
    }  # fmt: skip
    coarse, fine = (
        simulate(driven | {"step": 5 / steps, "steps": steps})["methods"][0] for steps in (200, 400)
    )
    assert np.log2(coarse["max_error"] / fine["max_error"]) == pytest.approx(order, abs=0.15)
    if method["method"] == "nonholonomic":
        assert fine["max_constraint"] < 1e-14


def test_an_energy_that_is_not_constant_has_no_error() -> None:
    scene = FORCED | {
        "step": 0.1,
        "steps": 50,
        "observe": ["energy"],
        "methods": ["variational", "reference"],
    }
    for method in simulate(scene)["methods"]:
        assert method["max_energy_error"] is None
        assert "contains t" in method["energy_note"]
        assert len(method["points"]["columns"]["energy"]) == 51


def test_the_energy_of_a_driven_system_is_that_of_its_motion() -> None:
    scene = FORCED | {"step": 0.01, "steps": 300, "observe": ["energy"], "methods": ["variational"]}
    columns = simulate(scene)["methods"][0]["points"]["columns"]
    t = np.array(columns["t"])
    speed = np.gradient(forced(t), t, edge_order=2)
    expected = speed**2 / 2 + forced(t) ** 2 / 2 - forced(t) * np.cos(W * t)
    assert np.abs(np.array(columns["energy"]) - expected).max() < 1e-3


def test_a_lagrangian_that_has_other_motions_is_refused() -> None:
    scene = DAMPED | {
        "step": 0.1,
        "steps": 5,
        "methods": ["variational"],
        "free_lagrangian": "exp(t)*(x'^2 - x^2)",
    }
    with pytest.raises(InputError, match="does not solve"):
        simulate(scene)


def test_what_is_not_done_says_so() -> None:
    symmetrised = {"method": "variational", "alpha": 0, "symmetrised": True}
    method = simulate(FORCED | {"step": 0.1, "steps": 5, "methods": [symmetrised]})["methods"][0]
    assert method["outcome"] == "unavailable"
    assert "a system without t" in method["reason"]


FORCES = ["log(t)", "1/t", "sqrt(t - 1)"]


@pytest.mark.parametrize("force", FORCES)
def test_a_force_undefined_at_the_start_does_not_complete(force: str) -> None:
    """The midpoint and the collocation points would skip it unnoticed."""
    system = {"coordinates": ["x"], "lagrangian": f"x'^2/2 + x*{force}"}
    methods = [
        "variational",
        {"method": "variational", "form": "raw"},
        "nonholonomic",
        "runge-kutta",
        "reference",
    ]
    scene = {
        "system": system,
        "initial": {"positions": {"x": 0}, "velocities": {"x": 1}},
        "step": 0.1,
        "steps": 10,
    }
    for method in simulate(scene | {"methods": methods})["methods"]:
        assert method["outcome"] == "off_domain"
        assert "t = 0" in method["stopped"]["quantity"]


def test_heyoka_at_such_a_start_is_not_finite() -> None:
    pytest.importorskip("heyoka")
    scene = FORCED | {
        "system": {"coordinates": ["x"], "equations": {"x": "log(t)"}},
        "parameters": {},
    }
    scene |= {"step": 0.1, "steps": 10, "methods": ["heyoka"], "observe": ["energy", "velocities"]}
    assert simulate(scene)["methods"][0]["outcome"] == "not_finite"


def test_an_energy_with_t_is_observed_where_the_motion_has_none() -> None:
    scene = FORCED | {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 + 1/(t + 1)"},
        "parameters": {},
    }
    scene |= {"step": 0.1, "steps": 10, "methods": ["runge-kutta"], "observe": ["energy"]}
    energies = simulate(scene)["methods"][0]["points"]["columns"]["energy"]
    assert energies[-1] == pytest.approx(0.5 - 1 / 2, abs=0.06)

"""A force that lies between two points of a run, however narrow, does not let the run end as if it were not there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import Symbol
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation.array_values import array_value, bounds

FIXED = ["variational", "stormer-verlet", "runge-kutta", "reference"]
START = {"initial": {"positions": {"x": 0}, "velocities": {"x": 1}}, "step": 0.1, "steps": 30}
FREE = {"coordinates": ["x"], "lagrangian": "x'^2/2"}


def barrier(height: float, sharpness: str) -> dict[str, Any]:
    return {"coordinates": ["x"], "lagrangian": f"x'^2/2 - {height}*exp(-({sharpness}*(x - 1.03))^2)"}


def outcomes(scene: dict[str, Any]) -> dict[str, str]:
    return {method["label"]: method["outcome"] for method in simulate(scene)["methods"]}


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("sharpness", ["1000", "10^6", "10^12"])
def test_a_barrier_of_any_width_is_not_leapt_over(sharpness: str, every: int) -> None:
    """Ten widths down to the round-off of x; few points recorded hide nothing, and none behind the barrier is kept."""
    scene = START | {"system": barrier(0.3, sharpness), "methods": FIXED, "record_every": every}
    found = simulate(scene)["methods"]
    assert {method["outcome"] for method in found} == {"unresolved"}
    assert {len(method["points"]["columns"]["t"]) for method in found} == {10 // every + 1}
    assert {(method["steps"], method["final"]["t"]) for method in found} == {(10, 1.0)}


@pytest.mark.parametrize("observe", [["trajectory"], ["energy"]])
@pytest.mark.parametrize("every", [1, 10])
def test_a_run_that_gains_energy_in_two_steps_is_unresolved(observe: list[str], every: int) -> None:
    """A barrier of half a step throws the motion on with twice its energy; it turns round there."""
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - exp(-((x - 3)/s)^2)", "parameters": {"s": 0.02}}
    scene = {"system": system, "initial": {"positions": {"x": 0}, "velocities": {"x": 1.2}}, "step": 0.1, "time": 5}
    scene |= {"methods": [{"method": "stormer-verlet", "order": 8}], "observe": observe, "record_every": every}
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "unresolved"
    assert found["stopped"]["time"] == pytest.approx(2.5, abs=0.11)
    (finer,) = simulate(scene | {"step": 0.01})["methods"]
    assert finer["outcome"] == "completed"
    assert finer["final"]["positions"]["x"] < 3


def test_what_comes_after_the_end_of_a_run_does_not_count() -> None:
    """The barrier is behind the place at which an event ends the run."""
    scene = START | {"system": barrier(0.3, "1000"), "methods": ["stormer-verlet"]}
    assert set(outcomes(scene).values()) == {"unresolved"}
    assert set(outcomes(scene | {"events": [{"when": "x - 1/2", "do": "stop"}]}).values()) == {"completed"}


def test_friction_and_forces_are_looked_at_too() -> None:
    spike = "5000*exp(-(1000*(x - 1.03))^2)"
    with_force = START | {
        "system": FREE,
        "forces": {"x": f"-x'/10 - {spike}"},
        "methods": ["variational", "runge-kutta"],
    }
    with_drag = START | {"system": {"equations": {"x": f"-x'/10 - {spike}"}}, "methods": ["runge-kutta", "reference"]}
    assert set(outcomes(with_force).values()) == set(outcomes(with_drag).values()) == {"unresolved"}


def test_a_force_across_the_way_is_seen() -> None:
    """The potential is 0 on the way itself, and a wall beside it throws the motion aside."""
    system = {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 - 1000*y*exp(-(1000*(x - 1.03))^2)"}
    start = {"positions": {"x": 0, "y": 0}, "velocities": {"x": 1, "y": 0}}
    scene = START | {"system": system, "initial": start, "methods": ["variational", "runge-kutta"]}
    assert set(outcomes(scene).values()) == {"unresolved"}


def test_a_truth_that_leapt_is_no_truth() -> None:
    """All references pass a barrier of width 1e-6 alike; where one comes back the others are not believed."""
    found = simulate(START | {"system": barrier(10, "10^6"), "methods": ["adaptive", "heyoka"], "observe": ["error"]})
    assert {method["outcome"] for method in found["methods"]} <= {"unresolved", "unavailable"}
    assert "known until t = 1 only: there the reference solutions went by a force" in found["truth"]["reason"]
    assert "too narrow" in found["truth"]["reason"]


def test_a_method_with_steps_of_its_own_that_saw_the_barrier_goes_on() -> None:
    """DOP853 in steps of 0.1 or less comes back from a barrier 0.02 wide; those of heyoka are no longer."""
    pytest.importorskip("heyoka")
    scene = START | {"system": barrier(10, "50"), "methods": ["adaptive", "heyoka"]}
    for method in simulate(scene)["methods"]:
        if method["outcome"] == "completed":
            assert method["final"]["positions"]["x"] == pytest.approx(-1, abs=0.1)
    low = simulate(START | {"system": barrier(0.15, "10"), "methods": ["heyoka"], "observe": ["error"]})["methods"][0]
    assert (low["outcome"], low["max_error"]) == ("completed", pytest.approx(0, abs=1e-12))


@pytest.mark.parametrize(
    ("system", "step"),
    [
        ({"coordinates": ["x"], "lagrangian": "x'^2/2 + 2*cos(x)"}, 0.5),
        ({"coordinates": ["x"], "lagrangian": "x'^2/2 - 2*cosh(x)"}, 0.3),
        ({"coordinates": ["x"], "lagrangian": "x'^2/2 - (1 - exp(1 - x))^2"}, 0.3),
        ({"equations": {"x": "-tanh(x) - x'/10"}}, 0.5),
        ({"equations": {"x": "-x/sqrt(1 + x^2)"}}, 0.5),
    ],
    ids=["pendulum", "cosh", "Morse", "friction", "root"],
)
def test_coarse_steps_of_smooth_forces_go_to_the_end(system: dict[str, Any], step: float) -> None:
    scene = START | {"system": system, "step": step, "steps": 400, "methods": ["runge-kutta", "reference"]}
    for method in simulate(scene)["methods"]:
        assert method["outcome"] == "completed"
        assert "bounded on the straight way" in method["between_points"]


def test_what_was_not_looked_at_is_said() -> None:
    scene = START | {"methods": [{"method": "variational", "guard": False}, "runge-kutta"]}
    unguarded, _ = simulate(scene | {"system": barrier(0.3, "1000")})["methods"]
    assert (unguarded["outcome"], "the guard was off" in unguarded["between_points"]) == ("completed", True)
    assert all("polynomials" in m["between_points"] for m in simulate(scene | {"system": FREE})["methods"])
    long = {"step": 1e-5, "steps": 100_001, "record_every": 1000}
    assert "more than 100,000" in simulate(scene | long | {"system": barrier(0.3, "1")})["methods"][1]["between_points"]


@pytest.mark.parametrize("count", [40, 8000])
def test_members_that_leap_are_counted(count: int) -> None:
    """Every other member has the energy to reach x = 1.03; 8,000 are more than the sample that is looked at first."""
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2 - A*exp(-(10^6*(x - 1.03))^2)"}
    fast = [1.2 if k % 2 else 1.0 for k in range(count)]
    ensemble = {
        "initial": {"positions": {"x": [0.1 * (k // 2) / count for k in range(count)]}, "velocities": {"x": fast}}
    }
    scene = START | {"system": system, "parameters": {"A": 1}, "ensemble": ensemble, "methods": ["runge-kutta"]}
    (method,) = simulate(scene)["methods"]
    assert method["outcomes"] == {"unresolved": count // 2, "completed": count // 2}
    assert f"{count:,} of {count:,} members" in method["between_points"]
    if count == 40:
        ends = method["members_columns"]["x_end"]
        assert [end is None for end in ends] == [k % 2 == 1 for k in range(count)]


@pytest.mark.parametrize(
    "text",
    ["(x - 1)^2*exp(-x)", "x^2 - 2*x + 1", "sin(3*x)/(2 + cos(x))", "tan(x)", "sqrt(x^2 + 1)", "log(2 + x)*x^3",
     "1/x", "atan(x)*acos(x/9)", "x^(-2)", "cosh(x) - x^4", "2^x", "sech(x)*x", "asinh(x)^3"],
)  # fmt: skip
def test_bounds_hold_every_value(text: str) -> None:
    """And are as near as the box is small: of a box 1e-3 wide off the poles they are less than 0.1 apart."""
    tree, chance = read_formula(text, Names(("x",))), np.random.default_rng(1)
    starts = chance.uniform(-1.5, 1.5, 2000)
    ends = starts + chance.choice([1.0, -0.1, 1e-3], 2000)
    low, high = bounds(tree, {Symbol("x"): (starts, ends)})
    for share in np.linspace(0, 1, 7):
        values = array_value(tree, {Symbol("x"): starts + share * (ends - starts)})
        off = np.isfinite(values) & ((values < low - 1e-9 * abs(values)) | (values > high + 1e-9 * abs(values)))
        assert not off.any()
    narrow = (np.abs(ends - starts) < 0.01) & (np.abs(starts) > 0.5)
    assert (high - low)[narrow].max() < 0.1 or text == "tan(x)"


@pytest.mark.parametrize("force", ["-sin(x)", "-tan(x)", "-sinh(x) + x^3"])
def test_a_motion_of_any_size_hides_nothing(force: str) -> None:
    """sin is not cos of a shifted angle, whose round-off is far above a motion of 1e-30."""
    found = simulate({
        "system": {"equations": {"x": force}}, "initial": {"positions": {"x": 1e-30}, "velocities": {"x": 0}},
        "step": 0.05, "steps": 40, "methods": ["runge-kutta", "variational", "adaptive"],
    })  # fmt: skip
    assert {method["outcome"] for method in found["methods"]} <= {"completed", "unavailable"}
    assert found["methods"][0]["final"]["positions"]["x"] == pytest.approx(1e-30 * np.cos(2), rel=1e-5)


@pytest.mark.parametrize("sharpness", [30, 100, 300])
def test_a_method_with_a_tolerance_keeps_the_energy_or_is_unresolved(sharpness: int) -> None:
    """A Taylor series that steps into a barrier before it sees it had lost 0.2 % of the energy and `completed`."""
    methods = simulate(START | {"system": barrier(10, str(sharpness)), "methods": ["adaptive", "stiff", "heyoka"],
                                "observe": ["energy"]})["methods"]  # fmt: skip
    assert "completed" in {method["outcome"] for method in methods}
    for method in methods:
        assert method["outcome"] in ("unresolved", "unavailable") or method["max_energy_error"] < 1e-6, method["label"]


@pytest.mark.parametrize("far", [0, 10**3, 10**6])
def test_a_formula_is_evaluated_as_it_is_written(far: int) -> None:
    """Multiplied out, (x - 10^6)^2 + y^2 has lost 12 digits; the round-off of x itself is 1e-10."""
    system = {"coordinates": ["x", "y"], "lagrangian": f"(x'^2 + y'^2)/2 + 1/sqrt((x - {far})^2 + y^2)"}
    start = {"positions": {"x": far + 1, "y": 0}, "velocities": {"x": 0, "y": 1}}
    methods = ["adaptive", "reference", {"method": "stormer-verlet", "order": 8}, {"method": "variational", "order": 8}]
    scene = {"system": system, "initial": start, "step": 0.1, "steps": 100, "methods": methods, "observe": ["error"]}
    for method in simulate(scene)["methods"]:
        assert method["outcome"] == "completed", method["label"]
        assert method["final"]["positions"]["x"] - far == pytest.approx(np.cos(10), abs=1e-8 + far * 1e-13)
        assert method["max_error"] < 1e-8 + far * 1e-13


@pytest.mark.parametrize(
    ("force", "start"),
    [("-5000*x'*exp(-(100*x')^2)", 0.1), ("-tanh(1000*x')/3", 0.0), ("tanh(1000*(t - 3.333))", 0.0)],
    ids=["a brake for small velocities", "dry friction", "a switch"],
)
def test_a_series_that_goes_by_a_narrow_force_is_unresolved(force: str, start: float) -> None:
    """Far from it the force and all its derivatives are 0 or 1 to round-off, and so is every term of the series."""
    pytest.importorskip("heyoka")
    document = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}, "forces": {"x": force},
        "initial": {"positions": {"x": 3}, "velocities": {"x": start}}, "step": 0.05, "time": 10,
        "methods": ["heyoka", "adaptive"], "observe": ["error"],
    }  # fmt: skip
    series, steps = simulate(document)["methods"]
    assert series["outcome"] == "unresolved"
    assert "adaptive" in series["stopped"]["remedy"]
    assert (steps["outcome"], steps["max_error"]) == ("completed", pytest.approx(0, abs=1e-10))
    assert "polynomials" not in steps["between_points"]


def test_a_force_that_holds_one_velocity_is_not_leapt_over() -> None:
    """It lets no body become faster than 1: a step of 0.05 in the velocity goes by a width of 0.001."""
    document = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 + x"}, "step": 0.05, "time": 5,
        "forces": {"x": "-10^6*(x' - 1)*exp(-(1000*(x' - 1))^2)"},
        "methods": ["variational", "runge-kutta", "adaptive"],
        "initial": {"positions": {"x": 0}, "velocities": {"x": 0}},
    }  # fmt: skip
    *given, own = simulate(document)["methods"]
    assert [method["outcome"] for method in given] == ["unresolved"] * 2
    assert own["final"]["velocities"]["x"] == pytest.approx(1, abs=1e-5)
    drag = document | {"forces": {"x": "-2*x'*sqrt(x'^2 + 1)"}, "step": 0.3, "time": 6}
    assert {method["outcome"] for method in simulate(drag)["methods"]} == {"completed"}

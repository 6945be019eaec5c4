"""Scenes of textbooks against closed forms and against SciPy's DOP853 with equations by hand."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from inverse_service.service.scenes.simulating import simulate

Array = Any


def ends(scene: dict[str, Any]) -> Array:
    """The positions at the end by each method, which has to reach it without a doubt."""
    found = simulate(scene | {"step": 0.01, "observe": ["trajectory"]})["methods"]
    assert [(one["outcome"], "doubt" in one) for one in found] == [("completed", False)] * len(
        found
    )
    return np.array([[*one["final"]["positions"].values()] for one in found])


def test_a_block_on_a_belt_ends_in_the_orbit_that_just_touches_its_velocity() -> None:
    """x'' = -x - mu sign(x' - v) from x = 2 slips, is carried, and then moves by x = mu + v sin t."""
    mu, v, time = 0.6, 0.3, 9.0
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}, "forces": {"x": "-0.6*sign(x'-0.3)"},
        "initial": {"positions": {"x": 2}, "velocities": {"x": 0}}, "time": time, "methods": ["adaptive"],
    }  # fmt: skip
    first = np.pi + np.arcsin(v / (2 - mu))  # as fast as the belt, beyond -mu: it passes
    beyond = np.sqrt((2 - mu) ** 2 - v**2) - 2 * mu
    carried = first + 2 * np.arctan(beyond / v)
    leaves = carried + (2 * mu - beyond) / v
    assert np.abs(ends(scene) - (mu + v * np.sin(time - leaves))).max() < 1e-12


def sleigh(t: float, y: Array) -> list[float]:
    """x, y, angle, speed along the blade, and turn: the center of mass is 0.3 before the blade, m =
    1, I = 1/2, drag 0.2 at the blade.
    """
    _, _, angle, speed, turn = y
    return [
        speed * np.cos(angle), speed * np.sin(angle), turn, 0.3 * turn**2 - 0.2 * speed,
        -0.3 * speed * turn / (0.5 + 0.3**2),
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("method", ["adaptive", "reference", "stiff"])
def test_chaplygins_sleigh_with_drag(method: str) -> None:
    lagrangian = "((x' - 0.3*f'*sin(f))^2 + (y' + 0.3*f'*cos(f))^2)/2 + f'^2/4"
    system = {"coordinates": ["x", "y", "f"], "lagrangian": lagrangian, "constraints": ["y'*cos(f) = x'*sin(f)"]}  # fmt: skip
    start = {"positions": {"x": 0, "y": 0, "f": 0}, "velocities": {"x": 1, "y": 0, "f": 2}}
    scene = {"system": system, "initial": start, "forces": {"x": "-0.2*x'", "y": "-0.2*y'"}}
    true = solve_ivp(sleigh, (0, 6), [0, 0, 0, 1, 2], "DOP853", rtol=1e-13, atol=1e-13).y[:3, -1]
    assert np.abs(ends(scene | {"time": 6, "methods": [method]}) - true).max() < 1e-8


def gear(t: float, y: Array) -> Array:
    """Two links with dry friction in both joints, as long as both turn and turn against each
    other.
    """
    (a, b), (u, v) = y[:2], y[2:]
    masses = [[2, np.cos(a - b)], [np.cos(a - b), 1]]
    first, second = -3 * np.sign(u) - np.sign(u - v), np.sign(u - v)
    right = [
        -np.sin(a - b) * v**2 - 19.62 * np.sin(a) + first,
        np.sin(a - b) * u**2 - 9.81 * np.sin(b) + second,
    ]
    return np.array([u, v, *np.linalg.solve(masses, right)])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["adaptive", "reference", "stiff"])
def test_friction_in_joints_before_it_holds_them(method: str) -> None:
    lagrangian = "a'^2 + b'^2/2 + a'*b'*cos(a-b) + 19.62*cos(a) + 9.81*cos(b)"
    begin = [1.2, -0.9, -0.1, 0.1]
    scene = {
        "system": {"coordinates": ["a", "b"], "lagrangian": lagrangian}, "time": 0.3, "methods": [method],
        "forces": {"a": "-3*sign(a') - sign(a'-b')", "b": "sign(a'-b')"},
        "initial": {"positions": {"a": 1.2, "b": -0.9}, "velocities": {"a": -0.1, "b": 0.1}},
    }  # fmt: skip
    found = solve_ivp(gear, (0, 0.3), begin, "DOP853", rtol=1e-13, atol=1e-13).y
    assert (found[2] < 0).all()
    assert (found[2] < found[3]).all()
    assert np.abs(ends(scene) - found[:2, -1]).max() < 1e-8


@pytest.mark.parametrize("method", ["adaptive", "heyoka", "variational"])
def test_a_kinetic_energy_without_squares(method: str) -> None:
    """L = x' y' - x^2 y - y^3/3: x'' = -x^2 - y^2, y'' = -2 x y, so x + y and x - y move apart."""
    scene = {
        "system": {"coordinates": ["x", "y"], "lagrangian": "x'*y' - x^2*y - y^3/3"}, "time": 3,
        "initial": {"positions": {"x": 0.3, "y": 0.2}, "velocities": {"x": 0, "y": 0.1}}, "methods": [method],
    }  # fmt: skip

    def apart(t: float, y: Array) -> list[float]:
        return [y[2], y[3], -(y[0] ** 2), -(y[1] ** 2)]

    s, d = solve_ivp(apart, (0, 3), [0.5, 0.1, 0.1, -0.1], "DOP853", rtol=1e-13, atol=1e-13).y[
        :2, -1
    ]
    allowed = 1e-5 if method == "variational" else 1e-11
    assert np.abs(ends(scene) - [(s + d) / 2, (s - d) / 2]).max() < allowed

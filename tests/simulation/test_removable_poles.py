"""Motions through points at which the masses of the coordinates are singular and those on the
constraints are not.

Each is compared with the equations of its free coordinates, which are regular, written by hand, or
with [[g, -w^T], [w, 0]] (q'', lambda) as SymPy derives it and NumPy solves it, by SciPy's DOP853.
"""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from inverse_service.service.scenes.simulating import simulate
from tests.values import slow

Array = Any
TIME = 5.0


def disk(t: float, y: Array) -> list[float]:
    """A disk that falls over without turning or spinning is a pendulum with its rim at rest: q2 and
    q2'.
    """
    return [y[1], 9.81 * np.sin(y[0]) / (0.25 + 1)]


def spiral(t: float, y: Array) -> list[float]:
    """phi = 2 r in polar coordinates, V = r^2 + r/2."""
    return [y[1], (-4 * y[0] * y[1] ** 2 - 2 * y[0] - 0.5) / (1 + 4 * y[0] ** 2)]


def sphere(t: float, y: Array) -> list[float]:
    """phi = 3 theta on a sphere, V = -cos(theta - 1)."""
    s, c = np.sin(y[0]), np.cos(y[0])
    return [y[1], (-9 * s * c * y[1] ** 2 - np.sin(y[0] - 1)) / (1 + 9 * s**2)]


def top(t: float, y: Array) -> list[float]:
    """phi = 2 theta of a top with I1 = 1, whose p_psi is constant, V = -cos(theta) + theta/5."""
    s, c = np.sin(y[0]), np.cos(y[0])
    return [y[1], (-4 * s * c * y[1] ** 2 - s - 0.2) / (1 + 4 * s**2)]


def screw(t: float, y: Array) -> list[float]:
    """phi = 2 z in cylindrical coordinates, V = 2 r^2 + z: (r, z, r', z')."""
    r, _, dr, dz = y
    return [dr, dz, 4 * r * dz**2 - 4 * r, (-1 - 8 * r * dr * dz) / (1 + 4 * r**2)]


def knife(t: float, y: Array) -> list[float]:
    """phi' = x z', which has no integral, V = 2 r^2 + x^2/2 + z: (r, x, z, r', x', z')."""
    r, x, _, dr, dx, dz = y
    push = r**2 * dx * dz + 2 * r * dr * x * dz
    return [dr, dx, dz, r * (x * dz) ** 2 - 4 * r, -x, (-x * push - 1) / (1 + x**2 * r**2)]


POLES: dict[str, tuple[str, list[str], dict[str, float], dict[str, float], Callable[..., Any], list[str]]] = {
    "disk, cos(q2) = 0": (
        "(x'^2 + y'^2 + sin(q2)^2*q2'^2)/2 + (q2'^2 + q1'^2*cos(q2)^2)/8 + (q3' + q1'*sin(q2))^2/4 - 9.81*cos(q2)",
        ["x' = -cos(q1)*(q1'*sin(q2) + q3') - sin(q1)*cos(q2)*q2'",
         "y' = -sin(q1)*(q1'*sin(q2) + q3') + cos(q1)*cos(q2)*q2'"],
        {"q1": 0, "q2": 0.3, "q3": 0, "x": 0, "y": 0}, {"q1": 0, "q2": 0.1, "q3": 0}, disk, ["q2"],
    ),
    "spiral, r = 0": (
        "(r'^2 + r^2*phi'^2)/2 - r^2 - r/2", ["phi' = 2*r'"], {"r": 1, "phi": 2}, {"r": 0}, spiral,
        ["r"],
    ),
    "sphere, theta = 0": (
        "(theta'^2 + sin(theta)^2*phi'^2)/2 + cos(theta - 1)", ["phi' = 3*theta'"], {"theta": -1, "phi": -3},
        {"theta": 0.2}, sphere, ["theta"],
    ),
    "top, theta = 0": (
        "(theta'^2 + sin(theta)^2*phi'^2)/2 + (psi' + phi'*cos(theta))^2/4 + cos(theta) - theta/5", ["phi' = 2*theta'"],
        {"theta": 1.2, "phi": 2.4, "psi": 0}, {"theta": 0, "psi": 3}, top, ["theta"],
    ),
    "screw, r = 0": (
        "(r'^2 + r^2*phi'^2 + z'^2)/2 - 2*r^2 - z", ["phi' = 2*z'"], {"r": 1, "phi": 0, "z": 0}, {"r": 0, "z": 0.5},
        screw, ["r", "z"],
    ),
    "edge, r = 0": (
        "(r'^2 + r^2*phi'^2 + z'^2 + x'^2)/2 - 2*r^2 - x^2/2 - z", ["phi' = x*z'"],
        {"r": 1, "phi": 0, "x": 1, "z": 0}, {"r": 0, "x": 0.5, "z": 0.5}, knife, ["r", "x", "z"],
    ),
}  # fmt: skip


def distance(name: str, method: dict[str, Any] | str, step: float) -> float:
    """The greatest distance of the free coordinates at the end, which the run has to reach."""
    lagrangian, constraints, positions, velocities, rates, free = POLES[name]
    system = {"coordinates": [*positions], "lagrangian": lagrangian, "constraints": constraints}
    scene = {
        "system": system, "effects": ["kinetic", "potential", "constraints"], "step": step, "time": TIME,
        "initial": {"positions": positions, "velocities": velocities}, "methods": [method], "observe": ["trajectory"],
    }  # fmt: skip
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "completed", found
    begin = [float(at[x]) for at in (positions, velocities) for x in free]
    true = solve_ivp(rates, (0, TIME), begin, "DOP853", rtol=1e-13, atol=1e-13).y
    signs = np.sign(true[0]) if name != "disk, cos(q2) = 0" else np.sign(np.cos(true[0]))
    assert (np.diff(signs) != 0).any()  # it passes the pole
    end = np.array([found["final"]["positions"][x] for x in free])
    return float(np.abs(end - true[: len(free), -1]).max())


@pytest.mark.parametrize("name", POLES)
def test_a_motion_passes_where_only_its_coordinates_are_singular(name: str) -> None:
    assert distance(name, {"method": "runge-kutta", "order": 4}, 0.0005) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", POLES)
def test_adaptive_steps_pass_too(name: str) -> None:
    assert distance(name, "adaptive", 0.01) < 1e-9


TURNED = (
    "disk, cos(q2) = 0",
    {"q1": 0.4, "q2": 0.3, "q3": 0, "x": 0, "y": 0},
    {"q1": 0, "q2": 0.1, "q3": 0},
)
LIES = ("disk, cos(q2) = 0", {"q1": -1.1, "q2": 0.3, "q3": 0.7, "x": 1, "y": 2}, {"q1": 0, "q2": -0.5, "q3": 0})  # fmt: skip


@pytest.mark.parametrize(("name", "positions", "velocities"), [TURNED, LIES])
def test_a_disk_that_falls_in_any_direction_passes_where_it_lies_flat(
    name: str, positions: dict[str, float], velocities: dict[str, float]
) -> None:
    """Masses of its turn and its spin vanish there: round-off would become a turn."""
    lagrangian, constraints, *_ = POLES[name]
    found = ran(lagrangian, constraints, positions, velocities)
    begin = [float(positions["q2"]), float(velocities["q2"])]
    q2 = solve_ivp(disk, (0, TIME), begin, "DOP853", rtol=1e-13, atol=1e-13).y[0, -1]
    way, q1 = np.sin(q2) - np.sin(begin[0]), positions["q1"]
    place = positions["x"] - np.sin(q1) * way, positions["y"] + np.cos(q1) * way
    end = found["final"]["positions"]
    assert end["q1"] == q1
    assert end["q3"] == positions["q3"]
    assert np.abs(np.array([end["q2"], end["x"], end["y"]]) - [q2, *place]).max() < 1e-9
    assert found["estimated_error"] < 1e-8


SADDLES: dict[str, tuple[str, list[str], dict[str, float], dict[str, float]]] = {
    "spherical coordinates, theta = 0": (
        "(r'^2 + r^2*theta'^2 + r^2*sin(theta)^2*phi'^2)/2 - 2*(r-1)^2 + r*cos(theta-1)", ["phi' = 2*theta'"],
        {"r": 1, "theta": -1, "phi": 0}, {"r": 0, "theta": 0.2},
    ),
    "Euler's angles with two constraints": (
        "(theta'^2 + sin(theta)^2*phi'^2)/2 + (psi' + phi'*cos(theta))^2/4 + cos(theta - 1/2)",
        ["psi' = theta' - phi'", "phi' = 2*theta'"], {"theta": 1.2, "phi": 2.4, "psi": 0}, {"theta": 0},
    ),
    "Euler's angles, led by an oscillator": (
        "(theta'^2 + sin(theta)^2*phi'^2)/2 + (psi' + phi'*cos(theta))^2/4 + x'^2/2 + cos(theta) - x^2/2",
        ["phi' = x*theta'"], {"theta": 1.2, "phi": 0.4, "psi": 0, "x": 1}, {"theta": 0, "psi": 1, "x": 0},
    ),
    "Euler's angles of an asymmetric top": (
        "((theta'*cos(psi) + phi'*sin(theta)*sin(psi))^2 + 2*(phi'*sin(theta)*cos(psi) - theta'*sin(psi))^2)/2"
        " + 3*(psi' + phi'*cos(theta))^2/4 + cos(theta - 1/3)",
        ["phi' = 3*theta' - psi'", "psi' = 1/2*theta'"], {"theta": 1.1, "phi": 0.4, "psi": 0.2}, {"theta": -1.5},
    ),
    "angles of a sphere in four dimensions": (
        "(a'^2 + sin(a)^2*b'^2 + sin(a)^2*sin(b)^2*c'^2)/2 + cos(a - 1)", ["b' = a'", "c' = 2*a' + b'"],
        {"a": -1, "b": -1.5, "c": 0}, {"a": 0.2},
    ),
    "elliptic coordinates at a focus": (
        "(sinh(u)^2 + sin(w)^2)*(u'^2 + w'^2)/2 + x'^2/2 - x^2/2 - u^2/2", ["w' = x'", "u' = 1/2*x'"],
        {"u": 0.5, "w": 1, "x": 1}, {"x": 0},
    ),
}  # fmt: skip


def ran(
    lagrangian: str, constraints: list[str], positions: dict[str, float], velocities: dict[str, float],
) -> dict[str, Any]:  # fmt: skip
    system = {"coordinates": [*positions], "lagrangian": lagrangian, "constraints": constraints}
    scene = {
        "system": system, "step": 0.01, "time": TIME, "methods": ["adaptive"], "observe": ["trajectory"],
        "effects": ["kinetic", "potential", "constraints"],
        "initial": {"positions": positions, "velocities": velocities},
    }  # fmt: skip
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] == "completed", found
    assert isinstance(found, dict)
    return found


def by_saddle(
    lagrangian: str, constraints: list[str], positions: dict[str, float], velocities: dict[str, float],
) -> Array:  # fmt: skip
    """The positions at the end."""
    q, v = ([sympy.Symbol(f"{head}{x}") for x in positions] for head in ("", "v_"))

    def read(text: str) -> Any:
        text = re.sub(r"(\w+)'", r"v_\1", text).replace("^", "**")
        return sympy.sympify(text, locals={str(x): x for x in (*q, *v)})

    def along(tree: Any) -> Any:
        return sum(tree.diff(x) * y for x, y in zip(q, v, strict=True))

    whole, n = read(lagrangian), len(q)
    rows = [read(one.split(" = ")[0]) - read(one.split(" = ")[1]) for one in constraints]
    w = sympy.Matrix([[row.diff(y) for y in v] for row in rows])
    g = sympy.hessian(whole, v)
    matrix = g.row_join(-w.T).col_join(w.row_join(sympy.zeros(len(rows), len(rows))))
    right = [whole.diff(x) - along(whole.diff(y)) for x, y in zip(q, v, strict=True)]
    numbers = sympy.lambdify([q, v], [matrix, [*right, *(-along(row) for row in rows)]])
    begin = {sympy.Symbol(f"v_{x}"): value for x, value in velocities.items()}
    begin |= dict(zip(q, positions.values(), strict=True))
    begin |= sympy.solve([row.subs(begin) for row in rows], [y for y in v if y not in begin])

    def rates(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], np.linalg.solve(*numbers(y[:n], y[n:]))[:n]])

    start = [float(begin[x]) for x in (*q, *v)]
    return solve_ivp(rates, (0, TIME), start, "DOP853", rtol=1e-13, atol=1e-13).y[:n, -1]


@pytest.mark.parametrize(
    "name", [name if place < 3 else slow(name) for place, name in enumerate(SADDLES)]
)
def test_poles_of_coordinates_are_none_of_the_saddle_system(name: str) -> None:
    found = ran(*SADDLES[name])["final"]["positions"]
    assert np.abs(np.array([*found.values()]) - by_saddle(*SADDLES[name])).max() < 1e-9

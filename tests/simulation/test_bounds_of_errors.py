"""The error that a run shows, with its uncertainty, is at least the distance from the exact
solution.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest
from mpmath import ellipfun, ellipk, findroot, mp

from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate, simulate_tables
from inverse_service.simulation import accuracy, peers
from tests.values import slow


def kepler(t: float) -> list[float]:
    """e = 1/2 and major axis 1, from the pericenter: Kepler's equation."""
    anomaly = findroot(lambda u: u - mp.sin(u) / 2 - t, (t - 1, t + 1), solver="anderson")
    return [float(mp.cos(anomaly) - 0.5), float(mp.sqrt(mp.mpf(3) / 4) * mp.sin(anomaly))]


def quartic(t: float) -> list[float]:
    """x'' = -x^3 from rest at 1: cn(t, 1/2)."""
    return [float(ellipfun("cn", t, m=0.5))]


def pendulum(t: float) -> list[float]:
    """x'' = -sin x from rest at 2: sin(x/2) = sin(1) cd(t, sin(1)^2)."""
    m = mp.sin(1) ** 2
    return [float(2 * mp.asin(mp.sin(1) * ellipfun("sn", ellipk(m) - t, m=m)))]


def repelled(t: float) -> list[float]:
    """x'' = 1/x^3 from rest at 1."""
    return [float(np.sqrt(1 + t * t))]


Motion = tuple[dict[str, Any], list[float], list[float], Callable[[float], list[float]]]
KNOWN: dict[str, Motion] = {
    "kepler": ({"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 + 1/sqrt(x^2 + y^2)"}, [0.5, 0],
               [0, 3**0.5], kepler),
    "quartic": ({"coordinates": ["x"], "lagrangian": "x'^2/2 - x^4/4"}, [1], [0], quartic),
    "pendulum": ({"coordinates": ["x"], "lagrangian": "x'^2/2 + cos(x)"}, [2], [0], pendulum),
    "repelled": ({"coordinates": ["x"], "lagrangian": "x'^2/2 - 1/(2*x^2)"}, [1], [0], repelled),
}  # fmt: skip
METHODS = [
    "variational",
    {"method": "runge-kutta", "order": 4},
    {"method": "adaptive", "tolerance": 1e-6},
    "adaptive",
]


@pytest.fixture
def _own_references(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Without heyoka, the reference is ours, and its own error is most of its distance from the
    second one.
    """

    def missing() -> None:
        raise InputError("not here")

    monkeypatch.setattr(peers, "load_heyoka", missing)
    peers.taylor_integrator.cache_clear()
    yield
    peers.taylor_integrator.cache_clear()


def scene(name: str, step: float, time: float, methods: list[Any]) -> dict[str, Any]:
    system, positions, velocities, _ = KNOWN[name]
    names = system["coordinates"]
    pairs = (("positions", positions), ("velocities", velocities))
    initial = {kind: dict(zip(names, values, strict=True)) for kind, values in pairs}
    document = {
        "system": system,
        "initial": initial,
        "step": step,
        "time": time,
        "methods": methods,
    }
    return document | {"observe": ["trajectory", "error"]}


def distance(name: str, columns: Mapping[str, Any], every: int = 1) -> float:
    """The greatest distance of a coordinate from the exact solution, at every so many points."""
    with mp.workdps(25):
        exact = [KNOWN[name][3](t) for t in np.array(columns["t"])[::every].tolist()]
    points = np.array([columns[x] for x in KNOWN[name][0]["coordinates"]]).T[::every]
    return float(np.abs(points - exact).max())


@pytest.mark.parametrize("step", [0.1, 0.02])
@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("references", [slow("heyoka"), "ours"])
def test_the_uncertainty_bounds_the_error_of_the_reference(
    name: str, step: float, references: str, request: pytest.FixtureRequest
) -> None:
    if references == "ours":
        request.getfixturevalue("_own_references")
    found = simulate_tables(scene(name, step, 60, ["runge-kutta"]))
    truth = found["result"]["truth"]
    assert truth["by"].startswith("heyoka" if references == "heyoka" else "adaptive")
    error = distance(name, found["truth"], every=len(found["truth"]["t"]) // 20)
    assert error <= truth["uncertainty"] < 1e-10


@pytest.mark.usefixtures("_own_references")
@pytest.mark.parametrize("name", KNOWN)
def test_the_error_shown_with_its_uncertainty_is_the_distance_from_the_exact_solution(
    name: str,
) -> None:
    for method in simulate(scene(name, 0.1, 10, METHODS))["methods"]:
        error, shown = distance(name, method["points"]["columns"]), method["max_error"]
        assert method["outcome"] == "completed"
        assert error <= shown + method["error_uncertainty"]
        assert shown <= error + method["error_uncertainty"]
        # The estimate from half the step knows the error to a third, above round-off.
        assert 2 * error / 3 < method["estimated_error"] + 1e-13
        assert method["estimated_error"] < 3 * error / 2 + 1e-13


@pytest.mark.parametrize("step", [2.0, 2.2, 2.4])
def test_a_step_that_loses_most_of_a_constant_energy_is_too_long(step: float) -> None:
    """From rest at 1, x'' = -x, RK4 multiplies x - i v by R(ih), the sum of its series up to h^4:
    its modulus falls to 1/2 at h = sqrt(6).
    """
    factor = sum((1j * step) ** k / math.factorial(k) for k in range(5))
    lost = 1 - abs(factor) ** 2
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}
    scene = {
        "system": system,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": step,
        "time": 20 * step,
        "methods": [{"method": "runge-kutta", "order": 4}],
    }
    (found,) = simulate(scene)["methods"]
    assert (found["outcome"], found["steps"]) == ("unresolved", 0)
    share = re.search(r"changes in one step by ([\d.]+) of", found["stopped"]["quantity"])
    assert share is not None
    assert float(share[1]) == pytest.approx(lost / factor.imag**2, rel=1e-2)


@pytest.mark.parametrize(("start", "order"), [("momenta", 2), ("discrete_constraint", 1)])
def test_the_estimate_is_the_error_at_either_start(start: str, order: int) -> None:
    """Half the step shows 1 - 2^-order of the error; `adaptive` stands for the true motion."""
    scene = {
        "system": {
            "coordinates": ["x", "y", "z"], "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
            "constraints": ["z' + x*y'"],
        },
        "initial": {
            "positions": {"x": 0.5, "y": 0, "z": 0}, "velocities": {"x": 1, "y": 1, "z": -0.5},
        },
        "step": 0.02, "time": 2,
        "methods": [{"method": "nonholonomic", "start": start}, {"method": "adaptive", "tolerance": 1e-12}],
    }  # fmt: skip
    run, true = simulate(scene)["methods"]
    places = [one["final"]["positions"] for one in (run, true)]
    error = max(abs(places[0][name] - places[1][name]) for name in "xyz")
    assert run["order"] == order
    assert run["estimated_error"] == pytest.approx(error, rel=0.03)


def test_a_run_that_one_step_takes_away_is_lost_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half the step agrees for 1 s, and from the next point on is the whole range away."""
    errors_of = accuracy.errors_of

    def parted(*given: Any) -> Any:
        errors, shares = errors_of(*given)
        shares[11:] = 2.0
        return errors, shares

    monkeypatch.setattr(accuracy, "errors_of", parted)
    (method,) = simulate(
        {
            "system": {"coordinates": ["x"], "equations": {"x": "-x"}},
            "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
            "step": 0.1,
            "time": 2,
            "methods": ["runge-kutta"],
            "observe": ["trajectory"],
        }
    )["methods"]
    assert method["outcome"] == "unresolved"
    assert method["stopped"]["time"] == pytest.approx(1.0)

"""Links that hang at rest while the first one falls: their accelerations are round-off at first."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import inverse_service


def equal_rods(count: int) -> dict[str, object]:
    """A chain of point masses on rods of length 1, by absolute angles."""
    angles = [f"a{k}" for k in range(count)]
    pairs = [
        f"{count - max(i, j)}/2*cos({x} - {y})*{x}'*{y}'"
        for i, x in enumerate(angles)
        for j, y in enumerate(angles)
    ]
    weights = [f"{count - k}*cos({x})" for k, x in enumerate(angles)]
    return {"coordinates": angles, "lagrangian": " + ".join(pairs + weights)}


def rates(_: float, state: np.ndarray) -> np.ndarray:
    a, v = np.split(state, 2)
    count = len(a)
    weight = count - np.maximum.outer(np.arange(count), np.arange(count))
    apart = a[:, None] - a
    pull = (count - np.arange(count)) * np.sin(a)
    force = -(weight * np.sin(apart)) @ v**2 - pull
    return np.concatenate([v, np.linalg.solve(weight * np.cos(apart), force)])


@pytest.mark.parametrize("count", [3, 4])
def test_links_at_rest_below_one_that_falls_begin_to_move(count: int) -> None:
    names = [f"a{k}" for k in range(count)]
    bent = {name: int(k == 0) for k, name in enumerate(names)}
    scene = {
        "system": equal_rods(count),
        "initial": {"positions": bent, "velocities": dict.fromkeys(names, 0)},
        "step": 0.05,
        "steps": 20,
        "methods": ["adaptive"],
    }
    (method,) = inverse_service.simulate(scene)["methods"]
    start = np.concatenate([np.eye(count)[0], np.zeros(count)])
    peer = solve_ivp(rates, (0, 1), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:count, -1]
    assert method["outcome"] == "completed"
    assert list(method["final"]["positions"].values()) == pytest.approx(peer, abs=1e-9)

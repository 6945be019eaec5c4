"""A run that ends early is reported up to its end only."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.service.scenes.simulating import simulate
from tests.values import slow

ENDS = {
    "falls in": "-log(x)",
    "blows up": "x^4/4",
    "a kink": "-sqrt(x^2)",
    "a barrier": "-9*exp(-(10^6*(x - 0.305))^2)",
}


@pytest.mark.parametrize("potential", ENDS.values(), ids=ENDS)
@pytest.mark.parametrize(
    "method",
    ["adaptive",
     *(slow(one) for one in (
         "stormer-verlet", "nonholonomic", "heyoka", "variational",
         {"method": "variational", "form": "raw"}, {"method": "variational", "alpha": 0},
         "runge-kutta", "reference", "stiff"))],
)  # fmt: skip
def test_the_steps_done_are_those_recorded(potential: str, method: Any) -> None:
    """The steps, end time, last point, and final state of a stopped run agree."""
    scene = {"system": {"coordinates": ["x"], "lagrangian": f"x'^2/2 + {potential}"}, "step": 0.01}
    scene |= {
        "initial": {"positions": {"x": 1}, "velocities": {"x": -0.5}},
        "observe": ["trajectory", "energy"],
    }
    (found,) = simulate(scene | {"time": 20, "methods": [method]})["methods"]
    if found["outcome"] == "completed":
        assert found["steps"] == 2000
        return
    times = found["points"]["columns"]["t"]
    assert found["steps"] == found["stopped"]["step"] == len(times) - 1
    assert found["stopped"]["time"] == times[-1] == found["final"]["t"]


def test_what_is_watched_ends_with_the_run() -> None:
    """Forces after the event that ends a run do not affect its numbers."""
    system = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2 - x^4",
        "constraints": ["z' - y*x'"],
    }
    scene = {
        "system": system,
        "step": 0.05,
        "time": 3,
        "methods": [{"method": "nonholonomic", "alpha": 0}],
    }
    scene |= {
        "initial": {"positions": {"x": 0, "y": 0, "z": 0}, "velocities": {"x": 1, "y": 1}},
        "observe": ["energy"],
    }
    key, until = "max_discrete_energy_error", 0.5
    (whole,), (ended,), (short,) = (
        simulate(scene | more)["methods"]
        for more in (
            {},
            {"events": [{"when": f"t - {until + 0.01}", "do": "stop"}]},
            {"time": until},
        )
    )
    assert ended["steps"] == short["steps"] == 10
    assert ended[key] == pytest.approx(short[key])
    assert ended[key] < whole[key]


@pytest.mark.parametrize("step", [1e300, 1e-300])
@pytest.mark.parametrize(
    "method", ["stormer-verlet", "variational", "runge-kutta", "adaptive", "stiff", "heyoka"]
)
def test_no_step_is_too_large_or_small_for_a_typed_end(step: float, method: str) -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
        "step": step,
        "steps": 4,
    }
    scene |= {"initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "methods": [method]}
    (found,) = simulate(scene)["methods"]
    assert found["outcome"] not in ("failed", "unavailable")
    assert (found["outcome"] == "completed") <= (step < 1)

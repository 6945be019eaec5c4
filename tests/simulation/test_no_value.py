"""An undefined formula is reported: a function without a formula, a start outside the domain, a
column, an event.
"""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.expressions import arrays
from inverse_service.expressions.tree import Arbitrary, Symbol
from inverse_service.service.scenes.simulating import simulate
from inverse_service.service.scenes.work_precision import work_precision
from inverse_service.web.pages.simulations import notes_of

METHODS = [
    "variational",
    "nonholonomic",
    "runge-kutta",
    "reference",
    "adaptive",
    "stiff",
    "stormer-verlet",
]


def test_a_function_without_a_value_is_refused_as_input() -> None:
    with pytest.raises(InputError, match="A is not given"):
        arrays.array_value(Arbitrary("A", (Symbol("x"),), (0,)), {})


def run(lagrangian: str, position: float = 1, **more: Any) -> dict[str, Any]:
    document = {
        "system": {"coordinates": ["x"], "lagrangian": lagrangian, "parameters": ["k"]}, "parameters": {"k": 1},
        "initial": {"positions": {"x": position}, "velocities": {"x": 0.5}}, "step": 0.05, "steps": 40,
        "methods": METHODS, "observe": ["trajectory"],
    }  # fmt: skip
    return simulate(document | more)


def test_nothing_is_measured_where_no_motion_begins() -> None:
    """There are neither errors relative to the reference nor a Lyapunov exponent."""
    result = run("x'^2/2 + log(x - 5)", observe=["error", "lyapunov"], methods=["adaptive"])
    assert result["truth"]["against"] is None
    assert "lyapunov" not in result
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 + log(x - 5)"}, "step": 0.05, "time": 1,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "methods": ["adaptive"],
    }  # fmt: skip
    with pytest.raises(InputError, match="no value at the"):
        work_precision(scene)


@pytest.mark.parametrize("method", ["runge-kutta", "variational", "adaptive"])
def test_the_member_that_begins_outside_ends_there(method: str) -> None:
    ensemble = {"initial": [{"positions": {"x": x}, "velocities": {"x": 0}} for x in (6, 7, 4)]}
    (found,) = run("x'^2/2 + log(x - 5)", 6, ensemble=ensemble, methods=[method])["methods"]
    assert found["outcome"] == "partly"
    assert [(each["member"], each["outcome"], each["step"]) for each in found["ended"]] == [
        (2, "off_domain", 0)
    ]


def test_an_observable_without_a_value_is_noted() -> None:
    result = run(
        "x'^2/2 - x^2/2",
        observe=[{"F": "sqrt(x)"}, {"G": "x"}],
        time=6,
        steps=None,
        methods=["adaptive"],
    )
    found = result["methods"][0]["observables"]
    assert "no value at" in found["F"]["note"]
    assert "note" not in found["G"]
    assert any("F: The formula has" in note for note in notes_of(result))


def test_an_event_whose_formula_has_no_value_is_noted() -> None:
    result = run(
        "x'^2/2 - x^2/2",
        events=[{"when": "log(x - 5)"}, {"when": "x^2 + 1"}],
        methods=["variational"],
    )
    lost, never = result["methods"][0]["events"]
    assert "no value at 41" in lost["note"]
    assert lost["count"] == never["count"] == 0
    assert "note" not in never

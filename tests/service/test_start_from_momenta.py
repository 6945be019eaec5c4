"""A scene that starts from momenta has the velocities of these."""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service

CHARGE = "(x'^2+y'^2)/2+(x*y'-y*x')/2"


@pytest.mark.parametrize(
    ("lagrangian", "positions", "momenta", "velocities"),
    [
        # p = v + (-y, x)/2 in a magnetic field, and p = v^3 + v of a quartic kinetic energy.
        (CHARGE, {"x": 1, "y": 2}, {"x": 0.3, "y": 0.4}, {"x": 1.3, "y": -0.1}),
        ("x'^4/4+x'^2/2-x^2/2", {"x": 1}, {"x": 10}, {"x": 2}),
    ],
)
def test_velocities_follow_from_momenta(
    lagrangian: str,
    positions: dict[str, Any],
    momenta: dict[str, Any],
    velocities: dict[str, float],
) -> None:
    scene = {
        "system": {"coordinates": [*positions], "lagrangian": lagrangian},
        "initial": {"positions": positions, "momenta": momenta},
        "step": 0.01,
        "steps": 2,
        "methods": ["runge-kutta"],
    }
    found = inverse_service.simulate(scene)
    assert dict(found["initial"]["velocities"]) == pytest.approx(velocities, abs=1e-9)
